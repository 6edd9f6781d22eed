//! A path from anybody is refused, or has rows that follow each other.

#![no_main]

#[path = "../../formats/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::path(bytes));
