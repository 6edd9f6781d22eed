//! Vectors of the kernel: three doubles, combined by a fixed sequence of + − × ÷ √.
//!
//! Anything that decides a height is computed here and not through a general library, so that the
//! order of the operations, and with it every bit of the result, is written down in one place.

use std::ops::{Add, Mul, Sub};

/// A point or a vector, mm.
pub type Point = [f64; 3];

/// `a − b`, of points or of several side by side.
#[inline(always)]
pub fn sub<T: Copy + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + s·b`, of points or of several side by side.
#[inline(always)]
pub fn add_scaled<T: Copy + Add<Output = T> + Mul<Output = T>>(
    a: [T; 3],
    s: T,
    b: [T; 3],
) -> [T; 3] {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// Scalar product, of vectors or of several side by side.
#[inline(always)]
pub fn dot<T: Copy + Add<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product, of vectors or of several side by side.
#[inline(always)]
pub fn cross<T: Copy + Sub<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Euclidean length.
#[inline(always)]
pub fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// `a` scaled to length 1, or `None` if it has no length.
pub fn unit(a: Point) -> Option<Point> {
    let l = length(a);
    (l > 0.0 && l.is_finite()).then(|| [a[0] / l, a[1] / l, a[2] / l])
}

/// The point at travel `x` and so far from the spindle that faces the cutter when the part is turned by the angle
/// of this cosine and sine, in part coordinates, mm.
pub fn facing(x: f64, radius: f64, (cos, sin): (f64, f64)) -> Point {
    [x, radius * cos, -radius * sin]
}

/// The same when the part is turned by so many degrees.
pub fn facing_at(x: f64, radius: f64, degrees: f64) -> Point {
    let radians = degrees.rem_euclid(360.0).to_radians();
    facing(x, radius, (libm::cos(radians), libm::sin(radians)))
}

/// A closed interval `[low, high]` of the x axis, mm; empty if `low > high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// The interval that holds nothing.
    pub const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    /// The smallest interval that holds every value.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        values
            .into_iter()
            .fold(Self::EMPTY, |i, x| i.hull(Self { low: x, high: x }))
    }

    /// The smallest interval that holds both.
    pub fn hull(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// The interval grown by `by` at both ends.
    pub fn widened(self, by: f64) -> Self {
        Self {
            low: self.low - by,
            high: self.high + by,
        }
    }

    /// Whether the two have a point in common.
    pub fn meets(self, other: Self) -> bool {
        self.low <= other.high && other.low <= self.high
    }
}
