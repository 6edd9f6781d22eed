//! The section on how the cutter travels.

use horma_core::{Motion, MotionKind};

use super::raw::RawJob;
use super::source::Source;
use crate::error::Result;

pub(super) const KINDS: [(&str, MotionKind); 2] =
    [("helix", MotionKind::Helix), ("rings", MotionKind::Rings)];

impl Source<'_> {
    pub(super) fn motion(&self, raw: &RawJob) -> Result<Motion> {
        let Some(section) = &raw.motion else {
            let what = "there is no [motion]; say how the cutter travels, as in step = 2.0, \
                points_per_revolution = 360";
            return Err(self.wrong(None, what));
        };
        let motion = &section.value;
        let step = self.required(section, motion.step.as_ref(), "motion", "step = 2.0")?;
        let points = motion.points_per_revolution.as_ref();
        self.required(section, points, "motion", "points_per_revolution = 360")?;
        let points = points.map(|p| self.count(p, "points_per_revolution"));
        Ok(Motion {
            kind: self.choose(motion.kind.as_ref(), "motion", MotionKind::Helix, &KINDS)?,
            step: *step,
            points_per_revolution: points.transpose()?.unwrap_or_default(),
            from: motion.from.as_ref().map(|g| g.value),
            to: motion.to.as_ref().map(|g| g.value),
            path_tolerance: motion.path_tolerance.as_ref().map(|g| g.value),
            lead: [&motion.lead_in, &motion.lead_out].map(|g| g.as_ref().map_or(0.0, |g| g.value)),
        })
    }
}
