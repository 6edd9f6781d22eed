//! The exact digitizer equals brute force bit for bit, whatever part and job the bytes stand for.

#![no_main]

#[path = "../../core/tests/common/mod.rs"]
mod common;

use common::Case;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Some(case) = Case::from_bytes(bytes)
        && let Err(difference) = case.check()
    {
        panic!("{difference}\n{case:?}");
    }
});
