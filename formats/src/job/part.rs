//! The section on the part: its files, what is said of them, and the spindle.

use std::path::{Path, PathBuf};

use horma_core::{Axis, Point, unit};

use super::raw::{Given, RawAxis, RawJob};
use super::source::{Source, reworded};
use crate::error::Result;
use crate::part::{Reading, Trimmed, UNIT_NAMES, Unit};

pub(super) const TRIMMED: [(&str, Trimmed); 2] =
    [("refuse", Trimmed::Refuse), ("whole", Trimmed::Whole)];

impl Source<'_> {
    pub(super) fn part(&self, raw: &RawJob) -> Result<(Vec<PathBuf>, Reading, Axis)> {
        let Some(part) = &raw.part else {
            let what = "there is no [part]; say what to machine, as in files = [\"last.step\"]";
            return Err(self.wrong(None, what));
        };
        let files = self.required(
            part,
            part.value.files.as_ref(),
            "part",
            "files = [\"last.step\"]",
        )?;
        let files_at = part.value.files.as_ref().map(|f| &f.at);
        if files.is_empty() || files.iter().any(|f| f.as_os_str().is_empty()) {
            let what = "files must name at least one file, as in files = [\"last.step\"]";
            return Err(self.wrong(files_at, what));
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let files = files.iter().map(|f| folder.join(f)).collect();
        let axis = part.value.axis.as_ref();
        let axis = axis.map_or(Ok(Axis::default()), |a| self.axis(a))?;
        let trimmed = part.value.trimmed.as_ref();
        let reading = Reading {
            unit: part
                .value
                .units
                .as_ref()
                .map(|u| self.unit(u))
                .transpose()?,
            trimmed: self.choose(trimmed, "trimmed", Trimmed::Refuse, &TRIMMED)?,
        };
        Ok((files, reading, axis))
    }

    fn unit(&self, given: &Given<String>) -> Result<Unit> {
        Unit::named(&given.value).ok_or_else(|| {
            let what = format!("unknown unit '{}'; known: {UNIT_NAMES}", given.value);
            self.wrong(Some(&given.at), what)
        })
    }

    fn axis(&self, given: &Given<toml::Value>) -> Result<Axis> {
        const FORM: &str = "axis must be \"auto\" or { point = [x, y, z], direction = [x, y, z] }";
        if given.value.as_str() == Some("auto") {
            return Ok(Axis::Principal);
        }
        let wrong = |what: String| self.wrong(Some(&given.at), what);
        let raw: RawAxis = given
            .value
            .clone()
            .try_into()
            .map_err(|e: toml::de::Error| wrong(format!("{FORM}: {}", reworded(e.message()))))?;
        let point: Point = raw.point.unwrap_or_default();
        let direction = raw.direction.unwrap_or([1.0, 0.0, 0.0]);
        if let Some(c) = point.into_iter().find(|c| !c.is_finite()) {
            return Err(wrong(format!(
                "axis.point has the coordinate {c}, but must be finite"
            )));
        }
        if unit(direction).is_none() {
            return Err(wrong(
                horma_core::Error::NoDirection { direction }.to_string(),
            ));
        }
        Ok(Axis::Through { point, direction })
    }
}
