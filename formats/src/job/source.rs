//! The job file's text: values taken out of it, and errors that point into it.

use std::path::Path;

use super::place::Place;
use super::raw::{At, Given, RawJob};
use crate::error::{Error, Result};

/// The text that errors point into.
pub(super) struct Source<'a> {
    pub text: &'a str,
    pub path: &'a Path,
}

impl Source<'_> {
    /// A number within its bounds, or the default.
    pub fn number(
        &self,
        given: Option<&Given<f64>>,
        key: &str,
        default: f64,
        bound: &str,
        ok: fn(f64) -> bool,
    ) -> Result<f64> {
        let Some(given) = given else {
            return Ok(default);
        };
        if given.value.is_finite() && ok(given.value) {
            return Ok(given.value);
        }
        let what = format!("{key} is {}, but must be {bound}", given.value);
        Err(self.wrong(Some(&given.at), what))
    }

    pub fn required<'v, S, T>(
        &self,
        section: &Given<S>,
        value: Option<&'v Given<T>>,
        name: &str,
        example: &str,
    ) -> Result<&'v T> {
        value.map(|g| &g.value).ok_or_else(|| {
            let key = example.split(' ').next().unwrap_or_default();
            let what = format!("[{name}] has no {key}; give one, as in {example}");
            self.wrong(Some(&section.at), what)
        })
    }

    /// A number of things.
    pub fn count(&self, given: &Given<i64>, key: &str) -> Result<u32> {
        u32::try_from(given.value).map_err(|_| {
            let most = u32::MAX;
            let what = format!("{key} is {}, but must be from 0 to {most}", given.value);
            self.wrong(Some(&given.at), what)
        })
    }

    /// The one of `known` that is named, or the default.
    pub fn choose<T: Copy>(
        &self,
        given: Option<&Given<String>>,
        what: &str,
        default: T,
        known: &[(&str, T)],
    ) -> Result<T> {
        let Some(given) = given else {
            return Ok(default);
        };
        let found = known.iter().find(|(name, _)| *name == given.value);
        found.map(|&(_, value)| value).ok_or_else(|| {
            let known = known.iter().map(|(name, _)| *name).collect::<Vec<_>>();
            let what = format!(
                "unknown {what} '{}'; known: {}",
                given.value,
                known.join(", ")
            );
            self.wrong(Some(&given.at), what)
        })
    }

    /// What the core refuses, at the key that it is about.
    pub fn core(&self, raw: &RawJob, error: horma_core::Error) -> Error {
        let key = match &error {
            horma_core::Error::OutOfBounds { quantity, .. } => quantity,
            horma_core::Error::ConeTooSteep { .. } => "half_angle",
            horma_core::Error::EmptyTravel { .. } => "to",
            horma_core::Error::LocalNeedsPoints => "method",
            horma_core::Error::ToleranceTooFine { .. } => "tolerance",
            horma_core::Error::PathToleranceNeedsFallback => "path_tolerance",
            _ => return Error::Core(error),
        };
        self.wrong(raw.at(key), error.to_string())
    }

    pub fn wrong(&self, at: Option<&At>, what: impl Into<String>) -> Error {
        let place = match at {
            None => Place::File(self.path.to_owned()),
            Some(At::Flag(key)) => Place::Flag(key),
            Some(At::File(span)) => Place::of(self.path, self.text, span),
        };
        Error::Job {
            what: what.into(),
            place: Box::new(place),
        }
    }
}

/// The parser's message in the words of a job file.
pub(super) fn reworded(message: &str) -> String {
    let mut message = message.trim_end().replace('\n', ", ");
    for (theirs, ours) in [
        ("expected f64", "expected a number"),
        ("expected i64", "expected a whole number"),
        ("expected a sequence", "expected a list"),
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
    ] {
        message = message.replace(theirs, ours);
    }
    message
}
