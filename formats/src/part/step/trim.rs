//! Whether a face is the whole of its surface: every edge lies on the boundary of the domain.
//!
//! The edges bound a region of the domain; if none of them runs inside it, that region is the
//! domain. Seams of closed surfaces and collapsed sides are boundaries as any other.

use horma_core::{Direction, Net, Point, Surface, length, sub};
use step_io::scene::{CurveKind, Edge, Face, NurbsCurve};

use crate::error::{Error, Result};

/// Tightest and loosest distance at which an edge still lies on the boundary, mm. Files state how
/// well their own edges lie on their surfaces; between these bounds they are believed.
const TOLERANCE: (f64, f64) = (1.0e-4, 1.0e-2);

/// The same, relative to the size of the surface.
const RELATIVE: f64 = 1.0e-7;

/// Points at which a boundary is tabulated on each polynomial piece, to start the search from.
const POINTS: usize = 8;

/// Most points of an edge that are checked.
const MAX_SAMPLES: usize = 64;

/// Refuses a face that is trimmed inside `surface`. `scale` takes the file's lengths and its
/// `precision` to mm.
pub(super) fn check(
    name: &str,
    face: &Face,
    surface: &Surface,
    scale: f64,
    precision: Option<f64>,
) -> Result<()> {
    let unreadable = || Error::UnreadableTrim {
        name: name.to_owned(),
    };
    let transposed = surface.transposed();
    let nets = [Net::new(surface), Net::new(&transposed)];
    let sides: Vec<Side> = nets.iter().flat_map(sides).collect();
    let precision = precision.unwrap_or(0.0) * scale;
    let tolerance = precision.clamp(TOLERANCE.0, TOLERANCE.1) + RELATIVE * size(surface);
    for bound in face.bounds() {
        let mut empty = true;
        if let Some(point) = bound.vertex().and_then(|v| v.point()) {
            empty = false;
            if !lies_on(&sides, point.xyz().map(|c| c * scale), tolerance) {
                return Err(trimmed(name));
            }
        }
        for edge in bound.edges() {
            empty = false;
            let points = samples(name, &edge, scale).ok_or_else(unreadable)?;
            if !points.into_iter().all(|p| lies_on(&sides, p, tolerance)) {
                return Err(trimmed(name));
            }
        }
        if empty {
            return Err(unreadable());
        }
    }
    Ok(())
}

fn trimmed(name: &str) -> Error {
    Error::Trimmed {
        name: name.to_owned(),
    }
}

/// One side of the domain: `u = at`, tabulated.
struct Side<'a> {
    net: &'a Net<'a>,
    at: f64,
    vs: Vec<f64>,
    points: Vec<Point>,
}

/// The sides `u = first` and `u = last`.
fn sides<'a>(net: &'a Net<'a>) -> [Side<'a>; 2] {
    let (first, last) = net.surface.u().domain();
    [first, last].map(|at| {
        let vs = parameters(net.surface.v(), POINTS);
        let points = net.grid(&[at], &vs);
        Side {
            net,
            at,
            vs,
            points,
        }
    })
}

/// `points` parameters on each polynomial piece, and the end.
fn parameters(direction: &Direction, points: usize) -> Vec<f64> {
    let breaks = direction.breaks();
    let pieces = breaks.windows(2).flat_map(|piece| {
        let width = (piece[1] - piece[0]) / points as f64;
        let start = piece[0];
        (0..points).map(move |i| start + width * i as f64)
    });
    pieces.chain(breaks.last().copied()).collect()
}

fn lies_on(sides: &[Side], point: Point, tolerance: f64) -> bool {
    let mut candidates: Vec<(f64, usize, &Side)> = sides
        .iter()
        .filter_map(|side| {
            let (nearest, distance) = nearest_of(&side.points, point)?;
            Some((distance, nearest, side))
        })
        .collect();
    // An edge lies on one side as a rule, and the search is what costs.
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    candidates.into_iter().any(|(distance, nearest, side)| {
        distance <= tolerance || passes(side, nearest, point, tolerance)
    })
}

/// Parts into which a search divides what is left, and how often: down to 10⁻⁷ of a piece.
const PARTS: usize = 32;
const DIVISIONS: usize = 6;

/// Whether a side passes a point within the tolerance. From the nearest tabulated point on, by finer and finer
/// tables: the distance has one minimum near it.
fn passes(side: &Side, nearest: usize, point: Point, tolerance: f64) -> bool {
    let around = |nearest: usize, vs: &[f64]| {
        let last = vs.len() - 1;
        (vs[nearest.saturating_sub(1)], vs[(nearest + 1).min(last)])
    };
    let (mut low, mut high) = around(nearest, &side.vs);
    for _ in 0..DIVISIONS {
        let width = (high - low) / PARTS as f64;
        let vs: Vec<f64> = (0..=PARTS).map(|i| low + width * i as f64).collect();
        let points = side.net.grid(&[side.at], &vs);
        let Some((nearest, distance)) = nearest_of(&points, point) else {
            return false;
        };
        if distance <= tolerance {
            return true;
        }
        (low, high) = around(nearest, &vs);
    }
    false
}

/// Which of some points is nearest to a place, and how far away it is.
fn nearest_of(points: &[Point], place: Point) -> Option<(usize, f64)> {
    let away = points.iter().map(|&p| length(sub(p, place))).enumerate();
    away.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Points of an edge, mm; `None` if its curve cannot be read.
fn samples(name: &str, edge: &Edge, scale: f64) -> Option<Vec<Point>> {
    let Some(curve) = edge.to_nurbs() else {
        // Some writers give a collapsed edge a line for want of a curve; then both its ends are one.
        let ends = [edge.start()?.point()?.xyz(), edge.end()?.point()?.xyz()];
        let collapsed = ends[0] == ends[1] && matches!(edge.curve().kind(), CurveKind::Line(_));
        return collapsed.then(|| vec![ends[0].map(|c| c * scale)]);
    };
    let ruled = ruled(name, &curve, scale)?;
    let mut ts = parameters(ruled.v(), 3);
    let stride = ts.len().div_ceil(MAX_SAMPLES);
    let last = ts[ts.len() - 1];
    ts = ts.into_iter().step_by(stride).chain([last]).collect();
    Some(ruled.grid(&[0.0], &ts))
}

/// The curve as a surface without width, so that one evaluator serves both.
fn ruled(name: &str, curve: &NurbsCurve, scale: f64) -> Option<Surface> {
    let across = Direction {
        degree: 1,
        knots: vec![0.0, 0.0, 1.0, 1.0],
    };
    let along = Direction {
        degree: curve.degree,
        knots: curve.knots.clone(),
    };
    let poles = curve.control_points.iter();
    let poles: Vec<Point> = poles.map(|p| p.map(|c| c * scale)).collect();
    let weights = Some(curve.weights.repeat(2));
    Surface::new(name, across, along, poles.repeat(2), weights).ok()
}

fn size(surface: &Surface) -> f64 {
    let first = surface.poles()[0];
    let far = surface.poles().iter().map(|&p| length(sub(p, first)));
    far.fold(0.0, f64::max)
}
