//! Axes and curvatures that fit points: the shape of a lid before it is made to hold them.

use nalgebra::{Matrix4, Vector4};

use crate::slices::Axes;
use crate::vector::{Point, add_scaled, cross, dot, sub, unit};

/// Points that a lid is fitted to, at most.
const FIT: usize = 64;

/// A few of some points, evenly spread, and how many these are.
pub(super) fn few<'a>(points: impl Iterator<Item = Axes<'a>> + Clone) -> ([Point; FIT], usize) {
    let all: usize = points.clone().map(|[x, ..]| x.len()).sum();
    let step = all.div_ceil(FIT);
    let (mut few, mut count, mut next) = ([[0.0; 3]; FIT], 0, 0);
    for [x, y, z] in points {
        while next < x.len() {
            few[count] = [x[next], y[next], z[next]];
            count += 1;
            next += step;
        }
        next -= x.len();
    }
    (few, count)
}

/// How points lie: about on a paraboloid over a parallelogram.
pub(super) struct Shape {
    /// A direction that leans towards the spindle, one that is square to the spindle, and the normal, away from
    /// the spindle. The first leans towards the second as well, so that the paraboloid has no twist.
    pub axes: [Point; 3],
    /// What a vector has to be multiplied by to give its parts along these.
    pub parts: [Point; 3],
    /// How much it bends away from the normal along the first two, 1/mm: by `bends[0]·x² + bends[1]·y²`. Where it
    /// bends towards the normal that is 0.
    pub bends: [f64; 2],
}

/// How far the first axis may lean, as a share of the points' extents: a parallelogram has corners where there
/// are no points.
const LEAN: f64 = 0.3;

impl Shape {
    /// Of at least one point.
    pub fn of(points: &[Point]) -> Self {
        let (mean, normal) = plane(points);
        let axes = around(normal);
        let [mut size, mut inverse] = [[0.0; 2]; 2];
        for k in 0..2 {
            let far = |p: &Point| dot(sub(*p, mean), axes[k]).abs();
            size[k] = points.iter().map(far).fold(0.0, f64::max);
            inverse[k] = if size[k] > 0.0 { 1.0 / size[k] } else { 0.0 };
        }
        let [ss, tt, st] = paraboloid(points.iter().map(|&p| {
            let [x, y, w] = axes.map(|axis| dot(sub(p, mean), axis));
            [x * inverse[0], y * inverse[1], w]
        }));
        // Along conjugate directions there is no twist. What is left of it takes from both bends.
        let lean = if tt < 0.0 { -st / (2.0 * tt) } else { 0.0 };
        let lean = lean.clamp(-LEAN, LEAN);
        let ss = ss + (st + tt * lean) * lean;
        let twist = (st + 2.0 * tt * lean).abs() / 2.0;
        let bend = |square: f64, inverse: f64| (-square - twist).max(0.0) * inverse * inverse;
        let lean = lean * size[1] * inverse[0];
        let [u, v, normal] = axes;
        Self {
            axes: [add_scaled(u, lean, v), v, normal],
            parts: [u, add_scaled(v, -lean, u), normal],
            bends: [bend(ss, inverse[0]), bend(tt, inverse[1])],
        }
    }
}

/// What s², t² and st have to be multiplied by, beside a constant, to fit points `(s, t, w)` best.
fn paraboloid(points: impl Iterator<Item = Point>) -> [f64; 3] {
    let (mut count, mut sums, mut right) = (0.0, [0.0; 8], [0.0; 4]);
    for [s, t, w] in points {
        let (ss, tt, st) = (s * s, t * t, s * t);
        let products = [ss, tt, st, ss * ss, ss * st, ss * tt, tt * st, tt * tt];
        for (sum, product) in sums.iter_mut().zip(products) {
            *sum += product;
        }
        for (sum, term) in right.iter_mut().zip([1.0, ss, tt, st]) {
            *sum += w * term;
        }
        count += 1.0;
    }
    let [ss, tt, st, ssss, ssst, sstt, sttt, tttt] = sums;
    // A single line of points has no curvature across it.
    let little = 1.0e-6 * count;
    #[rustfmt::skip]
    let square = Matrix4::new(
        count + little, ss, tt, st,
        ss, ssss + little, sstt, ssst,
        tt, sstt, tttt + little, sttt,
        st, ssst, sttt, sstt + little,
    );
    let fit = square
        .try_inverse()
        .map(|inverse| inverse * Vector4::from(right));
    let fit = fit.filter(|fit| fit.iter().all(|c| c.is_finite()));
    let fit = fit.unwrap_or_else(Vector4::zeros);
    [fit[1], fit[2], fit[3]]
}

/// The middle of points, and the normal of the plane that fits them, away from the spindle.
fn plane(points: &[Point]) -> (Point, Point) {
    let mut sum = [0.0; 3];
    for p in points {
        sum = add_scaled(sum, 1.0, *p);
    }
    let mean = sum.map(|s| s / points.len() as f64);
    // Second moments, as the six numbers of a symmetric matrix.
    let mut m = [0.0; 6];
    for p in points {
        let [x, y, z] = sub(*p, mean);
        m = [
            m[0] + x * x,
            m[1] + x * y,
            m[2] + x * z,
            m[3] + y * y,
            m[4] + y * z,
            m[5] + z * z,
        ];
    }
    let normal = flattest(m);
    let outward = normal[1] * mean[1] + normal[2] * mean[2] >= 0.0;
    (mean, if outward { normal } else { normal.map(|c| -c) })
}

/// Axes around a normal, which is the last: one that leans towards the spindle, and one square to the spindle.
fn around(normal: Point) -> [Point; 3] {
    let x = [1.0, 0.0, 0.0];
    let u = unit(add_scaled(x, -normal[0], normal)).unwrap_or([0.0, 1.0, 0.0]);
    let v = cross(normal, u);
    // Square to the spindle but for rounding; the box has no room for more.
    match unit([0.0, v[1], v[2]]) {
        Some(v) => [cross(v, normal), v, normal],
        None => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }
}

/// The direction in which points with these second moments extend least; any if there is no such.
fn flattest(m: [f64; 6]) -> Point {
    // The adjugate's greatest direction is the matrix's least, and squaring makes it prevail.
    let mut a = m;
    for round in 0..5 {
        let size = a[0].abs().max(a[3].abs()).max(a[5].abs());
        if !(size > 0.0 && size.is_finite()) {
            return [0.0, 1.0, 0.0];
        }
        let [xx, xy, xz, yy, yz, zz] = a.map(|c| c / size);
        a = if round == 0 {
            [
                yy * zz - yz * yz,
                xz * yz - xy * zz,
                xy * yz - xz * yy,
                xx * zz - xz * xz,
                xy * xz - xx * yz,
                xx * yy - xy * xy,
            ]
        } else {
            [
                xx * xx + xy * xy + xz * xz,
                xx * xy + xy * yy + xz * yz,
                xx * xz + xy * yz + xz * zz,
                xy * xy + yy * yy + yz * yz,
                xy * xz + yy * yz + yz * zz,
                xz * xz + yz * yz + zz * zz,
            ]
        };
    }
    let [xx, xy, xz, yy, yz, zz] = a;
    let columns = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let longest = if xx >= yy && xx >= zz {
        0
    } else if yy >= zz {
        1
    } else {
        2
    };
    unit(columns[longest]).unwrap_or([0.0, 1.0, 0.0])
}
