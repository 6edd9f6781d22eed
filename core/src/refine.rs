//! Grids for a chordal tolerance: as many lines in each polynomial piece as its curvature needs.
//!
//! Every knot is a line, so that no facet spans a crease. Each piece is divided evenly, and the
//! number of divisions is found by measuring: the surface is sampled four times denser than the grid
//! in both directions, and the deviation of a chord falls with the square of the divisions.

use rayon::prelude::*;

use crate::discretize::{Lines, MAX_LINES};
use crate::error::{Error, Result};
use crate::surface::{Direction, Surface};
use crate::vector::{Point, add_scaled, cross, dot, length, sub};

/// Samples to a cell's side.
const DENSITY: usize = 4;

/// Rounds of measuring and dividing before giving up; three are usual.
const ROUNDS: usize = 24;

/// Most points of one surface's grid.
const MAX_POINTS: usize = 1 << 26;

/// Finds the lines of a grid whose facets are within `tolerance` (mm) of the surface at every sample.
pub(crate) fn refine(name: &str, surface: &Surface, tolerance: f64) -> Result<Lines> {
    let mut u = Divisions::new(surface.u());
    let mut v = Divisions::new(surface.v());
    let mut found = f64::INFINITY;
    for _ in 0..ROUNDS {
        let (us, vs) = (u.lines(1), v.lines(1));
        if us.len().max(vs.len()) > MAX_LINES || us.len() * vs.len() > MAX_POINTS {
            break;
        }
        let worst = measure(surface, &mut u, &mut v);
        found = worst;
        if worst <= tolerance {
            let deviation = Some(worst);
            return Ok(Lines { us, vs, deviation });
        }
        // Half of the tolerance for each direction: the deviations along u and v add up.
        let grown = u.grow(tolerance / 2.0) | v.grow(tolerance / 2.0);
        if !grown {
            u.grow_where_exceeding(tolerance);
            v.grow_where_exceeding(tolerance);
        }
    }
    Err(Error::ToleranceNotReached {
        name: name.to_owned(),
        rows: u.lines(1).len(),
        columns: v.lines(1).len(),
        deviation: found,
        tolerance,
    })
}

/// One parametric direction, its pieces and what was measured in each.
struct Divisions {
    breaks: Vec<f64>,
    count: Vec<usize>,
    /// Largest deviation of a chord along this direction, by piece.
    chord: Vec<f64>,
    /// Largest deviation of a facet, by piece.
    facet: Vec<f64>,
}

impl Divisions {
    fn new(direction: &Direction) -> Self {
        let breaks = direction.breaks();
        let pieces = breaks.len() - 1;
        Self {
            breaks,
            count: vec![1; pieces],
            chord: vec![0.0; pieces],
            facet: vec![0.0; pieces],
        }
    }

    /// The lines, each interval between them divided `density` times.
    fn lines(&self, density: usize) -> Vec<f64> {
        let mut lines = vec![self.breaks[0]];
        for (piece, &count) in self.breaks.windows(2).zip(&self.count) {
            let n = count * density;
            let inner = (1..n).map(|i| piece[0] + (piece[1] - piece[0]) * (i as f64 / n as f64));
            lines.extend(inner.chain([piece[1]]));
        }
        lines
    }

    fn raise(&mut self, piece: usize, deviation: &Deviation) {
        self.chord[piece] = self.chord[piece].max(deviation.chord);
        self.facet[piece] = self.facet[piece].max(deviation.facet);
    }

    /// The piece of each cell.
    fn pieces(&self) -> Vec<usize> {
        let cells = self.count.iter().enumerate();
        cells
            .flat_map(|(i, &n)| std::iter::repeat_n(i, n))
            .collect()
    }

    /// Divides further where a chord deviates by more than `allowed`; tells whether it did.
    fn grow(&mut self, allowed: f64) -> bool {
        let mut grown = false;
        for (count, &chord) in self.count.iter_mut().zip(&self.chord) {
            if chord > allowed {
                let ratio = (chord / allowed).sqrt();
                *count = (*count as f64 * ratio).ceil().max(*count as f64 + 1.0) as usize;
                grown = true;
            }
        }
        grown
    }

    /// Divides further where only the facets, by their twist, still deviate.
    fn grow_where_exceeding(&mut self, tolerance: f64) {
        for (count, &facet) in self.count.iter_mut().zip(&self.facet) {
            if facet > tolerance {
                *count += 1 + *count / 8;
            }
        }
    }
}

/// Measures chords and facets against a denser sampling; returns the largest deviation of a facet.
fn measure(surface: &Surface, u: &mut Divisions, v: &mut Divisions) -> f64 {
    for d in [&mut *u, &mut *v] {
        d.chord.fill(0.0);
        d.facet.fill(0.0);
    }
    let (us, vs) = (u.lines(DENSITY), v.lines(DENSITY));
    let (u_pieces, v_pieces) = (u.pieces(), v.pieces());
    // One strip of cells at a time: the dense sampling is never held as a whole.
    let strips: Vec<(Deviation, Vec<Deviation>)> = (0..u_pieces.len())
        .into_par_iter()
        .map(|i| {
            let strip = surface.grid(&us[i * DENSITY..=(i + 1) * DENSITY], &vs);
            let mut along = Deviation::default();
            let mut across = vec![Deviation::default(); v.count.len()];
            for (j, &v_piece) in v_pieces.iter().enumerate() {
                let cell = |a: usize, b: usize| strip[a * vs.len() + j * DENSITY + b];
                let (along_u, along_v, facet) = measure_cell(cell);
                along.raise(along_u, facet);
                across[v_piece].raise(along_v, facet);
            }
            (along, across)
        })
        .collect();
    let mut worst = 0.0_f64;
    for (&u_piece, (along, across)) in u_pieces.iter().zip(&strips) {
        u.raise(u_piece, along);
        for (piece, deviation) in across.iter().enumerate() {
            v.raise(piece, deviation);
        }
        worst = worst.max(along.facet);
    }
    worst
}

/// Largest deviations, mm.
#[derive(Clone, Copy, Default)]
struct Deviation {
    chord: f64,
    facet: f64,
}

impl Deviation {
    fn raise(&mut self, chord: f64, facet: f64) {
        self.chord = self.chord.max(chord);
        self.facet = self.facet.max(facet);
    }
}

/// Deviations of the chords along u, of those along v, and of the two facets of a cell, given its
/// samples.
fn measure_cell(at: impl Fn(usize, usize) -> Point) -> (f64, f64, f64) {
    let (mut along_u, mut along_v, mut facet) = (0.0_f64, 0.0_f64, 0.0_f64);
    for a in 0..=DENSITY {
        for b in 0..=DENSITY {
            let p = at(a, b);
            along_u = along_u.max(to_chord(p, at(0, b), at(DENSITY, b)));
            along_v = along_v.max(to_chord(p, at(a, 0), at(a, DENSITY)));
            // The facets share the diagonal from (0, 0); a sample is held against the one that its
            // parameters fall into.
            let third = if a > b {
                at(DENSITY, 0)
            } else {
                at(0, DENSITY)
            };
            facet = facet.max(to_triangle(p, at(0, 0), third, at(DENSITY, DENSITY)));
        }
    }
    (along_u, along_v, facet)
}

/// Distance from `p` to the segment from `a` to `b`.
fn to_chord(p: Point, a: Point, b: Point) -> f64 {
    let (ap, ab) = (sub(p, a), sub(b, a));
    let square = dot(ab, ab);
    let t = if square > 0.0 {
        (dot(ap, ab) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    length(add_scaled(ap, -t, ab))
}

/// Distance from `p` to the triangle.
fn to_triangle(p: Point, a: Point, b: Point, c: Point) -> f64 {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let n = cross(ab, ac);
    let square = dot(n, n);
    if square > 0.0 {
        let s = dot(cross(ap, ac), n) / square;
        let t = dot(cross(ab, ap), n) / square;
        if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
            return dot(ap, n).abs() / square.sqrt();
        }
    }
    to_chord(p, a, b)
        .min(to_chord(p, b, c))
        .min(to_chord(p, c, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::tests::quarter_cylinder;

    #[test]
    fn a_cylinder_gets_what_its_curvature_needs_and_no_more() {
        let surface = quarter_cylinder(50.0, 100.0);
        for tolerance in [1.0, 0.1, 0.01, 0.001] {
            let grid = refine("s", &surface, tolerance).expect("reachable");
            assert_eq!(grid.us.len(), 2, "straight along x");
            assert!(grid.deviation.expect("measured") <= tolerance);
            // The chord of an arc of angle a sags by r(1 − cos(a/2)).
            let angle = 2.0 * (1.0 - tolerance / 50.0_f64).acos();
            let needed = (std::f64::consts::FRAC_PI_2 / angle).ceil();
            let cells = (grid.vs.len() - 1) as f64;
            assert!(cells >= needed && cells <= 2.0 * needed, "{cells} {needed}");
        }
    }

    #[test]
    fn an_unreachable_tolerance_is_refused() {
        let quadratic = || Direction {
            degree: 2,
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        };
        let pole = |i: usize| {
            let (x, z) = ((i / 3) as f64 * 1e5, (i % 3) as f64 * 1e5);
            [x, (x * z).sqrt(), z]
        };
        let poles = (0..9).map(pole).collect();
        let bump = Surface::new("bump", quadratic(), quadratic(), poles, None).expect("valid");
        assert!(matches!(
            refine("bump", &bump, 1e-6),
            Err(Error::ToleranceNotReached { .. })
        ));
    }
}
