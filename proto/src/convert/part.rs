//! What it is computed from: bodies, rows, and surfaces that rows are made from.

use bytes::Bytes;
use horma_core::{
    Body, Coordinates, Direction, Mesh, Packing, Point, Row, RowKind, Shape, Surface, SurfaceGrid,
};

use super::{coordinates_from_wire, missing};
use crate::error::{Error, Result};
use crate::wire;

/// A row for the wire, packed if every point survives that to the last bit.
pub fn row_to_wire(row: &Row) -> wire::Row {
    use wire::row::{Coordinates, Kind};
    let packed: Option<Vec<u64>> = {
        let words = row.points.iter().map(|&p| Packing::POINTS.pack_exactly(p));
        words.collect()
    };
    wire::Row {
        id: row.id,
        coordinates: Some(match packed {
            Some(words) => {
                let bytes = words.into_iter().flat_map(u64::to_le_bytes);
                Coordinates::Packed21(bytes.collect())
            }
            None => Coordinates::Points(pack_points(&row.points)),
        }),
        kind: Some(match &row.kind {
            &RowKind::Isoline { joins_next } => Kind::Isoline(wire::Isoline { joins_next }),
            RowKind::Slab { facets } => Kind::Slab(wire::Slab {
                facets: pack_triangles(facets),
            }),
        }),
    }
}

/// A row from the wire.
///
/// # Errors
/// [`Error::Missing`], [`Error::Ragged`] or [`Error::Core`].
pub fn row_from_wire(row: &wire::Row) -> Result<Row> {
    use wire::row::{Coordinates, Kind};
    let kind = match row.kind.as_ref().ok_or(missing("row", "a kind"))? {
        Kind::Isoline(isoline) => RowKind::Isoline {
            joins_next: isoline.joins_next,
        },
        Kind::Slab(slab) => RowKind::Slab {
            facets: unpack_triangles(&slab.facets)?,
        },
    };
    let coordinates = row.coordinates.as_ref();
    let points = match coordinates.ok_or(missing("row", "points"))? {
        Coordinates::Points(points) => unpack_points(points)?,
        Coordinates::Packed21(words) => {
            let point = |word: &[u8; 8]| Packing::POINTS.unpack(u64::from_le_bytes(*word));
            unpack(words, "packed points", point)?
        }
    };
    let row = Row {
        id: row.id,
        points,
        kind,
    };
    row.validate()?;
    Ok(row)
}

/// A body for the wire.
pub fn body_to_wire(body: &Body) -> wire::Body {
    use wire::body::Shape as S;
    wire::Body {
        name: body.name.clone(),
        shape: Some(match &body.shape {
            Shape::Surface(surface) => S::Surface(surface_to_wire(surface)),
            Shape::Mesh(mesh) => S::Mesh(wire::Mesh {
                vertices: pack_points(mesh.vertices()),
                triangles: pack_triangles(mesh.triangles()),
            }),
        }),
    }
}

/// A body from the wire.
///
/// # Errors
/// [`Error::Missing`], [`Error::Ragged`] or [`Error::Core`].
pub fn body_from_wire(body: wire::Body) -> Result<Body> {
    use wire::body::Shape as S;
    let name = body.name;
    let shape = match body.shape.ok_or(missing("body", "a shape"))? {
        S::Surface(s) => Shape::Surface(surface_from_wire(&name, s)?),
        S::Mesh(m) => Shape::Mesh(Mesh::new(
            &name,
            unpack_points(&m.vertices)?,
            unpack_triangles(&m.triangles)?,
        )?),
    };
    Ok(Body { name, shape })
}

fn surface_to_wire(surface: &Surface) -> wire::Surface {
    let direction = |d: &Direction| {
        Some(wire::Direction {
            degree: d.degree as u32,
            knots: d.knots.clone(),
        })
    };
    wire::Surface {
        u: direction(surface.u()),
        v: direction(surface.v()),
        poles: pack_points(surface.poles()),
        weights: surface.weights().unwrap_or_default().to_vec(),
    }
}

fn surface_from_wire(name: &str, s: wire::Surface) -> Result<Surface> {
    let direction = |d: Option<wire::Direction>| {
        let d = d.ok_or(missing("surface", "a direction"))?;
        Ok::<_, Error>(Direction {
            degree: d.degree as usize,
            knots: d.knots,
        })
    };
    Ok(Surface::new(
        name,
        direction(s.u)?,
        direction(s.v)?,
        unpack_points(&s.poles)?,
        (!s.weights.is_empty()).then_some(s.weights),
    )?)
}

/// Rows to be made, for the wire.
pub fn grid_to_wire(grid: &SurfaceGrid) -> wire::SurfaceGrid {
    let (ids, us) = grid.us.iter().copied().unzip();
    wire::SurfaceGrid {
        name: grid.name.clone(),
        surface: Some(surface_to_wire(&grid.surface)),
        ids,
        us,
        vs: grid.vs.clone(),
        last: grid.last,
        packed21: grid.coordinates == Coordinates::Packed21,
    }
}

/// Rows to be made, from the wire.
///
/// # Errors
/// [`Error::Missing`], [`Error::Ragged`], [`Error::Incomplete`] or [`Error::Core`].
pub fn grid_from_wire(grid: wire::SurfaceGrid) -> Result<SurfaceGrid> {
    if grid.ids.len() != grid.us.len() {
        return Err(Error::Incomplete {
            what: "parameters of rows",
            expected: grid.ids.len() as u64,
            found: grid.us.len() as u64,
        });
    }
    let surface = grid.surface.ok_or(missing("grid", "a surface"))?;
    let surface = surface_from_wire(&grid.name, surface)?;
    let grid = SurfaceGrid {
        name: grid.name,
        surface,
        us: grid.ids.into_iter().zip(grid.us).collect(),
        vs: grid.vs,
        last: grid.last,
        coordinates: coordinates_from_wire(grid.packed21),
    };
    grid.validate()?;
    Ok(grid)
}

fn pack_points(points: &[Point]) -> Bytes {
    let numbers = points.iter().flatten();
    numbers.flat_map(|n| n.to_le_bytes()).collect()
}

fn unpack_points(bytes: &[u8]) -> Result<Vec<Point>> {
    let [x, y, z] = [0, 8, 16];
    let number = |b: &[u8; 24], at: usize| f64::from_le_bytes(std::array::from_fn(|i| b[at + i]));
    let point = |b: &[u8; 24]| [number(b, x), number(b, y), number(b, z)];
    unpack(bytes, "points", point)
}

fn pack_triangles(triangles: &[[u32; 3]]) -> Bytes {
    let numbers = triangles.iter().flatten();
    numbers.flat_map(|n| n.to_le_bytes()).collect()
}

fn unpack_triangles(bytes: &[u8]) -> Result<Vec<[u32; 3]>> {
    let number = |b: &[u8; 12], at: usize| u32::from_le_bytes(std::array::from_fn(|i| b[at + i]));
    let triangle = |b: &[u8; 12]| [number(b, 0), number(b, 4), number(b, 8)];
    unpack(bytes, "triangles", triangle)
}

fn unpack<T, const N: usize>(
    bytes: &[u8],
    what: &'static str,
    one: impl Fn(&[u8; N]) -> T,
) -> Result<Vec<T>> {
    let (all, rest) = bytes.as_chunks::<N>();
    if rest.is_empty() {
        Ok(all.iter().map(one).collect())
    } else {
        Err(Error::Ragged {
            what,
            bytes: bytes.len(),
            size: N,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_bodies_survive_the_wire() {
        use wire::row::Coordinates;
        let points = vec![[0.1, 1.0, -2.5], [1.0, 0.5, 3.0], [2.0, 0.0, 0.0]];
        let mut round = points.clone();
        round[0][0] = 0.125;
        for (points, packed) in [(&points, false), (&round, true)] {
            for kind in [
                RowKind::Isoline { joins_next: true },
                RowKind::Slab {
                    facets: vec![[0, 1, 2]],
                },
            ] {
                let row = Row {
                    id: 7,
                    points: points.clone(),
                    kind,
                };
                let sent = row_to_wire(&row);
                let size = match sent.coordinates.as_ref().expect("points") {
                    Coordinates::Packed21(words) => (true, words.len()),
                    Coordinates::Points(doubles) => (false, doubles.len()),
                };
                assert_eq!(size, (packed, if packed { 24 } else { 72 }));
                assert_eq!(row_from_wire(&sent), Ok(row));
            }
        }
        let mesh = Mesh::new("m", points, vec![[2, 1, 0]]).expect("valid");
        let body = Body {
            name: "m".to_owned(),
            shape: Shape::Mesh(mesh),
        };
        assert_eq!(body_from_wire(body_to_wire(&body)), Ok(body));
    }

    #[test]
    fn grids_survive_the_wire_and_are_checked() {
        let line = || Direction {
            degree: 1,
            knots: vec![0.0, 0.0, 1.0, 1.0],
        };
        let poles = vec![[0.0; 3], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0], [5.0, 1.0, 0.0]];
        let surface = Surface::new("s", line(), line(), poles, None).expect("valid");
        let grid = SurfaceGrid {
            name: "s".to_owned(),
            surface,
            us: vec![(4, 0.25), (7, 1.0)],
            vs: vec![0.0, 0.1 + 0.2, 1.0],
            last: 7,
            coordinates: Coordinates::Packed21,
        };
        let good = grid_to_wire(&grid);
        assert_eq!(grid_from_wire(good.clone()), Ok(grid));
        let bad = wire::SurfaceGrid {
            ids: vec![4],
            ..good.clone()
        };
        assert!(matches!(grid_from_wire(bad), Err(Error::Incomplete { .. })));
        let bad = wire::SurfaceGrid { last: 6, ..good };
        assert!(matches!(grid_from_wire(bad), Err(Error::Core(_))));
    }

    #[test]
    fn a_facet_beyond_its_row_is_refused() {
        let row = wire::Row {
            id: 0,
            coordinates: Some(wire::row::Coordinates::Points(pack_points(&[[0.0; 3]; 2]))),
            kind: Some(wire::row::Kind::Slab(wire::Slab {
                facets: pack_triangles(&[[0, 1, 2]]),
            })),
        };
        assert!(matches!(row_from_wire(&row), Err(Error::Core(_))));
    }
}
