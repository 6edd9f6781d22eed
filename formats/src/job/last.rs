//! The sections on a last: what it is in the part, how it is graded, where its landmarks are.

use horma_core::{Choice, Frame, Grading, Hold, Landmark, Last, System};
use serde_json::{Map, Value, json};

use super::raw::{Given, RawGrading, RawJob};
use super::source::Source;
use crate::error::{Error, Result};

/// Which foot a last is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Side {
    /// What it is called wherever it is typed or shown.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// What a job says of a last.
#[derive(Debug, Clone, PartialEq)]
pub struct LastOf {
    /// What it is in the part, and how it lies.
    pub last: Last,
    /// Whether the toe is at the greatest travel.
    pub toe_at_greatest: bool,
    /// Square to the ground, in the part frame.
    pub up: [f64; 3],
    /// Which foot the files are for.
    pub files_side: Side,
    /// How it is graded, if it is.
    pub grading: Option<Grading>,
    /// The size that is to be made: the base if there is none.
    pub size: Option<f64>,
    /// The side that is to be made.
    pub side: Side,
}

impl LastOf {
    /// How it is graded, and to which size, unless that is the files' own.
    pub fn graded(&self) -> Option<(&Grading, f64)> {
        let grading = self.grading.as_ref()?;
        let size = self.size.filter(|&size| size != grading.base)?;
        Some((grading, size))
    }

    /// Whether it is for the other foot than the files.
    pub fn mirrored(&self) -> bool {
        self.side != self.files_side
    }
}

pub(super) const SIDES: [(&str, Side); 2] = [("right", Side::Right), ("left", Side::Left)];
const TOES: [(&str, bool); 2] = [("+x", true), ("-x", false)];
pub(super) const SYSTEMS: [(&str, System); 3] = [
    ("paris", System::Paris),
    ("uk", System::Uk),
    ("us", System::Us),
];
const METHODS: [(&str, bool); 2] = [("arithmetic", false), ("geometric", true)];
const HOLDS: [&str; 3] = ["heel_height", "toe_spring", "toe_thickness"];

impl Source<'_> {
    /// What a job says of its last; nothing if it does not speak of one.
    pub(super) fn last(&self, raw: &RawJob) -> Result<Option<LastOf>> {
        let section = &raw.last;
        let (size, side) = (&section.make.size, &section.make.side);
        let spoken = section.given || raw.grading.is_some() || !raw.measures.is_empty();
        if !spoken && size.is_none() && side.is_none() {
            return Ok(None);
        }
        let up = section.up.as_ref().map_or([0.0, 0.0, 1.0], |g| g.value);
        let toe_at_greatest = self.choose(section.toe.as_ref(), "toe", true, &TOES)?;
        let files_side = self.choose(section.side.as_ref(), "side", Side::Right, &SIDES)?;
        let frame = Frame::new(toe_at_greatest, up, files_side == Side::Right).map_err(|_| {
            let what = "up must be a direction [x, y, z] that is not along the spindle";
            self.wrong(section.up.as_ref().map(|g| &g.at), what)
        })?;
        let grading = raw.grading.as_ref().map(|g| self.grading(g)).transpose()?;
        let size = match (size, &grading) {
            (Some(given), None) => {
                let what = "a size is asked for, but there is no [grading]; say what size the files \
                    are, as in base = 37";
                return Err(self.wrong(Some(&given.at), what));
            }
            (size, _) => size.as_ref().map(|g| g.value),
        };
        let bodies = section.bodies.as_ref();
        Ok(Some(LastOf {
            last: Last {
                bodies: bodies.map_or_else(Vec::new, |g| g.value.clone()),
                frame,
                choices: self.landmarks(raw)?,
            },
            toe_at_greatest,
            up,
            files_side,
            grading,
            size,
            side: self.choose(side.as_ref(), "side", files_side, &SIDES)?,
        }))
    }

    fn grading(&self, section: &Given<RawGrading>) -> Result<Grading> {
        let grading = &section.value;
        let base = self.required(section, grading.base.as_ref(), "grading", "base = 37")?;
        if !base.is_finite() {
            let what = format!("base is {base}, but must be a size");
            return Err(self.wrong(grading.base.as_ref().map(|g| &g.at), what));
        }
        let mut hold = Hold::default();
        for name in grading.hold.iter().flat_map(|g| &g.value) {
            match HOLDS.iter().position(|h| h == name) {
                Some(0) => hold.heel_height = true,
                Some(1) => hold.toe_spring = true,
                Some(_) => hold.toe_thickness = true,
                None => {
                    let what = format!("cannot hold '{name}'; known: {}", HOLDS.join(", "));
                    return Err(self.wrong(grading.hold.as_ref().map(|g| &g.at), what));
                }
            }
        }
        Ok(Grading {
            base: *base,
            system: self.choose(grading.system.as_ref(), "system", System::Paris, &SYSTEMS)?,
            geometric: self.choose(grading.method.as_ref(), "method", false, &METHODS)?,
            hold,
        })
    }

    fn landmarks(&self, raw: &RawJob) -> Result<Vec<(Landmark, Choice)>> {
        let given = raw.measures.iter();
        given
            .map(|(name, given)| {
                let landmark = Landmark::ALL.into_iter().find(|l| l.name() == name);
                let landmark = landmark.ok_or_else(|| {
                    let known = Landmark::ALL.map(Landmark::name).join(", ");
                    self.wrong(
                        Some(&given.at),
                        format!("unknown landmark '{name}'; known: {known}"),
                    )
                })?;
                Ok((landmark, self.choice(name, given)?))
            })
            .collect()
    }

    fn choice(&self, name: &str, given: &Given<toml::Value>) -> Result<Choice> {
        let wrong = || -> Error {
            let what = format!(
                "{name} must be a point [x, y, z] in the part frame, mm, or a share of the last's \
                 length, 0 at the heel and 1 at the toe"
            );
            self.wrong(Some(&given.at), what)
        };
        if let Ok(point) = given.value.clone().try_into::<[f64; 3]>() {
            let ok = point.iter().all(|c| c.is_finite());
            return ok.then_some(Choice::At(point)).ok_or_else(wrong);
        }
        let share = given.value.clone().try_into::<f64>().map_err(|_| wrong())?;
        let ok = (0.0..=1.0).contains(&share);
        ok.then_some(Choice::Share(share)).ok_or_else(wrong)
    }
}

/// The sections on a last as values again, for the report.
pub(super) fn echo(of: &LastOf) -> [(&'static str, Value); 3] {
    let name_of = super::echo::name_of::<bool>;
    let mut make = Map::new();
    if let Some(size) = of.size {
        make.insert("size".to_owned(), json!(size));
    }
    make.insert("side".to_owned(), json!(of.side.name()));
    let last = json!({
        "bodies": of.last.bodies,
        "toe": name_of(&TOES, &of.toe_at_greatest),
        "up": of.up,
        "side": of.files_side.name(),
        "make": make,
    });
    let grading = of.grading.map_or(Value::Null, |g| {
        let held = [g.hold.heel_height, g.hold.toe_spring, g.hold.toe_thickness];
        let held = HOLDS.iter().zip(held).filter(|(_, held)| *held);
        json!({
            "base": g.base,
            "system": super::echo::name_of(&SYSTEMS, &g.system),
            "method": name_of(&METHODS, &g.geometric),
            "hold": held.map(|(name, _)| *name).collect::<Vec<_>>(),
        })
    });
    let choices = of.last.choices.iter().map(|(landmark, choice)| {
        let choice = match choice {
            Choice::At(point) => json!(point),
            Choice::Share(share) => json!(share),
        };
        (landmark.name().to_owned(), choice)
    });
    let measures = choices.collect::<Map<_, _>>().into();
    [("last", last), ("grading", grading), ("measures", measures)]
}
