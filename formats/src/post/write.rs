//! The writer: one function for all dialects.

use std::io::{self, Write};

use horma_core::MachineAxis;

use super::dialect::{Counted, Dialect, Direction, Inverse};
use super::lines::Lines;
use super::placed::{Leg, Placed};
use super::{Angles, FeedMode, Heading, Program, Programmed, Split, Units};
use crate::error::{Error, Result};

/// Corners may be rounded by this, mm, so that the axes need not stop at each position.
const BLEND: f64 = 0.01;

/// Text that is gathered before it is handed on, in bytes.
const CHUNK: usize = 1 << 16;

/// Longer than the longest move with what ends a file after it, in bytes, and with what begins a pass before
/// it.
const ENDING: u64 = 400;
const PASS: u64 = 1000;

const TRAVEL: usize = MachineAxis::Travel as usize;
const ATTACK: usize = MachineAxis::Attack as usize;
const ROTATION: usize = MachineAxis::Rotation as usize;

/// All that goes into a program.
pub(super) struct Script<'a> {
    pub(super) placed: &'a Placed,
    /// Of each pass.
    pub(super) durations: &'a [Vec<f64>],
    pub(super) program: &'a Program,
    pub(super) dialect: &'static Dialect,
    pub(super) heading: &'a Heading<'a>,
}

impl Script<'_> {
    /// Checks that F can count every move.
    ///
    /// # Errors
    /// [`Error::NoFeed`]
    pub(super) fn check(&self) -> Result<()> {
        let passes = self.placed.legs.iter().zip(self.durations);
        let mut moves = passes.flat_map(|(leg, durations)| {
            let ends = leg.positions.clone().skip(1);
            ends.zip(durations)
        });
        match moves.find(|(to, seconds)| self.feed(*to, **seconds) == Some(0.0)) {
            None => Ok(()),
            Some((to, _)) => Err(Error::NoFeed {
                spot: self.placed.spot(to - 1),
            }),
        }
    }

    /// Writes file number `part`, from position `first`; the position at which the next one begins.
    pub(super) fn write(&self, first: usize, part: u32, out: &mut impl Write) -> io::Result<usize> {
        let mut lines = Lines::new(self.dialect, self.program.block_numbers);
        self.open(&mut lines, part, first);
        let (mut at, mut moves, mut written) = (first, 0, 0);
        let passes = self.placed.legs.iter().zip(self.durations);
        for (leg, durations) in passes.filter(|(leg, _)| leg.positions.end > first) {
            let size = written + lines.text.len() as u64;
            if at > first && self.full(moves, size + PASS) {
                break;
            }
            if self.placed.legs.len() > 1 {
                lines.comment(&format!("pass: {}", leg.title));
            }
            if at == first {
                self.retract(&mut lines);
            }
            let turns = self.turns_behind(at);
            self.approach(&mut lines, leg, at, turns);
            self.begin_feed(&mut lines);
            while at + 1 < leg.positions.end {
                let size = written + lines.text.len() as u64;
                if moves > 0 && (self.full(moves, size) || self.overflows(at + 1, turns)) {
                    break;
                }
                at += 1;
                moves += 1;
                self.cut(
                    &mut lines,
                    at,
                    turns,
                    durations[at - leg.positions.start - 1],
                );
                if lines.text.len() >= CHUNK {
                    out.write_all(&lines.text)?;
                    written += lines.text.len() as u64;
                    lines.text.clear();
                }
            }
            self.end_feed(&mut lines);
            self.retract(&mut lines);
            self.rezero(&mut lines, self.placed.increments[at][ROTATION]);
            if at + 1 < leg.positions.end {
                break;
            }
            at = leg.positions.end;
        }
        for line in self.dialect.end {
            self.ending(&mut lines, line);
        }
        out.write_all(&lines.text)?;
        Ok(at)
    }

    /// The way from where the cutter is retracted to position `at`, and down.
    fn approach(&self, lines: &mut Lines, leg: &Leg, at: usize, turns: i64) {
        let [travel, attack, rotation] = self.placed.increments[at];
        lines.begin("G0");
        self.word(lines, TRAVEL, travel);
        self.turn(lines, rotation - turns);
        lines.end();
        lines.begin("G1");
        self.word(lines, ATTACK, attack);
        lines.feed(leg.feed / self.program.units.length(), f64::INFINITY);
        lines.end();
    }

    /// The move to position `to`, in so many seconds.
    fn cut(&self, lines: &mut Lines, to: usize, turns: i64, seconds: f64) {
        let [travel, attack, rotation] = self.placed.increments[to];
        lines.begin("G1");
        self.word(lines, TRAVEL, travel);
        self.word(lines, ATTACK, attack);
        self.turn(lines, rotation - turns);
        match (self.feed(to, seconds), self.dialect.inverse) {
            (Some(feed), _) => lines.feed(feed, f64::INFINITY),
            (None, Inverse::PerMinute) => lines.feed(60.0 / seconds, self.dialect.most_inverse),
            (None, Inverse::Seconds) => lines.seconds(seconds),
        }
        lines.end();
    }

    /// Whether a file of so many moves and bytes takes no more.
    fn full(&self, moves: u64, bytes: u64) -> bool {
        match self.program.split {
            None => false,
            Some(Split::Moves(most)) => moves >= most,
            Some(Split::Bytes(most)) => bytes + ENDING > most,
        }
    }

    /// Whether position `to` is too far turned for the control, and another file could begin before it.
    fn overflows(&self, to: usize, turns: i64) -> bool {
        let turned = self.placed.increments[to][ROTATION] - turns;
        self.program.split.is_some()
            && self.program.angles == Angles::Rezero
            && turned.abs() > self.dialect.most
    }

    fn open(&self, lines: &mut Lines, part: u32, first: usize) {
        for line in self.dialect.begin {
            lines.bare(&line.replace("{part}", &format!("{part:04}")));
        }
        for (label, value) in self.heading {
            lines.comment(&format!("{label}: {value}"));
        }
        for note in self.notes() {
            lines.comment(&note);
        }
        if self.program.split.is_some() {
            lines.comment(&format!(
                "file {part}, from {}",
                ascii(&self.placed.spot(first))
            ));
        }
        let inch = self.program.units == Units::Inch;
        let blend = if inch {
            "0.0004".to_owned()
        } else {
            BLEND.to_string()
        };
        for line in self.dialect.setup {
            let line = line.replace("{units}", self.dialect.units[usize::from(inch)]);
            lines.block(&line.replace("{blend}", &blend));
        }
    }

    /// What whoever runs the program has to know.
    fn notes(&self) -> Vec<String> {
        let Program { words, units, .. } = self.program;
        let [x, y, a] = words.map(|w| w.letter);
        let reversed = |axis: usize| {
            if words[axis].negative {
                ", reversed"
            } else {
                ""
            }
        };
        let (unit, point) = (
            match units {
                Units::Mm => "mm",
                Units::Inch => "inches",
            },
            match self.program.point {
                Programmed::Centre => "the tool centre",
                Programmed::Tip => "the tip of the tool",
            },
        );
        let feed = match (
            self.program.feed_mode,
            self.dialect.inverse,
            self.dialect.minute,
        ) {
            (FeedMode::Inverse, Inverse::PerMinute, _) => "under G93 F is 1/min".to_owned(),
            (FeedMode::Inverse, Inverse::Seconds, _) => "under G93 F is seconds".to_owned(),
            (FeedMode::Minute, _, Some(Counted::All)) => {
                format!("F is {unit}/min over {x}, {y} and {a}, a degree as one of the {unit}")
            }
            (FeedMode::Minute, _, _) => {
                format!("F is {unit}/min over {x} and {y}, and degrees/min where {a} turns alone")
            }
            (FeedMode::Degrees, _, _) => format!("F is degrees/min of {a}"),
        };
        let hand = if words[TRAVEL].negative == words[ROTATION].negative {
            "right"
        } else {
            "left"
        };
        let mut notes = vec![
            format!("units: {unit} and degrees"),
            format!(
                "{x}: travel along the spindle axis{}, 0 is the part's",
                reversed(TRAVEL)
            ),
            format!(
                "{y}: attack axis{}, from the spindle axis to {point}",
                reversed(ATTACK)
            ),
            format!("{a}: turn of the part about {x}, {hand}-handed"),
            feed,
        ];
        match (self.program.angles, &self.dialect.modulo) {
            (Angles::Modulo, Some(modulo)) => {
                notes.push(modulo.note.replace("{rotation}", &a.to_string()));
            }
            (Angles::Rezero, _) => notes.push(format!(
                "after the retract G92 takes whole turns off {a}, so that nothing unwinds"
            )),
            _ => {}
        }
        notes.push(
            "start the cutter before this program: it starts no spindle and changes no tool"
                .to_owned(),
        );
        notes
    }

    fn retract(&self, lines: &mut Lines) {
        lines.begin("G0");
        self.word(lines, ATTACK, self.placed.retracted);
        lines.end();
    }

    fn begin_feed(&self, lines: &mut Lines) {
        if self.program.feed_mode == FeedMode::Inverse {
            return lines.block("G93");
        }
        let [x, y, a] = self.program.words.map(|w| w.letter);
        let axes = match self.program.feed_mode {
            FeedMode::Degrees => a.to_string(),
            FeedMode::Inverse | FeedMode::Minute => format!("{x},{y},{a}"),
        };
        for line in self.dialect.group.iter().flat_map(|g| g.begin) {
            let line = line.replace("{axes}", &axes);
            lines.block(&line.replace("{rotation}", &a.to_string()));
        }
    }

    fn end_feed(&self, lines: &mut Lines) {
        match (self.program.feed_mode, &self.dialect.group) {
            (FeedMode::Inverse, _) => lines.block("G94"),
            (_, Some(group)) => lines.block(group.end),
            (_, None) => {}
        }
    }

    /// Gives the place where the part has come to rest the number that it has within a turn.
    fn rezero(&self, lines: &mut Lines, rotation: i64) {
        if self.program.angles == Angles::Rezero {
            lines.begin("G92");
            self.word(lines, ROTATION, rotation % self.program.turn());
            lines.end();
        }
    }

    fn ending(&self, lines: &mut Lines, line: &str) {
        if line == "%" {
            lines.bare(line);
        } else {
            lines.block(line);
        }
    }

    fn word(&self, lines: &mut Lines, axis: usize, increments: i64) {
        let letter = self.program.words[axis].letter;
        lines.word(letter, increments, self.program.decimals[axis]);
    }

    /// Where to turn.
    fn turn(&self, lines: &mut Lines, rotation: i64) {
        let Some(modulo) = self
            .dialect
            .modulo
            .as_ref()
            .filter(|_| self.program.angles == Angles::Modulo)
        else {
            return self.word(lines, ROTATION, rotation);
        };
        let (turn, word) = (self.program.turn(), self.program.words[ROTATION]);
        let within = rotation.rem_euclid(turn);
        let decimals = self.program.decimals[ROTATION];
        match modulo.direction {
            Direction::Shorter => self.word(lines, ROTATION, within),
            // Also of 0: hence not the number's own.
            Direction::Sign if word.negative => {
                lines.called(word.letter, "-", within, decimals, "");
            }
            Direction::Sign => self.word(lines, ROTATION, within),
            Direction::Function(open) => {
                let open = open[usize::from(word.negative)];
                lines.called(word.letter, open, within, decimals, ")");
            }
        }
    }

    /// The whole turns that are not counted after a retract, from position `first` on.
    fn turns_behind(&self, first: usize) -> i64 {
        match self.program.angles {
            Angles::Unwound | Angles::Modulo => 0,
            Angles::Rezero => {
                let turn = self.program.turn();
                self.placed.increments[first][ROTATION] / turn * turn
            }
        }
    }

    /// F of the move to position `to` in so many seconds, in units or degrees a minute; `None` where it tells
    /// the time.
    fn feed(&self, to: usize, seconds: f64) -> Option<f64> {
        let [from, to_] = [to - 1, to].map(|i| self.placed.increments[i]);
        let way = |axis: usize| {
            let decimals = i32::from(self.program.decimals[axis]);
            (to_[axis] - from[axis]) as f64 / 10_f64.powi(decimals)
        };
        let [x, y, a] = [way(TRAVEL), way(ATTACK), way(ROTATION).abs()];
        let counted = match (self.program.feed_mode, self.dialect.minute) {
            (FeedMode::Inverse, _) => return None,
            (FeedMode::Degrees, _) => a,
            (FeedMode::Minute, Some(Counted::All)) => (x * x + y * y + a * a).sqrt(),
            (FeedMode::Minute, _) => match (x * x + y * y).sqrt() {
                0.0 => a,
                length => length,
            },
        };
        Some(60.0 * counted / seconds)
    }
}

/// A place in ASCII.
fn ascii(spot: &super::Spot) -> String {
    spot.to_string().replace('°', " degrees")
}
