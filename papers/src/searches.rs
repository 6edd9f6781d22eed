//! The experiments of 2001: the search with the window δ and without, how deep a path over points gouges, and
//! what is to be done by each of several workers.
//!
//! [`experiments`] are the two tables in print; [`gouges`] is eq. (6), and [`workers`] eq. (10). Evaluations,
//! heights and depths are counted and measured, and the same on every machine; times are apart.

pub mod experiments;
pub mod gouges;
pub mod workers;

mod chapter;

pub use chapter::chapter;
