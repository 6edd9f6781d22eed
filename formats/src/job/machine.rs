//! The section on the machine: how far, how fast and how hard each axis goes.

use std::ops::RangeInclusive;

use horma_core::{AxisLimits, Limits, MachineAxis};

use super::raw::{Given, RawAxisLimits, RawJob};
use super::source::Source;
use crate::error::Result;
use crate::post::Program;

/// What the machine can do, as far as the job says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Machine {
    /// Least and greatest position of travel and attack that a program may ask for, mm.
    pub ranges: [Option<RangeInclusive<f64>>; 2],
    /// Velocity, acceleration and jerk of each axis, in mm or degrees, and seconds.
    pub axes: [[Option<f64>; 3]; 3],
    /// Most turns of the part a minute.
    pub turns: Option<f64>,
}

/// The limits of an axis, by their keys in the order of [`Machine::axes`].
pub(super) const LIMITS: [&str; 3] = ["velocity", "acceleration", "jerk"];

impl Machine {
    /// What the moves of a pass have to keep to: at this feed, mm/min, and at most so many turns a minute, if
    /// the machine does not make fewer.
    pub fn limits(&self, program: &Program, feed: f64, turns: Option<f64>) -> Limits {
        let mut axes = self.axes.map(|limits| {
            let [velocity, acceleration, jerk] = limits.map(|l| l.unwrap_or(f64::INFINITY));
            AxisLimits {
                velocity,
                acceleration,
                jerk,
            }
        });
        let rotation = &mut axes[MachineAxis::Rotation as usize];
        for turns in self.turns.into_iter().chain(turns) {
            rotation.velocity = rotation.velocity.min(6.0 * turns);
        }
        Limits {
            feed: feed / 60.0,
            shortest: program.shortest(),
            axes,
        }
    }
}

impl Source<'_> {
    pub(super) fn machine(&self, raw: &RawJob) -> Result<Machine> {
        let section = &raw.machine;
        let mut machine = Machine::default();
        let given = [&section.travel, &section.attack, &section.rotation];
        for (axis, given) in given.into_iter().enumerate() {
            let Some(given) = given else { continue };
            machine.axes[axis] = self.axis_limits(MachineAxis::ALL[axis], given)?;
            match (&given.value.range, machine.ranges.get_mut(axis)) {
                (None, _) => {}
                (Some(range), Some(place)) => *place = Some(self.range(axis, range)?),
                (Some(range), None) => {
                    let what = "rotation has no range: it turns on and on";
                    return Err(self.wrong(Some(&range.at), what));
                }
            }
        }
        if let Some(turns) = &section.turns {
            machine.turns = Some(self.positive(turns, "turns", "a minute")?);
        }
        Ok(machine)
    }

    fn axis_limits(
        &self,
        axis: MachineAxis,
        given: &Given<RawAxisLimits>,
    ) -> Result<[Option<f64>; 3]> {
        let RawAxisLimits {
            velocity,
            acceleration,
            jerk,
            ..
        } = &given.value;
        let unit = match axis {
            MachineAxis::Travel | MachineAxis::Attack => "mm",
            MachineAxis::Rotation => "degrees",
        };
        let mut limits = [None; 3];
        let all = [velocity, acceleration, jerk].into_iter().zip(LIMITS);
        for ((given, key), limit) in all.zip(&mut limits) {
            let what = format!("{} of {}", key, axis.name());
            let given = given.as_ref();
            *limit = given.map(|g| self.positive(g, &what, unit)).transpose()?;
        }
        if let (None, Some(jerk)) = (acceleration, jerk) {
            let what = format!("jerk of {} needs its acceleration as well", axis.name());
            return Err(self.wrong(Some(&jerk.at), what));
        }
        Ok(limits)
    }

    fn range(&self, axis: usize, given: &Given<[f64; 2]>) -> Result<RangeInclusive<f64>> {
        let [least, most] = given.value;
        if least.is_finite() && most.is_finite() && least < most {
            return Ok(least..=most);
        }
        let name = MachineAxis::ALL[axis].name();
        let what = format!(
            "range of {name} is from {least} to {most}, but must be finite and end after it begins"
        );
        Err(self.wrong(Some(&given.at), what))
    }

    pub(super) fn positive(&self, given: &Given<f64>, what: &str, unit: &str) -> Result<f64> {
        if given.value.is_finite() && given.value > 0.0 {
            return Ok(given.value);
        }
        let what = format!(
            "{what} is {}, but must be greater than 0 ({unit})",
            given.value
        );
        Err(self.wrong(Some(&given.at), what))
    }
}
