//! What arbitrary bytes do to each decoder: nothing, or a value that survives being sent again. Shared
//! by the tests and the fuzz targets.

#![allow(dead_code)] // Each fuzz target uses its part of this.

use horma_proto::{Messages, TaskId, wire};
use prost::Message;

/// A decoder to try.
pub type Decoder = fn(&[u8]);

/// All of them, by name.
pub const DECODERS: [(&str, Decoder); 7] = [
    ("job", job),
    ("row", row),
    ("body", body),
    ("grid", grid),
    ("positions", positions),
    ("chunks", chunks),
    ("task", task),
];

/// A job as it comes from a client or from the master.
pub fn job(bytes: &[u8]) {
    let Ok(Ok(job)) = wire::Job::decode(bytes).map(|j| horma_proto::job_from_wire(&j)) else {
        return;
    };
    let again = horma_proto::job_from_wire(&horma_proto::job_to_wire(&job));
    assert_eq!(again, Ok(job));
}

/// A row as it comes to a worker.
pub fn row(bytes: &[u8]) {
    let Ok(Ok(row)) = wire::Row::decode(bytes).map(|r| horma_proto::row_from_wire(&r)) else {
        return;
    };
    let again = horma_proto::row_from_wire(&horma_proto::row_to_wire(&row));
    assert_eq!(again, Ok(row));
}

/// A surface or a mesh as it comes from a client.
pub fn body(bytes: &[u8]) {
    let Ok(Ok(body)) = wire::Body::decode(bytes).map(horma_proto::body_from_wire) else {
        return;
    };
    let again = horma_proto::body_from_wire(horma_proto::body_to_wire(&body));
    assert_eq!(again, Ok(body));
}

/// What a worker makes rows from.
pub fn grid(bytes: &[u8]) {
    let Ok(Ok(grid)) = wire::SurfaceGrid::decode(bytes).map(horma_proto::grid_from_wire) else {
        return;
    };
    let again = horma_proto::grid_from_wire(horma_proto::grid_to_wire(&grid));
    assert_eq!(again, Ok(grid));
}

/// Positions as they come from a worker: as they are, and with a checksum that holds.
pub fn positions(bytes: &[u8]) {
    let Ok(mut positions) = wire::Positions::decode(bytes) else {
        return;
    };
    // Nearly always refused.
    let _ = horma_proto::unpack_positions(&positions, u64::MAX);
    positions.crc32c = horma_proto::checksum(&positions);
    let Ok(run) = horma_proto::unpack_positions(&positions, u64::MAX) else {
        return;
    };
    let again = horma_proto::pack_positions(run.first, &run.touches, &run.between);
    assert_eq!(horma_proto::unpack_positions(&again, u64::MAX), Ok(run));
}

/// Messages out of a stream of chunks, which end wherever the first bytes say.
pub fn chunks(bytes: &[u8]) {
    let (sizes, mut rest) = bytes.split_at(bytes.len().min(8));
    let mut messages = Messages::default();
    for &size in sizes.iter().chain([&u8::MAX; 8]) {
        let (data, more) = rest.split_at(rest.len().min(usize::from(size)));
        rest = more;
        let chunk = wire::Chunk {
            crc32c: crc32c::crc32c(data),
            data: data.to_vec().into(),
        };
        messages.push(&chunk).expect("the checksum holds");
        loop {
            match messages.pop::<wire::Row>() {
                Ok(Some(row)) => drop(horma_proto::row_from_wire(&row)),
                Ok(None) => break,
                Err(_) => return,
            }
        }
    }
}

/// The header of a task as it comes to a worker.
pub fn task(bytes: &[u8]) {
    let Ok(task) = wire::Task::decode(bytes) else {
        return;
    };
    if let Ok(id) = TaskId::try_from(task.id) {
        let again = TaskId::try_from(Some(wire::TaskId::from(id)));
        assert_eq!(again, Ok(id));
    }
    if let Ok(trajectory) = horma_proto::trajectory_from_wire(task.trajectory.as_ref()) {
        let again = horma_proto::trajectory_to_wire(&trajectory);
        assert_eq!(
            horma_proto::trajectory_from_wire(Some(&again)),
            Ok(trajectory)
        );
    }
    if let Some(job) = &task.job {
        self::job(&job.encode_to_vec());
    }
}
