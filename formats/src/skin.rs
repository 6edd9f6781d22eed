//! A surface that rays from the spindle end at, as triangles between rays that stand next to each other, and
//! nowhere else: ends stay open.

use horma_core::{Machined, Point};

/// Which of the two surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// As designed: where a ray last meets the part.
    Designed,
    /// As machined: where it first meets a cutter.
    Machined,
}

/// Triangles, with the deviation of the machined surface from the designed one at each corner.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Skin {
    /// Corners, in part coordinates, mm.
    pub points: Vec<Point>,
    /// How far the machined surface lies outside of the designed one there, mm; nothing if one of them is missing.
    pub deviations: Vec<Option<f64>>,
    /// Triangles by their corners, seen anticlockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// One of the surfaces as triangles.
pub(crate) fn skin(surface: &Machined, which: Which) -> Skin {
    let radii = match which {
        Which::Designed => &surface.designed,
        Which::Machined => &surface.machined,
    };
    let (mut points, mut deviations) = (Vec::new(), Vec::new());
    // A ray's corner, numbered over those that there are.
    let mut numbers = Vec::with_capacity(radii.len());
    for (ray, radius) in radii.iter().enumerate() {
        numbers.push(radius.map(|radius| {
            points.push(surface.rays.point(ray, radius));
            deviations.push(surface.deviation[ray]);
            points.len() as u32 - 1
        }));
    }
    Skin {
        points,
        deviations,
        triangles: triangles(&numbers, surface.rays.columns as usize),
    }
}

/// The triangles between neighbouring rays.
fn triangles(numbers: &[Option<u32>], columns: usize) -> Vec<[u32; 3]> {
    let mut triangles = Vec::with_capacity(2 * numbers.len());
    for ray in 0..numbers.len().saturating_sub(columns) {
        let beside = ray - ray % columns + (ray + 1) % columns;
        let [a, b, c, d] = [ray, ray + columns, beside + columns, beside].map(|ray| numbers[ray]);
        for triangle in [[a, b, c], [a, c, d]] {
            if let [Some(a), Some(b), Some(c)] = triangle {
                triangles.push([a, b, c]);
            }
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use horma_core::{cross, dot, sub};

    use super::*;
    use crate::map::tests::surface;

    #[test]
    fn a_ring_is_closed_and_faces_outward() {
        // 3 rows of 8, one ray of which meets no cutter: two rings of 16 triangles without the 3 at its sides.
        for (which, corners, count) in [(Which::Machined, 23, 29), (Which::Designed, 24, 32)] {
            let skin = skin(&surface(), which);
            assert_eq!((skin.points.len(), skin.triangles.len()), (corners, count));
            for triangle in &skin.triangles {
                let [a, b, c] = triangle.map(|k| skin.points[k as usize]);
                let normal = cross(sub(b, a), sub(c, a));
                assert!(dot(normal, [0.0, a[1], a[2]]) > 0.0, "{triangle:?}");
            }
        }
    }

    #[test]
    fn corners_keep_their_deviations() {
        let gouged = |which| {
            let skin = skin(&surface(), which);
            let at = skin.deviations.iter().position(|d| *d == Some(-0.5));
            let [_, y, z] = skin.points[at.expect("one")];
            y.hypot(z)
        };
        assert!((gouged(Which::Machined) - 9.5).abs() < 1e-12);
        assert!((gouged(Which::Designed) - 10.0).abs() < 1e-12);
    }
}
