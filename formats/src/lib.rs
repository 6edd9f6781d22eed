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

pub mod apt;
pub mod csv;
pub mod map;
pub mod plot;
pub mod ply;
pub mod post;
pub mod preview;
pub mod report;
pub mod sizes;
pub mod view;

pub use error::{Error, Result};
