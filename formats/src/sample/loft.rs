//! From numbers to surfaces: smooth functions through a table, and closed sections lofted along x.

use horma_core::{Direction, Point, Result, Surface};

/// Values at stations, and a smooth function through them.
pub(super) type Table = [(f64, f64)];

/// The value of `table` at `t`, which lies within it: a cubic through its entries that never
/// overshoots them (Fritsch and Butland, 1984), so that a smooth table makes no ripple.
pub(super) fn at(table: &Table, t: f64) -> f64 {
    let last = table.len() - 2;
    let i = table.partition_point(|e| e.0 <= t).clamp(1, last + 1) - 1;
    let chord = |k: usize| {
        let ((x, y), (next_x, next_y)) = (table[k], table[k + 1]);
        (next_x - x, (next_y - y) / (next_x - x))
    };
    let slope = |k: usize| {
        if k == 0 || k == last + 1 {
            return chord(k.min(last)).1;
        }
        let ((before, rise), (after, next)) = (chord(k - 1), chord(k));
        if rise * next <= 0.0 {
            return 0.0;
        }
        let weights = (2.0 * after + before, after + 2.0 * before);
        (weights.0 + weights.1) / (weights.0 / rise + weights.1 / next)
    };
    let (width, rise) = chord(i);
    let s = (t - table[i].0) / width;
    let (start, end) = (slope(i), slope(i + 1));
    let bend = (3.0 * rise - 2.0 * start - end) + s * (start + end - 2.0 * rise);
    table[i].1 + width * s * (start + s * bend)
}

/// The bicubic surface whose poles are `sections`, each a closed ring of as many points: twice
/// continuously differentiable everywhere, and its v closed. u runs from section to section.
///
/// # Errors
/// Those of [`Surface::new`].
pub(super) fn loft(name: &str, sections: &[Vec<Point>]) -> Result<Surface> {
    let around = sections.first().map_or(0, Vec::len);
    let poles = sections.iter().flat_map(|ring| clamped(ring)).map(rounded);
    let (u, v) = (cubic(sections.len()), cubic(around + 3));
    Surface::new(name, u, v, poles.collect(), None)
}

/// Uniform cubic knots for `poles` poles, clamped at both ends.
fn cubic(poles: usize) -> Direction {
    let pieces = poles.saturating_sub(3);
    let knot = |i: usize| i.saturating_sub(3).min(pieces) as f64;
    Direction {
        degree: 3,
        knots: (0..poles + 4).map(knot).collect(),
    }
}

/// The poles of the same closed curve when its knots are clamped at the first pole: three more.
fn clamped(ring: &[Point]) -> Vec<Point> {
    let n = ring.len();
    let mix = |a: f64, p: Point, b: f64, q: Point| std::array::from_fn(|k| a * p[k] + b * q[k]);
    let (before, first, after) = (ring[n - 1], ring[0], ring[1]);
    let (third, two_thirds) = (1.0 / 3.0, 2.0 / 3.0);
    let incoming = mix(third, before, two_thirds, first);
    let outgoing = mix(two_thirds, first, third, after);
    let seam = mix(0.5, incoming, 0.5, outgoing);
    let mut poles = vec![seam, outgoing];
    poles.extend(&ring[1..]);
    poles.extend([incoming, seam]);
    poles
}

/// To the nearest nanometre, so that a file of them is short.
fn rounded(p: Point) -> Point {
    p.map(|c| (c * 1.0e6).round() / 1.0e6 + 0.0)
}

#[cfg(test)]
mod tests {
    use horma_core::{length, sub};

    use super::*;

    #[test]
    fn a_table_is_met_and_never_overshot() {
        let table = [(0.0, 1.0), (1.0, 3.0), (1.5, 3.0), (4.0, -2.0)];
        for (t, y) in table {
            assert!((at(&table, t) - y).abs() < 1e-12);
        }
        for i in 0..=400 {
            let y = at(&table, f64::from(i) / 100.0);
            assert!((-2.0..=3.0).contains(&y), "{y}");
        }
    }

    #[test]
    fn a_clamped_ring_is_closed_and_smooth_at_its_seam() {
        let ring = |x: f64| {
            let corners = [
                [3.0, 0.0],
                [0.0, 2.0],
                [-3.0, 1.0],
                [-2.0, -2.0],
                [1.0, -4.0],
            ];
            corners.map(|[y, z]| [x, y, z]).to_vec()
        };
        let sections = [ring(0.0), ring(1.0), ring(2.0), ring(3.0)];
        let surface = loft("ring", &sections).expect("valid");
        let h = 1e-3;
        let end = surface.v().domain().1;
        let near = surface.grid(&[0.4], &[0.0, h, 2.0 * h, end - 2.0 * h, end - h, end]);
        assert_eq!(near[0], near[5]);
        let slopes = [sub(near[1], near[0]), sub(near[5], near[4])];
        let kink = length(sub(slopes[1], slopes[0]));
        assert!(kink < 10.0 * h * h, "{kink}");
        let bends = [
            sub(slopes[0], sub(near[2], near[1])),
            sub(sub(near[4], near[3]), slopes[1]),
        ];
        let kink = length(sub(bends[1], bends[0]));
        assert!(kink < 50.0 * h * h * h, "{kink}");
    }
}
