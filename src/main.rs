//! The `horma` binary; everything it does is in `cli/`.

use std::process::ExitCode;

fn main() -> ExitCode {
    horma_cli::main()
}
