//! A STEP file from anybody is refused, or becomes sound bodies, and the same ones again.

#![no_main]

#[path = "../../formats/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::step(bytes));
