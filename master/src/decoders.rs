//! What arbitrary bytes do to a master that is sent them, or finds them in its store: they are refused, or
//! make what survives being kept again. For the tests here and the fuzz targets: no other build has it.

use std::sync::LazyLock;

use bytes::Bytes;
use horma_core::{
    Body, Contact, Coordinates, Cutter, Discretization, Distribution, Extent, Handout, Job, Mesh,
    Method, Motion, MotionKind, Part, Shape, Sharing,
};
use horma_proto::wire::submit_request::Kind as Request;
use horma_proto::wire::{Chunk, SubmitRequest};
use prost::Message;

use crate::submission::{self, Arriving};
use crate::{journal, store};

#[cfg(test)]
#[path = "../../proto/tests/common/samples.rs"]
mod samples;

/// A decoder to try; it returns whether the bytes were good.
pub type Decoder = fn(&[u8]) -> bool;

/// All of them, by name.
pub const DECODERS: [(&str, Decoder); 3] = [
    ("submission", submission),
    ("journal", journal),
    ("entry", entry),
];

/// Memory that a job of a test may take, bytes.
const MEMORY: u64 = 1 << 22;

/// A job with its part: requests, length-delimited.
pub fn submission(mut bytes: &[u8]) -> bool {
    let mut arriving = Arriving::default();
    while let Ok(request) = SubmitRequest::decode_length_delimited(&mut bytes) {
        let taken = match request.kind {
            Some(Request::Header(chunk)) => arriving.header(&mended(chunk)).map(drop),
            Some(Request::Bodies(chunk)) => arriving.bodies(&mended(chunk)),
            None => return false,
        };
        if taken.is_err() {
            return false;
        }
    }
    let Ok(sent) = arriving.end() else {
        return false;
    };
    let again = submission::again(sent.pieces).expect("it was good before");
    assert_eq!((again.key, &again.name), (sent.key, &sent.name));
    assert_eq!((again.job, again.sharing), (sent.job, sent.sharing));
    assert_eq!(again.part, sent.part);
    // Whether it is taken in.
    let way = sent.sharing.distribution;
    let _ = Handout::predict(&sent.part, &sent.job, way, MEMORY, true);
    true
}

/// An extent in the journal: pieces, length-delimited.
pub fn journal(mut bytes: &[u8]) -> bool {
    let next = || Bytes::decode_length_delimited(&mut bytes).ok();
    let pieces: Vec<Bytes> = std::iter::from_fn(next).collect();
    let (plan, extent) = &*PLANNED;
    let Ok((positions, record)) = journal::from_pieces(&pieces, plan, extent) else {
        return false;
    };
    let pieces = journal::to_pieces(&positions, &record).expect("numbers and text");
    let again = journal::from_pieces(&pieces, plan, extent).expect("it was good before");
    assert_eq!(again.0, positions);
    true
}

/// A job in the store, with and without its seal.
pub fn entry(bytes: &[u8]) -> bool {
    // Nearly always refused.
    let _ = store::unseal(bytes);
    let sealed = store::unseal(&store::seal(bytes)).expect("sealed just now");
    assert_eq!(sealed, bytes);
    let Ok(entry) = store::from_json(bytes) else {
        return false;
    };
    let again = store::to_json(&entry).expect("numbers and text");
    assert_eq!(store::from_json(&again).expect("it was good before"), entry);
    true
}

/// With the checksum that it ought to have: nothing random ever has it.
fn mended(chunk: Chunk) -> Chunk {
    horma_proto::chunk(chunk.data)
}

/// A small job over a square, and its only extent.
static PLANNED: LazyLock<(Handout, Extent)> = LazyLock::new(|| {
    let corners = [
        [0.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [4.0, 0.0, 4.0],
        [0.0, 0.0, 4.0],
    ];
    let mesh = Mesh::new("square", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let shape = Shape::Mesh(mesh.expect("two triangles"));
    let name = "square".to_owned();
    let part = Part {
        bodies: vec![Body { name, shape }],
    };
    let job = Job {
        discretization: Discretization::Tolerance(0.1),
        cutter: Cutter::Torus {
            major_radius: 4.0,
            minor_radius: 1.0,
        },
        motion: Motion {
            from: Some(0.0),
            to: Some(4.0),
            path_tolerance: Some(0.1),
            ..Motion::new(MotionKind::Helix, 1.0, 4)
        },
        coordinates: Coordinates::Double,
        contact: Contact::Facet,
        method: Method::Exact,
    };
    let sharing = Sharing {
        distribution: Distribution::Overlap,
        extents_per_worker: 1,
    };
    let plan = Handout::new(&part, job, sharing, MEMORY, false).expect("a small job");
    let extent = plan.split(1).into_iter().next().expect("one extent");
    (plan, extent)
});

#[cfg(test)]
mod tests {
    use horma_core::{ExtentRecord, SubTrajectory};
    use horma_proto::wire;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::store::{Entry, Gone, Stage};

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic_a_master(bytes in vec(any::<u8>(), 0..600)) {
            for (_, decode) in DECODERS {
                decode(&bytes);
            }
        }

        #[test]
        fn spoilt_bytes_never_panic_a_master(
            bytes in samples::spoilt(good()),
        ) {
            for (_, decode) in DECODERS {
                decode(&bytes);
            }
        }
    }

    #[test]
    fn what_is_spoilt_there_is_good_before() {
        for bytes in good() {
            assert!(DECODERS.iter().any(|(_, decode)| decode(&bytes)));
        }
    }

    /// A submission, an extent of the planned job, and entries.
    fn good() -> Vec<Vec<u8>> {
        let header = wire::SubmitHeader {
            version: horma_proto::VERSION.to_owned(),
            job: Some(samples::job()),
            sharing: Some(wire::Sharing {
                distribution: wire::Distribution::Overlap.into(),
                extents_per_worker: 1,
            }),
            key: vec![7; 16].into(),
            name: "job.toml".to_owned(),
        };
        let bodies = samples::bodies().map(|body| body.encode_length_delimited_to_vec());
        let kinds = [
            Request::Header(horma_proto::seal(&header)),
            Request::Bodies(horma_proto::chunk(bodies.concat().into())),
        ];
        let requests = kinds.map(|kind| SubmitRequest { kind: Some(kind) });
        let submission = requests.map(|request| request.encode_length_delimited_to_vec());

        let (_, extent) = &*PLANNED;
        let positions = SubTrajectory {
            first: extent.first,
            touches: vec![None; extent.count as usize],
            between: Vec::new(),
        };
        let pieces = journal::to_pieces(&[positions], &ExtentRecord::default()).expect("text");
        let pieces = pieces.iter().map(Message::encode_length_delimited_to_vec);

        let at = std::time::Duration::from_secs(7);
        let stages = [
            Stage::Running {
                workers: 2,
                digest: 3,
            },
            Stage::Gone {
                at,
                why: Gone::Fetched,
            },
        ];
        let entries = stages.map(|stage| {
            let entry = Entry {
                key: u128::MAX,
                name: "job.toml".to_owned(),
                submitted: at,
                memory: u64::MAX,
                trace: Some("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01".to_owned()),
                stage,
            };
            store::to_json(&entry).expect("text")
        });
        [submission.concat(), pieces.flatten().collect()]
            .into_iter()
            .chain(entries)
            .collect()
    }
}
