//! A job in a damaged store is refused, or survives being kept again.

#![no_main]

use horma_master::decoders::entry;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    entry(bytes);
});
