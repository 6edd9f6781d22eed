//! The `horma` command: what was typed becomes a call, and its end an exit code.
//!
//! Everything that touches the user is here and nothing else: arguments, progress, signals, messages.

mod args;
mod error;

mod program;
mod run;

mod client;
mod cluster;
mod here;
mod jobs;
mod submit;
mod tls;
mod verify;

mod bench;
mod certs;
mod doctor;
mod http;
mod inspect;
mod reach;
mod serve;

mod progress;
mod system;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;

use args::{Arguments, Command};
use error::{Error, Result};

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let filter = tracing_subscriber::EnvFilter::builder().parse_lossy(&arguments.log);
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .init();
    exit_code(execute(arguments))
}

/// Measures the kernel on the sample, quickly: what `cargo bench` runs. Results go to `output`.
pub fn bench_kernel(output: &Path) -> ExitCode {
    exit_code(bench::kernel(&args::BenchKernel {
        job: None,
        output: output.to_owned(),
        quick: true,
        quiet: false,
    }))
}

fn exit_code(ended: Result<()>) -> ExitCode {
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(Error::Interrupted) => ExitCode::from(Error::Interrupted.exit_code()),
        Err(error) => {
            // Standard error may be closed; the exit code still tells.
            let _ = writeln!(std::io::stderr(), "horma: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn execute(arguments: Arguments) -> Result<()> {
    match arguments.command {
        Command::Run(run) => run::run(&run),
        Command::Submit(submit) => run::submit(&submit),
        Command::Status(args) => jobs::status(&args),
        Command::Cancel(args) => jobs::cancel(&args),
        Command::Fetch(args) => run::fetch(args),
        Command::Verify(args) => verify::verify(&args),
        Command::Master(master) => serve::master(&master),
        Command::Worker(worker) => serve::worker(worker),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Certs(certs) => certs::certs(&certs),
        Command::Init { directory } => inspect::init(&directory),
        Command::Inspect { files } => inspect::inspect(&files),
        Command::Bench(args::Bench::Kernel(bench)) => bench::kernel(&bench),
        Command::Bench(args::Bench::Scaling(bench)) => bench::scaling(&bench),
        Command::Completions { shell } => {
            args::print_completions(shell);
            Ok(())
        }
    }
}

/// Writes to standard output; a reader that has gone away is no error.
fn say(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}
