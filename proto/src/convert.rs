//! Wire ↔ core. Going out cannot fail; coming in, everything is checked by the core's own
//! constructors.

use bytes::Bytes;
use horma_core::{
    Body, Contact, Coordinates, Counters, Culling, Cutter, Direction, Discretization, Distribution,
    Job, Local, Mesh, Method, Motion, MotionKind, Packing, Point, Row, RowKind, Shape, Sharing,
    Surface, SurfaceGrid, Trajectory, Window,
};

use crate::error::{Error, Result};
use crate::wire;

fn missing(message: &'static str, field: &'static str) -> Error {
    Error::Missing { message, field }
}

/// A job for the wire.
pub fn job_to_wire(job: &Job) -> wire::Job {
    use wire::job::{Cutter as C, Discretization as D};
    wire::Job {
        discretization: Some(match job.discretization {
            Discretization::Grid { rows, columns } => D::Grid(wire::Grid { rows, columns }),
            Discretization::Tolerance(t) => D::Tolerance(t),
        }),
        cutter: Some(match job.cutter {
            Cutter::Torus {
                major_radius,
                minor_radius,
            } => C::Torus(wire::Torus {
                major_radius,
                minor_radius,
            }),
            Cutter::Cone {
                radius,
                width,
                half_angle,
                ..
            } => C::Cone(wire::Cone {
                radius,
                width,
                half_angle,
            }),
        }),
        motion: Some(wire::Motion {
            kind: kind_to_wire(job.motion.kind).into(),
            step: job.motion.step,
            points_per_revolution: job.motion.points_per_revolution,
            from: job.motion.from,
            to: job.motion.to,
            path_tolerance: job.motion.path_tolerance,
            lead_in: job.motion.lead[0],
            lead_out: job.motion.lead[1],
        }),
        contact: match job.contact {
            Contact::Point => wire::Contact::Point,
            Contact::Facet => wire::Contact::Facet,
        }
        .into(),
        method: match job.method {
            Method::Exact => wire::Method::Exact,
            Method::Brute => wire::Method::Brute,
            Method::Local(_) => wire::Method::Local,
        }
        .into(),
        local: local_to_wire(job.method),
        packed21: job.coordinates == Coordinates::Packed21,
    }
}

/// A job from the wire.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Core`].
pub fn job_from_wire(job: &wire::Job) -> Result<Job> {
    use wire::job::{Cutter as C, Discretization as D};
    let discretization = match job.discretization {
        Some(D::Grid(wire::Grid { rows, columns })) => Discretization::Grid { rows, columns },
        Some(D::Tolerance(t)) => Discretization::Tolerance(t),
        None => return Err(missing("job", "a discretization")),
    };
    let cutter = match &job.cutter {
        Some(C::Torus(t)) => Cutter::torus(t.major_radius, t.minor_radius)?,
        Some(C::Cone(c)) => Cutter::cone(c.radius, c.width, c.half_angle)?,
        None => return Err(missing("job", "a cutter")),
    };
    let motion = job.motion.as_ref().ok_or(missing("job", "a motion"))?;
    let motion = Motion {
        kind: kind_from_wire(motion.kind())?,
        step: motion.step,
        points_per_revolution: motion.points_per_revolution,
        from: motion.from,
        to: motion.to,
        path_tolerance: motion.path_tolerance,
        lead: [motion.lead_in, motion.lead_out],
    };
    let job = Job {
        discretization,
        coordinates: coordinates_from_wire(job.packed21),
        cutter,
        motion,
        contact: match job.contact() {
            wire::Contact::Point => Contact::Point,
            wire::Contact::Facet => Contact::Facet,
            wire::Contact::Unspecified => return Err(missing("job", "a contact")),
        },
        method: match job.method() {
            wire::Method::Exact => Method::Exact,
            wire::Method::Brute => Method::Brute,
            wire::Method::Local => {
                let local = job.local.ok_or(missing("job", "a window"))?;
                Method::Local(local_from_wire(local))
            }
            wire::Method::Unspecified => return Err(missing("job", "a method")),
        },
    };
    job.validate()?;
    Ok(job)
}

fn coordinates_from_wire(packed21: bool) -> Coordinates {
    if packed21 {
        Coordinates::Packed21
    } else {
        Coordinates::Double
    }
}

/// The local search, if that is the method. Workers have its fallback in any case.
fn local_to_wire(method: Method) -> Option<wire::Local> {
    let Method::Local(local) = method else {
        return None;
    };
    let window = local.window.unwrap_or(Window::EVERYTHING);
    Some(wire::Local {
        delta_u: window.delta_u,
        delta_v: window.delta_v,
        back_faces: local.culling.back_faces,
        beyond_reach: local.culling.beyond_reach,
    })
}

fn local_from_wire(local: wire::Local) -> Local {
    Local {
        window: Some(Window {
            delta_u: local.delta_u,
            delta_v: local.delta_v,
        }),
        culling: Culling {
            back_faces: local.back_faces,
            beyond_reach: local.beyond_reach,
        },
        fallback: true,
    }
}

/// What searches cost, for the wire.
pub fn counters_to_wire(counters: Counters) -> wire::Counters {
    wire::Counters {
        evaluations: counters.evaluations,
        nodes: counters.nodes,
        lost: counters.lost,
        largest_loss: counters.largest_loss,
        beyond_tolerance: counters.beyond_tolerance,
    }
}

/// What searches cost, from the wire.
///
/// # Errors
/// [`Error::Malformed`] if a loss is no length: no report or journal could give it back.
pub fn counters_from_wire(counters: wire::Counters) -> Result<Counters> {
    let loss = counters.largest_loss;
    if !(0.0..f64::INFINITY).contains(&loss) {
        let why = format!("a largest loss of {loss} mm");
        return Err(Error::Malformed(why));
    }
    Ok(Counters {
        evaluations: counters.evaluations,
        nodes: counters.nodes,
        lost: counters.lost,
        largest_loss: loss,
        beyond_tolerance: counters.beyond_tolerance,
    })
}

fn kind_to_wire(kind: MotionKind) -> wire::MotionKind {
    match kind {
        MotionKind::Helix => wire::MotionKind::Helix,
        MotionKind::Rings => wire::MotionKind::Rings,
    }
}

fn kind_from_wire(kind: wire::MotionKind) -> Result<MotionKind> {
    match kind {
        wire::MotionKind::Helix => Ok(MotionKind::Helix),
        wire::MotionKind::Rings => Ok(MotionKind::Rings),
        wire::MotionKind::Unspecified => Err(missing("motion", "a kind")),
    }
}

/// A trajectory for the wire.
pub fn trajectory_to_wire(t: &Trajectory) -> wire::Trajectory {
    wire::Trajectory {
        kind: kind_to_wire(t.kind).into(),
        from: t.from,
        step: t.step,
        points_per_revolution: t.points_per_revolution,
        positions: t.positions,
    }
}

/// A trajectory from the wire.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Core`].
pub fn trajectory_from_wire(t: Option<&wire::Trajectory>) -> Result<Trajectory> {
    let t = t.ok_or(missing("task", "a trajectory"))?;
    let kind = kind_from_wire(t.kind())?;
    let motion = Motion {
        kind,
        step: t.step,
        points_per_revolution: t.points_per_revolution,
        from: Some(t.from),
        to: None,
        path_tolerance: None,
        lead: [0.0; 2],
    };
    motion.validate()?;
    Ok(Trajectory {
        kind,
        from: t.from,
        step: t.step,
        points_per_revolution: t.points_per_revolution,
        positions: t.positions,
    })
}

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

/// How a job is shared, for the wire.
pub fn sharing_to_wire(sharing: Sharing) -> wire::Sharing {
    let distribution = match sharing.distribution {
        Distribution::Overlap => wire::Distribution::Overlap,
        Distribution::Halo => wire::Distribution::Halo,
        Distribution::Surface => wire::Distribution::Surface,
    };
    wire::Sharing {
        distribution: distribution.into(),
        extents_per_worker: sharing.extents_per_worker,
    }
}

/// How a job is shared, from the wire.
///
/// # Errors
/// [`Error::Missing`].
pub fn sharing_from_wire(sharing: Option<&wire::Sharing>) -> Result<Sharing> {
    let missing = |field| missing("submission", field);
    let sharing = sharing.ok_or(missing("how it is shared"))?;
    let distribution = match sharing.distribution() {
        wire::Distribution::Overlap => Distribution::Overlap,
        wire::Distribution::Halo => Distribution::Halo,
        wire::Distribution::Surface => Distribution::Surface,
        wire::Distribution::Unspecified => return Err(missing("a distribution")),
    };
    let extents_per_worker = sharing.extents_per_worker;
    if extents_per_worker == 0 {
        return Err(missing("a number of extents for each worker"));
    }
    Ok(Sharing {
        distribution,
        extents_per_worker,
    })
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

    fn job(cutter: Cutter) -> Job {
        Job {
            discretization: Discretization::Grid {
                rows: 159,
                columns: 120,
            },
            cutter,
            motion: Motion {
                kind: MotionKind::Rings,
                step: 2.0,
                points_per_revolution: 360,
                from: None,
                to: Some(12.5),
                path_tolerance: None,
                lead: [0.0; 2],
            },
            coordinates: Coordinates::Double,
            contact: Contact::Facet,
            method: Method::Brute,
        }
    }

    #[test]
    fn jobs_survive_the_wire() {
        for cutter in [
            Cutter::torus(40.0, 8.0),
            Cutter::cylinder(20.0, 6.0),
            Cutter::cone(20.0, 6.0, 30.0),
        ] {
            let mut job = job(cutter.expect("valid"));
            assert_eq!(job_from_wire(&job_to_wire(&job)), Ok(job));
            job.motion.path_tolerance = Some(0.005);
            job.motion.lead = [4.0, 2.5];
            job.coordinates = Coordinates::Packed21;
            job.contact = Contact::Point;
            job.method = Method::Local(Local {
                window: Some(Window {
                    delta_u: 8,
                    delta_v: 20,
                }),
                culling: Culling {
                    back_faces: true,
                    beyond_reach: false,
                },
                fallback: true,
            });
            assert_eq!(job_from_wire(&job_to_wire(&job)), Ok(job));
        }
    }

    #[test]
    fn what_is_impossible_is_refused_on_arrival() {
        let good = job_to_wire(&job(Cutter::ball(5.0).expect("valid")));
        let negative = wire::Torus {
            major_radius: -1.0,
            minor_radius: 1.0,
        };
        let bad = wire::Job {
            cutter: Some(wire::job::Cutter::Torus(negative)),
            ..good
        };
        assert!(matches!(job_from_wire(&bad), Err(Error::Core(_))));
        let mut bad = good;
        if let Some(motion) = &mut bad.motion {
            motion.path_tolerance = Some(f64::NAN);
        }
        assert!(matches!(job_from_wire(&bad), Err(Error::Core(_))));
        let bad = wire::Job { contact: 0, ..good };
        assert!(matches!(job_from_wire(&bad), Err(Error::Missing { .. })));
    }

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
