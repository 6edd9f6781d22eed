//! The section on the program: whose dialect, and what shops do differently.

use horma_core::MachineAxis;

use super::raw::{At, Given, RawDecimals, RawJob, RawProgram, RawSplit};
use super::source::Source;
use super::{DEFAULT_CLEARANCE, DEFAULT_FEED};
use crate::error::Result;
use crate::post::{
    Angles, Control, Counted, Dialect, FeedMode, Program, Programmed, Split, Units, Word,
};

pub(super) const CONTROLS: [(&str, Control); 6] = {
    let [a, b, c, d, e, f] = Control::ALL;
    [
        (a.dialect().name, a),
        (b.dialect().name, b),
        (c.dialect().name, c),
        (d.dialect().name, d),
        (e.dialect().name, e),
        (f.dialect().name, f),
    ]
};
pub(super) const UNITS: [(&str, Units); 2] = [("mm", Units::Mm), ("inch", Units::Inch)];
pub(super) const POINTS: [(&str, Programmed); 2] =
    [("centre", Programmed::Centre), ("tip", Programmed::Tip)];
pub(super) const ANGLES: [(&str, Angles); 3] = [
    ("unwound", Angles::Unwound),
    ("modulo", Angles::Modulo),
    ("rezero", Angles::Rezero),
];
pub(super) const FEED_MODES: [(&str, FeedMode); 3] = [
    ("inverse", FeedMode::Inverse),
    ("minute", FeedMode::Minute),
    ("degrees", FeedMode::Degrees),
];

/// The axes of a job that does not say.
const LETTERS: [char; 3] = ['X', 'Y', 'A'];
/// What each axis may be called.
const CHOICES: [&str; 3] = ["XYZ", "XYZ", "ABC"];
/// Most decimals of an axis: finer than any machine, and well within what is counted.
const MOST_DECIMALS: i64 = 6;
/// Fewest bytes of a file of a split program: room for its heading and some moves.
const LEAST_BYTES: i64 = 10_000;

impl Source<'_> {
    pub(super) fn program(&self, raw: &RawJob) -> Result<Program> {
        let section = &raw.program;
        let control = section.dialect.as_ref();
        let control = self.choose(control, "dialect", Control::LinuxCnc, &CONTROLS)?;
        let dialect = control.dialect();
        let units = self.choose(section.units.as_ref(), "units", Units::Mm, &UNITS)?;
        let point = section.point.as_ref();
        let angles = section.angles.as_ref();
        let mode = section.feed_mode.as_ref();
        let program = Program {
            control,
            words: self.words(section)?,
            decimals: self.decimals(section.decimals.as_ref(), dialect, units)?,
            units,
            point: self.choose(point, "point", Programmed::Centre, &POINTS)?,
            angles: self.choose(angles, "angles", Angles::Unwound, &ANGLES)?,
            feed_mode: self.choose(mode, "feed_mode", FeedMode::Inverse, &FEED_MODES)?,
            split: self.split(section.split.as_ref())?,
            apt: section.apt.as_ref().is_some_and(|g| g.value),
            block_numbers: self.block_numbers(section.block_numbers.as_ref(), dialect)?,
            feed: self.number(
                section.feed.as_ref(),
                "feed",
                DEFAULT_FEED,
                "greater than 0 and at most 1000000 mm/min",
                |v| v > 0.0 && v <= 1.0e6,
            )?,
            clearance: self.number(
                section.clearance.as_ref(),
                "clearance",
                DEFAULT_CLEARANCE,
                "from 0 to 10000 mm",
                |v| (0.0..=1.0e4).contains(&v),
            )?,
        };
        self.angles_fit(raw, &program)?;
        self.feed_mode_fits(section, &program)?;
        Ok(program)
    }

    /// The axes' letters, each with a minus where it counts the other way.
    fn words(&self, section: &RawProgram) -> Result<[Word; 3]> {
        let given = [&section.travel, &section.attack, &section.rotation];
        let mut words = LETTERS.map(|letter| Word {
            letter,
            negative: false,
        });
        for (axis, given) in given.into_iter().enumerate() {
            let Some(given) = given else { continue };
            let name = given.value.strip_prefix('-').unwrap_or(&given.value);
            let mut letters = name.chars();
            let (Some(letter), None) = (letters.next(), letters.next()) else {
                return Err(self.not_a_word(axis, given));
            };
            if !CHOICES[axis].contains(letter) {
                return Err(self.not_a_word(axis, given));
            }
            words[axis] = Word {
                letter,
                negative: name.len() < given.value.len(),
            };
        }
        if words[0].letter == words[1].letter {
            let letter = words[0].letter;
            let at = section.attack.as_ref().or(section.travel.as_ref());
            let what = format!("travel and attack are both {letter}; give each its own axis");
            return Err(self.wrong(at.map(|g| &g.at), what));
        }
        Ok(words)
    }

    fn not_a_word(&self, axis: usize, given: &Given<String>) -> crate::Error {
        let name = MachineAxis::ALL[axis].name();
        let letters: Vec<String> = CHOICES[axis].chars().map(String::from).collect();
        let what = format!(
            "{name} is {:?}, but must be one of {}, with a minus in front where the machine counts the other way",
            given.value,
            letters.join(", ")
        );
        self.wrong(Some(&given.at), what)
    }

    fn decimals(
        &self,
        given: Option<&Given<RawDecimals>>,
        dialect: &Dialect,
        units: Units,
    ) -> Result<[u8; 3]> {
        let [mm, inch, degrees] = dialect.decimals;
        let length = match units {
            Units::Mm => mm,
            Units::Inch => inch,
        };
        let mut decimals = [length, length, degrees];
        let Some(given) = given else {
            return Ok(decimals);
        };
        let RawDecimals {
            travel,
            attack,
            rotation,
        } = &given.value;
        for (axis, given) in [travel, attack, rotation].into_iter().enumerate() {
            let Some(given) = given else { continue };
            if !(1..=MOST_DECIMALS).contains(&given.value) {
                let what = format!(
                    "decimals of {} are {}, but must be from 1 to {MOST_DECIMALS}",
                    MachineAxis::ALL[axis].name(),
                    given.value
                );
                return Err(self.wrong(Some(&given.at), what));
            }
            decimals[axis] = given.value as u8;
        }
        Ok(decimals)
    }

    fn split(&self, given: Option<&Given<RawSplit>>) -> Result<Option<Split>> {
        let Some(given) = given else {
            return Ok(None);
        };
        let (number, least, unit) = match (&given.value.bytes, &given.value.moves) {
            (Some(bytes), None) => (bytes, LEAST_BYTES, "bytes"),
            (None, Some(moves)) => (moves, 1, "moves"),
            _ => {
                let what = "split is { bytes = N } or { moves = N }, the most that a file holds";
                return Err(self.wrong(Some(&given.at), what));
            }
        };
        match u64::try_from(number.value) {
            Ok(most) if number.value >= least => Ok(Some(if unit == "bytes" {
                Split::Bytes(most)
            } else {
                Split::Moves(most)
            })),
            _ => {
                let what = format!(
                    "split after {} {unit}, but a file must hold at least {least}",
                    number.value
                );
                Err(self.wrong(Some(&number.at), what))
            }
        }
    }

    fn block_numbers(&self, given: Option<&Given<i64>>, dialect: &Dialect) -> Result<u32> {
        let Some(given) = given else {
            return Ok(dialect.block_numbers);
        };
        let step = self.count(given, "block_numbers")?;
        if step > 1000 {
            let what = format!("block_numbers go by {step}, but must go by 1000 at most, or 0");
            return Err(self.wrong(Some(&given.at), what));
        }
        Ok(step)
    }

    /// Whether the control can count turns like that.
    fn angles_fit(&self, raw: &RawJob, program: &Program) -> Result<()> {
        let dialect = program.control.dialect();
        let at = raw.program.angles.as_ref().map(|g| &g.at);
        let known = |angles: &Angles| match angles {
            Angles::Unwound => true,
            Angles::Modulo => dialect.modulo.is_some(),
            Angles::Rezero => dialect.rezero,
        };
        if !known(&program.angles) {
            let known: Vec<&str> = ANGLES
                .iter()
                .filter(|(_, a)| known(a))
                .map(|(n, _)| *n)
                .collect();
            let name = super::echo::name_of(&ANGLES, &program.angles);
            let what = format!(
                "{} is not known to count turns as {name}; known: {}",
                dialect.title,
                known.join(", ")
            );
            return Err(self.wrong(at, what));
        }
        let points = raw
            .motion
            .as_ref()
            .and_then(|m| m.value.points_per_revolution.as_ref());
        if program.angles == Angles::Modulo && points.is_some_and(|p| p.value < 3) {
            let what = "angles to 360 need at least 3 points_per_revolution, or a turn could go either way";
            return Err(self.wrong(at, what));
        }
        Ok(())
    }

    /// Whether F can say that.
    fn feed_mode_fits(&self, section: &RawProgram, program: &Program) -> Result<()> {
        let dialect = program.control.dialect();
        let title = dialect.title;
        let what = match (program.feed_mode, dialect.minute, program.units) {
            (FeedMode::Minute, None, _) => format!(
                "what F counts on {title} when the part turns as well is not known; choose feed_mode = \"inverse\""
            ),
            (FeedMode::Minute, Some(Counted::All), Units::Inch) => format!(
                "what F makes of degrees on {title} in inches is not known; choose feed_mode = \"inverse\", or mm"
            ),
            (FeedMode::Degrees, _, _) if dialect.group.is_none() => {
                format!("F cannot count degrees alone on {title}; choose feed_mode = \"inverse\"")
            }
            _ => return Ok(()),
        };
        let at: Option<&At> = section.feed_mode.as_ref().map(|g| &g.at);
        Err(self.wrong(at, what))
    }
}
