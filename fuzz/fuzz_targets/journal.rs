//! An extent in a damaged journal is refused, or survives being kept again.

#![no_main]

use horma_master::decoders::journal;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    journal(bytes);
});
