//! Whatever bytes arrive, a decoder refuses them or makes a valid value of them.

mod common;

use common::DECODERS;
use horma_core::{Index, Inserted};
use horma_proto::wire;
use proptest::collection::vec;
use proptest::prelude::*;
use prost::Message;

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic_a_decoder(bytes in vec(any::<u8>(), 0..600)) {
        for (_, decode) in DECODERS {
            decode(&bytes);
        }
    }

    /// Messages that are nearly right get further than noise.
    #[test]
    fn spoilt_messages_never_panic_a_decoder(
        bytes in proptest::sample::select(good()),
        at in any::<proptest::sample::Index>(),
        with in vec(any::<u8>(), 0..9),
    ) {
        let mut bytes = bytes;
        let at = at.index(bytes.len());
        let end = bytes.len().min(at + with.len());
        bytes.splice(at..end, with);
        for (_, decode) in DECODERS {
            decode(&bytes);
        }
    }
}

/// One good message of each kind.
fn good() -> Vec<Vec<u8>> {
    let numbers = |n: u32| -> Vec<u8> {
        let numbers = (0..n).map(|i| f64::from(i * i % 17));
        numbers.flat_map(f64::to_le_bytes).collect()
    };
    let triangle: Vec<u8> = [0u32, 1, 2].iter().flat_map(|i| i.to_le_bytes()).collect();
    let job = wire::Job {
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
        }),
        contact: wire::Contact::Facet.into(),
        method: wire::Method::Exact.into(),
        local: None,
    };
    let trajectory = wire::Trajectory {
        kind: wire::MotionKind::Rings.into(),
        from: 0.0,
        step: 1.0,
        points_per_revolution: 90,
        positions: 900,
    };
    let task = wire::Task {
        id: Some(wire::TaskId {
            job: 1,
            extent: 2,
            attempt: 3,
        }),
        job: Some(job),
        trajectory: Some(trajectory),
        runs: vec![wire::Run {
            first: 90,
            count: 90,
            rows: vec![wire::Span { first: 3, count: 7 }],
        }],
        supply: Some(wire::task::Supply::Rows(7)),
    };
    let row = wire::Row {
        id: 7,
        points: numbers(9).into(),
        kind: Some(wire::row::Kind::Slab(wire::Slab {
            facets: triangle.clone().into(),
        })),
    };
    let direction = wire::Direction {
        degree: 1,
        knots: vec![0.0, 0.0, 1.0, 1.0],
    };
    let surface = wire::Surface {
        u: Some(direction.clone()),
        v: Some(direction),
        poles: numbers(12).into(),
        weights: vec![1.0, 0.5, 1.0, 2.0],
    };
    let grid = wire::SurfaceGrid {
        name: "g".to_owned(),
        surface: Some(surface.clone()),
        ids: vec![4, 5],
        us: vec![0.25, 1.0],
        vs: vec![0.0, 0.5, 1.0],
        last: 5,
    };
    let shapes = [
        wire::body::Shape::Surface(surface),
        wire::body::Shape::Mesh(wire::Mesh {
            vertices: numbers(9).into(),
            triangles: triangle.into(),
        }),
    ];
    let between = [(5, 256), (6, 1023)].map(|(whole, parts)| Inserted {
        index: Index::between(whole, parts).expect("between"),
        touch: None,
    });
    let mut all = vec![
        job.encode_to_vec(),
        task.encode_to_vec(),
        row.encode_to_vec(),
        grid.encode_to_vec(),
        horma_proto::pack_positions(5, &[None, None], &between).encode_to_vec(),
        // Rows in chunks: sizes first.
        [
            vec![3, 40, 0, 7, 9, 200, 1, 1],
            row.encode_length_delimited_to_vec(),
        ]
        .concat(),
    ];
    all.extend(shapes.map(|shape| {
        let body = wire::Body {
            name: "b".to_owned(),
            shape: Some(shape),
        };
        body.encode_to_vec()
    }));
    all
}
