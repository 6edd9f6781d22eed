//! Files in and out of horma: parts and jobs come in, paths, programs and reports go out.
//!
//! This crate owns every file format and nothing else: it computes no path and opens no socket.
//!
//! # From a job file to a path
//!
//! ```
//! use horma_core::{Digitizer, Plan, Simd, place};
//! use horma_formats::{csv, job, part, sample};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let dir = tempfile::tempdir()?;
//! // What `horma init` writes: a shoe last, its holders and a job.
//! sample::write_sample(dir.path())?;
//! let overrides = job::Overrides {
//!     tolerance: Some(0.1),
//!     step: Some(10.0),
//!     ..Default::default()
//! };
//! let file = job::read(&dir.path().join("job.toml"), &overrides)?;
//! let read = part::read_all(&file.files, &file.reading)?;
//! assert!(read.warnings.is_empty());
//!
//! // horma-core digitizes it.
//! let part = place(read.part, file.axis)?;
//! let plan = Plan::new(&part, file.job, 1 << 30)?;
//! let digitizer = Digitizer::new(&file.job, &plan.model.rows, Simd::best());
//! let (path, _cost) = digitizer.path(&plan.trajectory);
//! csv::save(&dir.path().join("path.csv"), &path)?;
//! # Ok(())
//! # }
//! ```

mod error;

pub mod job;
pub mod part;

pub mod inspect;

pub mod lasts;

pub mod sample;
pub mod step_out;

mod decimal;
pub mod output;
mod raster;
mod svg;

pub mod also;
pub mod apt;
pub mod columns;
pub mod csv;
mod glb;
pub mod map;
mod npy;
mod parquet;
pub mod plot;
pub mod ply;
pub mod post;
pub mod preview;
pub mod report;
pub mod sizes;
mod skin;
pub mod stl_out;
pub mod view;

pub use error::{Error, Result};
pub use skin::Which;
pub use svg::escaped;
