//! The coprocessor: a transform unit in hardware turns packed points, and the host takes their distances
//! (coprocessor paper).
//!
//! [`transform`] is the unit, clocked stage by stage; [`path`] is what paths it gives, held against doubles;
//! [`schedule`] is unit and host at work at once, and what the printed times say of it; [`shares`] is what the
//! inner loop spends its time on.

pub mod path;
pub mod schedule;
pub mod shares;
pub mod transform;

mod chapter;

pub use chapter::chapter;
