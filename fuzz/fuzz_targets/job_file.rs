//! A job file from anybody is refused, or means the same every time.

#![no_main]

#[path = "../../formats/tests/common/mod.rs"]
mod common;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| common::job_file(bytes));
