//! A small reader of G-code, for tests: the words of each block, modal groups, and what they mean.

use horma_core::Station;

/// What the text alone does not tell.
#[derive(Debug)]
pub struct Meaning {
    /// Travel, attack and rotation.
    pub letters: [char; 3],
    /// Which of them count the other way.
    pub reversed: [bool; 3],
    /// mm in a unit of length.
    pub unit: f64,
    /// What is added to the attack axis to get to the centre, mm.
    pub tip: f64,
    /// Whether F is seconds under G93.
    pub seconds: bool,
    /// Whether F counts lengths alone under G94, if there are any.
    pub lengths_only: bool,
    /// Whether F counts degrees alone.
    pub degrees_only: bool,
    /// Whether the rotation counts to 360 ...
    pub wrapped: bool,
    /// ... and is told which way to turn, or takes the shorter one.
    pub directed: bool,
}

/// A move of the machine.
#[derive(Debug, Clone)]
pub struct Move {
    pub rapid: bool,
    /// Which axes were named.
    pub named: [bool; 3],
    /// Where to, in mm and degrees of the path.
    pub to: [f64; 3],
    /// How far, in the program's own units.
    way: [f64; 3],
    /// mm in one of its lengths.
    unit: f64,
    /// The F of its own block, and what its last digit is worth.
    feed: Option<(f64, f64)>,
    inverse: bool,
    /// How long it takes, s; infinite for a rapid one.
    pub seconds: f64,
    /// By how much F's last digit changes that.
    pub rounding: f64,
}

/// Letter, sign of the number (also of a zero), number, and what its last digit is worth.
fn words(line: &str) -> Vec<(char, bool, f64, f64)> {
    let mut words = Vec::new();
    let mut rest = line.trim();
    while let Some(letter) = rest.chars().next() {
        assert!(
            letter.is_ascii_uppercase(),
            "a word begins with {letter}: {line}"
        );
        rest = &rest[1..];
        let mut negative = None;
        for (open, backwards) in [("=ACP(", false), ("=ACN(", true)] {
            if let Some(inner) = rest.strip_prefix(open) {
                rest = inner;
                negative = Some(backwards);
            }
        }
        let end = rest.find(|c: char| !c.is_ascii_digit() && !"-.".contains(c));
        let (number, after) = rest.split_at(end.unwrap_or(rest.len()));
        let value: f64 = number.parse().expect(line);
        let places = number.split_once('.').map_or(0, |(_, d)| d.len());
        words.push((
            letter,
            negative.unwrap_or(number.starts_with('-')),
            value.abs() * if number.starts_with('-') { -1.0 } else { 1.0 },
            10_f64.powi(-(places as i32)),
        ));
        rest = after
            .strip_prefix(')')
            .filter(|_| negative.is_some())
            .unwrap_or(after)
            .trim();
    }
    words
}

/// Every move of a program.
pub fn read(text: &str, meaning: &Meaning) -> Vec<Move> {
    let mut moves: Vec<Move> = Vec::new();
    // Where the control thinks that it is; what G92 has added to that; G0 or G1; G93.
    let (mut at, mut added) = ([0.0; 3], 0.0);
    let (mut rapid, mut inverse, mut ended) = (true, false, false);
    let mut modes = Vec::new();
    for line in text.lines() {
        let code = line.split(['(', ';']).next().unwrap_or_default();
        // Lines that are no blocks of words.
        if code.trim_end() == "%" || line.contains("FGROUP") || line.contains("FGREF") {
            continue;
        }
        // "=ACP(" is no comment.
        let code = if line.contains("=AC") { line } else { code };
        let code = code.replace(" ADIS=0.01", "").replace(" ADIS=0.0004", "");
        let mut named = [None; 3];
        let (mut feed, mut shift) = (None, false);
        for (letter, negative, value, digit) in words(&code) {
            match (letter, value) {
                ('G', 0.0) => rapid = true,
                ('G', 1.0) => rapid = false,
                ('G', 93.0) => inverse = true,
                ('G', 94.0) => inverse = false,
                ('G', 92.0) => shift = true,
                ('G', _) => modes.push(value as u32),
                ('M', _) => ended = [2.0, 30.0].contains(&value),
                ('F', _) => feed = Some((value, digit)),
                ('N' | 'O' | 'P' | 'D', _) => {}
                _ => {
                    let axis = meaning.letters.iter().position(|l| *l == letter);
                    named[axis.expect(line)] = Some((negative, value));
                }
            }
        }
        if shift {
            let (_, value) = named[2].expect("G92 names the rotation");
            added += at[2] - value;
            at[2] = value;
            continue;
        }
        if named == [None; 3] {
            continue;
        }
        let before = at;
        for (axis, word) in named.iter().enumerate() {
            let Some((negative, value)) = *word else {
                continue;
            };
            at[axis] = if axis == 2 && meaning.wrapped {
                wrapped(at[2], value, negative, moves.len() < 2, meaning)
            } else {
                value
            };
        }
        let way: [f64; 3] = std::array::from_fn(|axis| at[axis] - before[axis]);
        let unit = [meaning.unit, meaning.unit, 1.0];
        let shifts = [0.0, meaning.tip, 0.0];
        let counted = [at[0], at[1], at[2] + added];
        let to = std::array::from_fn(|axis| {
            let sign = if meaning.reversed[axis] { -1.0 } else { 1.0 };
            sign * counted[axis] * unit[axis] + shifts[axis]
        });
        let mut next = Move {
            rapid,
            named: named.map(|n| n.is_some()),
            to,
            way,
            unit: meaning.unit,
            feed,
            inverse,
            seconds: f64::INFINITY,
            rounding: 0.0,
        };
        (next.seconds, next.rounding) = next.time(meaning);
        moves.push(next);
    }
    assert!(ended, "the program has an end");
    assert!(!inverse, "G94 is restored");
    for needed in [90, 17, 40] {
        assert!(modes.contains(&needed), "G{needed} is missing");
    }
    moves
}

/// Where an axis that counts to 360 goes from `at`, counted on; the first time it may go any way.
fn wrapped(at: f64, value: f64, negative: bool, first: bool, meaning: &Meaning) -> f64 {
    let place = value.abs();
    assert!(place <= 360.0, "{value}");
    let turns = ((at - place) / 360.0).floor();
    // The nearest places at or below, and above.
    let (below, above) = (place + 360.0 * turns, place + 360.0 * (turns + 1.0));
    let near = 1e-9;
    if first {
        // Counted on from there, as the path does.
        return if meaning.reversed[2] {
            place.rem_euclid(360.0) - 360.0
        } else {
            place
        };
    }
    if (at - below).abs() < near || (at - above).abs() < near {
        return at;
    }
    match meaning.directed {
        true if negative => below,
        true => above,
        false if above - at < at - below => above,
        false => below,
    }
}

impl Move {
    fn time(&self, meaning: &Meaning) -> (f64, f64) {
        let (Some((feed, digit)), false) = (self.feed, self.rapid) else {
            assert!(self.rapid, "every move under feed has its F: {self:?}");
            return (f64::INFINITY, 0.0);
        };
        assert!(feed > 0.0);
        let [x, y, a] = self.way;
        let length = x.hypot(y);
        match (self.inverse, meaning.seconds) {
            (true, true) => (feed, digit),
            (true, false) => (60.0 / feed, 60.0 * digit / (feed * feed)),
            _ => {
                let counted = match (meaning.degrees_only, meaning.lengths_only) {
                    (true, _) => a.abs(),
                    (false, true) if length > 0.0 => length,
                    (false, true) => a.abs(),
                    (false, false) => length.hypot(a),
                };
                (
                    60.0 * counted / feed,
                    60.0 * counted * digit / (feed * feed),
                )
            }
        }
    }
}

/// That the files are these passes one after the other, each file and each pass safe by itself; the moves of
/// each pass, without the way there.
pub fn check(
    files: &[Vec<Move>],
    courses: &[Vec<Station>],
    rounding: [f64; 3],
    clearance: f64,
    clear: Option<f64>,
) -> Result<Vec<Vec<Move>>, String> {
    let heights = courses.iter().flatten().map(|s| s.axes[1]);
    let highest = heights.chain(clear).fold(f64::MIN, f64::max);
    let same = |found: [f64; 3], station: &Station| {
        let turned = found[2] - station.axes[2];
        // A pass, and a file, may begin at any turn.
        let offset = 360.0 * (turned / 360.0).round();
        let near = |axis: usize, shift: f64| {
            let off = found[axis] - shift - station.axes[axis];
            off.abs() <= rounding[axis] * (1.0 + 1e-6) + 1e-9
        };
        (near(0, 0.0) && near(1, 0.0) && near(2, offset)).then_some(offset)
    };
    let safe = |m: &Move| {
        m.rapid
            && m.named == [false, true, false]
            && m.to[1] >= highest + clearance - rounding[1] * 1.001
    };
    let mut all: Vec<Vec<Move>> = courses.iter().map(|_| Vec::new()).collect();
    // The pass, and the position in it.
    let (mut pass, mut at) = (0, 0);
    for (n, moves) in files.iter().enumerate() {
        let [retract, rest @ ..] = &moves[..] else {
            return Err(format!("file {n} has no moves"));
        };
        if !safe(retract) || rest.is_empty() {
            return Err(format!("file {n} retracts {retract:?}, over {highest}"));
        }
        let (mut rest, mut before) = (rest, None::<&Move>);
        while !rest.is_empty() {
            let course = courses
                .get(pass)
                .ok_or("there are more passes than courses")?;
            let end = rest.iter().position(safe);
            let end = end.ok_or_else(|| format!("file {n} does not retract over {highest}"))?;
            let [travel, plunge, cuts @ ..] = &rest[..end] else {
                return Err(format!("file {n} retracts at once"));
            };
            if !travel.rapid || travel.named != [true, false, true] {
                return Err(format!("file {n} travels {travel:?}"));
            }
            let unwound = before.map_or(0.0, |back| (travel.to[2] - back.to[2]).abs());
            if unwound > 360.0 + 1e-6 {
                return Err(format!("file {n} turns by {unwound} between passes"));
            }
            if plunge.rapid || plunge.named != [false, true, false] {
                return Err(format!("file {n} plunges {plunge:?}"));
            }
            let begin = same(plunge.to, &course[at]);
            if begin.is_none() {
                return Err(format!(
                    "file {n} begins at {plunge:?}, not at {:?}",
                    course[at]
                ));
            }
            for cut in cuts {
                at += 1;
                let station = course
                    .get(at)
                    .ok_or("there are more moves than positions")?;
                if cut.rapid || same(cut.to, station) != begin {
                    return Err(format!(
                        "position {at} is {station:?}, but the move {cut:?}"
                    ));
                }
                all[pass].push(cut.clone());
            }
            before = Some(&rest[end]);
            rest = &rest[end + 1..];
            if at + 1 == course.len() {
                (pass, at) = (pass + 1, 0);
            } else if !rest.is_empty() {
                return Err(format!("file {n} leaves pass {pass} at position {at}"));
            }
        }
    }
    if pass != courses.len() {
        return Err(format!("pass {pass} ends at position {at}"));
    }
    Ok(all)
}

/// That no axis breaks its limits of velocity, acceleration and jerk, but for what F's last digit does.
pub fn within(moves: &[Move], limits: &[[f64; 3]; 3]) -> Result<(), String> {
    for (axis, [most_v, most_a, most_j]) in limits.iter().enumerate() {
        let unit = |m: &Move| if axis < 2 { m.unit } else { 1.0 };
        let mut before = (0.0, 0.0, 0.0, 0.0, 0.0);
        let rest = (0.0, 0.0, 0.0);
        let all = moves.iter().map(|m| {
            let v = m.way[axis] * unit(m) / m.seconds;
            (v, m.seconds, v.abs() * m.rounding / m.seconds)
        });
        for (i, (v, t, v_off)) in all.chain([rest]).enumerate() {
            let (v0, t0, v0_off, a0, a0_off) = before;
            let mean = 0.5 * (t + t0);
            if mean == 0.0 {
                continue;
            }
            let a = (v - v0) / mean;
            // Both velocities, and the time between them.
            let t_off = v_off.max(v0_off) / v.abs().max(v0.abs()).max(1e-300);
            let a_off = (v_off + v0_off) / mean + a.abs() * t_off;
            let slack = 1.0 + 1e-9;
            if v.abs() > most_v * slack {
                return Err(format!(
                    "move {i}: axis {axis} goes at {v}, more than {most_v}"
                ));
            }
            if a.abs() > most_a * slack + a_off {
                return Err(format!(
                    "before move {i}: axis {axis} gains {a}, more than {most_a}"
                ));
            }
            let j = (a - a0) / t0;
            if i > 0 && j.abs() > most_j * slack + (a_off + a0_off) / t0 + j.abs() * t_off {
                return Err(format!(
                    "move {i}: axis {axis} jerks {j}, more than {most_j}"
                ));
            }
            before = (v, t, v_off, a, a_off);
        }
    }
    Ok(())
}
