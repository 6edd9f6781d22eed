//! Verification: a tool path held against the designed surface rather than the grid it came from.
//!
//! Digitizing asks, for each position, which point of the part stops the cutter. This asks the dual:
//! for each sample of the surface, over all positions of the path, how close the cutter comes. The
//! least clearance of a sample is a gouge where it is negative and excess where it is positive, and
//! it is measured twice: along the normal, as the distance to the cutter's body, and along the attack
//! axis, as the advance of the cutter until it would touch. The search shares nothing with that of
//! the digitizer and takes paths from anywhere. Nothing here repairs a path, and nothing knows of
//! grids, rows or facets. The same input gives the same bits with any number of threads.
//!
//! Between samples, `spacing` apart, a gouge can be deeper than reported by up to about `spacing² / 2`
//! times the difference of the curvatures of cutter and part: 16 µm for 0.5 mm and a radius of 8 mm.
//! Memory: about 90 bytes a sample and 210 bytes a position.

mod body;
mod hierarchy;
mod sample;
mod scallop;
mod search;
mod survey;

use serde::{Deserialize, Serialize};

pub use scallop::Scallop;

use crate::cutter::Cutter;
use crate::error::{Error, Result, bounded};
use crate::part::Part;
use crate::tolerance::MAX_COORDINATE;
use crate::vector::Point;
use body::{Cone, Solid, Torus};
use hierarchy::{Hierarchy, Item};
use sample::Samples;
use survey::Worst;

/// Poses checked on each straight move: at a quarter, the half and three quarters of it, the half
/// being where a smooth motion strays most. What they can miss is a gouge that rises and falls between
/// two of them: of one that peaks as a sharp wedge at an eighth of a move, 14 percent of its depth.
pub const INTERMEDIATE: usize = 3;

/// Greatest magnitude of an angle, degrees: there a double still resolves a ten-millionth of one.
const MAX_ANGLE: f64 = 1.0e9;

/// One position of a path from anywhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Position {
    /// Travel along the spindle, mm.
    pub x: f64,
    /// Angle of the part, degrees, unwound.
    pub angle: f64,
    /// Tool centre along the attack axis, mm; `None` where the cutter is not at the part.
    pub height: Option<f64>,
}

/// What verifying a path found. Lengths in mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// Samples of the designed surface, each counted once whatever area it stands for.
    pub samples: u64,
    /// About how far neighbouring samples are apart.
    pub spacing: f64,
    /// Positions with a height.
    pub positions: u64,
    /// Straight moves between successive positions, both with a height.
    pub moves: u64,
    /// Share of the samples, from 0 to 1, that the cutter can reach along the attack axis from no
    /// position.
    pub never_reached: f64,
    /// Along the normal: over all samples, a position whose reach just misses a sample included.
    pub normal: Deviation,
    /// Along the attack axis: over the samples that are reached.
    pub attack: Deviation,
    /// Height of the scallop.
    pub scallop: Scallop,
}

/// How the machined surface deviates from the designed one, in one way of measuring. Lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Deviation {
    /// Material left; nothing if the path does not come near any sample.
    pub excess: Option<Excess>,
    /// Deepest gouge at a position; nothing if there is none.
    pub gouge: Option<Gouge>,
    /// Deepest gouge between positions, as the machine moves travel, angle and height linearly from
    /// each to the next ([`INTERMEDIATE`] poses of each move); nothing if there is none.
    pub motion_gouge: Option<Gouge>,
}

/// Percentiles of the material left over the samples, by nearest rank, mm; a gouged sample counts
/// as 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Excess {
    /// 50th percentile.
    pub median: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 100th percentile: the largest.
    pub max: f64,
}

/// The cutter in the part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gouge {
    /// How deep the sample lies within the cutter (normal), or how far the cutter went beyond the
    /// touch (attack axis), mm.
    pub depth: f64,
    /// The sample, in part coordinates, mm.
    pub point: Point,
    /// Which of the path's positions it is, or from which of them the move departs, from 0; inserted
    /// ones are counted too.
    pub position: u64,
    /// Travel at which it happens, mm.
    pub x: f64,
    /// Angle at which it happens, degrees, unwound.
    pub angle: f64,
    /// Height at which it happens, mm.
    pub height: f64,
}

/// The clearance of each sample of the designed surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clearances {
    /// The samples, in part coordinates, mm.
    pub points: Vec<Point>,
    /// Least clearance of each along the normal, over all positions, moves left out, mm: negative where
    /// it is gouged, else the material left. Empty if the path has no position with a height.
    pub normal: Vec<f64>,
}

/// Verifies a path of `cutter` against the designed surface of `part`, which is in the part frame.
/// `step`, the travel per revolution in mm, is for the scallop; `spacing` is that of the samples in
/// mm, by default such that there are about 240 thousand: half a millimetre on a shoe last. Runs on
/// the current thread pool.
///
/// # Errors
/// [`Error::EmptyPart`]; [`Error::OutOfBounds`] for step or spacing; [`Error::BadPosition`] for a
/// number that is not finite or too far out; [`Error::TooManySamples`].
pub fn verify(
    part: &Part,
    cutter: &Cutter,
    step: Option<f64>,
    positions: &[Position],
    spacing: Option<f64>,
) -> Result<Verification> {
    verify_everywhere(part, cutter, step, positions, spacing).map(|(found, _)| found)
}

/// The same, and where on the surface it was found.
///
/// # Errors
/// Those of [`verify`].
pub fn verify_everywhere(
    part: &Part,
    cutter: &Cutter,
    step: Option<f64>,
    positions: &[Position],
    spacing: Option<f64>,
) -> Result<(Verification, Clearances)> {
    part.validate()?;
    if let Some(step) = step {
        let ok = step > 0.0 && step.is_finite();
        bounded("step", step, ok, "greater than 0 mm and finite")?;
    }
    check(positions)?;
    let samples = sample::sample(part, spacing)?;
    let (mut verification, normal) = match *cutter {
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let body = Torus {
                major_radius,
                minor_radius,
            };
            verify_body(body, &samples, step, positions)
        }
        Cutter::Cone {
            radius,
            width,
            slope,
            ..
        } => verify_body(Cone::new(radius, width, slope), &samples, step, positions),
    };
    verification.scallop.predicted = step.and_then(|s| scallop::predicted(cutter, s));
    let points = samples.points;
    Ok((verification, Clearances { points, normal }))
}

/// The same with the cutter's body, all but the predicted scallop; and the normal clearances.
fn verify_body<S: Solid + Copy>(
    body: S,
    samples: &Samples,
    step: Option<f64>,
    positions: &[Position],
) -> (Verification, Vec<f64>) {
    let points = &samples.points;
    let items = items(positions);
    let standing = items.len() as u64;
    let moves = items.iter().filter(|i| i.by.is_some()).count() as u64;
    let survey = survey::survey(&Hierarchy::new(body, items), points);
    let excess: Vec<f64> = survey.normal.iter().map(|c| c.max(0.0)).collect();
    let measured = match step {
        Some(step) if standing > 0 => scallop::measured(samples, &excess, step),
        _ => None,
    };
    let reached: Vec<f64> = survey.attack.into_iter().flatten().collect();
    let never = points.len() - reached.len();
    let gouge = |worst: Worst, index: usize, share: f64| {
        let [x, angle, height] = at(positions, index, share);
        Gouge {
            depth: -worst.value,
            point: points[worst.sample],
            position: index as u64,
            x,
            angle,
            height,
        }
    };
    let deviation = |measure: usize, excess: Vec<f64>| Deviation {
        excess: percentiles(excess),
        gouge: survey.gouges[measure].map(|w| gouge(w, w.index, 0.0)),
        motion_gouge: survey.motion_gouges[measure].map(|w| {
            let share = hierarchy::share(w.index % INTERMEDIATE);
            gouge(w, w.index / INTERMEDIATE, share)
        }),
    };
    let verification = Verification {
        samples: points.len() as u64,
        spacing: samples.spacing,
        positions: standing,
        moves,
        never_reached: never as f64 / points.len() as f64,
        normal: deviation(0, excess),
        attack: deviation(1, reached),
        scallop: Scallop {
            predicted: None,
            measured,
        },
    };
    (verification, survey.normal)
}

/// Refuses numbers that are not finite or so far out that they would lose their last digits.
pub(crate) fn check(positions: &[Position]) -> Result<()> {
    let far = "finite and within a kilometre of the origin";
    for (index, p) in positions.iter().enumerate() {
        let numbers = [
            ("travel", p.x, MAX_COORDINATE, far),
            (
                "angle",
                p.angle,
                MAX_ANGLE,
                "finite and within 1000000000 degrees",
            ),
            ("height", p.height.unwrap_or(0.0), MAX_COORDINATE, far),
        ];
        for (quantity, value, limit, bound) in numbers {
            // Not the other way round: no comparison holds for what is not a number.
            let ok = value.abs() <= limit;
            if !ok {
                return Err(Error::BadPosition {
                    index,
                    quantity,
                    value,
                    bound,
                });
            }
        }
    }
    Ok(())
}

/// The positions with a height, by index, each with its move if the next one has a height too.
fn items(positions: &[Position]) -> Vec<Item> {
    let mut items = Vec::with_capacity(positions.len());
    for (index, p) in positions.iter().enumerate() {
        let Some(height) = p.height else { continue };
        let next = positions.get(index + 1);
        let by = next.and_then(|q| {
            let turned = (q.angle - p.angle).to_radians();
            q.height.map(|h| [q.x - p.x, turned, h - height])
        });
        items.push(Item {
            index,
            at: [p.x, hierarchy::turn(p.angle), height],
            by,
        });
    }
    items
}

/// Travel (mm), angle (degrees, unwound) and height (mm) `share` of the way from a position with a
/// height to the next.
fn at(positions: &[Position], index: usize, share: f64) -> [f64; 3] {
    let numbers = |p: &Position| [p.x, p.angle, p.height.unwrap_or(f64::NAN)];
    let from = numbers(&positions[index]);
    match positions.get(index + 1) {
        Some(next) if share > 0.0 => {
            let to = numbers(next);
            std::array::from_fn(|k| from[k] + (to[k] - from[k]) * share)
        }
        _ => from,
    }
}

fn percentiles(mut values: Vec<f64>) -> Option<Excess> {
    if values.is_empty() {
        return None;
    }
    let mut rank = |share: f64| {
        let rank = (share * values.len() as f64).ceil() as usize;
        let at = rank.max(1) - 1;
        *values.select_nth_unstable_by(at, f64::total_cmp).1
    };
    Some(Excess {
        median: rank(0.5),
        p99: rank(0.99),
        max: rank(1.0),
    })
}

#[cfg(test)]
mod tests;
