//! Positions from anybody are refused, or survive being sent again.

#![no_main]

#[path = "../../proto/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::positions(bytes));
