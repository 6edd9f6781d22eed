//! Positions between: inserted where the straight move from one position to the next would stray.
//!
//! A machine moves travel, angle and height linearly from each position to the next. Whether that is
//! good enough is decided for each move by exact heights alone: at a quarter, the half and three
//! quarters of it, the height at which the cutter first touches is held against the straight line.
//! Where they are further apart than the tolerance, too deep or too high, a position is inserted at
//! the half, and both halves are looked at in the same way, down to [`Index::PARTS`] of a move. A move
//! is nobody's business but its own, so the outcome does not depend on who looks at which.
//!
//! The difference is measured along the attack axis. Normal to the surface it is at most that: moved by
//! so much the cutter no longer gouges.
//!
//! Where nothing is in reach at one end, the machine comes or goes at the height of the other end or
//! above, so only what lies higher than that counts. Where nothing is in reach at either end there is
//! no line, and nothing is inserted. What is too short to insert into and still strays, as at a
//! vertical step of the height, is counted. Nothing here searches: heights come from whoever can.

use crate::contact::Pose;
use crate::motion::{Index, Trajectory};
use crate::path::{Inserted, Touch};

/// Where a height is wanted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    pub pose: Pose,
    /// What is touched on either side of it: where to look first.
    pub near: [Option<Touch>; 2],
}

const PARTS: u32 = Index::PARTS as u32;

/// Pieces of a move: what is too short to insert into has quarters too.
const PIECES: u32 = 4 * PARTS;

/// A straight piece of a move, in [`PIECES`]ths.
#[derive(Debug, Clone, Copy)]
struct Span {
    /// The position from which the move begins.
    whole: u64,
    from: u32,
    size: u32,
    /// At its beginning, its half and its end.
    touches: [Option<Touch>; 3],
}

impl Span {
    fn probe(&self, trajectory: &Trajectory, quarters: u32, near: [Option<Touch>; 2]) -> Probe {
        let at = self.from + self.size / 4 * quarters;
        let share = f64::from(at) / f64::from(PIECES);
        let (cos, sin) = trajectory.direction_at(self.whole, share);
        let x = trajectory.travel_at(self.whole, share);
        let pose = Pose { x, cos, sin };
        Probe { pose, near }
    }

    /// Whether the straight line strays further than the tolerance from what is touched at a quarter,
    /// the half and three quarters.
    fn strays(&self, quarters: [Option<Touch>; 2], tolerance: f64) -> bool {
        let [begin, half, end] = self.touches;
        let inner = [(0.25, quarters[0]), (0.5, half), (0.75, quarters[1])];
        let mut inner = inner.into_iter().filter_map(|(s, t)| Some((s, t?.height)));
        match (begin, end) {
            (Some(a), Some(b)) => {
                let line = |share: f64| a.height + (b.height - a.height) * share;
                inner.any(|(share, height)| (height - line(share)).abs() > tolerance)
            }
            (Some(t), None) | (None, Some(t)) => inner.any(|(_, h)| h - t.height > tolerance),
            (None, None) => false,
        }
    }

    /// The index of its half, unless it is too short to have one.
    fn half(&self) -> Option<Index> {
        let at = self.from + self.size / 2;
        let parts = at
            .is_multiple_of(PIECES / PARTS)
            .then_some(at / (PIECES / PARTS))?;
        Index::between(self.whole, parts as u16)
    }

    /// Its halves, given what is touched at the half of each.
    fn halves(&self, quarters: [Option<Touch>; 2]) -> [Self; 2] {
        let size = self.size / 2;
        let [begin, half, end] = self.touches;
        let first = Self {
            size,
            touches: [begin, quarters[0], half],
            ..*self
        };
        let second = Self {
            size,
            from: self.from + size,
            touches: [half, quarters[1], end],
            ..*self
        };
        [first, second]
    }
}

/// Inserts positions into the moves between consecutive positions, of which `touches` are what is
/// touched, from position `first` on; `search` finds what is touched at each of some probes. Returns
/// them in order, and how many moves still stray.
pub(crate) fn insert(
    trajectory: &Trajectory,
    tolerance: f64,
    first: u64,
    touches: &[Option<Touch>],
    mut search: impl FnMut(&[Probe]) -> Vec<Option<Touch>>,
) -> (Vec<Inserted>, u64) {
    let moves = (first..).zip(touches.windows(2));
    let moves = moves.filter(|(_, ends)| ends[0].is_some() || ends[1].is_some());
    let mut spans: Vec<Span> = moves
        .map(|(whole, ends)| Span {
            whole,
            from: 0,
            size: PIECES,
            touches: [ends[0], None, ends[1]],
        })
        .collect();
    let probes = |s: &Span| s.probe(trajectory, 2, [s.touches[0], s.touches[2]]);
    let halves = search(&spans.iter().map(probes).collect::<Vec<_>>());
    for (span, half) in spans.iter_mut().zip(halves) {
        span.touches[1] = half;
    }
    let (mut inserted, mut beyond) = (Vec::new(), 0);
    // All pieces of one size at a time: their heights are searched together.
    while !spans.is_empty() {
        let probes = spans.iter().flat_map(|s| {
            let [begin, half, end] = s.touches;
            let [low, high] = [(1, [begin, half]), (3, [half, end])];
            [low, high].map(|(quarters, near)| s.probe(trajectory, quarters, near))
        });
        let found = search(&probes.collect::<Vec<_>>());
        let (quarters, _) = found.as_chunks::<2>();
        let mut next = Vec::new();
        for (span, &quarters) in spans.iter().zip(quarters) {
            if !span.strays(quarters, tolerance) {
                continue;
            }
            match span.half() {
                Some(index) => {
                    let touch = span.touches[1];
                    inserted.push(Inserted { index, touch });
                    next.extend(span.halves(quarters));
                }
                None => beyond += 1,
            }
        }
        spans = next;
    }
    inserted.sort_unstable_by_key(|i| i.index);
    (inserted, beyond)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionKind;

    /// Four positions in a revolution: moves of a right angle.
    const TRAJECTORY: Trajectory = Trajectory {
        kind: MotionKind::Helix,
        from: 0.0,
        step: 4.0,
        points_per_revolution: 4,
        positions: 9,
    };

    /// What is inserted where the height is a function of the travel, and with how many probes.
    fn check(
        tolerance: f64,
        height: impl Fn(f64) -> Option<f64>,
    ) -> (Vec<(f64, Option<f64>)>, u64, usize) {
        let touch = |x: f64| {
            height(x).map(|height| Touch {
                height,
                contact: [x, 0.0, 0.0],
            })
        };
        let touches: Vec<_> = (0..9).map(|i| touch(TRAJECTORY.travel(i))).collect();
        let mut probes = 0;
        let (inserted, beyond) = insert(&TRAJECTORY, tolerance, 0, &touches, |some| {
            probes += some.len();
            some.iter().map(|p| touch(p.pose.x)).collect()
        });
        let at = |i: &Inserted| {
            let x = TRAJECTORY.travel_at(i.index.floor(), i.index.share());
            (x, i.touch.map(|t| t.height))
        };
        (inserted.iter().map(at).collect(), beyond, probes)
    }

    #[test]
    fn a_straight_height_needs_nothing() {
        let (inserted, beyond, probes) = check(1e-9, |x| Some(3.0 * x - 1.0));
        assert_eq!((inserted, beyond, probes), (vec![], 0, 24));
    }

    #[test]
    fn a_parabola_is_halved_until_its_sagitta_is_within() {
        // Over a move of length l it strays by l² / 4 in the middle.
        let (inserted, beyond, _) = check(0.02, |x| Some(x * x));
        assert_eq!((inserted.len(), beyond), (8 * 3, 0));
        assert!(inserted.iter().all(|&(x, h)| h == Some(x * x)));
        let (inserted, _, _) = check(0.01, |x| Some(-x * x));
        assert_eq!(inserted.len(), 8 * 7);
    }

    #[test]
    fn a_step_is_enclosed_and_counted() {
        let step = |x: f64| Some(if x < 2.3 { 1.0 } else { 2.0 });
        let (inserted, beyond, _) = check(0.1, step);
        assert_eq!((inserted.len(), beyond), (10, 1));
        let at = inserted.partition_point(|i| i.0 < 2.3);
        let (low, high) = (inserted[at - 1].0, inserted[at].0);
        assert!(high - low <= 1.0 / 1024.0, "{low} to {high}");
    }

    #[test]
    fn where_nothing_is_in_reach_only_what_lies_higher_counts() {
        let beside = |x: f64| (x > 2.5).then_some(x);
        // On the move that enters, the end at 3 is the highest.
        assert_eq!(check(0.01, beside).0, vec![]);
        // A peak on it is not.
        let peak = |x: f64| (x > 2.5).then(|| x.max(9.0 - 24.0 * (x - 2.75).abs()));
        let (inserted, beyond, _) = check(0.01, peak);
        assert_eq!(beyond, 0);
        let heights: Vec<f64> = inserted.iter().filter_map(|i| i.1).collect();
        assert_eq!(heights.into_iter().reduce(f64::max), Some(9.0));
        assert_eq!(check(0.01, |_| None).2, 0);
    }
}
