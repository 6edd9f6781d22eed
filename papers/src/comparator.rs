//! Figure 11: the spiral of a three-axis mill beside the turned one, for the same last.
//!
//! `path` has both tools and their paths, and what these leave of the last.

mod chapter;
mod path;

pub use chapter::chapter;
