//! Roughing: from the stock down to a target, in layers of at most so much.
//!
//! The target is the exact path of the cutter *grown* by the allowance: where that touches the part, the
//! cutter itself is the allowance away from it, normal to the surface. The depth of cut is counted along
//! the attack axis from the height at which the cutter first touches the stock: layer `k` is as low as
//! `k` depths of cut below that, but nowhere below the target. So layers never rise from one to the next,
//! none takes more than the depth of cut at a position, and the last one is the target. At the stock's ends
//! that holds on the moves as well.
//!
//! A layer goes over all positions: where it has nothing to cut it runs along the surface that is there.

use crate::course::course;
use crate::cutter::Cutter;
use crate::error::{Error, Result};
use crate::path::{ToolPath, Touch};
use crate::solid::Solid;
use crate::vector::facing;

/// One layer of roughing.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Its path. Where it does not come down to the target, the contact is the point of the cutter that is
    /// nearest to the spindle.
    pub path: ToolPath,
    /// The most that it takes at a position, mm along the attack axis.
    pub deepest: f64,
}

/// Most layers, and most positions of all of them.
const MAX_LAYERS: u64 = 200;
const MAX_POSITIONS: u64 = 50_000_000;

/// What is left to take by no layer of its own, mm: a nanometre, which is rounding.
const NOTHING: f64 = 1.0e-6;

/// The layers from `stock` down to `target`, for the cutter itself and not for the grown one; none if there
/// is nothing to take. Where the target touches nothing, it counts as [`course`] has it.
///
/// # Errors
/// [`Error::TooManyLayers`]
pub fn layers(
    target: &ToolPath,
    cutter: &Cutter,
    stock: &Solid,
    depth_of_cut: f64,
) -> Result<Vec<Layer>> {
    let Some(held) = course(target) else {
        return Ok(Vec::new());
    };
    let bottoms: Vec<f64> = held.iter().map(|s| s.axes[1]).collect();
    let tops = tops(target, cutter, stock);
    let both = || tops.iter().zip(&bottoms);
    let most = both().filter_map(|(top, bottom)| Some((*top)? - bottom));
    let most = most.fold(0.0, f64::max);
    let number = ((most - NOTHING) / depth_of_cut).ceil().max(0.0);
    let limit = MAX_LAYERS.min(MAX_POSITIONS / bottoms.len() as u64);
    if number > limit as f64 {
        return Err(Error::TooManyLayers {
            layers: number,
            limit,
        });
    }
    let number = number as u32;
    // How low layer `k` goes where there is stock; the 0th is the stock itself.
    let height = |k: u32, top: f64, bottom: f64| match k == number {
        true => bottom,
        false => bottom.max(top - f64::from(k) * depth_of_cut),
    };
    let layer = |k: u32| {
        let all = target.along().zip(both());
        let touches = all.map(|((waypoint, _, direction), (&top, &bottom))| {
            let Some(top) = top else {
                return waypoint.touch;
            };
            let height = height(k, top, bottom);
            let touched = waypoint.touch.filter(|t| t.height == height);
            Some(touched.unwrap_or_else(|| {
                let tip = height - cutter.max_radius();
                let contact = facing(waypoint.x, tip, direction);
                Touch { height, contact }
            }))
        });
        let taken = both().filter_map(|(top, &bottom)| {
            let top = (*top)?;
            let before = match k {
                1 => top,
                _ => height(k - 1, top, bottom),
            };
            Some(before - height(k, top, bottom))
        });
        Layer {
            deepest: taken.fold(0.0, f64::max),
            path: target.with(touches.collect()),
        }
    };
    Ok((1..=number).map(layer).collect())
}

/// The most that a path takes from `stock` at a position where it touches, mm along the attack axis.
pub fn deepest_cut(path: &ToolPath, cutter: &Cutter, stock: &Solid) -> f64 {
    let tops = tops(path, cutter, stock).into_iter().zip(path.waypoints());
    let taken = tops.filter_map(|(top, w)| Some(top? - w.touch?.height));
    taken.fold(0.0, f64::max)
}

/// The height at which the cutter first touches the stock at each position or on the moves at either side;
/// `None` where it does not.
fn tops(path: &ToolPath, cutter: &Cutter, stock: &Solid) -> Vec<Option<f64>> {
    let tops = path.along();
    tops.map(|(_, travel, direction)| stock.height(cutter, travel, direction))
        .collect()
}

#[cfg(test)]
mod tests;
