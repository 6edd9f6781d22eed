//! A job from anybody, with its part, is refused or survives being kept.

#![no_main]

use horma_master::decoders::submission;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    submission(bytes);
});
