//! The section on output: what is written beside the path, its program and its report.

use super::raw::RawJob;
use super::source::Source;
use crate::also::Also;
use crate::error::Result;

impl Source<'_> {
    pub(super) fn also(&self, raw: &RawJob) -> Result<Vec<Also>> {
        let Some(given) = &raw.output.also else {
            return Ok(Vec::new());
        };
        let mut all = Vec::new();
        for name in &given.value {
            let Some(also) = Also::named(name) else {
                let known = Also::ALL.map(Also::name).join(", ");
                let what = format!("also names {name:?}, but what can be written is {known}");
                return Err(self.wrong(Some(&given.at), what));
            };
            if !all.contains(&also) {
                all.push(also);
            }
        }
        Ok(all)
    }
}
