//! A path from anybody is refused, or has each position once.

#![no_main]

#[path = "../../proto/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::path(bytes));
