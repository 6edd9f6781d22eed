//! How long each move of a program takes: as short as the feed at the contact and the machine allow.
//!
//! A machine runs a path as straight moves, each in the time that it is told. An axis then has one
//! velocity in each move and jumps to the next one at the joint. What that asks of a drive depends on how
//! the control rounds the joint; here the **acceleration at a joint** is the difference of the two
//! velocities over the mean of the two durations, as if velocity went evenly from the middle of one move
//! to the middle of the next. The path begins and ends at rest. The **jerk in a move** is the difference of
//! the accelerations at its two joints over its duration.
//!
//! In `u = 1/t`, the moves a second, and x = u², with d₁ and d₂ what an axis goes in two moves,
//! κ = d₂ − d₁ and m = (d₁ + d₂)/2: the acceleration at the joint is at most
//! `|κ|·max(x₁, x₂) + |m|·|x₂ − x₁|/2`. Held to that, the greater x is bounded by something that rises with
//! the smaller, so that one pass forward and one back give the greatest x of all moves at once, and
//! looking ahead is no more than that. Jerk has no such form: where there is too much of it the
//! accelerations at the joints around are allowed a smaller share of their limit, time and again, and what
//! is then left is taken out by slowing the whole path. This module knows no file and no control.

use crate::course::{MachineAxis, Station};

/// What an axis can do; infinite where nobody says. In mm or degrees, and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLimits {
    /// Greatest velocity.
    pub velocity: f64,
    /// Greatest acceleration.
    pub acceleration: f64,
    /// Greatest jerk.
    pub jerk: f64,
}

impl AxisLimits {
    /// No limit at all.
    pub const NONE: Self = Self {
        velocity: f64::INFINITY,
        acceleration: f64::INFINITY,
        jerk: f64::INFINITY,
    };
}

/// What a plan keeps to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Feed at the contact, mm/s.
    pub feed: f64,
    /// Shortest move that the control can be told, s.
    pub shortest: f64,
    /// Each axis, in the order of [`MachineAxis::ALL`].
    pub axes: [AxisLimits; 3],
}

/// What keeps a move from being shorter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The feed at the contact.
    Feed,
    /// The control cannot be told less.
    Shortest,
    /// An axis is as fast as it can be.
    Velocity(MachineAxis),
    /// An axis gains or loses speed as fast as it can, here or in the moves next to it.
    Acceleration(MachineAxis),
    /// An axis changes its acceleration as fast as it can, somewhere in the neighbourhood.
    Jerk(MachineAxis),
}

/// Durations of the moves from each station to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    /// One for each move, s.
    pub durations: Vec<f64>,
    /// What keeps each of them from being shorter.
    pub bounds: Vec<Bound>,
}

/// The most that is asked of an axis. In mm or degrees, and seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Peak {
    /// Greatest velocity.
    pub velocity: f64,
    /// Greatest acceleration at a joint.
    pub acceleration: f64,
    /// Greatest jerk in a move.
    pub jerk: f64,
}

impl Peak {
    /// The greater of each.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self {
            velocity: self.velocity.max(other.velocity),
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
        }
    }
}

/// The same path at one speed of the spindle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steady {
    /// The greatest within the limits, degrees a second.
    pub velocity: f64,
    /// How long the path then takes, s.
    pub seconds: f64,
}

/// Shortest way that a feed is divided by, mm: the resolution of a coordinate.
const SHORTEST_CUT: f64 = 1.0e-4;

/// How often accelerations are cut down for the sake of jerk.
const ROUNDS: usize = 100;

/// The least that is left of an acceleration in one of the [`ROUNDS`].
const LEAST_SHARE: f64 = 0.5;

/// Plans the moves along `stations`. No axis is ever beyond its limits, as the module defines them.
pub fn timing(stations: &[Station], limits: &Limits) -> Timing {
    let moves: Vec<[f64; 3]> = stations.windows(2).map(|w| w[0].to(&w[1])).collect();
    let alone: Vec<Square> = stations
        .windows(2)
        .map(|w| Square::alone(&w[0], &w[1], limits))
        .collect();
    let mut shares = vec![Share::WHOLE; moves.len() + 1];
    let mut timing = looking_ahead(&moves, alone.clone(), limits, &shares);
    if limits.axes.iter().all(|a| a.jerk.is_infinite()) {
        return timing;
    }
    for _ in 0..ROUNDS {
        if cut_down(&mut shares, &moves, &timing.durations, limits) <= 1.0 {
            return timing;
        }
        timing = looking_ahead(&moves, alone.clone(), limits, &shares);
    }
    let left = cut_down(&mut shares, &moves, &timing.durations, limits);
    for duration in &mut timing.durations {
        *duration *= left.cbrt().max(1.0);
    }
    timing
}

/// The shortest durations with this share of the accelerations at each joint, the two at rest included.
fn looking_ahead(
    moves: &[[f64; 3]],
    mut squares: Vec<Square>,
    limits: &Limits,
    shares: &[Share],
) -> Timing {
    rest(moves, &mut squares, limits, shares);
    let joints = || moves.windows(2).zip(&shares[1..]).enumerate();
    for (i, (joint, share)) in joints() {
        for axis in MachineAxis::ALL {
            let turning = curvature(joint, axis).abs();
            let (limit, bound) = limits.acceleration(axis, share);
            squares[i].lower(limit / turning, bound);
            squares[i + 1].lower(limit / turning, bound);
        }
    }
    for (i, (joint, share)) in joints() {
        let neighbour = squares[i].value;
        squares[i + 1].after(neighbour, joint, limits, share);
    }
    for i in (1..moves.len()).rev() {
        let neighbour = squares[i].value;
        squares[i - 1].after(neighbour, &moves[i - 1..=i], limits, &shares[i]);
    }
    Timing {
        durations: squares.iter().map(|s| 1.0 / s.value.sqrt()).collect(),
        bounds: squares.iter().map(|s| s.bound).collect(),
    }
}

/// How much of the accelerations a joint may have, and on whose account it is no more.
#[derive(Debug, Clone, Copy)]
struct Share {
    value: f64,
    jerk_of: Option<MachineAxis>,
}

impl Share {
    const WHOLE: Self = Self {
        value: 1.0,
        jerk_of: None,
    };
}

/// Lowers the shares of the joints at both ends of each move with too much jerk; how many times its limit
/// the worst is.
fn cut_down(shares: &mut [Share], moves: &[[f64; 3]], durations: &[f64], limits: &Limits) -> f64 {
    let mut worst: f64 = 0.0;
    let mut cuts = vec![Share::WHOLE; shares.len()];
    for axis in MachineAxis::ALL {
        let at = accelerations(moves, durations, axis);
        let limit = limits.axes[axis as usize].jerk;
        for (i, (ends, duration)) in at.windows(2).zip(durations).enumerate() {
            let ratio = (ends[1] - ends[0]).abs() / duration / limit;
            worst = worst.max(ratio);
            let value = (1.0 / ratio).max(LEAST_SHARE);
            for cut in cuts[i..i + 2].iter_mut().filter(|c| value < c.value) {
                *cut = Share {
                    value,
                    jerk_of: Some(axis),
                };
            }
        }
    }
    for (share, cut) in shares.iter_mut().zip(cuts) {
        share.value *= cut.value;
        share.jerk_of = cut.jerk_of.or(share.jerk_of);
    }
    worst
}

/// The square of the moves a second, and what bounds it.
#[derive(Debug, Clone, Copy)]
struct Square {
    value: f64,
    bound: Bound,
}

impl Square {
    /// Of a move by itself.
    fn alone(from: &Station, to: &Station, limits: &Limits) -> Self {
        let squared = |u: f64| u * u;
        let mut square = Self {
            value: squared(limits.feed / from.cut(to).max(SHORTEST_CUT)),
            bound: Bound::Feed,
        };
        square.lower(squared(1.0 / limits.shortest), Bound::Shortest);
        for (axis, way) in MachineAxis::ALL.into_iter().zip(from.to(to)) {
            let most = squared(limits.axes[axis as usize].velocity / way);
            square.lower(most, Bound::Velocity(axis));
        }
        square
    }

    fn lower(&mut self, value: f64, bound: Bound) {
        if value < self.value {
            *self = Self { value, bound };
        }
    }

    /// No more than what the neighbour across `joint`, if it is slower, allows.
    fn after(&mut self, neighbour: f64, joint: &[[f64; 3]], limits: &Limits, share: &Share) {
        for axis in MachineAxis::ALL {
            let (limit, bound) = limits.acceleration(axis, share);
            let half = 0.25 * (joint[0][axis as usize] + joint[1][axis as usize]).abs();
            let turning = curvature(joint, axis).abs();
            self.lower((limit + half * neighbour) / (half + turning), bound);
        }
    }
}

impl Limits {
    /// The acceleration of an axis at a joint with this share of it, and what to call it.
    fn acceleration(&self, axis: MachineAxis, share: &Share) -> (f64, Bound) {
        let bound = share.jerk_of.map_or(Bound::Acceleration(axis), Bound::Jerk);
        (share.value * self.axes[axis as usize].acceleration, bound)
    }
}

/// κ of an axis: how much farther it goes in the second of two moves.
fn curvature(joint: &[[f64; 3]], axis: MachineAxis) -> f64 {
    joint[1][axis as usize] - joint[0][axis as usize]
}

/// The first move begins, and the last ends, at rest: the whole velocity over half the duration.
fn rest(moves: &[[f64; 3]], squares: &mut [Square], limits: &Limits, shares: &[Share]) {
    let last = moves.len().saturating_sub(1);
    for (i, joint) in [(0, 0), (last, moves.len())] {
        let (Some(way), Some(square)) = (moves.get(i), squares.get_mut(i)) else {
            continue;
        };
        for axis in MachineAxis::ALL {
            let (limit, bound) = limits.acceleration(axis, &shares[joint]);
            square.lower(limit / (2.0 * way[axis as usize].abs()), bound);
        }
    }
}

/// Of an axis at each joint, from rest to rest: one more than there are moves.
fn accelerations(moves: &[[f64; 3]], durations: &[f64], axis: MachineAxis) -> Vec<f64> {
    let (mut velocity, mut duration) = (0.0, 0.0);
    let ways = moves.iter().map(|way| way[axis as usize]);
    let mut at = |way: f64, t: f64| {
        let next = if t > 0.0 { way / t } else { 0.0 };
        let acceleration = (next - velocity) / (0.5 * (duration + t));
        (velocity, duration) = (next, t);
        acceleration
    };
    let mut found: Vec<f64> = ways.zip(durations).map(|(w, &t)| at(w, t)).collect();
    if !found.is_empty() {
        found.push(at(0.0, 0.0));
    }
    found
}

/// The most that moves of these durations, from rest to rest, ask of each axis.
pub fn peaks(stations: &[Station], durations: &[f64]) -> [Peak; 3] {
    let moves: Vec<[f64; 3]> = stations.windows(2).map(|w| w[0].to(&w[1])).collect();
    MachineAxis::ALL.map(|axis| {
        let all = accelerations(&moves, durations, axis);
        peak(&moves, durations, axis, &all, durations)
    })
}

/// Of an axis, with its accelerations at some joints and the durations between these.
fn peak(
    moves: &[[f64; 3]],
    durations: &[f64],
    axis: MachineAxis,
    accelerations: &[f64],
    between: &[f64],
) -> Peak {
    let largest = |most: f64, value: f64| most.max(value.abs());
    let velocities = moves.iter().zip(durations);
    let jerks = accelerations.windows(2).zip(between);
    Peak {
        velocity: velocities
            .map(|(way, t)| way[axis as usize] / t)
            .fold(0.0, largest),
        acceleration: accelerations.iter().copied().fold(0.0, largest),
        jerk: jerks.map(|(a, t)| (a[1] - a[0]) / t).fold(0.0, largest),
    }
}

/// The greatest steady speed of the spindle within `limits`, the spindle turning before the path begins and
/// after it ends; `None` if the path does not turn all the time.
pub fn steady(stations: &[Station], limits: &Limits) -> Option<Steady> {
    let moves: Vec<[f64; 3]> = stations.windows(2).map(|w| w[0].to(&w[1])).collect();
    // At one degree a second.
    let durations: Vec<f64> = moves.iter().map(|way| way[2]).collect();
    let last = durations.len().checked_sub(1)?;
    if durations.iter().any(|t| *t <= 0.0) {
        return None;
    }
    let cuts = stations.windows(2).zip(&durations);
    let fastest = cuts.map(|(w, t)| w[0].cut(&w[1]) / t).fold(0.0, f64::max);
    let shortest = durations.iter().copied().fold(f64::INFINITY, f64::min);
    let mut velocity = (limits.feed / fastest).min(shortest / limits.shortest);
    for (axis, limit) in MachineAxis::ALL.into_iter().zip(limits.axes) {
        let all = accelerations(&moves, &durations, axis);
        let inner = (&all[1..=last], &durations[1.min(last)..last]);
        let peak = peak(&moves, &durations, axis, inner.0, inner.1);
        velocity = velocity
            .min(limit.velocity / peak.velocity)
            .min((limit.acceleration / peak.acceleration).sqrt())
            .min((limit.jerk / peak.jerk).cbrt());
    }
    let seconds = durations.iter().sum::<f64>() / velocity;
    Some(Steady { velocity, seconds })
}

#[cfg(test)]
mod tests;
