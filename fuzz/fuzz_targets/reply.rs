//! A worker's answer from anybody is refused, or survives being sent again.

#![no_main]

#[path = "../../proto/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::reply(bytes));
