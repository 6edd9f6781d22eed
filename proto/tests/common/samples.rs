//! A good message of each kind, to be spoilt.

#![allow(dead_code)] // Each crate uses its part of this.

use horma_proto::wire;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// One of these with some bytes of it replaced by others: what is nearly right gets further than noise.
pub fn spoilt(good: Vec<Vec<u8>>) -> impl Strategy<Value = Vec<u8>> {
    let parts = (select(good), any::<Index>(), vec(any::<u8>(), 0..9));
    parts.prop_map(|(mut bytes, at, with)| {
        let at = at.index(bytes.len());
        let end = bytes.len().min(at + with.len());
        bytes.splice(at..end, with);
        bytes
    })
}

/// Little-endian numbers.
pub fn numbers(n: u32) -> Vec<u8> {
    let numbers = (0..n).map(|i| f64::from(i * i % 17));
    numbers.flat_map(f64::to_le_bytes).collect()
}

/// Three corners.
fn triangle() -> Vec<u8> {
    [0u32, 1, 2].iter().flat_map(|i| i.to_le_bytes()).collect()
}

/// An attempt.
pub const ID: wire::TaskId = wire::TaskId {
    job: 1,
    extent: 2,
    attempt: 3,
};

/// A job.
pub fn job() -> wire::Job {
    wire::Job {
        discretization: Some(wire::job::Discretization::Tolerance(0.01)),
        cutter: Some(wire::job::Cutter::Torus(wire::Torus {
            major_radius: 40.0,
            minor_radius: 8.0,
        })),
        motion: Some(wire::Motion {
            kind: wire::MotionKind::Helix.into(),
            step: 2.0,
            points_per_revolution: 360,
            from: Some(-1.0),
            to: Some(1.0),
            path_tolerance: Some(0.005),
            lead_in: 0.0,
            lead_out: 0.0,
        }),
        contact: wire::Contact::Facet.into(),
        method: wire::Method::Exact.into(),
        local: None,
        packed21: true,
    }
}

/// The positions of a job.
pub fn trajectory() -> wire::Trajectory {
    wire::Trajectory {
        kind: wire::MotionKind::Rings.into(),
        from: 0.0,
        step: 1.0,
        points_per_revolution: 90,
        positions: 900,
    }
}

/// A task, and what its rows come from.
pub fn task(supply: wire::task::Supply) -> wire::Task {
    wire::Task {
        id: Some(ID),
        job: Some(job()),
        trajectory: Some(trajectory()),
        runs: vec![wire::Run {
            first: 90,
            count: 90,
            rows: vec![wire::Span { first: 3, count: 7 }],
        }],
        supply: Some(supply),
    }
}

/// A row of a mesh.
pub fn row(id: u32) -> wire::Row {
    wire::Row {
        id,
        coordinates: Some(wire::row::Coordinates::Points(numbers(9).into())),
        kind: Some(wire::row::Kind::Slab(wire::Slab {
            facets: triangle().into(),
        })),
    }
}

/// A row of a mesh, its points packed.
pub fn packed_row(id: u32) -> wire::Row {
    let words = [0_u64, 7, (1 << 42) - 1].into_iter();
    let words = words.flat_map(u64::to_le_bytes).collect();
    wire::Row {
        coordinates: Some(wire::row::Coordinates::Packed21(words)),
        ..row(id)
    }
}

fn surface() -> wire::Surface {
    let direction = wire::Direction {
        degree: 1,
        knots: vec![0.0, 0.0, 1.0, 1.0],
    };
    wire::Surface {
        u: Some(direction.clone()),
        v: Some(direction),
        poles: numbers(12).into(),
        weights: vec![1.0, 0.5, 1.0, 2.0],
    }
}

/// What rows are made from.
pub fn grid() -> wire::SurfaceGrid {
    wire::SurfaceGrid {
        name: "g".to_owned(),
        surface: Some(surface()),
        ids: vec![4, 5],
        us: vec![0.25, 1.0],
        vs: vec![0.0, 0.5, 1.0],
        last: 5,
        packed21: true,
    }
}

/// A surface and a mesh.
pub fn bodies() -> [wire::Body; 2] {
    let shapes = [
        wire::body::Shape::Surface(surface()),
        wire::body::Shape::Mesh(wire::Mesh {
            vertices: numbers(9).into(),
            triangles: triangle().into(),
        }),
    ];
    shapes.map(|shape| wire::Body {
        name: "b".to_owned(),
        shape: Some(shape),
    })
}
