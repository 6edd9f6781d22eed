//! A result as it is kept: the very replies that a client is going to get.

use bytes::Bytes;
use horma_proto::wire;
use horma_proto::wire::path_reply::Kind;
use prost::Message;

use crate::Outcome;
use crate::error::{Error, Result};
use crate::store::Pieces;

/// The path in chunks, and then the record.
pub(crate) fn to_pieces((path, record): &Outcome) -> Result<Pieces> {
    let header = wire::PathHeader {
        trajectory: Some(horma_proto::trajectory_to_wire(&path.trajectory)),
    };
    let positions = horma_proto::position_chunks(0, &path.touches, &path.between);
    let record = serde_json::to_vec(record).map_err(|e| Error::StoreDamaged(e.to_string()))?;
    let kinds = std::iter::once(Kind::Path(header))
        .chain(positions.map(Kind::Positions))
        .chain(std::iter::once(Kind::Record(record.into())));
    let piece = |kind| wire::PathReply { kind: Some(kind) }.encode_to_vec();
    Ok(kinds.map(|kind| Bytes::from(piece(kind))).collect())
}

/// One of them again.
pub(crate) fn from_piece(piece: Bytes) -> Result<wire::PathReply> {
    wire::PathReply::decode(piece).map_err(|e| Error::StoreDamaged(e.to_string()))
}
