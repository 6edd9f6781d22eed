//! `path.apt`: the path as cutter locations in APT (ISO 4343), for post-processors elsewhere.
//!
//! Locations are in the part's frame, mm: the part stands still and the wheel goes around it. The tool's axis
//! is the wheel's, parallel to X, and the location is where it ends on the side of smaller x. Each FEDRAT is
//! that location's, so that a move takes as long as it is planned to. No control is known here.

use std::io::Write;
use std::path::Path;

use horma_core::{Cutter, Station, facing_at};

use crate::error::Result;
use crate::output;
use crate::post::{Heading, Placed};

/// Decimals of coordinates and of feeds.
const DECIMALS: usize = 6;

/// The most that the wheel goes around the part in one straight move from pass to pass, degrees.
const CHORD: f64 = 10.0;

/// Text that is gathered before it is handed on, in bytes.
const CHUNK: usize = 1 << 16;

/// Writes placed passes to `file`, each move in its duration: beside it first, then renamed. There are the
/// durations of each pass.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(
    file: &Path,
    placed: &Placed,
    durations: &[Vec<f64>],
    cutter: &Cutter,
    heading: &Heading,
) -> Result<()> {
    let retracted = |s: &Station| location(s, placed.safe, cutter);
    output::write(file, |out| {
        let mut text = String::new();
        for (label, value) in heading {
            text += &format!("$$ {label}: {}\n", ascii(value));
        }
        text += "UNITS/MM\n";
        text += &described(cutter);
        text += "MULTAX/ON\n";
        let mut last = None;
        for (pass, durations) in placed.passes().zip(durations) {
            if placed.legs.len() > 1 {
                text += &format!("$$ pass: {}\n", ascii(pass.title));
            }
            if let (Some(from), Some(to)) = (last, pass.course.first()) {
                around(&mut text, from, to, placed.safe, cutter);
            }
            last = pass.course.last();
            let mut before: Option<[f64; 3]> = None;
            for (i, station) in pass.course.iter().enumerate() {
                let here = location(station, station.axes[1], cutter);
                match before {
                    None => {
                        text += "RAPID\n";
                        go(&mut text, retracted(station));
                        fed(&mut text, pass.feed);
                    }
                    Some(from) => fed(&mut text, 60.0 * distance(from, here) / durations[i - 1]),
                }
                go(&mut text, here);
                before = Some(here);
                if text.len() >= CHUNK {
                    out.write_all(text.as_bytes())?;
                    text.clear();
                }
            }
            if let Some(last) = last {
                text += "RAPID\n";
                go(&mut text, retracted(last));
            }
        }
        text += "FINI\n";
        out.write_all(text.as_bytes())
    })
}

/// Where the wheel's axis ends on the side of smaller x, in the part's frame, with its centre at `height`.
fn location(station: &Station, height: f64, cutter: &Cutter) -> [f64; 3] {
    let [x, _, angle] = station.axes;
    facing_at(x - cutter.half_width(), height, angle)
}

/// The way around the part from where one pass ends to where the next begins, nowhere below `safe`.
fn around(text: &mut String, from: &Station, to: &Station, safe: f64, cutter: &Cutter) {
    let [along, _, turned] = from.to(to);
    let chords = (turned.abs() / CHORD).ceil().max(1.0);
    let height = safe / libm::cos((0.5 * CHORD).to_radians());
    *text += "RAPID\n";
    for i in 0..=chords as u32 {
        let share = f64::from(i) / chords;
        let [x, y, angle] = from.axes;
        let on = Station {
            axes: [x + share * along, y, angle + share * turned],
            ..*from
        };
        go(text, location(&on, height, cutter));
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    horma_core::length(horma_core::sub(a, b))
}

fn go(text: &mut String, [x, y, z]: [f64; 3]) {
    let [x, y, z] = [x, y, z].map(number);
    *text += &format!("GOTO/{x},{y},{z},1,0,0\n");
}

fn fed(text: &mut String, feed: f64) {
    // A move that goes nowhere is not to be told 0.
    let feed = number(feed.max(0.1_f64.powi(DECIMALS as i32)));
    *text += &format!("FEDRAT/{feed},MMPM\n");
}

/// The seven numbers of a cutter: diameter; radius of the corner; its centre's distance from the axis and
/// from the end; angles of the end and of the side; height along the axis.
fn described(cutter: &Cutter) -> String {
    let seven = match *cutter {
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let outer = 2.0 * (major_radius + minor_radius);
            let corner = [minor_radius, major_radius, minor_radius];
            [
                outer,
                corner[0],
                corner[1],
                corner[2],
                0.0,
                0.0,
                2.0 * minor_radius,
            ]
        }
        Cutter::Cone {
            radius,
            width,
            half_angle,
            slope,
        } => {
            let end = radius - 0.5 * width * slope;
            [2.0 * end, 0.0, end, 0.0, 0.0, half_angle, width]
        }
    };
    format!("CUTTER/{}\n", seven.map(number).join(","))
}

/// A number without exponent, trailing zeros or a negative zero.
fn number(value: f64) -> String {
    let text = format!("{value:.DECIMALS$}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        short => short.to_owned(),
    }
}

fn ascii(text: &str) -> String {
    let plain = text.chars();
    plain
        .map(|c| if matches!(c, ' '..='~') { c } else { '?' })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::post::Pass;

    fn stations() -> Vec<Station> {
        let station = |i: u32| {
            let angle = 30.0 * f64::from(i);
            Station {
                axes: [
                    -1.0 + 0.25 * f64::from(i),
                    60.0 + (angle / 50.0).sin(),
                    angle,
                ],
                reach: 12.0,
            }
        };
        (0..40).map(station).collect()
    }

    /// The passes as placed, and the text.
    fn text(passes: &[Pass], durations: &[Vec<f64>], cutter: &Cutter) -> (Placed, String) {
        let job = "[part]\nfiles = ['a.stl']\n[cutter]\nkind = 'ball'\nradius = 5\n
            [motion]\nstep = 1\npoints_per_revolution = 90\n[program]\nclearance = 20";
        let job = crate::job::parse(job, Path::new("job.toml"), &Default::default());
        let program = job.expect("a job").program;
        let placed = Placed::new(passes, None, cutter, &program).expect("it fits");
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join("path.apt");
        let heading = [("part", "caf\u{e9}.step")];
        save(&file, &placed, durations, cutter, &heading).expect("writable");
        let text = std::fs::read_to_string(file).expect("ASCII");
        (placed, text)
    }

    #[test]
    fn locations_read_back_as_the_path_and_its_durations() {
        let course = stations();
        let durations: Vec<f64> = (1..40).map(|i| 0.01 * f64::from(i)).collect();
        let cutter = Cutter::torus(40.0, 8.0).expect("a wheel");
        let pass = |title, feed| Pass {
            title,
            course: &course,
            feed,
        };
        let passes = [pass("rough 1", 1500.0), pass("finish", 900.0)];
        let (placed, text) = text(&passes, &[durations.clone(), durations.clone()], &cutter);
        let mut lines = text.lines();
        let mut next = || lines.next().expect("a line");
        assert_eq!(next(), "$$ part: caf?.step");
        assert_eq!(next(), "UNITS/MM");
        assert_eq!(next(), "CUTTER/96,8,40,8,0,0,16");
        assert_eq!(next(), "MULTAX/ON");
        let numbers = |line: &str, word: &str| -> Vec<f64> {
            let rest = line.strip_prefix(word).expect(line);
            let rest = rest.trim_end_matches(",MMPM");
            rest.split(',').map(|n| n.parse().expect(line)).collect()
        };
        // Travel, height and the cosine and sine of the angle, turned back.
        let turned = |line: &str| {
            let n = numbers(line, "GOTO/");
            assert_eq!(n[3..], [1.0, 0.0, 0.0]);
            let height = n[1].hypot(n[2]);
            (
                [n[0] + 8.0, height, n[1] / height, -n[2] / height],
                [n[0], n[1], n[2]],
            )
        };
        let near = |found: [f64; 4], station: &Station, height: f64| {
            let angle = station.axes[2].to_radians();
            let expected = [station.axes[0], height, angle.cos(), angle.sin()];
            let off = found.iter().zip(expected).map(|(f, e)| (f - e).abs());
            assert!(off.fold(0.0, f64::max) < 2e-6, "{found:?} {expected:?}");
        };
        let safe = course.iter().map(|s| s.axes[1]).fold(0.0, f64::max) + 20.0;
        assert_eq!(placed.safe, safe);
        for (n, pass) in placed.passes().enumerate() {
            assert_eq!(next(), format!("$$ pass: {}", pass.title));
            if n > 0 {
                // Around the part to where it goes on.
                assert_eq!(next(), "RAPID");
                let mut before: Option<[f64; 3]> = None;
                // From 1170 to 1440 degrees.
                for _ in 0..28 {
                    let (_, here) = turned(next());
                    for share in 0..=10 {
                        let share = 0.1 * f64::from(share);
                        let from = before.unwrap_or(here);
                        let [y, z] = [1, 2].map(|i| from[i] + share * (here[i] - from[i]));
                        assert!(y.hypot(z) > safe - 1e-6, "{from:?} {here:?}");
                    }
                    before = Some(here);
                }
            }
            assert_eq!(next(), "RAPID");
            near(turned(next()).0, &pass.course[0], safe);
            let mut before = None;
            for (i, station) in pass.course.iter().enumerate() {
                let feed = numbers(next(), "FEDRAT/")[0];
                let (found, here) = turned(next());
                near(found, station, station.axes[1]);
                match before.replace(here) {
                    None => assert_eq!(feed, passes[n].feed),
                    Some(from) => {
                        let seconds = 60.0 * distance(from, here) / feed;
                        let meant = durations[i - 1];
                        assert!((seconds / meant - 1.0).abs() < 1e-6, "{seconds} {meant}");
                    }
                }
            }
            assert_eq!(next(), "RAPID");
            near(turned(next()).0, &pass.course[39], safe);
        }
        assert_eq!([Some(next()), lines.next()], [Some("FINI"), None]);
    }

    #[test]
    fn cutters_are_described_from_their_end() {
        for (cutter, expected) in [
            (Cutter::ball(5.0), "CUTTER/10,5,0,5,0,0,10\n"),
            (Cutter::cylinder(15.0, 6.0), "CUTTER/30,0,15,0,0,0,6\n"),
            (Cutter::cone(15.0, 6.0, 45.0), "CUTTER/24,0,12,0,0,45,6\n"),
        ] {
            assert_eq!(described(&cutter.expect("a wheel")), expected);
        }
    }
}
