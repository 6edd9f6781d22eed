//! `cargo bench`: the quick bench of the kernel on the sample, with its results in `target/bench`.
//! `horma bench kernel` is the full one, and takes any job.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    // Only `cargo bench` says so; `cargo test --benches` wants to know that it builds.
    if !std::env::args().any(|argument| argument == "--bench") {
        return ExitCode::SUCCESS;
    }
    horma_cli::bench_kernel(&Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("bench"))
}
