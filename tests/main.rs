//! The real binary, alone and as several processes. One program for all of it, so that it is linked once and a
//! test that waits leaves its place to others; `cargo test cluster::` runs a module.

mod common;

mod chaos;
mod cli;
mod cluster;
mod configurations;
mod deploy;
mod doctor;
mod faults;
mod habits;
mod lasts;
mod machined;
mod oracles;
mod page;
mod passes;
mod program;
mod python;
mod security;
mod seen;
mod serve;
mod soak;
mod table;
mod traces;
mod view;
