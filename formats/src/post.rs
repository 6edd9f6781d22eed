//! Programs for machines: a path in the dialect of a control.
//!
//! Every program retracts first, then travels, and plunges last; under G93 every move has its F, and G94 is
//! restored before the retract at the end. So does each of its passes, and the part goes on turning from one
//! to the next. It starts no spindle and changes no tool: nothing is known of
//! either. Each file of a program that is split begins and ends in the same way, so it can be run alone. No
//! position is left out or simplified. How long a move takes is decided in the core; what a program says is
//! rounded here, towards slower.

mod dialect;
mod lines;
mod placed;
mod write;

use std::path::Path;

use horma_core::{MachineAxis, Station};

pub use self::dialect::{Control, Counted, Dialect, Direction, Group, Inverse, Modulo};
pub use self::placed::{Leg, Placed};
use self::write::Script;
use crate::error::{Error, Result};
use crate::output;

/// How a path is written as a program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Program {
    /// Whose dialect.
    pub control: Control,
    /// Letters and directions, in the order of [`horma_core::MachineAxis::ALL`].
    pub words: [Word; 3],
    /// Decimals of each axis, in the program's units.
    pub decimals: [u8; 3],
    /// Of lengths.
    pub units: Units,
    /// What of the cutter is programmed.
    pub point: Programmed,
    /// How turns are counted.
    pub angles: Angles,
    /// What F says.
    pub feed_mode: FeedMode,
    /// Where a file ends and the next begins; a single file if nowhere.
    pub split: Option<Split>,
    /// Whether the path is written as cutter locations as well.
    pub apt: bool,
    /// Block numbers go by this; 0 for none.
    pub block_numbers: u32,
    /// Feed at the contact, mm/min.
    pub feed: f64,
    /// How far above the highest position the cutter retracts, mm.
    pub clearance: f64,
}

/// An axis as a program names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    /// Its letter.
    pub letter: char,
    /// Whether it counts the other way.
    pub negative: bool,
}

/// Units of lengths; angles are in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Units {
    /// Millimetres.
    Mm,
    /// Inches.
    Inch,
}

/// What of the cutter is programmed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Programmed {
    /// Its centre.
    Centre,
    /// The point of its rim that is nearest to the spindle axis.
    Tip,
}

/// How turns are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Angles {
    /// On and on.
    Unwound,
    /// To 360 and again from 0.
    Modulo,
    /// On and on, and after each retract whole turns are taken off what the control has counted.
    Rezero,
}

/// What F says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FeedMode {
    /// How long a move takes: G93.
    Inverse,
    /// Units a minute: G94.
    Minute,
    /// Degrees of rotation a minute.
    Degrees,
}

/// The most that a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// In bytes.
    Bytes(u64),
    /// In moves under feed.
    Moves(u64),
}

/// A line of a program's heading: what it tells (`cutter`) and the text itself.
pub type Heading<'a> = [(&'static str, &'a str)];

/// Most files of a program: Fanuc leaves other numbers to the machine's builder.
const MOST_FILES: u32 = 7999;

impl Units {
    /// How long one is, mm.
    pub fn length(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Inch => 25.4,
        }
    }
}

impl Program {
    /// A turn of the part, in increments.
    fn turn(&self) -> i64 {
        360 * 10_i64.pow(u32::from(self.decimals[MachineAxis::Rotation as usize]))
    }

    /// The shortest move that the control can be told, s.
    pub fn shortest(&self) -> f64 {
        match self.feed_mode {
            FeedMode::Inverse => 60.0 / self.control.dialect().most_inverse,
            FeedMode::Minute | FeedMode::Degrees => 0.0,
        }
    }
}

/// One pass of the cutter over the part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass<'a> {
    /// What it is called where there are several.
    pub title: &'a str,
    /// Its positions, at least one.
    pub course: &'a [Station],
    /// Feed of its plunge, mm/min.
    pub feed: f64,
}

/// Writes the program of placed passes, each move in its duration, to files in `dir`; their names, in order.
/// There are the durations of each pass.
///
/// # Errors
/// [`Error::NoFeed`] for a move that F cannot count, [`Error::TooManyFiles`], [`Error::Io`] if a file cannot
/// be written.
pub fn save(
    dir: &Path,
    placed: &Placed,
    durations: &[Vec<f64>],
    program: &Program,
    heading: &Heading,
) -> Result<Vec<String>> {
    let script = Script {
        placed,
        durations,
        program,
        dialect: program.control.dialect(),
        heading,
    };
    script.check()?;
    let mut names = Vec::new();
    let mut first = 0;
    for part in 1..=MOST_FILES {
        let name = output::program_name(program.control, program.split.map(|_| part));
        first = output::write(&dir.join(&name), |out| script.write(first, part, out))?;
        names.push(name);
        if first == placed.increments.len() {
            return Ok(names);
        }
    }
    Err(Error::TooManyFiles { limit: MOST_FILES })
}

/// Where a path is, for messages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Travel along the spindle, mm.
    pub x: f64,
    /// Unwound angle, degrees.
    pub angle: f64,
}

impl std::fmt::Display for Spot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "travel {:.3}, angle {:.2}°", self.x, self.angle)
    }
}
