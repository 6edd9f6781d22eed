//! What arbitrary bytes do to a worker that is sent them as the requests of a call: nothing, or a task
//! that holds together. For the tests here and the fuzz targets: no other build has it.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use horma_proto::wire::digitize_request::Kind as Request;
use horma_proto::wire::place_request::Kind as Placing;
use horma_proto::wire::{Chunk, DigitizeRequest, PlaceRequest};
use prost::Message;

use crate::halo::some_of;
use crate::receive::{self, Supply};

#[cfg(test)]
#[path = "../../proto/tests/common/samples.rs"]
mod samples;

/// A decoder to try; it returns whether the bytes were good.
pub type Decoder = fn(&[u8]) -> bool;

/// All of them, by name.
pub const DECODERS: [(&str, Decoder); 2] = [("digitize", digitize), ("place", place)];

/// A task with the rows or grids that come with it.
pub fn digitize(bytes: &[u8]) -> bool {
    let requests = messages(bytes).map(|mut request: DigitizeRequest| {
        if let Some(Request::Task(chunk) | Request::Rows(chunk)) = &mut request.kind {
            mend(chunk);
        }
        Ok(request)
    });
    let Ok(task) = at_once(receive::task(tokio_stream::iter(requests))) else {
        return false;
    };
    let positions: u64 = task.runs.iter().map(|run| run.count).sum();
    assert!(positions <= task.trajectory.positions);
    let rows = match task.supply {
        Supply::Rows(rows) => rows,
        Supply::Grids(grids) => {
            let mut rows = Vec::new();
            for grid in grids {
                grid.rows(&mut |row| rows.push(row));
            }
            rows
        }
        Supply::Held { halo, .. } => {
            assert!(
                halo.iter()
                    .all(|source| some_of(&[], &source.rows).count() == 0)
            );
            Vec::new()
        }
    };
    for run in &task.runs {
        let found = some_of(&rows, &run.rows).count();
        assert!(found <= rows.len());
    }
    true
}

/// Rows that are to be held.
pub fn place(bytes: &[u8]) -> bool {
    let requests = messages(bytes).map(|mut request: PlaceRequest| {
        if let Some(Placing::Rows(chunk)) = &mut request.kind {
            mend(chunk);
        }
        Ok(request)
    });
    let placed = at_once(receive::placement(tokio_stream::iter(requests)));
    let Ok((_, _, rows)) = placed else {
        return false;
    };
    assert!(rows.is_sorted_by(|a, b| a.id < b.id));
    true
}

/// Messages, length-delimited, as far as they are any.
fn messages<M: Message + Default>(mut bytes: &[u8]) -> impl Iterator<Item = M> {
    std::iter::from_fn(move || M::decode_length_delimited(&mut bytes).ok())
}

/// Gives a chunk the checksum that it ought to have: nothing random ever has it.
fn mend(chunk: &mut Chunk) {
    *chunk = horma_proto::chunk(std::mem::take(&mut chunk.data));
}

/// What comes of work that waits for nothing; a long stream only yields now and then.
fn at_once<T>(work: impl Future<Output = T>) -> T {
    let mut work = pin!(work);
    loop {
        if let Poll::Ready(done) = work.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return done;
        }
    }
}

#[cfg(test)]
mod tests {
    use horma_proto::wire;
    use horma_proto::wire::task::Supply as Announced;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic_a_worker(bytes in vec(any::<u8>(), 0..600)) {
            for (_, decode) in DECODERS {
                decode(&bytes);
            }
        }

        /// Requests that are nearly right get further than noise.
        #[test]
        fn spoilt_requests_never_panic_a_worker(
            bytes in samples::spoilt(good()),
        ) {
            for (_, decode) in DECODERS {
                decode(&bytes);
            }
        }
    }

    #[test]
    fn many_requests_are_as_good_as_few() {
        // Each the least there is: a length of nothing.
        assert!(!place(&[0; 1000]));
        let rows = good().pop().expect("rows to be held");
        let nothing = PlaceRequest {
            kind: Some(Placing::Rows(horma_proto::chunk(Vec::new().into()))),
        };
        let more = nothing.encode_length_delimited_to_vec().repeat(1000);
        assert!(place(&[rows, more].concat()));
    }

    #[test]
    fn what_is_spoilt_there_is_good_before() {
        for bytes in good() {
            assert!(DECODERS.iter().any(|(_, decode)| decode(&bytes)));
        }
    }

    /// Calls with rows, with grids, with neither, and with rows to be held.
    fn good() -> Vec<Vec<u8>> {
        let rows = [3, 4].map(|id| samples::row(id).encode_length_delimited_to_vec());
        let rows = horma_proto::chunk(rows.concat().into());
        let grid = samples::grid().encode_length_delimited_to_vec();
        let grid = horma_proto::chunk(grid.into());
        let source = wire::Source {
            id: Some(samples::ID),
            worker: "w".to_owned(),
            address: "127.0.0.1:1".to_owned(),
            rows: vec![wire::Span { first: 3, count: 2 }],
        };
        let held = wire::Holdings {
            own: Some(samples::ID),
            halo: vec![source],
        };
        let tasks = [
            (Announced::Rows(2), Some(rows.clone())),
            (Announced::Grids(1), Some(grid)),
            (Announced::Holdings(held), None),
        ];
        let digitize = |(supply, chunk): (Announced, Option<Chunk>)| {
            let task = Request::Task(horma_proto::seal(&samples::task(supply)));
            let kinds = std::iter::once(task).chain(chunk.map(Request::Rows));
            let requests = kinds.map(|kind| DigitizeRequest { kind: Some(kind) });
            let bytes = requests.map(|request| request.encode_length_delimited_to_vec());
            bytes.flatten().collect()
        };
        let placement = wire::Placement {
            id: Some(samples::ID),
            rows: 2,
            master: 7,
        };
        let place = [Placing::Placement(placement), Placing::Rows(rows)]
            .map(|kind| PlaceRequest { kind: Some(kind) }.encode_length_delimited_to_vec());
        tasks
            .map(digitize)
            .into_iter()
            .chain([place.concat()])
            .collect()
    }
}
