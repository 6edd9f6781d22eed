//! Chunks: how rows, bodies and positions travel without any message growing with the job, and whatever
//! decides a height with a checksum: TCP's own lets one damaged packet in thousands pass.

use bytes::{Buf, Bytes, BytesMut};
use horma_core::{Index, Inserted, SubTrajectory, Touch};
use prost::Message;

use crate::error::{Error, Result};
use crate::wire;

/// Aimed-at size of a chunk: well below the 4 MiB that gRPC accepts by default, and large enough
/// that its cost does not show.
pub const CHUNK_BYTES: usize = 1 << 20;

/// Greatest size of one row or body, bytes.
const MAX_PIECE: usize = 1 << 30;

/// Bytes of one packed position.
const POSITION_BYTES: usize = 32;

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
        (size > 0).then(|| chunk(self.waiting.split_to(size).freeze()))
    }
}

/// A small message as a chunk of its own.
pub fn seal(message: &impl Message) -> wire::Chunk {
    chunk(message.encode_to_vec().into())
}

/// The message of such a chunk.
///
/// # Errors
/// [`Error::Checksum`] or [`Error::Malformed`].
pub fn open<M: Message + Default>(chunk: &wire::Chunk) -> Result<M> {
    let data = undamaged(chunk)?;
    M::decode(data.clone()).map_err(|e| Error::Malformed(e.to_string()))
}

/// Bytes and their checksum.
pub fn chunk(data: Bytes) -> wire::Chunk {
    wire::Chunk {
        crc32c: crc32c::crc32c(&data),
        data,
    }
}

fn undamaged(chunk: &wire::Chunk) -> Result<&Bytes> {
    let (found, expected) = (crc32c::crc32c(&chunk.data), chunk.crc32c);
    if found == expected {
        return Ok(&chunk.data);
    }
    Err(Error::Checksum { found, expected })
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
        self.waiting.extend_from_slice(undamaged(chunk)?);
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

/// Bytes of one packed inserted position: its index before it.
const INSERTED_BYTES: usize = 8 + POSITION_BYTES;

/// Packs consecutive positions from `first` on, and all that was inserted on the moves that begin
/// there, into as many messages as it takes: of each the content is [`CHUNK_BYTES`] at most.
pub fn position_chunks<'a>(
    mut first: u64,
    mut touches: &'a [Option<Touch>],
    mut between: &'a [Inserted],
) -> impl Iterator<Item = wire::Positions> + 'a {
    std::iter::from_fn(move || {
        let (mut count, mut inserted, mut bytes) = (0, 0, 0);
        while count < touches.len() {
            // A position and its move stay together: that is far less than a chunk.
            let next = first + count as u64;
            let own = between[inserted..].partition_point(|i| i.index.floor() <= next);
            bytes += POSITION_BYTES + own * INSERTED_BYTES;
            if bytes > CHUNK_BYTES && count > 0 {
                break;
            }
            (count, inserted) = (count + 1, inserted + own);
        }
        let (some, own);
        (some, touches) = touches.split_at(count);
        (own, between) = between.split_at(inserted);
        let packed = (count > 0).then(|| pack_positions(first, some, own));
        first += count as u64;
        packed
    })
}

/// Packs consecutive positions from `first` on, and what was inserted, into one message.
pub fn pack_positions(
    first: u64,
    touches: &[Option<Touch>],
    between: &[Inserted],
) -> wire::Positions {
    let pack = |bytes: &mut Vec<u8>, touch: &Option<Touch>| {
        let [x, y, z] = touch.map_or([f64::NAN; 3], |t| t.contact);
        for number in [touch.map_or(f64::NAN, |t| t.height), x, y, z] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
    };
    let mut bytes = Vec::with_capacity(touches.len() * POSITION_BYTES);
    for touch in touches {
        pack(&mut bytes, touch);
    }
    let mut inserted = Vec::with_capacity(between.len() * INSERTED_BYTES);
    for Inserted { index, touch } in between {
        let index = index.floor() * u64::from(Index::PARTS) + u64::from(index.parts());
        inserted.extend_from_slice(&index.to_le_bytes());
        pack(&mut inserted, touch);
    }
    let mut packed = wire::Positions {
        first,
        touches: Bytes::from(bytes),
        between: Bytes::from(inserted),
        crc32c: 0,
    };
    packed.crc32c = checksum(&packed);
    packed
}

/// The CRC-32C that belongs to packed positions: of their place and all of their numbers.
pub fn checksum(packed: &wire::Positions) -> u32 {
    let first = crc32c::crc32c(&packed.first.to_le_bytes());
    let touches = crc32c::crc32c_append(first, &packed.touches);
    crc32c::crc32c_append(touches, &packed.between)
}

/// Unpacks positions of a trajectory that has so many.
///
/// # Errors
/// [`Error::Checksum`], [`Error::Ragged`], [`Error::Malformed`] if a number is infinite or only
/// some of a position's numbers are there, [`Error::Core`] for an inserted position that does not
/// belong there.
pub fn unpack_positions(packed: &wire::Positions, positions: u64) -> Result<SubTrajectory> {
    let (found, expected) = (checksum(packed), packed.crc32c);
    if found != expected {
        return Err(Error::Checksum { found, expected });
    }
    let touches = pieces::<POSITION_BYTES>(&packed.touches, "positions")?;
    let between = pieces::<INSERTED_BYTES>(&packed.between, "inserted positions")?;
    let inserted = |bytes: &[u8; INSERTED_BYTES]| {
        let (numbers, _) = bytes.as_chunks::<8>();
        let index = u64::from_le_bytes(numbers[0]);
        let parts = u64::from(Index::PARTS);
        let index = Index::between(index / parts, (index % parts) as u16);
        let whole = || Error::Malformed("an inserted position with a whole index".to_owned());
        Ok(Inserted {
            index: index.ok_or_else(whole)?,
            touch: touch(&numbers[1..])?,
        })
    };
    let run = SubTrajectory {
        first: packed.first,
        touches: touches
            .iter()
            .map(|bytes| touch(bytes.as_chunks::<8>().0))
            .collect::<Result<_>>()?,
        between: between.iter().map(inserted).collect::<Result<_>>()?,
    };
    if run.first.checked_add(run.touches.len() as u64).is_none() {
        return Err(Error::Malformed("positions without end".to_owned()));
    }
    run.validate(positions)?;
    Ok(run)
}

fn pieces<'a, const N: usize>(bytes: &'a [u8], what: &'static str) -> Result<&'a [[u8; N]]> {
    let (all, rest) = bytes.as_chunks::<N>();
    if rest.is_empty() {
        return Ok(all);
    }
    Err(Error::Ragged {
        what,
        bytes: bytes.len(),
        size: N,
    })
}

/// A touch from its four numbers.
fn touch(numbers: &[[u8; 8]]) -> Result<Option<Touch>> {
    let number = |i: usize| f64::from_le_bytes(numbers[i]);
    let (height, contact) = (number(0), [number(1), number(2), number(3)]);
    if height.is_nan() && contact.iter().all(|c| c.is_nan()) {
        Ok(None)
    } else if height.is_finite() && contact.iter().all(|c| c.is_finite()) {
        Ok(Some(Touch { height, contact }))
    } else {
        Err(Error::Malformed("a position that is half there".to_owned()))
    }
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
                coordinates: Some(wire::row::Coordinates::Points(vec![id as u8; size].into())),
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

    const TOUCH: Touch = Touch {
        height: 1.5,
        contact: [1.0, -2.0, 3.0],
    };

    fn inserted(whole: u64, parts: u16) -> Inserted {
        Inserted {
            index: Index::between(whole, parts).expect("between"),
            touch: parts.is_multiple_of(2).then_some(TOUCH),
        }
    }

    #[test]
    fn a_flipped_bit_is_found() {
        let (touches, between) = ([Some(TOUCH), None], [inserted(7, 512), inserted(8, 3)]);
        let good = pack_positions(7, &touches, &between);
        let run = unpack_positions(&good, 10).expect("intact");
        assert_eq!(
            (run.first, &run.touches[..], &run.between[..]),
            (7, &touches[..], &between[..])
        );
        let flip = |bytes: &mut Bytes| {
            let mut flipped = bytes.to_vec();
            flipped[3] ^= 1;
            *bytes = flipped.into();
        };
        let flips: [&dyn Fn(&mut wire::Positions); 3] =
            [&|p| p.first ^= 1, &|p| flip(&mut p.touches), &|p| {
                flip(&mut p.between);
            }];
        for flip in flips {
            let mut bad = good.clone();
            flip(&mut bad);
            let unpacked = unpack_positions(&bad, 10);
            assert!(matches!(unpacked, Err(Error::Checksum { .. })));
        }
    }

    #[test]
    fn a_sealed_message_opens_only_as_it_was() {
        let message = wire::Trajectory {
            step: 2.0,
            positions: 7,
            ..wire::Trajectory::default()
        };
        let sealed = seal(&message);
        assert_eq!(open::<wire::Trajectory>(&sealed), Ok(message));
        for bit in 0..8 * sealed.data.len() {
            let mut data = sealed.data.to_vec();
            data[bit / 8] ^= 1 << (bit % 8);
            let bad = wire::Chunk {
                data: data.into(),
                ..sealed
            };
            let opened = open::<wire::Trajectory>(&bad);
            assert!(matches!(opened, Err(Error::Checksum { .. })), "bit {bit}");
        }
    }

    #[test]
    fn what_was_inserted_elsewhere_is_refused() {
        let touches = [None; 2];
        for between in [
            &[inserted(6, 1)][..],
            &[inserted(9, 1)],
            &[inserted(7, 2), inserted(7, 2)],
            &[inserted(8, 2), inserted(7, 2)],
        ] {
            let packed = pack_positions(7, &touches, between);
            let unpacked = unpack_positions(&packed, 10);
            assert!(matches!(unpacked, Err(Error::Core(_))), "{between:?}");
        }
        let last = pack_positions(7, &touches, &[inserted(8, 2)]);
        assert!(
            unpack_positions(&last, 9).is_err(),
            "no move begins at the last position"
        );
        let whole = wire::Positions {
            between: [&7168u64.to_le_bytes()[..], &[0; POSITION_BYTES]]
                .concat()
                .into(),
            ..wire::Positions::default()
        };
        let whole = wire::Positions {
            crc32c: checksum(&whole),
            ..whole
        };
        assert!(matches!(
            unpack_positions(&whole, 10),
            Err(Error::Malformed(_))
        ));
    }

    #[test]
    fn no_message_grows_with_what_was_inserted() {
        let touches = vec![Some(TOUCH); 100];
        let moves = (1000..1099).flat_map(|whole| (1..1024).map(move |k| inserted(whole, k)));
        let between: Vec<Inserted> = moves.collect();
        let mut run = SubTrajectory {
            first: 1000,
            ..SubTrajectory::default()
        };
        for message in position_chunks(1000, &touches, &between) {
            assert!(message.touches.len() + message.between.len() <= CHUNK_BYTES);
            assert_eq!(message.first, run.end());
            let part = unpack_positions(&message, 2000).expect("intact");
            run.touches.extend(part.touches);
            run.between.extend(part.between);
        }
        assert_eq!((run.touches, run.between), (touches, between));
        assert_eq!(position_chunks(3, &[], &[]).count(), 0);
    }
}
