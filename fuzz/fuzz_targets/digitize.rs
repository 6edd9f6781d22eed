//! A task from anybody, with its rows or grids, is refused or holds together.

#![no_main]

use horma_worker::decoders::digitize;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    digitize(bytes);
});
