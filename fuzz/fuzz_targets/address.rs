//! An address from anybody is refused, or can be dialled.

#![no_main]

#[path = "../../proto/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::address(bytes));
