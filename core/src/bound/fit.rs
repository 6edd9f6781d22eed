//! Axes and curvatures that fit points: the shape of a lid before it is made to hold them.

use nalgebra::{Matrix3, Vector3};

use crate::slices::Axes;
use crate::vector::{Point, add_scaled, cross, sub, unit};

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

/// The curvatures a and b of the paraboloid `w₀ − a·s² − b·t²` that fits points `(s², t², w)` best.
pub(super) fn paraboloid(points: impl Iterator<Item = (f64, f64, f64)>) -> (f64, f64) {
    // The normal equations: sums of products of 1, s, t and w.
    let (mut count, mut sums) = (0.0, [0.0; 8]);
    for (s, t, w) in points {
        count += 1.0;
        let products = [s, t, s * s, s * t, t * t, w, s * w, t * w];
        for (sum, product) in sums.iter_mut().zip(products) {
            *sum += product;
        }
    }
    let [s, t, ss, st, tt, w, sw, tw] = sums;
    // A single line of points has no curvature across it.
    let lean = 1.0e-6 * count;
    let n = Matrix3::new(count + lean, s, t, s, ss + lean, st, t, st, tt + lean);
    let right = Vector3::new(w, sw, tw);
    let fit = n.try_inverse().map(|inverse| inverse * right);
    fit.filter(|f| f.iter().all(|c| c.is_finite()))
        .map_or((0.0, 0.0), |f| (-f[1], -f[2]))
}

/// Axes that fit points: a direction that leans towards the spindle, one that is square to the spindle,
/// and the normal, away from the spindle.
pub(super) fn axes(points: impl Iterator<Item = Point> + Clone) -> [Point; 3] {
    let (mut count, mut sum) = (0.0, [0.0; 3]);
    for p in points.clone() {
        count += 1.0;
        sum = add_scaled(sum, 1.0, p);
    }
    let mean = sum.map(|s| s / count);
    // Second moments, as the six numbers of a symmetric matrix.
    let mut m = [0.0; 6];
    for p in points {
        let [x, y, z] = sub(p, mean);
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
    let normal = if outward { normal } else { normal.map(|c| -c) };
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
