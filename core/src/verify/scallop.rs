//! The scallop: what successive turns of the cutter leave between them.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::sample::Samples;
use crate::cutter::Cutter;

/// Sectors of a turn, and fewest samples of a tile, for [`measured`].
const SECTORS: f64 = 36.0;
const FEWEST: usize = 8;

/// Height of the scallop, mm.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Scallop {
    /// On a surface parallel to the spindle, from the cutter's profile and the step alone: the
    /// height of the cusp over the surface. For a torus or ball `r − √(r² − (step/2)²)`; for a cone
    /// the saw tooth `step · tan φ`; for a cylinder 0. Nothing without a step, or if the step is
    /// wider than the cutter and successive turns do not meet.
    pub predicted: Option<f64>,
    /// As found on this part: the part is divided into tiles, each one step long (or four spacings,
    /// if they are longer) in x and a 36th of a turn wide, and each body by itself; the largest
    /// normal excess in each tile is one scallop, and this is their median. So neither hollows that
    /// the cutter cannot enter nor the steep ends of the part decide it. Nothing without a step, or
    /// if no tile holds 8 samples.
    pub measured: Option<f64>,
}

/// See [`Scallop::predicted`].
pub(super) fn predicted(cutter: &Cutter, step: f64) -> Option<f64> {
    if step > 2.0 * cutter.half_width() {
        return None;
    }
    Some(match *cutter {
        Cutter::Torus { minor_radius, .. } => {
            let half = 0.5 * step;
            let root = ((minor_radius - half) * (minor_radius + half)).max(0.0);
            half * half / (minor_radius + root.sqrt())
        }
        Cutter::Cone { slope, .. } => step * slope.abs(),
    })
}

/// See [`Scallop::measured`]; `excess` is the normal excess of each sample, mm.
pub(super) fn measured(samples: &Samples, excess: &[f64], step: f64) -> Option<f64> {
    let long = step.max(4.0 * samples.spacing);
    let mut bodies = samples.ends.iter().enumerate();
    let mut body = bodies.next();
    let mut tiles: Vec<((usize, i64, i64), f64)> = Vec::with_capacity(excess.len());
    for (i, (p, &e)) in samples.points.iter().zip(excess).enumerate() {
        while body.is_some_and(|(_, &end)| i >= end) {
            body = bodies.next();
        }
        let turn = libm::atan2(p[2], p[1]) / TAU;
        let place = (
            body.map_or(0, |(b, _)| b),
            (p[0] / long).floor() as i64,
            (turn * SECTORS).floor() as i64,
        );
        tiles.push((place, e));
    }
    tiles.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // In order of the excess within each tile, so the last one is the largest.
    let mut largest: Vec<f64> = tiles
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|tile| tile.len() >= FEWEST)
        .filter_map(|tile| tile.last().map(|t| t.1))
        .collect();
    largest.sort_unstable_by(f64::total_cmp);
    largest.get(largest.len().saturating_sub(1) / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prediction_follows_the_profile() {
        let of = |cutter: crate::Result<Cutter>, step| predicted(&cutter.expect("valid"), step);
        let known = |found: Option<f64>, expected: f64| {
            assert!(
                (found.expect("known") - expected).abs() < 1e-12,
                "{found:?}"
            );
        };
        known(of(Cutter::torus(40.0, 8.0), 2.0), 8.0 - 63.0_f64.sqrt());
        known(of(Cutter::ball(8.0), 16.0), 8.0);
        known(of(Cutter::cylinder(30.0, 10.0), 10.0), 0.0);
        known(of(Cutter::cone(30.0, 10.0, 45.0), 4.0), 4.0);
        known(of(Cutter::cone(30.0, 10.0, -45.0), 4.0), 4.0);
        assert_eq!(of(Cutter::ball(8.0), 16.1), None);
        assert_eq!(of(Cutter::cylinder(30.0, 10.0), 10.1), None);
    }
}
