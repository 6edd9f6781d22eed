//! A submission: a job and its part as a client sends them, checked piece by piece as they come, and
//! again when they come back from the store.

use horma_core::{Job, Part, Sharing};
use horma_proto::{Error, Messages, Result, VERSION, wire};

use crate::store::Pieces;

/// Longest name of a job, bytes.
const LONGEST_NAME: usize = 256;

/// What has come of a submission so far.
#[derive(Default)]
pub(crate) struct Arriving {
    header: Option<Header>,
    part: Part,
    messages: Messages,
    pieces: Pieces,
}

/// What a submission begins with.
struct Header {
    key: u128,
    name: String,
    job: Job,
    sharing: Sharing,
}

/// A submission that is complete.
pub(crate) struct Submission {
    /// Made up by the client.
    pub key: u128,
    /// What the client calls it.
    pub name: String,
    pub job: Job,
    pub sharing: Sharing,
    pub part: Part,
    /// The same as it was sent.
    pub pieces: Pieces,
}

impl Arriving {
    /// Takes the header, which comes first and once; returns its key.
    pub fn header(&mut self, sealed: &wire::Chunk) -> Result<u128> {
        if self.header.is_some() {
            return Err(out_of_order());
        }
        let header: wire::SubmitHeader = horma_proto::open(sealed)?;
        check_version(&header.version)?;
        let key = header.key[..].try_into().map(u128::from_le_bytes);
        let job = header.job.as_ref().ok_or(missing("a job"))?;
        if header.name.len() > LONGEST_NAME {
            return Err(Error::TooLarge {
                bytes: header.name.len(),
                limit: LONGEST_NAME,
            });
        }
        let all = Header {
            key: key.map_err(|_| missing("a key of 16 bytes"))?,
            job: horma_proto::job_from_wire(job)?,
            sharing: horma_proto::sharing_from_wire(header.sharing.as_ref())?,
            name: header.name,
        };
        self.pieces.push(sealed.data.clone());
        Ok(self.header.insert(all).key)
    }

    /// Takes bodies.
    pub fn bodies(&mut self, chunk: &wire::Chunk) -> Result<()> {
        if self.header.is_none() {
            return Err(out_of_order());
        }
        self.messages.push(chunk)?;
        while let Some(body) = self.messages.pop::<wire::Body>()? {
            self.part.bodies.push(horma_proto::body_from_wire(body)?);
        }
        self.pieces.push(chunk.data.clone());
        Ok(())
    }

    /// Nothing more comes.
    pub fn end(self) -> Result<Submission> {
        if !self.messages.is_empty() {
            return Err(missing("the end of its last body"));
        }
        let header = self.header.ok_or(missing("a header"))?;
        Ok(Submission {
            key: header.key,
            name: header.name,
            job: header.job,
            sharing: header.sharing,
            part: self.part,
            pieces: self.pieces,
        })
    }
}

/// The same again, from its pieces.
pub(crate) fn again(pieces: Pieces) -> Result<Submission> {
    let mut arriving = Arriving::default();
    let mut pieces = pieces.into_iter();
    let header = pieces.next().ok_or(missing("a header"))?;
    arriving.header(&horma_proto::chunk(header))?;
    for data in pieces {
        arriving.bodies(&horma_proto::chunk(data))?;
    }
    arriving.end()
}

/// Both ends run the same version.
pub(crate) fn check_version(theirs: &str) -> Result<()> {
    if theirs == VERSION {
        return Ok(());
    }
    Err(Error::Version {
        ours: VERSION,
        theirs: theirs.to_owned(),
    })
}

pub(crate) fn out_of_order() -> Error {
    Error::Malformed("a submission begins with its header, once".to_owned())
}

fn missing(field: &'static str) -> Error {
    Error::Missing {
        message: "submission",
        field,
    }
}
