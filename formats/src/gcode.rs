//! `path.ngc`: a program for LinuxCNC and the controls that follow it.
//!
//! X is the travel, Y the tool centre along the attack axis, A the unwound rotation of the part.
//! Inverse-time feed (G93) holds the feed at the contact, where rotation counts as much as travel.
//! The program starts no spindle and changes no tool: nothing is known of either. Limits of travel,
//! speed and acceleration are the machine's own.

use std::io::{self, Write};
use std::path::Path;

use horma_core::{ToolPath, Touch, Waypoint};

use crate::decimal::fixed;
use crate::error::{Error, Result};
use crate::job::Program;
use crate::output;

/// A line of the program's heading: what it tells (`cutter`) and the text itself.
pub type Heading<'a> = [(&'static str, &'a str)];

/// Said in every program, after the heading.
const NOTES: [&str; 4] = [
    "units: mm and degrees",
    "X: travel along the spindle axis; Y: attack axis, to the tool centre; A: turn of the part about X, right-handed",
    "X0 is the part's, Y0 is the spindle axis; under G93 F is 1/min",
    "start the cutter before this program: it starts no spindle and changes no tool",
];

/// Units, distances and planes; no compensation, no canned cycle, feed in mm/min.
const MODES: &str = "G21 G90 G17 G40 G49 G80 G94";

/// Corners may be rounded by this, mm, so that the axes need not stop at each position.
const BLEND: f64 = 0.01;

/// Decimals of X, Y and A.
const DECIMALS: usize = 4;

/// Shortest length that a feed is divided by, mm: the resolution of a coordinate.
const SHORTEST: f64 = 1.0e-4;

/// Longest text of a comment: a line must be shorter than 252 characters.
const COMMENT: usize = 240;

/// Text that is gathered before it is handed on, in bytes.
const CHUNK: usize = 1 << 16;

/// Writes `path` as a program to `file`: beside it first, then renamed.
///
/// Where the cutter touches nothing it goes as high as the higher of the nearest contacts before
/// and after; at the ends of the path there is only one.
///
/// # Errors
/// [`Error::NoContact`] if the cutter never touches the part, [`Error::Io`] if the file cannot be
/// written.
pub fn save(file: &Path, path: &ToolPath, program: Program, heading: &Heading) -> Result<()> {
    let touches: Vec<_> = path.waypoints().map(|w| w.touch).collect();
    let stations = bridged(&touches).ok_or(Error::NoContact {
        positions: path.trajectory.positions,
    })?;
    output::write(file, |out| write(path, &stations, program, heading, out))
}

/// Where the tool is at a position, and how far from the spindle axis it cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Station {
    height: f64,
    reach: f64,
}

/// A station for each position, or `None` if nothing is touched at all.
fn bridged(touches: &[Option<Touch>]) -> Option<Vec<Station>> {
    let station = |t: &Option<Touch>| {
        t.map(|t| Station {
            height: t.height,
            reach: (t.contact[1] * t.contact[1] + t.contact[2] * t.contact[2]).sqrt(),
        })
    };
    let mut before = None;
    let mut stations: Vec<Option<Station>> = Vec::with_capacity(touches.len());
    for touch in touches {
        before = station(touch).or(before);
        stations.push(before);
    }
    let mut after = None;
    for (place, touch) in stations.iter_mut().zip(touches).rev() {
        after = station(touch).or(after);
        *place = match (*place, after) {
            (Some(a), Some(b)) if a.height < b.height => after,
            (None, b) => b,
            (a, _) => a,
        };
    }
    let all: Option<Vec<Station>> = stations.into_iter().collect();
    all.filter(|s| !s.is_empty())
}

fn write(
    path: &ToolPath,
    stations: &[Station],
    program: Program,
    heading: &Heading,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut text = Vec::with_capacity(CHUNK + 1024);
    let highest = stations.iter().map(|s| s.height).fold(f64::MIN, f64::max);
    let safe = highest + program.clearance;

    text.extend_from_slice(b"%\n");
    for (label, value) in heading {
        comment(&mut text, &format!("{label}: {value}"));
    }
    for note in NOTES {
        comment(&mut text, note);
    }
    line(&mut text, MODES, &[]);
    line(&mut text, "G64", &[(b'P', BLEND)]);
    line(&mut text, "G0", &[(b'Y', safe)]);

    let mut last = None;
    for (Waypoint { x, angle, .. }, station) in path.waypoints().zip(stations) {
        match last {
            None => {
                line(&mut text, "G0", &[(b'X', x), (b'A', angle)]);
                text.extend_from_slice(b"G1");
                word(&mut text, b'Y', station.height, DECIMALS);
                feed_word(&mut text, program.feed);
                text.extend_from_slice(b"G93\n");
            }
            Some((from_x, from_angle, from)) => {
                let length = cut(x - from_x, angle - from_angle, from, station);
                text.extend_from_slice(b"G1");
                word(&mut text, b'X', x, DECIMALS);
                word(&mut text, b'Y', station.height, DECIMALS);
                word(&mut text, b'A', angle, DECIMALS);
                feed_word(&mut text, program.feed / length.max(SHORTEST));
            }
        }
        last = Some((x, angle, station));
        if text.len() >= CHUNK {
            out.write_all(&text)?;
            text.clear();
        }
    }

    text.extend_from_slice(b"G94\n");
    line(&mut text, "G0", &[(b'Y', safe)]);
    text.extend_from_slice(b"M2\n%\n");
    out.write_all(&text)
}

/// Length of the cutter's way over the part, mm: travel, attack, and the arc at the contact.
fn cut(dx: f64, degrees: f64, from: &Station, to: &Station) -> f64 {
    let dy = to.height - from.height;
    let arc = 0.5 * (from.reach + to.reach) * degrees.to_radians();
    (dx * dx + dy * dy + arc * arc).sqrt()
}

/// A comment of printable ASCII without parentheses, which would end it.
fn comment(text: &mut Vec<u8>, content: &str) {
    text.push(b'(');
    text.extend(content.chars().take(COMMENT).map(|c| match c {
        '(' => b'[',
        ')' => b']',
        ' '..='~' => c as u8,
        _ => b'?',
    }));
    text.extend_from_slice(b")\n");
}

/// A line of a command and its words.
fn line(text: &mut Vec<u8>, command: &str, words: &[(u8, f64)]) {
    text.extend_from_slice(command.as_bytes());
    for &(letter, value) in words {
        word(text, letter, value, DECIMALS);
    }
    text.push(b'\n');
}

/// F, to six significant digits, never 0; it ends the line.
fn feed_word(text: &mut Vec<u8>, feed: f64) {
    let (mut decimals, mut leading) = (5, feed);
    while leading >= 10.0 && decimals > 0 {
        (decimals, leading) = (decimals - 1, leading / 10.0);
    }
    while leading < 1.0 && decimals < 12 {
        (decimals, leading) = (decimals + 1, leading * 10.0);
    }
    word(text, b'F', feed.max(1.0e-12), decimals);
    text.push(b'\n');
}

/// A letter and a number without exponent, trailing zeros or a negative zero.
fn word(text: &mut Vec<u8>, letter: u8, value: f64, decimals: usize) {
    text.extend_from_slice(&[b' ', letter]);
    fixed(text, value, decimals);
}

#[cfg(test)]
mod tests {
    use horma_core::{Index, Inserted, MotionKind, Trajectory};

    use super::*;

    const PROGRAM: Program = Program {
        feed: 1000.0,
        clearance: 5.0,
    };

    /// A path of these heights, touching straight below the tool at 10 mm from the spindle axis.
    fn path(heights: &[Option<f64>]) -> ToolPath {
        let touch = |h: &Option<f64>| {
            h.map(|height| Touch {
                height,
                contact: [0.0, 6.0, 8.0],
            })
        };
        ToolPath {
            trajectory: Trajectory {
                kind: MotionKind::Helix,
                from: -1.0,
                step: 4.0,
                points_per_revolution: 4,
                positions: heights.len() as u64,
            },
            touches: heights.iter().map(touch).collect(),
            between: Vec::new(),
        }
    }

    fn text(path: &ToolPath, heading: &Heading) -> String {
        let mut out = Vec::new();
        let touches: Vec<_> = path.waypoints().map(|w| w.touch).collect();
        let stations = bridged(&touches).expect("contact");
        write(path, &stations, PROGRAM, heading, &mut out).expect("memory");
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn a_short_program() {
        let path = path(&[Some(50.0), Some(50.123_456), Some(-0.000_01)]);
        let expected = "\
%
(part: last.step)
(units: mm and degrees)
(X: travel along the spindle axis; Y: attack axis, to the tool centre; A: turn of the part about X, right-handed)
(X0 is the part's, Y0 is the spindle axis; under G93 F is 1/min)
(start the cutter before this program: it starts no spindle and changes no tool)
G21 G90 G17 G40 G49 G80 G94
G64 P0.01
G0 Y55.1235
G0 X-1 A0
G1 Y50 F1000
G93
G1 X0 Y50.1235 A90 F63.5314
G1 X1 Y0 A180 F19.0343
G94
G0 Y55.1235
M2
%
";
        assert_eq!(text(&path, &[("part", "last.step")]), expected);
    }

    #[test]
    fn inserted_positions_are_moved_to_in_their_turn() {
        let mut path = path(&[Some(50.0), Some(60.0)]);
        path.between = vec![Inserted {
            index: Index::between(0, 768).expect("between"),
            touch: Some(Touch {
                height: 52.5,
                contact: [0.0, 6.0, 8.0],
            }),
        }];
        let text = text(&path, &[]);
        let moves: Vec<&str> = text.lines().filter(|l| l.starts_with("G1 X")).collect();
        assert!(moves[0].starts_with("G1 X-0.25 Y52.5 A67.5 F"), "{text}");
        assert!(moves[1].starts_with("G1 X0 Y60 A90 F"), "{text}");
    }

    #[test]
    fn gaps_are_bridged_at_the_higher_side() {
        let path = path(&[
            None,
            Some(3.0),
            None,
            None,
            Some(7.0),
            None,
            Some(5.0),
            None,
        ]);
        let heights: Vec<f64> = bridged(&path.touches)
            .expect("contact")
            .iter()
            .map(|s| s.height)
            .collect();
        assert_eq!(heights, [3.0, 3.0, 7.0, 7.0, 7.0, 7.0, 5.0, 5.0]);
    }

    #[test]
    fn a_path_without_contact_is_an_error() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join("path.ngc");
        for heights in [&[None, None][..], &[]] {
            let saved = save(&file, &path(heights), PROGRAM, &[]);
            assert!(matches!(saved, Err(Error::NoContact { .. })));
        }
        assert!(!file.exists());
    }

    #[test]
    fn comments_are_harmless() {
        let part = format!("a(b)c\n%\u{e9} {}", "long ".repeat(100));
        let text = text(&path(&[Some(1.0)]), &[("part", &part)]);
        let comment = text.lines().nth(1).expect("heading");
        assert!(comment.starts_with("(part: a[b]c?%? long"), "{comment}");
        assert!(text.is_ascii() && text.lines().all(|l| l.len() < 252));
    }

    #[test]
    fn feeds_keep_six_digits_and_are_never_zero() {
        for (feed, expected) in [
            (1.0e7, " F10000000\n"),
            (1234.5678, " F1234.57\n"),
            (0.000_123_456_789, " F0.000123457\n"),
            (1.0e-30, " F0.000000000001\n"),
            (1.0, " F1\n"),
        ] {
            let mut text = Vec::new();
            feed_word(&mut text, feed);
            assert_eq!(text, expected.as_bytes());
        }
    }
}
