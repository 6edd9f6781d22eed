//! Files in and out of horma: parts and jobs come in, paths, programs and reports go out.
//!
//! This crate owns every file format and nothing else: it computes no path and opens no socket.

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
mod columns;
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
