//! What arbitrary bytes do to each decoder: nothing, or a value that survives being sent again. Shared
//! by the tests and the fuzz targets.

#![allow(dead_code)] // Each fuzz target uses its part of this.

#[cfg(test)]
pub mod samples;

use horma_core::stitch;
use horma_proto::wire::digitize_reply::Kind as Reply;
use horma_proto::wire::path_reply::Kind as Path;
use horma_proto::{Messages, TaskId, transport, wire};
use prost::Message;

/// A decoder to try.
pub type Decoder = fn(&[u8]);

/// All of them, by name.
pub const DECODERS: [(&str, Decoder); 10] = [
    ("job", job),
    ("row", row),
    ("body", body),
    ("grid", grid),
    ("positions", positions),
    ("chunks", chunks),
    ("task", task),
    ("reply", reply),
    ("path", path),
    ("address", address),
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

/// What a worker answers the master.
pub fn reply(bytes: &[u8]) {
    let Ok(reply) = wire::DigitizeReply::decode(bytes) else {
        return;
    };
    let counters = horma_proto::counters_from_wire(reply.counters.unwrap_or_default());
    if let Ok(counters) = counters {
        let again = horma_proto::counters_to_wire(counters);
        assert_eq!(horma_proto::counters_from_wire(again), Ok(counters));
    }
    match reply.kind {
        Some(Reply::Positions(all)) => positions(&all.encode_to_vec()),
        Some(Reply::HaloLost(lost)) => drop(TaskId::try_from(lost.source)),
        Some(Reply::Finished(_)) | None => {}
    }
}

/// A path as it comes to a client: replies, length-delimited, with checksums that hold.
pub fn path(mut bytes: &[u8]) {
    let (mut trajectory, mut parts) = (None, Vec::new());
    while let Ok(reply) = wire::PathReply::decode_length_delimited(&mut bytes) {
        match reply.kind {
            Some(Path::Path(header)) => {
                let header = horma_proto::open(&horma_proto::chunk(header.data));
                let Ok(header) = header as Result<wire::PathHeader, _> else {
                    return;
                };
                trajectory = horma_proto::trajectory_from_wire(header.trajectory.as_ref()).ok();
            }
            Some(Path::Positions(mut positions)) => {
                positions.crc32c = horma_proto::checksum(&positions);
                let count = trajectory.map_or(0, |t| t.positions);
                let Ok(run) = horma_proto::unpack_positions(&positions, count) else {
                    return;
                };
                parts.push(run);
            }
            Some(Path::Record(_) | Path::Progress(_)) | None => {}
        }
    }
    let Some(trajectory) = trajectory else {
        return;
    };
    if let Ok(path) = stitch(trajectory, parts) {
        assert_eq!(path.touches.len() as u64, trajectory.positions);
        assert_eq!(
            path.positions().len(),
            path.touches.len() + path.between.len()
        );
    }
}

/// The address that a worker gives as its own.
pub fn address(bytes: &[u8]) {
    if let Ok(address) = std::str::from_utf8(bytes) {
        // It is refused, or dialled some day.
        let _ = transport::endpoint(address);
    }
}
