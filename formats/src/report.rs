//! `report.json`: what was computed, out of what, by whom and how fast.
//!
//! Figures are taken as they come from the run's record; nothing is measured here.

mod machined;

use std::io::Write;
use std::path::Path;

use horma_core::{
    Bound, Counters, MachineAxis, Peak, Raised, Record, Steady, Timing, Touch, Verification,
    Waypoint,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::Result;
use crate::lasts::Lasts;
use crate::output;
use crate::part::Source;
use crate::post::Program;

pub use machined::{MachinedStatistics, Percentiles};

/// A run's report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of horma that wrote it.
    pub version: String,
    /// The job in effect, keyed as a job file is.
    pub job: Value,
    /// The part's files, each with the unit of its lengths.
    pub files: Vec<Source>,
    /// What the machinist should know, such as the open edges of a mesh.
    pub warnings: Vec<String>,
    /// The path.
    pub path: PathStatistics,
    /// How the path compares with the designed surface; nothing if that was skipped.
    pub verification: Option<Verification>,
    /// The surface that the path leaves; nothing if that was not looked at.
    pub machined: Option<MachinedStatistics>,
    /// The program for the machine; nothing if none was written.
    pub program: Option<ProgramStatistics>,
    /// What each keep-out did to the finishing pass, in the job's order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep_outs: Vec<Raised>,
    /// What the roughing leaves; nothing if the job speaks of none.
    pub roughing: Option<RoughStatistics>,
    /// What the last measures; nothing if the job speaks of none.
    #[serde(default)]
    pub last: Option<Lasts>,
    /// Phases, bodies, counters, workers, extents and lost attempts, each under its own key.
    #[serde(flatten)]
    pub record: Record,
}

/// A path in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathStatistics {
    /// Number of positions.
    pub positions: u64,
    /// Of these, those that were inserted between others.
    pub inserted: u64,
    /// Straight moves that stray farther than the path tolerance and are too short to insert into.
    pub beyond_tolerance: u64,
    /// Positions where the cutter touches the part.
    pub with_contact: u64,
    /// Positions where nothing is in its reach.
    pub without_contact: u64,
    /// Lowest tool centre, mm; nothing without any contact.
    pub lowest: Option<f64>,
    /// Highest tool centre, mm; nothing without any contact.
    pub highest: Option<f64>,
}

impl PathStatistics {
    /// Counts over the positions of a path, and what its search counted.
    pub fn of(path: impl Iterator<Item = Waypoint>, counters: &Counters) -> Self {
        let mut counted = Self {
            positions: 0,
            inserted: 0,
            beyond_tolerance: counters.beyond_tolerance,
            with_contact: 0,
            without_contact: 0,
            lowest: None,
            highest: None,
        };
        for Waypoint { index, touch, .. } in path {
            counted.positions += 1;
            counted.inserted += u64::from(index.parts() > 0);
            let Some(Touch { height, .. }) = touch else {
                counted.without_contact += 1;
                continue;
            };
            counted.with_contact += 1;
            counted.lowest = Some(counted.lowest.map_or(height, |low| low.min(height)));
            counted.highest = Some(counted.highest.map_or(height, |high| high.max(height)));
        }
        counted
    }
}

/// A roughing in figures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RoughStatistics {
    /// Its layers.
    pub layers: u64,
    /// What they leave on the designed surface; nothing if that was not verified.
    pub left: Option<Left>,
}

/// What is left on the samples of a designed surface, mm along its normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// The least, at positions.
    pub least: f64,
    /// 50th percentile.
    pub median: f64,
    /// 99th percentile.
    pub p99: f64,
    /// The most.
    pub max: f64,
}

/// A pass in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassStatistics {
    /// What it is called in the program.
    pub name: String,
    /// The file of its path.
    pub path: String,
    /// Number of positions.
    pub positions: u64,
    /// Length of the cutter's way over the part, mm.
    pub length: f64,
    /// How long it takes, s.
    pub seconds: f64,
    /// The most that it takes of what the passes before it left, mm: at a position along the attack axis, for
    /// a finishing pass after a roughing along the normal of the surface; nothing if that is not known.
    pub deepest_cut: Option<f64>,
}

/// A program in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProgramStatistics {
    /// Whose dialect.
    pub dialect: String,
    /// Its files, in the order in which they are run.
    pub files: Vec<String>,
    /// Its passes, in their order.
    pub passes: Vec<PassStatistics>,
    /// How long the cutter is at work, s: from the first position to the last of each pass.
    pub seconds: f64,
    /// What keeps moves from being shorter, with the share of the moves that it holds; the greatest first.
    pub bounds: Vec<(String, f64)>,
    /// The most that is asked of each axis.
    pub peaks: Vec<AxisPeak>,
    /// The same passes at the greatest steady speed of the spindle within the same limits; nothing if the
    /// part does not turn all the time.
    pub steady: Option<SteadySpindle>,
}

/// The most that is asked of an axis, in mm or degrees, and seconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxisPeak {
    /// Its name.
    pub axis: String,
    /// Greatest velocity.
    pub velocity: f64,
    /// Greatest acceleration: the difference of two moves' velocities over the mean of their durations.
    pub acceleration: f64,
    /// Greatest jerk: the difference of the accelerations at a move's ends over its duration.
    pub jerk: f64,
}

/// A path at a steady speed of the spindle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SteadySpindle {
    /// Turns a minute.
    pub turns: f64,
    /// How long the path then takes, s.
    pub seconds: f64,
}

/// A pass as it is run.
#[derive(Debug, Clone, PartialEq)]
pub struct Ran {
    /// It in figures.
    pub figures: PassStatistics,
    /// How long its moves take, and why.
    pub timing: Timing,
    /// The most that is asked of each axis.
    pub peaks: [Peak; 3],
    /// It at a steady speed.
    pub steady: Option<Steady>,
}

impl ProgramStatistics {
    /// Of a program in these files, of these passes.
    pub fn of(program: &Program, files: Vec<String>, passes: Vec<Ran>) -> Self {
        let peaks = MachineAxis::ALL.map(|axis| {
            let peaks = passes.iter().map(|p| p.peaks[axis as usize]);
            let peak = peaks.fold(Peak::default(), Peak::max);
            AxisPeak {
                axis: axis.name().to_owned(),
                velocity: peak.velocity,
                acceleration: peak.acceleration,
                jerk: peak.jerk,
            }
        });
        let bounds: Vec<Bound> = passes
            .iter()
            .flat_map(|p| p.timing.bounds.clone())
            .collect();
        let steady: Option<Vec<Steady>> = passes.iter().map(|p| p.steady).collect();
        Self {
            dialect: program.control.dialect().name.to_owned(),
            files,
            seconds: passes.iter().map(|p| p.figures.seconds).sum(),
            bounds: shares(&bounds),
            peaks: peaks.to_vec(),
            steady: steady.map(|all| SteadySpindle::of(&all)),
            passes: passes.into_iter().map(|p| p.figures).collect(),
        }
    }
}

impl SteadySpindle {
    /// All of them at the speed of the slowest.
    fn of(all: &[Steady]) -> Self {
        let slowest = all.iter().map(|s| s.velocity).fold(f64::INFINITY, f64::min);
        let seconds = all.iter().map(|s| s.seconds * (s.velocity / slowest));
        Self {
            turns: slowest / 6.0,
            seconds: seconds.sum(),
        }
    }
}

/// The share of each bound, the greatest first.
fn shares(bounds: &[Bound]) -> Vec<(String, f64)> {
    let mut counted: Vec<(Bound, u64)> = Vec::new();
    for bound in bounds {
        match counted.iter_mut().find(|(b, _)| b == bound) {
            Some((_, count)) => *count += 1,
            None => counted.push((*bound, 1)),
        }
    }
    counted.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let share = |count: u64| count as f64 / bounds.len() as f64;
    let named = counted.into_iter().map(|(b, n)| (name_of(b), share(n)));
    named.collect()
}

fn name_of(bound: Bound) -> String {
    match bound {
        Bound::Feed => "feed".to_owned(),
        Bound::Shortest => "shortest move of the control".to_owned(),
        Bound::Velocity(axis) => format!("{} velocity", axis.name()),
        Bound::Acceleration(axis) => format!("{} acceleration", axis.name()),
        Bound::Jerk(axis) => format!("{} jerk", axis.name()),
    }
}

/// Writes `report` to `file`: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(file: &Path, report: &Report) -> Result<()> {
    output::write(file, |out| {
        serde_json::to_writer_pretty(&mut *out, report)?;
        out.write_all(b"\n")
    })
}

#[cfg(test)]
mod tests {
    use horma_core::{Index, Inserted, LostAttempt, MotionKind, Phase, ToolPath, Trajectory};

    use super::*;

    fn path() -> ToolPath {
        let touch = |height| Touch {
            height,
            contact: [0.0; 3],
        };
        ToolPath {
            trajectory: Trajectory {
                kind: MotionKind::Rings,
                from: 0.0,
                step: 1.0,
                points_per_revolution: 3,
                positions: 3,
            },
            touches: vec![Some(touch(2.5)), None, Some(touch(-1.0))],
            between: Vec::new(),
        }
    }

    #[test]
    fn a_path_is_counted() {
        let counted = PathStatistics::of(path().waypoints(), &Counters::default());
        assert_eq!((counted.with_contact, counted.without_contact), (2, 1));
        assert_eq!((counted.lowest, counted.highest), (Some(-1.0), Some(2.5)));
        let nothing = ToolPath {
            touches: vec![None],
            ..path()
        };
        let nothing = PathStatistics::of(nothing.waypoints(), &Counters::default());
        assert_eq!((nothing.lowest, nothing.highest), (None, None));
        let finer = ToolPath {
            between: vec![Inserted {
                index: Index::between(0, 512).expect("between"),
                touch: Some(Touch {
                    height: 7.0,
                    contact: [0.0; 3],
                }),
            }],
            ..path()
        };
        let finer = PathStatistics::of(finer.waypoints(), &Counters::default());
        assert_eq!((finer.positions, finer.inserted), (4, 1));
        assert_eq!((finer.with_contact, finer.highest), (3, Some(7.0)));
    }

    #[test]
    fn what_bounds_most_moves_comes_first() {
        let attack = Bound::Acceleration(MachineAxis::Attack);
        let found = shares(&[Bound::Feed, attack, attack, Bound::Shortest, attack]);
        assert_eq!(found[0], ("attack acceleration".to_owned(), 0.6));
        assert_eq!(found.len(), 3);
        assert_eq!(shares(&[]), []);
    }

    #[test]
    fn a_report_reads_back() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join(output::REPORT);
        let report = Report {
            version: "0.1.0".to_owned(),
            job: serde_json::json!({ "cutter": { "kind": "ball", "radius": 5.0 } }),
            files: vec![Source {
                file: "last.stl".to_owned(),
                unit: "inch".to_owned(),
                millimetres: 25.4,
                stated: false,
                bodies: 1,
            }],
            warnings: vec!["last.stl: 3 edges are open".to_owned()],
            path: PathStatistics::of(path().waypoints(), &Counters::default()),
            verification: None,
            machined: None,
            program: None,
            keep_outs: Vec::new(),
            roughing: None,
            last: None,
            record: Record {
                phases: vec![Phase {
                    name: "digitize".to_owned(),
                    seconds: 0.1 + 0.2,
                }],
                lost: vec![LostAttempt {
                    extent: 1,
                    attempt: 1,
                    worker: "w2".to_owned(),
                    positions_received: 100,
                    positions: 250,
                    reason: "connection reset".to_owned(),
                }],
                ..Record::default()
            },
        };
        save(&file, &report).expect("writable");
        let text = std::fs::read_to_string(&file).expect("there");
        let value: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(value["lost"][0]["positions_received"], 100);
        assert_eq!(value["path"]["with_contact"], 2);
        let back: Report = serde_json::from_value(value).expect("own format");
        assert_eq!(back, report);
    }
}
