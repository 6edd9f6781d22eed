//! Chunks: how rows, bodies and positions travel without any message growing with the job.

use bytes::{Buf, Bytes, BytesMut};
use horma_core::Touch;
use prost::Message;

use crate::error::{Error, Result};
use crate::wire;

/// Aimed-at size of a chunk: well below the 4 MiB that gRPC accepts by default, and large enough
/// that its cost does not show.
pub const CHUNK_BYTES: usize = 1 << 20;

/// Greatest size of one row or body, bytes.
const MAX_PIECE: usize = 1 << 30;

/// Bytes of one packed position.
pub const POSITION_BYTES: usize = 32;

/// Packs messages, length-delimited, into chunks.
pub struct Chunks<I> {
    messages: I,
    waiting: BytesMut,
}

impl<M: Message, I: Iterator<Item = M>> Chunks<I> {
    /// Chunks of these messages, made as they are taken.
    pub fn of(messages: I) -> Self {
        Self {
            messages,
            waiting: BytesMut::new(),
        }
    }
}

impl<M: Message, I: Iterator<Item = M>> Iterator for Chunks<I> {
    type Item = wire::Chunk;

    fn next(&mut self) -> Option<wire::Chunk> {
        while self.waiting.len() < CHUNK_BYTES {
            let Some(message) = self.messages.next() else {
                break;
            };
            let bytes = message.encode_length_delimited_to_vec();
            self.waiting.extend_from_slice(&bytes);
        }
        let size = self.waiting.len().min(CHUNK_BYTES);
        let data = self.waiting.split_to(size).freeze();
        (size > 0).then(|| wire::Chunk {
            crc32c: crc32c::crc32c(&data),
            data,
        })
    }
}

/// Unpacks the messages of chunks as they arrive.
#[derive(Default)]
pub struct Messages {
    waiting: BytesMut,
}

impl Messages {
    /// Takes the next chunk.
    ///
    /// # Errors
    /// [`Error::Checksum`] or [`Error::TooLarge`].
    pub fn push(&mut self, chunk: &wire::Chunk) -> Result<()> {
        let found = crc32c::crc32c(&chunk.data);
        if found != chunk.crc32c {
            let expected = chunk.crc32c;
            return Err(Error::Checksum { found, expected });
        }
        self.waiting.extend_from_slice(&chunk.data);
        Ok(())
    }

    /// The next message that is complete.
    ///
    /// # Errors
    /// [`Error::Malformed`] or [`Error::TooLarge`].
    pub fn pop<M: Message + Default>(&mut self) -> Result<Option<M>> {
        let mut rest = &self.waiting[..];
        let Ok(size) = prost::decode_length_delimiter(&mut rest) else {
            // A length takes at most ten bytes; with fewer it may still be on its way.
            return if self.waiting.len() < 10 {
                Ok(None)
            } else {
                Err(Error::Malformed("a length that is no number".to_owned()))
            };
        };
        if size > MAX_PIECE {
            return Err(Error::TooLarge {
                bytes: size,
                limit: MAX_PIECE,
            });
        }
        if rest.len() < size {
            return Ok(None);
        }
        let prefix = self.waiting.len() - rest.len();
        self.waiting.advance(prefix);
        let bytes = self.waiting.split_to(size).freeze();
        M::decode(bytes)
            .map(Some)
            .map_err(|e| Error::Malformed(e.to_string()))
    }

    /// Whether nothing is left over.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }
}

/// Packs consecutive positions from `first` on.
pub fn pack_positions(first: u64, touches: &[Option<Touch>]) -> wire::Positions {
    let mut bytes = Vec::with_capacity(touches.len() * POSITION_BYTES);
    for touch in touches {
        let [x, y, z] = touch.map_or([f64::NAN; 3], |t| t.contact);
        for number in [touch.map_or(f64::NAN, |t| t.height), x, y, z] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
    }
    wire::Positions {
        first,
        crc32c: crc32c::crc32c(&bytes),
        touches: Bytes::from(bytes),
    }
}

/// Unpacks positions.
///
/// # Errors
/// [`Error::Checksum`], [`Error::Ragged`], or [`Error::Malformed`] if a number is infinite or only
/// some of a position's numbers are there.
pub fn unpack_positions(positions: &wire::Positions) -> Result<Vec<Option<Touch>>> {
    let found = crc32c::crc32c(&positions.touches);
    if found != positions.crc32c {
        let expected = positions.crc32c;
        return Err(Error::Checksum { found, expected });
    }
    let (all, rest) = positions.touches.as_chunks::<POSITION_BYTES>();
    if !rest.is_empty() {
        return Err(Error::Ragged {
            what: "positions",
            bytes: positions.touches.len(),
            size: POSITION_BYTES,
        });
    }
    let touch = |bytes: &[u8; POSITION_BYTES]| {
        let (numbers, _) = bytes.as_chunks::<8>();
        let number = |i: usize| f64::from_le_bytes(numbers[i]);
        let (height, contact) = (number(0), [number(1), number(2), number(3)]);
        if height.is_nan() && contact.iter().all(|c| c.is_nan()) {
            Ok(None)
        } else if height.is_finite() && contact.iter().all(|c| c.is_finite()) {
            Ok(Some(Touch { height, contact }))
        } else {
            Err(Error::Malformed("a position that is half there".to_owned()))
        }
    };
    all.iter().map(touch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_any_size_survive_their_chunks() {
        let sizes = [
            0,
            1,
            127,
            128,
            CHUNK_BYTES - 3,
            CHUNK_BYTES,
            3 * CHUNK_BYTES + 7,
        ];
        let rows: Vec<wire::Row> = (0..)
            .zip(sizes)
            .map(|(id, size)| wire::Row {
                id,
                points: vec![id as u8; size].into(),
                kind: None,
            })
            .collect();
        let chunks: Vec<_> = Chunks::of(rows.iter().cloned()).collect();
        assert!(chunks.iter().all(|c| c.data.len() <= CHUNK_BYTES));
        let mut messages = Messages::default();
        let mut back = Vec::new();
        for chunk in &chunks {
            messages.push(chunk).expect("intact");
            while let Some(row) = messages.pop::<wire::Row>().expect("well formed") {
                back.push(row);
            }
        }
        assert!(messages.is_empty());
        assert_eq!(back, rows);
    }

    #[test]
    fn a_flipped_bit_is_found() {
        let touch = Touch {
            height: 1.5,
            contact: [1.0, -2.0, 3.0],
        };
        let good = pack_positions(7, &[Some(touch), None]);
        assert_eq!(unpack_positions(&good), Ok(vec![Some(touch), None]));
        let mut bytes = good.touches.to_vec();
        bytes[3] ^= 1;
        let bad = wire::Positions {
            touches: bytes.into(),
            ..good
        };
        assert!(matches!(
            unpack_positions(&bad),
            Err(Error::Checksum { .. })
        ));
    }
}
