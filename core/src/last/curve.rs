//! Closed curves in a plane: where they turn most, and how long they are from place to place.

use crate::vector::{Point, length, sub};

/// Openings up to this share of a curve's length are bridged: the ends of a last, where its holders are.
const OPENING: f64 = 0.2;

/// The longest curve, with those whose ends are near its own joined to it.
pub(super) fn join(mut curves: Vec<Vec<Point>>) -> Vec<Point> {
    let long = |c: &[Point]| -> f64 { c.windows(2).map(|p| length(sub(p[1], p[0]))).sum() };
    let longest = (0..curves.len()).max_by(|&a, &b| {
        let order = long(&curves[a]).total_cmp(&long(&curves[b]));
        order.then(b.cmp(&a))
    });
    let Some(longest) = longest else {
        return Vec::new();
    };
    let mut curve = curves.swap_remove(longest);
    let all = long(&curve) + curves.iter().map(|c| long(c)).sum::<f64>();
    curves.retain(|c| c.first() != c.last());
    while curve.first() != curve.last() {
        let end = curve[curve.len() - 1];
        let mut nearest: Option<(f64, usize, bool)> = None;
        for (k, other) in curves.iter().enumerate() {
            for (place, backwards) in [(other[0], false), (other[other.len() - 1], true)] {
                let gap = length(sub(place, end));
                if nearest.is_none_or(|(least, _, _)| gap < least) {
                    nearest = Some((gap, k, backwards));
                }
            }
        }
        let closing = length(sub(curve[0], end));
        match nearest.filter(|n| n.0 < closing && n.0 <= OPENING * all) {
            None => break,
            Some((_, k, backwards)) => {
                let mut other = curves.swap_remove(k);
                if backwards {
                    other.reverse();
                }
                curve.extend(other);
            }
        }
    }
    curve
}

/// A closed curve, counter-clockwise, and how far along it each of its points is.
#[derive(Debug, Clone)]
pub(super) struct Loop {
    points: Vec<[f64; 2]>,
    /// Distance of each point from the first along the curve, mm; then that of the first again.
    at: Vec<f64>,
}

/// How far before and behind a place the curve is looked at for its turn there, mm.
const ARM: f64 = 3.0;
/// Distance of places that are tried, mm.
const STRIDE: f64 = 0.25;

impl Loop {
    /// Closes the curve through `points`, begins it at the one of least `begin` and lets it run
    /// counter-clockwise. Nothing if there are less than three.
    pub fn new(mut points: Vec<[f64; 2]>, begin: impl Fn([f64; 2]) -> f64) -> Option<Self> {
        points.dedup();
        if points.first() == points.last() {
            points.pop();
        }
        if points.len() < 3 {
            return None;
        }
        let next = |k: usize| points[(k + 1) % points.len()];
        let area: f64 = (0..points.len())
            .map(|k| points[k][0] * next(k)[1] - points[k][1] * next(k)[0])
            .sum();
        if area < 0.0 {
            points.reverse();
        }
        let first =
            (0..points.len()).min_by(|&a, &b| begin(points[a]).total_cmp(&begin(points[b])))?;
        points.rotate_left(first);
        let mut at = vec![0.0];
        for k in 0..points.len() {
            let [p, q] = [points[k], points[(k + 1) % points.len()]];
            at.push(at[k] + length([q[0] - p[0], q[1] - p[1], 0.0]));
        }
        Some(Self { points, at })
    }

    /// Its length, mm.
    pub fn length(&self) -> f64 {
        self.at[self.points.len()]
    }

    /// The place at a distance from its first point, any number of times around.
    pub fn place(&self, at: f64) -> [f64; 2] {
        let all = self.length();
        let at = at - (at / all).floor() * all;
        let k = self
            .at
            .partition_point(|&a| a <= at)
            .clamp(1, self.points.len());
        let [p, q] = [self.points[k - 1], self.points[k % self.points.len()]];
        let share = (at - self.at[k - 1]) / (self.at[k] - self.at[k - 1]);
        [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]
    }

    /// How far along it the point of greatest `value` is.
    pub fn greatest(&self, value: impl Fn([f64; 2]) -> f64) -> f64 {
        let best = (0..self.points.len()).max_by(|&a, &b| {
            value(self.points[a])
                .total_cmp(&value(self.points[b]))
                .then(b.cmp(&a))
        });
        best.map_or(0.0, |k| self.at[k])
    }

    /// How far along it the point next to `p` is.
    pub fn nearest(&self, p: [f64; 2]) -> f64 {
        let mut best = (f64::INFINITY, 0.0);
        for k in 0..self.points.len() {
            let [a, b] = [self.points[k], self.points[(k + 1) % self.points.len()]];
            let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
            let along = (p[0] - a[0]) * dx + (p[1] - a[1]) * dy;
            let share = (along / (dx * dx + dy * dy)).clamp(0.0, 1.0);
            let off = length([a[0] + share * dx - p[0], a[1] + share * dy - p[1], 0.0]);
            if off < best.0 {
                best = (off, self.at[k] + share * (self.at[k + 1] - self.at[k]));
            }
        }
        best.1
    }

    /// How far along it, between `from` and `to`, it turns most to the left, where `allowed`.
    pub fn corner(&self, from: f64, to: f64, allowed: impl Fn([f64; 2]) -> bool) -> Option<f64> {
        let turn = |at: f64| {
            let [a, b, c] = [at - ARM, at, at + ARM].map(|at| self.place(at));
            let [before, behind] = [[b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]];
            let size = |v: [f64; 2]| length([v[0], v[1], 0.0]);
            let cos = (before[0] * behind[0] + before[1] * behind[1])
                / (size(before) * size(behind)).max(f64::MIN_POSITIVE);
            let left = before[0] * behind[1] - before[1] * behind[0] > 0.0;
            if left { 1.0 - cos } else { 0.0 }
        };
        let count = ((to - from) / STRIDE).max(0.0) as usize;
        let places = (0..=count).map(|k| from + STRIDE * k as f64);
        let tried = places
            .filter(|&at| allowed(self.place(at)))
            .map(|at| (turn(at), at));
        let best = tried.reduce(|best, next| if next.0 > best.0 { next } else { best });
        best.map(|(_, at)| at)
    }

    /// The points from one place of it to the next, both included.
    pub fn between(&self, from: f64, to: f64) -> Vec<[f64; 2]> {
        let all = self.length();
        let to = if to < from { to + all } else { to };
        let inner = (0..2).flat_map(|turn| {
            let points = self.points.iter().zip(&self.at);
            points.map(move |(&p, &at)| (p, at + all * f64::from(turn)))
        });
        let inner = inner
            .filter(|&(_, at)| at > from && at < to)
            .map(|(p, _)| p);
        let first = [self.place(from)].into_iter();
        first.chain(inner).chain([self.place(to)]).collect()
    }

    /// The least and the greatest second coordinate where the first is `at`.
    pub fn crossed(&self, at: f64) -> Option<[f64; 2]> {
        let count = self.points.len();
        let crossings = (0..count).filter_map(|k| {
            let [p, q] = [self.points[k], self.points[(k + 1) % count]];
            let over = (p[0] >= at) != (q[0] >= at);
            over.then(|| p[1] + (at - p[0]) / (q[0] - p[0]) * (q[1] - p[1]))
        });
        crossings.fold(None, |found, c| {
            let [low, high] = found.unwrap_or([c, c]);
            Some([c.min(low), c.max(high)])
        })
    }
}
