//! The papers' hardware and experiments, built in software and set beside what is printed in them.
//!
//! An [`Experiment`] is a module with a function that gives its [`Chapter`], plain values; how
//! these look is for `markdown` and `html`. Nothing of horma depends on this crate but the command.
//!
//! Hardware is modelled twice: as arithmetic, and as registers that are clocked; tests hold the two to each
//! other bit for bit, and the arithmetic to doubles within a bound that is derived beside it.

mod error;

pub mod fixed;
pub mod resources;

pub mod cordic;
pub mod multirotator;

pub mod precision;

pub mod coprocessor;

pub mod subject;

pub mod searches;

pub mod quality;

pub mod comparator;

pub mod report;

pub mod html;
pub mod markdown;

use std::fmt;
use std::fs;
use std::io::Write;
use std::path::Path;

use horma_formats::output::{self, Staging};
use horma_formats::plot;

pub use error::{Error, Result};
use report::{Block, Chapter};

/// The report as Markdown.
pub const PAGE: &str = "papers.md";
/// The report as one page of HTML.
pub const VIEW: &str = "papers.html";
/// The folder of its diagrams.
pub const DIAGRAMS: &str = "papers";

const TITLE: &str = "The papers, reproduced";

/// What is said before all chapters.
const INTRODUCTION: [&str; 3] = [
    "Three papers describe virtual digitizing: Jimeno, García and Salas, “Shoe last machining using Virtual \
     Digitising” (2001, below: the 2001 paper); Jimeno, Cuenca, Martínez and Sánchez, “Accelerating tool path \
     computing in turning lathe machining” (the coprocessor paper); Jimeno, Sánchez, Mora, Mora and \
     García-Chamizo, “FPGA-based tool path computation” (the FPGA paper). What they describe is built here, and \
     each figure in print stands beside the one found.",
    "The texts at hand have lost their images, and of the FPGA paper all tables and figures: tables 1 to 4 and \
     figures 1 to 11. Where a claim is known only from the sentence about a figure, only the sentence is \
     compared.",
    "Everything is exact and the same on every machine but for what is timed, which differs from run to run. \
     “Agrees”: the same figure, or the bound in print is kept. “Differs”: it is not. “Fitted”: a model was \
     fitted to what is printed, so that it proves nothing.",
];

/// What can be reproduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    /// The MultiRotator's arithmetic, circuits and cycles.
    MultiRotator,
    /// CORDIC, and the two compared.
    Cordic,
    /// How precise both are.
    Precision,
    /// Packed points, the transform unit, how it speeds up a path.
    Coprocessor,
    /// The experiments of 2001: windows, gouges over points, workers.
    Searches,
    /// What lasts measure as designed and as machined.
    Quality,
    /// A Z-constant path beside the turned one.
    Comparator,
}

impl Experiment {
    /// All of them, in the order in which they are told.
    pub const ALL: [Self; 7] = [
        Self::MultiRotator,
        Self::Cordic,
        Self::Precision,
        Self::Coprocessor,
        Self::Searches,
        Self::Quality,
        Self::Comparator,
    ];

    /// What it is called on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::MultiRotator => "multirotator",
            Self::Cordic => "cordic",
            Self::Precision => "precision",
            Self::Coprocessor => "coprocessor",
            Self::Searches => "searches",
            Self::Quality => "quality",
            Self::Comparator => "comparator",
        }
    }

    /// Makes it.
    ///
    /// # Errors
    /// Those of the experiment.
    pub fn run(self) -> Result<Chapter> {
        match self {
            Self::MultiRotator => multirotator::chapter(),
            Self::Cordic => cordic::chapter(),
            Self::Precision => precision::chapter(),
            Self::Coprocessor => coprocessor::chapter(),
            Self::Searches => searches::chapter(),
            Self::Quality => quality::chapter(),
            Self::Comparator => comparator::chapter(),
        }
    }
}

impl fmt::Display for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The command that makes these chapters.
fn command(chapters: &[Chapter]) -> String {
    let all = chapters
        .iter()
        .map(|c| c.name)
        .eq(Experiment::ALL.map(Experiment::name));
    let names = chapters.iter().map(|c| format!(" {}", c.name));
    let names = if all { String::new() } else { names.collect() };
    format!("horma papers{names} -o docs")
}

/// Every diagram of these chapters: the name of its file, and the file.
pub fn diagrams(chapters: &[Chapter]) -> impl Iterator<Item = (String, String)> + '_ {
    let blocks = chapters.iter().flat_map(|c| &c.blocks);
    blocks.filter_map(|block| match block {
        Block::Figure(name, plot) => Some((format!("{name}.svg"), plot::svg(plot))),
        _ => None,
    })
}

/// Makes `dir` ready for a report: there may be anything else in it, but only diagrams in its folder of
/// diagrams.
///
/// # Errors
/// Those of [`output::prepare_dir_of`].
pub fn prepare(dir: &Path) -> Result<()> {
    Ok(output::prepare_dir_of(&dir.join(DIAGRAMS), |name| {
        name.ends_with(".svg")
    })?)
}

/// Writes the report of these chapters into `dir`, whole or not at all; what an earlier one left there goes.
///
/// # Errors
/// [`Error::Formats`] if it cannot be written.
pub fn write(dir: &Path, chapters: &[Chapter]) -> Result<()> {
    let staging = Staging::begin_of(dir, |name| [PAGE, VIEW, DIAGRAMS].contains(&name))?;
    let folder = staging.file(DIAGRAMS);
    fs::create_dir(&folder).map_err(|source| horma_formats::Error::Io {
        path: folder.clone(),
        source,
    })?;
    let pages = [
        (PAGE, markdown::page(chapters)),
        (VIEW, html::page(chapters)),
    ];
    let pages = pages.map(|(name, text)| (staging.file(name), text));
    let diagrams = diagrams(chapters).map(|(name, text)| (folder.join(name), text));
    for (file, text) in pages.into_iter().chain(diagrams) {
        output::write(&file, |out| out.write_all(text.as_bytes()))?;
    }
    Ok(staging.publish()?)
}
