//! What a job says of its files, beside what they say themselves.

use super::{Unit, Warning};
use crate::error::{Error, Result};

/// How files are to be read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reading {
    /// The unit of length of files that state none; without it mm, as everywhere in horma.
    pub unit: Option<Unit>,
    /// What becomes of faces that are trimmed inside their surface.
    pub trimmed: Trimmed,
}

/// What becomes of a face that is trimmed inside its surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Trimmed {
    /// Its file is refused.
    #[default]
    Refuse,
    /// Its whole surface is machined. What the trim cuts away only keeps the cutter out: nothing is
    /// gouged, but more is left than was designed.
    Whole,
}

impl Reading {
    /// Millimetres in one number of a file that states no unit.
    pub(super) fn scale(&self) -> f64 {
        self.unit.as_ref().map_or(1.0, |u| u.millimetres)
    }

    /// The unit of a file that states none.
    pub(super) fn assumed(&self) -> Unit {
        self.unit.clone().unwrap_or_default()
    }
}

/// The faces of a file that are trimmed inside their surfaces, as they turn up.
pub(super) struct Trims {
    trimmed: Trimmed,
    faces: usize,
    first: String,
}

impl Trims {
    pub(super) fn new(reading: &Reading) -> Self {
        Self {
            trimmed: reading.trimmed,
            faces: 0,
            first: String::new(),
        }
    }

    /// The face `name` is one.
    ///
    /// # Errors
    /// [`Error::Trimmed`] unless such faces count whole.
    pub(super) fn inside(&mut self, name: &str) -> Result<()> {
        match self.trimmed {
            Trimmed::Refuse => Err(Error::Trimmed {
                name: name.to_owned(),
            }),
            Trimmed::Whole => {
                if self.faces == 0 {
                    self.first = name.to_owned();
                }
                self.faces += 1;
                Ok(())
            }
        }
    }

    /// Whether such faces count whole.
    pub(super) fn count_whole(&self) -> bool {
        self.trimmed == Trimmed::Whole
    }

    /// What there is to say of them in the end.
    pub(super) fn warning(self, name: &str) -> Option<Warning> {
        let own = self.first.strip_prefix(&format!("{name}: "));
        let first = own.unwrap_or(&self.first).to_owned();
        (self.faces > 0).then(|| Warning::Whole {
            name: name.to_owned(),
            faces: self.faces,
            first,
        })
    }
}
