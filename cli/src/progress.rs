//! What is told while a command works: on standard error a bar for each phase on a terminal and plain
//! lines elsewhere; or events for other programs, JSON, one a line, on standard output; or nothing.

use std::io::{IsTerminal, Write, stderr, stdout};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;

use crate::error::Error;
use crate::forecast::Forecast;

/// How often plain lines tell of a phase that takes long.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// How often events do.
const EVENT_EVERY: Duration = Duration::from_millis(200);

/// To whom it is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Audience {
    /// Whoever looks at the terminal.
    People,
    /// Whoever reads standard output, line by line.
    Programs,
    Nobody,
}

/// What a program is told. The names are a contract: they are added to, not changed.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(crate) enum Event<'a> {
    /// A phase has begun; the one before it has ended.
    Phase {
        name: &'a str,
    },
    /// Positions done so far in the phase, and of how many.
    Progress {
        name: &'a str,
        done: u64,
        total: u64,
    },
    /// A phase has ended.
    PhaseDone {
        name: &'a str,
        seconds: f64,
    },
    Warning {
        text: &'a str,
    },
    Note {
        text: &'a str,
    },
    /// What the job would be: `--dry-run`.
    Plan {
        plan: &'a Forecast,
    },
    /// A master has taken the job in.
    Submitted {
        job: u64,
    },
    /// All files are in place.
    Done {
        directory: &'a Path,
    },
    /// Nothing is; the text is what standard error says too.
    Failed {
        exit_code: u8,
        text: &'a str,
    },
    /// The run is over, and begins again when one of these changes.
    Watching {
        files: &'a [PathBuf],
    },
    /// This one has.
    Changed {
        file: &'a Path,
    },
}

/// Shows the progress of one run. Clones show the same.
#[derive(Clone)]
pub(crate) struct Display {
    kind: Kind,
    current: Arc<Mutex<Option<Phase>>>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Bars,
    Lines,
    Events,
    Nothing,
}

struct Phase {
    name: &'static str,
    begin: Instant,
    told: Instant,
    done: u64,
    bar: ProgressBar,
}

impl Audience {
    /// Whoever looks at the terminal, unless it is to be quiet.
    pub fn unless(quiet: bool) -> Self {
        if quiet { Self::Nobody } else { Self::People }
    }
}

impl Display {
    pub fn new(audience: Audience) -> Self {
        let kind = match audience {
            Audience::People if stderr().is_terminal() => Kind::Bars,
            Audience::People => Kind::Lines,
            Audience::Programs => Kind::Events,
            Audience::Nobody => Kind::Nothing,
        };
        Self {
            kind,
            current: Arc::default(),
        }
    }

    /// Tells that `done` of `total` of a phase is done; a new name ends the phase before. A total of
    /// 0 is an unknown one.
    pub fn tell(&self, name: &'static str, done: u64, total: u64) {
        if self.kind == Kind::Nothing {
            return;
        }
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if current.as_ref().is_none_or(|p| p.name != name) {
            self.end(current.take());
            *current = Some(self.begin(name, total));
        }
        if let Some(phase) = current.as_mut() {
            phase.done = phase.done.max(done);
            if total > 0 && phase.bar.length() != Some(total) {
                phase.bar.set_length(total);
                phase.bar.set_style(counted());
            }
            phase.bar.set_position(phase.done);
            let every = match self.kind {
                Kind::Events => EVENT_EVERY,
                Kind::Bars | Kind::Lines | Kind::Nothing => LINE_EVERY,
            };
            let due = total > 0 && phase.told.elapsed() >= every;
            if due && self.kind == Kind::Events {
                phase.told = Instant::now();
                let done = phase.done;
                event(&Event::Progress { name, done, total });
            } else if due && self.kind == Kind::Lines {
                phase.told = Instant::now();
                let elapsed = phase.begin.elapsed().as_secs_f64();
                let rate = phase.done as f64 / elapsed;
                let left = (total - phase.done.min(total)) as f64 / rate;
                line(&format!(
                    "{name}: {} of {total}, {rate:.0}/s, {left:.0} s left",
                    phase.done
                ));
            }
        }
    }

    /// Ends the last phase.
    pub fn finish(&self) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        self.end(current.take());
    }

    /// Says something beside the progress.
    pub fn note(&self, text: &str) {
        self.tell_of(text, &Event::Note { text });
    }

    /// Warns of something that does not end the run.
    pub fn warn(&self, text: &str) {
        self.tell_of(&format!("warning: {text}"), &Event::Warning { text });
    }

    /// Tells programs of something that people are told in another way.
    pub fn event(&self, what: &Event) {
        if self.kind == Kind::Events {
            event(what);
        }
    }

    /// Tells programs why there is no result; people read it when the process ends.
    pub fn failed(&self, error: &Error) {
        let text = &error.to_string();
        let exit_code = error.exit_code();
        self.event(&Event::Failed { exit_code, text });
    }

    /// Says something beside the progress to people, and tells programs of it in their way.
    pub fn tell_of(&self, text: &str, what: &Event) {
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        match (self.kind, current.as_ref()) {
            (Kind::Nothing, _) => {}
            (Kind::Events, _) => event(what),
            (Kind::Bars, Some(phase)) => phase.bar.suspend(|| line(text)),
            (Kind::Bars | Kind::Lines, _) => line(text),
        }
    }

    fn begin(&self, name: &'static str, total: u64) -> Phase {
        self.event(&Event::Phase { name });
        let target = match self.kind {
            Kind::Bars => ProgressDrawTarget::stderr(),
            Kind::Lines | Kind::Events | Kind::Nothing => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target((total > 0).then_some(total), target);
        bar.set_style(if total > 0 { counted() } else { uncounted() });
        bar.set_message(name);
        bar.enable_steady_tick(Duration::from_millis(100));
        Phase {
            name,
            begin: Instant::now(),
            told: Instant::now(),
            done: 0,
            bar,
        }
    }

    fn end(&self, phase: Option<Phase>) {
        let Some(Phase {
            name,
            begin,
            done,
            bar,
            ..
        }) = phase
        else {
            return;
        };
        bar.finish_and_clear();
        let seconds = begin.elapsed().as_secs_f64();
        if self.kind == Kind::Events {
            event(&Event::PhaseDone { name, seconds });
        } else if done > 0 {
            let rate = done as f64 / seconds;
            line(&format!(
                "{name:<10} {seconds:>8.3} s   {done} positions, {rate:.0}/s"
            ));
        } else {
            line(&format!("{name:<10} {seconds:>8.3} s"));
        }
    }
}

fn event(what: &Event) {
    if let Ok(text) = serde_json::to_string(what) {
        // Nobody may be listening.
        let _ = writeln!(stdout(), "{text}");
    }
}

fn line(text: &str) {
    // Nobody may be listening.
    let _ = writeln!(stderr(), "{text}");
}

fn counted() -> ProgressStyle {
    style("{msg:<10} {wide_bar} {human_pos}/{human_len}  {rate}  {eta} left")
}

fn uncounted() -> ProgressStyle {
    style("{msg:<10} {spinner} {elapsed}")
}

fn style(template: &str) -> ProgressStyle {
    let style = ProgressStyle::with_template(template);
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
    style.with_key(
        "rate",
        |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // A bar that cannot be drawn is not worth an error.
            let _ = write!(out, "{:.0}/s", state.per_sec());
        },
    )
}
