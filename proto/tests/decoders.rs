//! Whatever bytes arrive, a decoder refuses them or makes a valid value of them.

mod common;

use common::{DECODERS, samples};
use horma_core::{Index, Inserted};
use horma_proto::wire;
use horma_proto::wire::digitize_reply::Kind as Reply;
use horma_proto::wire::path_reply::Kind as Path;
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
        bytes in samples::spoilt(good()),
    ) {
        for (_, decode) in DECODERS {
            decode(&bytes);
        }
    }
}

/// One good message of each kind.
fn good() -> Vec<Vec<u8>> {
    let between = [(5, 256), (6, 1023)].map(|(whole, parts)| Inserted {
        index: Index::between(whole, parts).expect("between"),
        touch: None,
    });
    let positions = horma_proto::pack_positions(5, &[None, None], &between);
    let reply = |kind| wire::DigitizeReply {
        id: Some(samples::ID),
        kind: Some(kind),
        counters: Some(wire::Counters {
            evaluations: 7,
            largest_loss: 0.5,
            ..wire::Counters::default()
        }),
    };
    let path = [
        Path::Path(horma_proto::seal(&wire::PathHeader {
            trajectory: Some(wire::Trajectory {
                positions: 2,
                ..samples::trajectory()
            }),
        })),
        Path::Positions(horma_proto::pack_positions(0, &[None, None], &[])),
        Path::Record(b"{}"[..].into()),
    ];
    let path = path.map(|kind| wire::PathReply { kind: Some(kind) });
    let mut all = vec![
        samples::job().encode_to_vec(),
        samples::task(wire::task::Supply::Rows(7)).encode_to_vec(),
        samples::row(7).encode_to_vec(),
        samples::packed_row(7).encode_to_vec(),
        samples::grid().encode_to_vec(),
        positions.encode_to_vec(),
        reply(Reply::Positions(positions)).encode_to_vec(),
        reply(Reply::Finished(wire::Finished::default())).encode_to_vec(),
        path.map(|reply| reply.encode_length_delimited_to_vec())
            .concat(),
        // Rows in chunks: sizes first.
        [
            vec![3, 40, 0, 7, 9, 200, 1, 1],
            samples::row(7).encode_length_delimited_to_vec(),
        ]
        .concat(),
    ];
    all.extend(samples::bodies().map(|body| body.encode_to_vec()));
    all
}
