//! The part as triangles, few enough to be turned in a browser.

use std::collections::HashMap;

use horma_core::Point;

use super::pack;
use crate::preview::Sheet;

/// Most triangles.
const MOST: usize = 120_000;

/// Cells along the longest side of the part within which points become one, at first.
const CELLS: f64 = 256.0;

/// Triangles to look at.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Solid {
    /// Corners, mm.
    pub points: Vec<Point>,
    /// Triangles by their corners.
    pub triangles: Vec<[u32; 3]>,
    /// The first point of each body; its points follow each other.
    pub bodies: Vec<u32>,
    /// Edges to be marked, those that are open.
    pub edges: Vec<[Point; 2]>,
    /// How many triangles there were before they became fewer.
    pub of: u64,
}

/// The part's triangles; if they are too many, points near each other become one, in cells that grow
/// until they are few enough.
pub(super) fn solid(sheets: &[Sheet]) -> Solid {
    let of: usize = sheets.iter().map(|s| s.triangles.len()).sum();
    if of <= MOST {
        return joined(sheets, of);
    }
    let (low, high) = pack::bounds(sheets.iter().flat_map(|s| s.points.iter().copied()));
    let side = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let mut cell = side / CELLS;
    loop {
        let fewer: Vec<Sheet> = sheets.iter().map(|s| clustered(s, cell)).collect();
        let left: usize = fewer.iter().map(|s| s.triangles.len()).sum();
        // In a cell as large as the part nothing is left.
        if left <= MOST {
            return joined(&fewer, of);
        }
        cell *= 1.25;
    }
}

/// All sheets as one.
fn joined(sheets: &[Sheet], of: usize) -> Solid {
    let mut solid = Solid {
        of: of as u64,
        ..Solid::default()
    };
    for sheet in sheets {
        let first = solid.points.len() as u32;
        solid.bodies.push(first);
        solid.points.extend(&sheet.points);
        let triangles = sheet.triangles.iter().map(|t| t.map(|c| first + c));
        solid.triangles.extend(triangles);
    }
    solid
}

/// The first point of each cell stands for all of it; what has lost its area goes.
fn clustered(sheet: &Sheet, cell: f64) -> Sheet {
    let mut cells = HashMap::new();
    let mut points = Vec::new();
    let places: Vec<u32> = sheet
        .points
        .iter()
        .map(|&p| {
            *cells
                .entry(p.map(|c| (c / cell).floor() as i64))
                .or_insert_with(|| {
                    points.push(p);
                    points.len() as u32 - 1
                })
        })
        .collect();
    let triangles = sheet
        .triangles
        .iter()
        .map(|t| t.map(|c| places[c as usize]));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a);
    Sheet {
        triangles: triangles.collect(),
        normals: Vec::new(),
        points,
    }
}

#[cfg(test)]
mod tests {
    use crate::preview::sheets;
    use horma_core::{Body, Mesh, Part, Shape};

    use super::*;

    /// A square of so many cells along each side, 100 mm long.
    fn square(cells: u32) -> Part {
        let n = cells + 1;
        let at = |i: u32| f64::from(i) * 100.0 / f64::from(cells);
        let points = (0..n * n).map(|k| [at(k / n), at(k % n), 5.0]).collect();
        let corners = (0..cells * cells).map(|k| k / cells * n + k % cells);
        let triangles = corners.flat_map(|a| [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]);
        let mesh = Mesh::new("square", points, triangles.collect()).expect("valid");
        Part {
            bodies: vec![Body {
                name: "square".to_owned(),
                shape: Shape::Mesh(mesh),
            }],
        }
    }

    #[test]
    fn a_few_triangles_stay_as_they_are() {
        let solid = solid(&sheets(&square(10)));
        assert_eq!((solid.triangles.len(), solid.of), (200, 200));
        assert_eq!(solid.points.len(), 121);
    }

    #[test]
    fn many_become_fewer_and_still_cover_the_part() {
        let solid = solid(&sheets(&square(300)));
        assert_eq!(solid.of, 180_000);
        assert!((20_000..=MOST).contains(&solid.triangles.len()));
        let area: f64 = solid
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|k| solid.points[k as usize]);
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs()
            })
            .sum();
        assert!((9_800.0..=10_000.0 + 1e-6).contains(&area), "{area}");
    }
}
