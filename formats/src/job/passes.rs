//! The sections on what is cut from what, in which passes, and what the cutter keeps out of.

use horma_core::{Error as Refused, Interval, Job, KeepOut, Motion, Section, Solid};

use super::JobFile;
use super::raw::{At, Given, RawJob, RawKeepOut, RawRoughing, RawStock};
use super::source::Source;
use crate::error::{Error, Result};

/// How the stock is roughed before the finishing pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughing {
    /// What is left for the finishing pass, mm normal to the surface.
    pub allowance: f64,
    /// The most that a layer takes, mm along the attack axis.
    pub depth_of_cut: f64,
    /// How the cutter travels.
    pub motion: Motion,
    /// Feed at the contact, mm/min.
    pub feed: f64,
    /// Most turns of the part a minute, if fewer than the machine's.
    pub turns: Option<f64>,
}

/// Keys and what they were given.
type Keys<'a> = [(&'static str, &'a Option<Given<f64>>)];

pub(super) const STOCKS: [&str; 2] = ["cylinder", "block"];

/// Largest allowance and depth of cut, mm.
const MOST: f64 = 1000.0;

impl Roughing {
    /// What the roughing's target is made by: `job` with a cutter that is grown by the allowance.
    ///
    /// # Errors
    /// [`horma_core::Error::OutOfBounds`] if that is too large for a cutter.
    pub fn target(&self, job: Job) -> Result<Job> {
        Ok(Job {
            cutter: job.cutter.grown(self.allowance)?,
            motion: self.motion,
            ..job
        })
    }
}

impl JobFile {
    /// What has to be digitized, in the order in which it is cut; the last one is the finishing pass.
    ///
    /// # Errors
    /// Those of [`Roughing::target`].
    pub fn targets(&self) -> Result<Vec<Job>> {
        let roughing = self.roughing.iter().map(|r| r.target(self.job));
        roughing.chain([Ok(self.job)]).collect()
    }

    /// How far out the cutter's centre has to be to stay clear of stock and keep-outs, mm; nothing if the
    /// job speaks of neither.
    pub fn clear(&self) -> Option<f64> {
        let kept = self.keep_outs.iter().map(KeepOut::solid);
        let solids = kept.chain(self.stock);
        let reach = solids.map(|s| s.reach()).reduce(f64::max);
        reach.map(|reach| reach + self.job.cutter.max_radius())
    }
}

impl Source<'_> {
    pub(super) fn keep_outs(&self, raw: &RawJob) -> Result<Vec<KeepOut>> {
        let all = raw.keep_out.iter();
        all.map(|section| {
            let RawKeepOut {
                from,
                to,
                radius,
                margin,
            } = &section.value;
            let given = |value: &Option<Given<f64>>, example| {
                self.required(section, value.as_ref(), "[keep_out]", example)
                    .copied()
            };
            let keep_out = KeepOut {
                x: Interval {
                    low: given(from, "from = -60")?,
                    high: given(to, "to = -12")?,
                },
                radius: given(radius, "radius = 60")?,
                margin: margin.as_ref().map_or(0.0, |g| g.value),
            };
            let keys = [
                ("from", from),
                ("to", to),
                ("radius", radius),
                ("margin", margin),
            ];
            let valid = keep_out.validate();
            valid.map_err(|e| self.at_key(&e, &section.at, &keys))?;
            Ok(keep_out)
        })
        .collect()
    }

    pub(super) fn stock(&self, raw: &RawJob) -> Result<Option<Solid>> {
        let Some(section) = &raw.stock else {
            return Ok(None);
        };
        let RawStock {
            kind,
            radius,
            height,
            width,
            from,
            to,
        } = &section.value;
        self.required(section, kind.as_ref(), "stock", "kind = \"cylinder\"")?;
        let known = STOCKS.map(|kind| (kind, kind));
        let kind = self.choose(kind.as_ref(), "stock", STOCKS[0], &known)?;
        let given = |value: &Option<Given<f64>>, key: &str| match value {
            Some(given) => Ok(given.value),
            None => Err(self.wrong(Some(&section.at), format!("a {kind} needs {key}, in mm"))),
        };
        let foreign = |given: &Option<Given<f64>>, key: &str| match given {
            None => Ok(()),
            Some(given) => {
                let keys = ["radius", "height and width"][usize::from(kind == STOCKS[1])];
                let what = format!("{key} does not belong to a {kind}, which has {keys}");
                Err(self.wrong(Some(&given.at), what))
            }
        };
        let cross_section = if kind == STOCKS[0] {
            foreign(height, "height")?;
            foreign(width, "width")?;
            Section::Disc {
                radius: given(radius, "radius")?,
            }
        } else {
            foreign(radius, "radius")?;
            Section::Rectangle {
                height: given(height, "height")?,
                width: given(width, "width")?,
            }
        };
        let end = |given: &Option<Given<f64>>, far| given.as_ref().map_or(far, |g| g.value);
        let solid = Solid {
            x: Interval {
                low: end(from, f64::NEG_INFINITY),
                high: end(to, f64::INFINITY),
            },
            section: cross_section,
        };
        let keys = [
            ("radius", radius),
            ("height", height),
            ("width", width),
            ("from", from),
            ("to", to),
        ];
        let valid = solid.validate();
        valid.map_err(|e| self.at_key(&e, &section.at, &keys))?;
        Ok(Some(solid))
    }

    /// The roughing of a job, which cuts as `job` does where the section says nothing else.
    pub(super) fn roughing(&self, raw: &RawJob, job: Job, feed: f64) -> Result<Option<Roughing>> {
        let Some(section) = &raw.roughing else {
            return Ok(None);
        };
        if raw.stock.is_none() {
            let what =
                "[roughing] needs a [stock] to begin with, as in kind = \"cylinder\", radius = 70";
            return Err(self.wrong(Some(&section.at), what));
        }
        let RawRoughing {
            allowance,
            depth_of_cut,
            step,
            points_per_revolution: points,
            path_tolerance,
            feed: own_feed,
            turns,
        } = &section.value;
        self.required(section, allowance.as_ref(), "roughing", "allowance = 1.0")?;
        self.required(
            section,
            depth_of_cut.as_ref(),
            "roughing",
            "depth_of_cut = 10.0",
        )?;
        let step_given = self.required(section, step.as_ref(), "roughing", "step = 5.0")?;
        let points_given = points.as_ref();
        let points_given = points_given.map(|p| self.count(p, "points_per_revolution"));
        let roughing = Roughing {
            allowance: self.number(
                allowance.as_ref(),
                "allowance",
                0.0,
                "from 0 to 1000 mm",
                |v| (0.0..=MOST).contains(&v),
            )?,
            depth_of_cut: self.number(
                depth_of_cut.as_ref(),
                "depth_of_cut",
                0.0,
                "greater than 0 and at most 1000 mm",
                |v| v > 0.0 && v <= MOST,
            )?,
            motion: Motion {
                step: *step_given,
                points_per_revolution: points_given
                    .transpose()?
                    .unwrap_or(job.motion.points_per_revolution),
                path_tolerance: path_tolerance.as_ref().map(|g| g.value),
                ..job.motion
            },
            feed: self.number(
                own_feed.as_ref(),
                "feed",
                feed,
                "greater than 0 and at most 1000000 mm/min",
                |v| v > 0.0 && v <= 1.0e6,
            )?,
            turns: match turns {
                None => None,
                Some(turns) => Some(self.positive(turns, "turns", "a minute")?),
            },
        };
        let target = roughing.target(job).map_err(|_| {
            let what = "allowance makes the cutter larger than the 10 m that it may have";
            self.wrong(allowance.as_ref().map(|g| &g.at), what)
        })?;
        target.validate().map_err(|e| {
            if let (Refused::OutOfBounds { quantity, .. }, Some(points)) = (&e, points)
                && *quantity == "points_per_revolution"
            {
                return self.wrong(Some(&points.at), e.to_string());
            }
            let keys = [("step", step), ("path_tolerance", path_tolerance)];
            self.at_key(&e, &section.at, &keys)
        })?;
        Ok(Some(roughing))
    }

    /// What the core refuses of a section, at the key that it is about.
    fn at_key(&self, error: &Refused, section: &At, keys: &Keys) -> Error {
        let key = match error {
            Refused::OutOfBounds { quantity, .. } => quantity,
            Refused::EmptyTravel { .. } => "to",
            Refused::PathToleranceNeedsFallback => "path_tolerance",
            _ => "",
        };
        let given = keys.iter().find(|(name, _)| *name == key);
        let given = given.and_then(|(_, given)| given.as_ref());
        self.wrong(Some(given.map_or(section, |g| &g.at)), error.to_string())
    }
}

/// The sections as values again, each by its name.
pub(super) fn echo(job: &JobFile) -> Vec<(&'static str, serde_json::Value)> {
    use serde_json::json;
    let end = |x: f64| x.is_finite().then_some(x);
    let mut all = Vec::new();
    if let Some(Solid { x, section }) = job.stock {
        let (from, to) = (end(x.low), end(x.high));
        all.push((
            "stock",
            match section {
                Section::Disc { radius } => {
                    json!({ "kind": STOCKS[0], "radius": radius, "from": from, "to": to })
                }
                Section::Rectangle { height, width } => json!({
                    "kind": STOCKS[1], "height": height, "width": width, "from": from, "to": to
                }),
            },
        ));
    }
    if let Some(roughing) = &job.roughing {
        all.push((
            "roughing",
            json!({
                "allowance": roughing.allowance,
                "depth_of_cut": roughing.depth_of_cut,
                "step": roughing.motion.step,
                "points_per_revolution": roughing.motion.points_per_revolution,
                "path_tolerance": roughing.motion.path_tolerance,
                "feed": roughing.feed,
                "turns": roughing.turns,
            }),
        ));
    }
    if !job.keep_outs.is_empty() {
        let keep_outs = job.keep_outs.iter().map(
            |k| json!({ "from": k.x.low, "to": k.x.high, "radius": k.radius, "margin": k.margin }),
        );
        all.push(("keep_out", keep_outs.collect()));
    }
    all
}
