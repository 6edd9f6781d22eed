//! A job as it was typed: every key optional, every value with its place.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

use serde::{Deserialize, Deserializer};
use toml::Spanned;

use super::Overrides;

/// Where a value comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum At {
    /// These bytes of the job file.
    File(Range<usize>),
    /// A flag or an environment variable, by the key whose place it takes.
    Flag(&'static str),
}

impl At {
    /// Whether it is the job file that says so.
    pub(super) fn in_file(&self) -> bool {
        matches!(self, Self::File(_))
    }
}

/// A value and where it comes from.
#[derive(Debug)]
pub(super) struct Given<T> {
    pub(super) value: T,
    pub(super) at: At,
}

impl<T> Given<T> {
    /// Whether it is the job file that says so.
    pub(super) fn in_file(&self) -> bool {
        self.at.in_file()
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Given<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let spanned = Spanned::deserialize(deserializer)?;
        Ok(Self {
            at: At::File(spanned.span()),
            value: spanned.into_inner(),
        })
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawJob {
    pub(super) part: Option<Given<RawPart>>,
    #[serde(default)]
    pub(super) discretization: RawDiscretization,
    pub(super) cutter: Option<Given<RawCutter>>,
    pub(super) motion: Option<Given<RawMotion>>,
    #[serde(default)]
    pub(super) digitizing: RawDigitizing,
    #[serde(default)]
    pub(super) cluster: RawCluster,
    pub(super) stock: Option<Given<RawStock>>,
    pub(super) roughing: Option<Given<RawRoughing>>,
    #[serde(default)]
    pub(super) keep_out: Vec<Given<RawKeepOut>>,
    #[serde(default)]
    pub(super) program: RawProgram,
    #[serde(default)]
    pub(super) machine: RawMachine,
    #[serde(default)]
    pub(super) output: RawOutput,
    #[serde(default, deserialize_with = "given")]
    pub(super) last: RawLast,
    pub(super) grading: Option<Given<RawGrading>>,
    #[serde(default)]
    pub(super) measures: BTreeMap<String, Given<toml::Value>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPart {
    pub(super) files: Option<Given<Vec<PathBuf>>>,
    pub(super) axis: Option<Given<toml::Value>>,
    pub(super) units: Option<Given<String>>,
    pub(super) trimmed: Option<Given<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawAxis {
    pub(super) point: Option<[f64; 3]>,
    pub(super) direction: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDiscretization {
    pub(super) tolerance: Option<Given<f64>>,
    pub(super) grid: Option<Given<RawGrid>>,
    pub(super) coordinates: Option<Given<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGrid {
    pub(super) rows: Given<i64>,
    pub(super) columns: Given<i64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCutter {
    pub(super) kind: Option<Given<String>>,
    major_radius: Option<Given<f64>>,
    minor_radius: Option<Given<f64>>,
    radius: Option<Given<f64>>,
    width: Option<Given<f64>>,
    half_angle: Option<Given<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMotion {
    pub(super) kind: Option<Given<String>>,
    pub(super) step: Option<Given<f64>>,
    pub(super) points_per_revolution: Option<Given<i64>>,
    pub(super) from: Option<Given<f64>>,
    pub(super) to: Option<Given<f64>>,
    pub(super) lead_in: Option<Given<f64>>,
    pub(super) lead_out: Option<Given<f64>>,
    pub(super) path_tolerance: Option<Given<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDigitizing {
    pub(super) contact: Option<Given<String>>,
    pub(super) method: Option<Given<String>>,
    pub(super) delta_u: Option<Given<i64>>,
    pub(super) delta_v: Option<Given<i64>>,
    pub(super) back_face_culling: Option<Given<bool>>,
    pub(super) area_of_influence: Option<Given<bool>>,
    pub(super) fallback: Option<Given<bool>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCluster {
    pub(super) workers: Option<Given<i64>>,
    pub(super) distribution: Option<Given<String>>,
    pub(super) extents_per_worker: Option<Given<i64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawStock {
    pub(super) kind: Option<Given<String>>,
    pub(super) radius: Option<Given<f64>>,
    pub(super) height: Option<Given<f64>>,
    pub(super) width: Option<Given<f64>>,
    pub(super) from: Option<Given<f64>>,
    pub(super) to: Option<Given<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRoughing {
    pub(super) allowance: Option<Given<f64>>,
    pub(super) depth_of_cut: Option<Given<f64>>,
    pub(super) step: Option<Given<f64>>,
    pub(super) points_per_revolution: Option<Given<i64>>,
    pub(super) path_tolerance: Option<Given<f64>>,
    pub(super) feed: Option<Given<f64>>,
    pub(super) turns: Option<Given<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawKeepOut {
    pub(super) from: Option<Given<f64>>,
    pub(super) to: Option<Given<f64>>,
    pub(super) radius: Option<Given<f64>>,
    pub(super) margin: Option<Given<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawProgram {
    pub(super) dialect: Option<Given<String>>,
    pub(super) travel: Option<Given<String>>,
    pub(super) attack: Option<Given<String>>,
    pub(super) rotation: Option<Given<String>>,
    pub(super) units: Option<Given<String>>,
    pub(super) point: Option<Given<String>>,
    pub(super) decimals: Option<Given<RawDecimals>>,
    pub(super) angles: Option<Given<String>>,
    pub(super) feed_mode: Option<Given<String>>,
    pub(super) split: Option<Given<RawSplit>>,
    pub(super) block_numbers: Option<Given<i64>>,
    pub(super) apt: Option<Given<bool>>,
    pub(super) feed: Option<Given<f64>>,
    pub(super) clearance: Option<Given<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDecimals {
    pub(super) travel: Option<Given<i64>>,
    pub(super) attack: Option<Given<i64>>,
    pub(super) rotation: Option<Given<i64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSplit {
    pub(super) bytes: Option<Given<i64>>,
    pub(super) moves: Option<Given<i64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMachine {
    pub(super) travel: Option<Given<RawAxisLimits>>,
    pub(super) attack: Option<Given<RawAxisLimits>>,
    pub(super) rotation: Option<Given<RawAxisLimits>>,
    pub(super) turns: Option<Given<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOutput {
    pub(super) also: Option<Given<Vec<String>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawAxisLimits {
    pub(super) range: Option<Given<[f64; 2]>>,
    pub(super) velocity: Option<Given<f64>>,
    pub(super) acceleration: Option<Given<f64>>,
    pub(super) jerk: Option<Given<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLast {
    /// Whether the table is there at all.
    #[serde(skip)]
    pub(super) given: bool,
    pub(super) bodies: Option<Given<Vec<String>>>,
    pub(super) toe: Option<Given<String>>,
    pub(super) up: Option<Given<[f64; 3]>>,
    pub(super) side: Option<Given<String>>,
    #[serde(default)]
    pub(super) make: RawMake,
}

/// What is to be made of a last.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMake {
    pub(super) size: Option<Given<f64>>,
    pub(super) side: Option<Given<String>>,
}

/// A table that is there.
fn given<'de, D: Deserializer<'de>>(deserializer: D) -> Result<RawLast, D::Error> {
    let last = RawLast::deserialize(deserializer)?;
    Ok(RawLast {
        given: true,
        ..last
    })
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGrading {
    pub(super) base: Option<Given<f64>>,
    pub(super) system: Option<Given<String>>,
    pub(super) method: Option<Given<String>>,
    pub(super) hold: Option<Given<Vec<String>>>,
}

impl From<u32> for RawSplit {
    /// As a flag says it.
    fn from(moves: u32) -> Self {
        Self {
            bytes: None,
            moves: Some(Given {
                value: moves.into(),
                at: At::Flag("split"),
            }),
        }
    }
}

impl RawCutter {
    /// Every dimension by its key.
    pub(super) fn dimensions(&self) -> [(&'static str, Option<&Given<f64>>); 5] {
        [
            ("major_radius", self.major_radius.as_ref()),
            ("minor_radius", self.minor_radius.as_ref()),
            ("radius", self.radius.as_ref()),
            ("width", self.width.as_ref()),
            ("half_angle", self.half_angle.as_ref()),
        ]
    }
}

impl RawJob {
    /// Puts flags and environment variables in the place of what the file says.
    pub(super) fn replace(&mut self, by: &Overrides) {
        fn put<T: Clone, U>(slot: &mut Option<Given<U>>, key: &'static str, by: &Option<T>)
        where
            U: From<T>,
        {
            if let Some(value) = by.clone() {
                *slot = Some(Given {
                    value: value.into(),
                    at: At::Flag(key),
                });
            }
        }
        put(&mut self.cluster.workers, "workers", &by.workers);
        put(
            &mut self.cluster.distribution,
            "distribution",
            &by.distribution,
        );
        put(
            &mut self.cluster.extents_per_worker,
            "extents_per_worker",
            &by.extents_per_worker,
        );
        let coordinates = &mut self.discretization.coordinates;
        put(coordinates, "coordinates", &by.coordinates);
        put(&mut self.digitizing.contact, "contact", &by.contact);
        put(&mut self.digitizing.method, "method", &by.method);
        put(&mut self.digitizing.delta_u, "delta_u", &by.delta_u);
        put(&mut self.digitizing.delta_v, "delta_v", &by.delta_v);
        put(&mut self.digitizing.fallback, "fallback", &by.fallback);
        put(&mut self.last.make.size, "size", &by.size);
        put(&mut self.last.make.side, "side", &by.side);
        put(&mut self.program.dialect, "dialect", &by.dialect);
        put(&mut self.program.split, "split", &by.split);
        put(&mut self.program.feed, "feed", &by.feed);
        put(&mut self.program.clearance, "clearance", &by.clearance);
        put(&mut self.output.also, "also", &by.also);
        if by.tolerance.is_some() {
            self.discretization.grid = None;
            put(
                &mut self.discretization.tolerance,
                "tolerance",
                &by.tolerance,
            );
        }
        if let Some(motion) = &mut self.motion {
            let motion = &mut motion.value;
            let points = &mut motion.points_per_revolution;
            put(points, "points_per_revolution", &by.points_per_revolution);
            put(&mut motion.step, "step", &by.step);
            put(&mut motion.from, "from", &by.from);
            put(&mut motion.to, "to", &by.to);
            let tolerance = &mut motion.path_tolerance;
            put(tolerance, "path_tolerance", &by.path_tolerance);
        }
    }

    /// Where the value of `key` comes from; no two sections share one that the core knows.
    pub(super) fn at(&self, key: &str) -> Option<&At> {
        fn number<T>(given: &Option<Given<T>>) -> Option<&At> {
            given.as_ref().map(|g| &g.at)
        }
        let motion = self.motion.as_ref().map(|m| &m.value);
        let grid = self.discretization.grid.as_ref().map(|g| &g.value);
        match key {
            "tolerance" => number(&self.discretization.tolerance),
            "rows" => grid.map(|g| &g.rows.at),
            "columns" => grid.map(|g| &g.columns.at),
            "delta_u" => number(&self.digitizing.delta_u),
            "delta_v" => number(&self.digitizing.delta_v),
            "method" => number(&self.digitizing.method),
            "step" => number(&motion?.step),
            "points_per_revolution" => number(&motion?.points_per_revolution),
            "from" => number(&motion?.from),
            "to" => number(&motion?.to),
            "lead_in" => number(&motion?.lead_in),
            "lead_out" => number(&motion?.lead_out),
            "path_tolerance" => number(&motion?.path_tolerance),
            _ => {
                let mut dimensions = self.cutter.as_ref()?.value.dimensions().into_iter();
                dimensions.find_map(|(k, v)| v.filter(|_| k == key).map(|g| &g.at))
            }
        }
    }
}
