//! Chunks from anybody, cut anywhere, make messages or are refused.

#![no_main]

#[path = "../../proto/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::chunks(bytes));
