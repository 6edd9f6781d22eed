//! The store: what the master must not forget, in one file or, without one, in memory.
//!
//! It keeps the queue with each job as it was sent, the journal of finished extents, and results, all as
//! numbered pieces of bytes with a checksum each. Every call is one transaction, on disk before it
//! returns: a master killed at any instant finds all of it or nothing. Calls block, so they are for
//! blocking threads. It knows neither the network nor what the pieces mean.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use bytes::Bytes;
use redb::backends::InMemoryBackend;
use redb::{
    Database, DatabaseError, ReadableDatabase, ReadableTable, TableDefinition, WriteTransaction,
};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// What the file is called within its directory.
const FILE: &str = "jobs.redb";

/// Changes whenever what is written here changes.
const FORMAT: u64 = 2;

/// Memory for pages that were read or written lately; in memory alone there is nothing to gain.
const CACHE: usize = 32 << 20;

const NUMBERS: TableDefinition<&str, u64> = TableDefinition::new("numbers");
const JOBS: TableDefinition<u64, &[u8]> = TableDefinition::new("jobs");
/// Jobs by the key that their client made up.
const KEYS: TableDefinition<u128, u64> = TableDefinition::new("keys");
/// Pieces by job and number.
type PiecesTable = TableDefinition<'static, (u64, u32), &'static [u8]>;
const SUBMISSIONS: PiecesTable = TableDefinition::new("submissions");
const RESULTS: PiecesTable = TableDefinition::new("results");
/// Pieces by job, extent and number.
const JOURNAL: TableDefinition<(u64, u32, u32), &[u8]> = TableDefinition::new("journal");

/// Jobs, what they consist of and what has come of them.
pub(crate) struct Store {
    db: Database,
}

/// One job in short.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Made up by the client: a submission that comes twice is the same job.
    pub key: u128,
    /// What the client calls it.
    pub name: String,
    /// When it came, since 1970.
    pub submitted: Duration,
    /// Bytes of memory that it is expected to take.
    pub memory: u64,
    /// The span for which it is done, if the client or the master told of one.
    pub trace: Option<String>,
    pub stage: Stage,
}

/// How far a job is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Stage {
    Queued,
    /// It was split for so many workers; the digest tells whether it would be so again.
    Running {
        workers: u32,
        digest: u32,
    },
    /// Its result is here, in so many pieces.
    Done {
        at: Duration,
        pieces: u32,
        bytes: u64,
    },
    /// Its result has been here.
    Gone {
        at: Duration,
        why: Gone,
    },
    /// It came to nothing: a status code and its message.
    Failed {
        at: Duration,
        code: i32,
        reason: String,
    },
    /// Nobody wanted it any more.
    Cancelled {
        at: Duration,
    },
}

/// Why a result is not here any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Gone {
    /// The client has it.
    Fetched,
    /// Nobody fetched it in time, or there was no room.
    Dropped,
}

impl Stage {
    /// Whether there is still something to be done.
    pub fn is_open(&self) -> bool {
        matches!(self, Self::Queued | Self::Running { .. })
    }

    /// Since when there is not.
    pub fn ended(&self) -> Option<Duration> {
        match *self {
            Self::Queued | Self::Running { .. } => None,
            Self::Done { at, .. }
            | Self::Gone { at, .. }
            | Self::Failed { at, .. }
            | Self::Cancelled { at } => Some(at),
        }
    }
}

/// Pieces of a finished extent, as they were given.
pub(crate) type Pieces = Vec<Bytes>;

impl Store {
    /// Opens the store in a directory, which is made if it is not there; without one, in memory.
    ///
    /// # Errors
    /// [`Error::StoreUnusable`], [`Error::StoreFormat`], [`Error::Store`].
    pub fn open(dir: Option<&Path>) -> Result<Self> {
        let builder = Database::builder();
        let db = match dir {
            None => {
                let mut builder = builder;
                let memory = InMemoryBackend::new();
                builder.set_cache_size(0).create_with_backend(memory)?
            }
            Some(dir) => open_file(builder, dir)?,
        };
        let store = Self { db };
        store.change(|t| {
            // All tables are there from now on, so that reading finds them.
            t.open_table(JOBS)?;
            t.open_table(KEYS)?;
            t.open_table(SUBMISSIONS)?;
            t.open_table(RESULTS)?;
            t.open_table(JOURNAL)?;
            let mut numbers = t.open_table(NUMBERS)?;
            let found = numbers.get("format")?.map(|n| n.value());
            match found {
                None => drop(numbers.insert("format", FORMAT)?),
                Some(FORMAT) => {}
                Some(found) => {
                    return Err(Error::StoreFormat {
                        found,
                        ours: FORMAT,
                    });
                }
            }
            Ok(())
        })?;
        Ok(store)
    }

    /// All jobs.
    pub fn jobs(&self) -> Result<BTreeMap<u64, Entry>> {
        let jobs = self.db.begin_read()?.open_table(JOBS)?;
        let entry = |row: std::result::Result<_, redb::StorageError>| {
            let (job, entry): (redb::AccessGuard<'_, u64>, redb::AccessGuard<'_, &[u8]>) = row?;
            Ok((job.value(), from_json(entry.value())?))
        };
        jobs.iter()?.map(entry).collect()
    }

    /// Takes a job in; one with a known key is there already. Returns its number, and whether it is new.
    pub fn submit(&self, entry: &Entry, pieces: &[Bytes]) -> Result<(u64, bool)> {
        self.change(|t| {
            let mut keys = t.open_table(KEYS)?;
            let known = keys.get(entry.key)?.map(|job| job.value());
            if let Some(job) = known {
                return Ok((job, false));
            }
            let mut numbers = t.open_table(NUMBERS)?;
            let job = numbers.get("next job")?.map_or(1, |n| n.value());
            numbers.insert("next job", job + 1)?;
            keys.insert(entry.key, job)?;
            put(t, job, entry)?;
            put_pieces(t, SUBMISSIONS, job, pieces)?;
            Ok((job, true))
        })
    }

    /// A job as it was sent.
    pub fn submission(&self, job: u64) -> Result<Pieces> {
        let table = self.db.begin_read()?.open_table(SUBMISSIONS)?;
        let pieces = table.range((job, 0)..=(job, u32::MAX))?;
        pieces.map(|row| unseal(row?.1.value())).collect()
    }

    /// An open job is split like this from now on. What is in its journal stays if that was so before;
    /// returns whether anything had to go.
    pub fn begin(&self, job: u64, workers: u32, digest: u32) -> Result<bool> {
        self.change(|t| {
            let Some(mut entry) = open_entry(t, job)? else {
                return Ok(false);
            };
            let stage = Stage::Running { workers, digest };
            if entry.stage == stage {
                return Ok(false);
            }
            entry.stage = stage;
            put(t, job, &entry)?;
            drop_journal(t, job)
        })
    }

    /// Journals an extent of an open job; returns whether the job is open.
    pub fn keep(&self, job: u64, extent: u32, pieces: &[Bytes]) -> Result<bool> {
        self.change(|t| {
            if open_entry(t, job)?.is_none() {
                return Ok(false);
            }
            let mut journal = t.open_table(JOURNAL)?;
            for (i, piece) in (0..).zip(pieces) {
                journal.insert((job, extent, i), &seal(piece)[..])?;
            }
            Ok(true)
        })
    }

    /// The extents of a job that are in the journal.
    pub fn journal(&self, job: u64) -> Result<BTreeMap<u32, Pieces>> {
        let table = self.db.begin_read()?.open_table(JOURNAL)?;
        let mut extents: BTreeMap<u32, Pieces> = BTreeMap::new();
        for row in table.range((job, 0, 0)..=(job, u32::MAX, u32::MAX))? {
            let (key, piece) = row?;
            let pieces = extents.entry(key.value().1).or_default();
            pieces.push(unseal(piece.value())?);
        }
        Ok(extents)
    }

    /// Puts a result in the place of an open job's submission and journal. Nothing happens to a job that
    /// is not open any more. Returns its stage.
    pub fn finish(&self, job: u64, at: Duration, pieces: &[Bytes]) -> Result<Option<Stage>> {
        let stage = Stage::Done {
            at,
            pieces: pieces.len() as u32,
            bytes: pieces.iter().map(|p| p.len() as u64).sum(),
        };
        self.close(job, stage, pieces)
    }

    /// An open job comes to nothing, which is the stage given; else as [`Store::finish`].
    pub fn end(&self, job: u64, stage: Stage) -> Result<Option<Stage>> {
        self.close(job, stage, &[])
    }

    fn close(&self, job: u64, stage: Stage, result: &[Bytes]) -> Result<Option<Stage>> {
        self.change(|t| {
            let Some(mut entry) = open_entry(t, job)? else {
                return Ok(entry_of(t, job)?.map(|e| e.stage));
            };
            entry.stage = stage;
            put(t, job, &entry)?;
            drop_pieces(t, SUBMISSIONS, job)?;
            drop_journal(t, job)?;
            put_pieces(t, RESULTS, job, result)?;
            Ok(Some(entry.stage))
        })
    }

    /// A piece of a result, if it is still there.
    pub fn result(&self, job: u64, piece: u32) -> Result<Option<Bytes>> {
        let table = self.db.begin_read()?.open_table(RESULTS)?;
        let piece = table.get((job, piece))?;
        piece.map(|piece| unseal(piece.value())).transpose()
    }

    /// Drops a job's result, if there is one. Returns its stage.
    pub fn drop_result(&self, job: u64, why: Gone) -> Result<Option<Stage>> {
        self.change(|t| {
            let Some(mut entry) = entry_of(t, job)? else {
                return Ok(None);
            };
            if let Stage::Done { at, .. } = entry.stage {
                entry.stage = Stage::Gone { at, why };
                put(t, job, &entry)?;
                drop_pieces(t, RESULTS, job)?;
            }
            Ok(Some(entry.stage))
        })
    }

    /// Forgets a job that is not open, with all that is left of it.
    pub fn forget(&self, job: u64) -> Result<()> {
        self.change(|t| {
            let Some(entry) = entry_of(t, job)?.filter(|e| !e.stage.is_open()) else {
                return Ok(());
            };
            t.open_table(KEYS)?.remove(entry.key)?;
            t.open_table(JOBS)?.remove(job)?;
            drop_pieces(t, RESULTS, job)
        })
    }

    /// One transaction: all of it, or nothing if it fails.
    fn change<T>(&self, what: impl FnOnce(&WriteTransaction) -> Result<T>) -> Result<T> {
        let mut transaction = self.db.begin_write()?;
        // After a kill the file is opened at once, however large it is.
        transaction.set_quick_repair(true);
        let done = what(&transaction)?;
        transaction.commit()?;
        Ok(done)
    }
}

fn open_file(mut builder: redb::Builder, dir: &Path) -> Result<Database> {
    let file = dir.join(FILE);
    let unusable = |reason: String| Error::StoreUnusable {
        file: file.clone(),
        reason,
    };
    std::fs::create_dir_all(dir).map_err(|e| unusable(e.to_string()))?;
    let opened = builder.set_cache_size(CACHE).create(&file);
    opened.map_err(|error| match error {
        DatabaseError::DatabaseAlreadyOpen => {
            unusable("another master uses it; give each a directory of its own".to_owned())
        }
        other => unusable(other.to_string()),
    })
}

fn entry_of(t: &WriteTransaction, job: u64) -> Result<Option<Entry>> {
    let jobs = t.open_table(JOBS)?;
    let entry = jobs.get(job)?;
    entry.map(|entry| from_json(entry.value())).transpose()
}

fn open_entry(t: &WriteTransaction, job: u64) -> Result<Option<Entry>> {
    Ok(entry_of(t, job)?.filter(|entry| entry.stage.is_open()))
}

fn put(t: &WriteTransaction, job: u64, entry: &Entry) -> Result<()> {
    t.open_table(JOBS)?.insert(job, &to_json(entry)?[..])?;
    Ok(())
}

pub(crate) fn to_json(entry: &Entry) -> Result<Vec<u8>> {
    serde_json::to_vec(entry).map_err(|e| Error::StoreDamaged(e.to_string()))
}

pub(crate) fn from_json(json: &[u8]) -> Result<Entry> {
    serde_json::from_slice(json).map_err(|e| Error::StoreDamaged(e.to_string()))
}

fn put_pieces(t: &WriteTransaction, table: PiecesTable, job: u64, pieces: &[Bytes]) -> Result<()> {
    let mut table = t.open_table(table)?;
    for (i, piece) in (0..).zip(pieces) {
        table.insert((job, i), &seal(piece)[..])?;
    }
    Ok(())
}

fn drop_pieces(t: &WriteTransaction, table: PiecesTable, job: u64) -> Result<()> {
    let mut table = t.open_table(table)?;
    table.retain_in((job, 0)..=(job, u32::MAX), |_, _| false)?;
    Ok(())
}

/// Returns whether there was anything.
fn drop_journal(t: &WriteTransaction, job: u64) -> Result<bool> {
    let mut journal = t.open_table(JOURNAL)?;
    let all = (job, 0, 0)..=(job, u32::MAX, u32::MAX);
    let any = journal.range(all.clone())?.next().is_some();
    journal.retain_in(all, |_, _| false)?;
    Ok(any)
}

/// A piece behind its checksum.
pub(crate) fn seal(piece: &[u8]) -> Vec<u8> {
    [&crc32c::crc32c(piece).to_le_bytes(), piece].concat()
}

pub(crate) fn unseal(sealed: &[u8]) -> Result<Bytes> {
    let (sum, piece) = sealed.split_at_checked(4).unwrap_or_default();
    let found = crc32c::crc32c(piece);
    if sum != found.to_le_bytes() {
        let why = format!("a piece of {} bytes has checksum {found:08x}", piece.len());
        return Err(Error::StoreDamaged(why));
    }
    Ok(Bytes::copy_from_slice(piece))
}

#[cfg(test)]
mod tests;
