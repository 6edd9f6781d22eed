//! The `horma` command: what was typed becomes a call, and its end an exit code.
//!
//! Everything that touches the user is here and nothing else: arguments, progress, signals, messages.

mod args;
mod error;

mod passes;
mod pipeline;
mod program;
mod results;
mod run;

mod client;
mod cluster;
mod examine;
mod forecast;
mod here;
mod jobs;
mod lasts;
mod machined;
mod sizes;
mod submit;
mod tls;
mod verify;
mod watch;

mod bench;
mod certs;
mod doctor;
mod http;
mod inspect;
mod manual;
mod papers;
mod reach;
mod serve;
mod view;

mod progress;
mod system;
mod traces;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;

use args::{Arguments, Command};
use error::{Error, Result};
use traces::Traces;
use tracing::info_span;
use tracing_subscriber::filter::{EnvFilter, FilterExt, filter_fn};
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let traces = arguments.command.traces();
    let traces = traces.map(|(service, collector)| Traces::begin(service, collector));
    let traces = match traces.transpose() {
        Ok(traces) => traces,
        Err(error) => return exit_code(Err(error)),
    };
    let filter = EnvFilter::builder().parse_lossy(&arguments.log);
    // What is logged names what it is about. Spans are for traces.
    let log = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .with_filter(filter.and(filter_fn(|what| !what.is_span())));
    tracing_subscriber::registry()
        .with(log)
        .with(traces.as_ref().map(Traces::layer))
        .init();
    let ended = execute(arguments);
    if let Some(traces) = traces {
        traces.end();
    }
    exit_code(ended)
}

/// Measures the kernel on the sample, quickly: what `cargo bench` runs. Results go to `output`.
pub fn bench_kernel(output: &Path) -> ExitCode {
    exit_code(bench::kernel(&args::BenchKernel {
        job: None,
        output: output.to_owned(),
        quick: true,
        motion: args::BenchMotion::default(),
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
        Command::Run(run) => info_span!("run").in_scope(|| run::run(&run)),
        Command::Submit(submit) => info_span!("submit").in_scope(|| run::submit(&submit)),
        Command::Status(args) => jobs::status(&args),
        Command::Cancel(args) => jobs::cancel(&args),
        Command::Fetch(args) => run::fetch(args),
        Command::Verify(args) => verify::verify(&args),
        Command::Machined(args) => machined::machined(&args),
        Command::Measure(args) => lasts::measure(&args),
        Command::View(args) => view::view(&args),
        Command::Master(master) => serve::master(&master),
        Command::Worker(worker) => serve::worker(worker),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Certs(certs) => certs::certs(&certs),
        Command::Init { directory } => inspect::init(&directory),
        Command::Inspect { files, units, html } => {
            inspect::inspect(&files, units.as_ref(), html.as_deref())
        }
        Command::Bench(args::Bench::Kernel(bench)) => bench::kernel(&bench),
        Command::Bench(args::Bench::Scaling(bench)) => bench::scaling(&bench),
        Command::Papers(args) => papers::papers(&args),
        Command::Completions { shell } => {
            manual::completions(shell);
            Ok(())
        }
        Command::Man { directory } => manual::pages(&directory),
    }
}

/// Writes to standard output; a reader that has gone away is no error.
fn say(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}
