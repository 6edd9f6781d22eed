//! Rows that anybody wants held are refused, or in order.

#![no_main]

use horma_worker::decoders::place;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    place(bytes);
});
