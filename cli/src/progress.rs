//! Progress: a bar for each phase on a terminal, plain lines elsewhere, nothing if quiet.

use std::io::{IsTerminal, Write, stderr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// How often plain lines tell of a phase that takes long.
const LINE_EVERY: Duration = Duration::from_secs(5);

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
    Nothing,
}

struct Phase {
    name: &'static str,
    begin: Instant,
    told: Instant,
    done: u64,
    bar: ProgressBar,
}

impl Display {
    pub fn new(quiet: bool) -> Self {
        let kind = if quiet {
            Kind::Nothing
        } else if stderr().is_terminal() {
            Kind::Bars
        } else {
            Kind::Lines
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
            if self.kind == Kind::Lines && total > 0 && phase.told.elapsed() >= LINE_EVERY {
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
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        match (self.kind, current.as_ref()) {
            (Kind::Nothing, _) => {}
            (Kind::Bars, Some(phase)) => phase.bar.suspend(|| line(text)),
            (Kind::Bars | Kind::Lines, _) => line(text),
        }
    }

    fn begin(&self, name: &'static str, total: u64) -> Phase {
        let target = match self.kind {
            Kind::Bars => ProgressDrawTarget::stderr(),
            Kind::Lines | Kind::Nothing => ProgressDrawTarget::hidden(),
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
        if done > 0 {
            let rate = done as f64 / seconds;
            line(&format!(
                "{name:<10} {seconds:>8.3} s   {done} positions, {rate:.0}/s"
            ));
        } else {
            line(&format!("{name:<10} {seconds:>8.3} s"));
        }
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
