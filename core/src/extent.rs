//! Extents: which positions, and which rows, each worker gets.
//!
//! Positions are cut by x into runs of equal predicted work; an extent needs every row that the
//! cutter can reach from its positions. Both are decided here, once, whatever the distribution.
//! Where positions are inserted an extent owns the moves that begin at its positions, and also needs
//! what is in reach from the one that the last of them ends at.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::job::{Job, Method};
use crate::motion::Trajectory;
use crate::row::Outline;
use crate::runs::Run;
use crate::tolerance::REACH_SLACK;
use crate::vector::Interval;

/// A run of positions and the rows in reach from them.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Extent {
    /// Number of the extent in the job.
    pub id: u32,
    /// Index of its first position.
    pub first: u64,
    /// Number of its positions.
    pub count: u64,
    /// Ids of the rows it needs, in order.
    pub rows: Vec<u32>,
    /// Of these, the ones it owns. Every row that any extent needs is owned by one that does.
    pub own: Vec<u32>,
    /// The rest of these, by their owners.
    pub halo: Vec<Halo>,
}

/// Rows that an extent needs and another one owns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halo {
    /// The owner.
    pub extent: u32,
    /// Ids of the rows, in order.
    pub rows: Vec<u32>,
}

impl Extent {
    /// All of it as one run.
    pub fn whole(&self) -> Run {
        Run {
            first: self.first,
            count: self.count,
            rows: self.rows.clone(),
        }
    }
}

/// Places at which the predicted work is looked at.
const SAMPLES: u64 = 4096;

/// Cuts the trajectory into at most `parts` extents of about equal predicted work, none empty.
pub fn split(trajectory: &Trajectory, outlines: &[Outline], job: &Job, parts: u32) -> Vec<Extent> {
    let w = job.cutter.half_width() + REACH_SLACK;
    let reach = Reach::new(outlines);
    let blocks = trajectory.positions.min(SAMPLES);
    let parts = parts.min(blocks as u32);
    let block =
        |i: u64| (u128::from(trajectory.positions) * u128::from(i) / u128::from(blocks)) as u64;
    let mut total = 0.0;
    let work: Vec<f64> = (0..blocks)
        .map(|i| {
            let positions = block(i)..block(i + 1);
            let x = trajectory.travel((positions.start + positions.end) / 2);
            let candidates = reach.candidates(Interval {
                low: x - w,
                high: x + w,
            });
            total += (positions.end - positions.start) as f64 * predicted(job.method, candidates);
            total
        })
        .collect();
    // The k-th cut is where the work so far first reaches its share.
    let cut = |k: u32| {
        let share = total * f64::from(k) / f64::from(parts);
        block((work.partition_point(|&w| w < share) as u64 + 1).min(blocks))
    };
    let mut cuts: Vec<u64> = (1..parts).map(cut).collect();
    cuts.insert(0, 0);
    cuts.push(trajectory.positions);
    cuts.dedup();
    let extent = |(id, ends): (u32, &[u64])| {
        let (first, count) = (ends[0], ends[1] - ends[0]);
        Extent {
            id,
            first,
            count,
            rows: rows_within(
                outlines,
                seen(trajectory, job, first..first + count).widened(w),
            ),
            ..Extent::default()
        }
    };
    let mut extents: Vec<Extent> = (0..).zip(cuts.windows(2)).map(extent).collect();
    give_to_owners(&mut extents, outlines, trajectory);
    extents
}

/// The travel of positions, and of the one that their last move ends at where positions are inserted.
pub(crate) fn seen(trajectory: &Trajectory, job: &Job, positions: Range<u64>) -> Interval {
    let Range { start, end } = positions;
    let end = match job.motion.path_tolerance {
        Some(_) => trajectory.positions.min(end + 1),
        None => end,
    };
    trajectory.travel_of(start, end - start)
}

/// Gives each row to that of the extents that need it to which its middle is nearest.
fn give_to_owners(extents: &mut [Extent], outlines: &[Outline], trajectory: &Trajectory) {
    let mut owners: Vec<Option<(f64, u32)>> = vec![None; outlines.len()];
    for extent in &*extents {
        let travel = trajectory.travel_of(extent.first, extent.count);
        for &row in &extent.rows {
            let x = outlines[row as usize].x;
            let middle = (x.low + x.high) / 2.0;
            let away = (travel.low - middle).max(middle - travel.high).max(0.0);
            let owner = &mut owners[row as usize];
            if owner.is_none_or(|(least, _)| away < least) {
                *owner = Some((away, extent.id));
            }
        }
    }
    for extent in extents {
        let mut halo: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &row in &extent.rows {
            match owners[row as usize] {
                Some((_, owner)) if owner != extent.id => halo.entry(owner).or_default().push(row),
                _ => extent.own.push(row),
            }
        }
        let halo = halo.into_iter();
        extent.halo = halo.map(|(extent, rows)| Halo { extent, rows }).collect();
    }
}

/// Predicted work of a position with so many candidates within the cutter's width. What the exact
/// search's counters show grows as the fourth root, over grids from three to a hundred thousand points
/// in reach; brute force tries all; a position with nothing in reach is nearly free.
fn predicted(method: Method, candidates: u64) -> f64 {
    let n = candidates as f64;
    match method {
        Method::Exact => 0.05 + libm::sqrt(libm::sqrt(n)),
        Method::Brute => 0.05 + n,
        // The windows are the same everywhere.
        Method::Local(_) => 1.0,
    }
}

/// Ids of the rows of which something lies within `window`, with the rows their facets lead to.
pub(crate) fn rows_within(outlines: &[Outline], window: Interval) -> Vec<u32> {
    let mut rows = Vec::new();
    let mut wanted = false;
    for (id, outline) in (0u32..).zip(outlines) {
        let meets = outline.x.meets(window);
        if wanted || meets {
            rows.push(id);
        }
        wanted = meets && outline.joins_next;
    }
    rows
}

/// How many candidates lie within a window, by the ends of the rows in order.
struct Reach {
    lows: Vec<(f64, u64)>,
    highs: Vec<(f64, u64)>,
}

impl Reach {
    fn new(outlines: &[Outline]) -> Self {
        let cumulative = |end: fn(&Outline) -> f64| {
            let mut ends: Vec<(f64, u64)> = outlines
                .iter()
                .map(|o| (end(o), o.points.max(o.facets)))
                .collect();
            ends.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut sum = 0;
            for (_, n) in &mut ends {
                sum += *n;
                *n = sum;
            }
            ends
        };
        Self {
            lows: cumulative(|o| o.x.low),
            highs: cumulative(|o| o.x.high),
        }
    }

    fn candidates(&self, window: Interval) -> u64 {
        let before = |ends: &[(f64, u64)], i: usize| i.checked_sub(1).map_or(0, |i| ends[i].1);
        let begun = self.lows.partition_point(|e| e.0 <= window.high);
        let ended = self.highs.partition_point(|e| e.0 < window.low);
        before(&self.lows, begun).saturating_sub(before(&self.highs, ended))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::cutter::Cutter;
    use crate::job::{Contact, Coordinates, Discretization};
    use crate::motion::{Motion, MotionKind};
    use crate::runs::interior_first;
    use proptest::prelude::*;

    pub fn job(radius: f64, path_tolerance: Option<f64>) -> Job {
        Job {
            discretization: Discretization::Tolerance(0.1),
            cutter: Cutter::ball(radius).expect("valid"),
            motion: Motion {
                path_tolerance,
                ..Motion::new(MotionKind::Helix, 3.0, 40)
            },
            coordinates: Coordinates::Double,
            contact: Contact::Point,
            method: Method::Exact,
        }
    }

    fn outlines() -> impl Strategy<Value = Vec<Outline>> {
        let row = (-10.0..110.0_f64, 0.0..20.0_f64, any::<bool>());
        prop::collection::vec(row, 1..60).prop_map(|rows| {
            let last = rows.len() - 1;
            let outline = |(i, (low, width, joins)): (usize, (f64, f64, bool))| Outline {
                x: Interval {
                    low,
                    high: low + width,
                },
                joins_next: joins && i < last,
                points: 10,
                facets: 18,
            };
            rows.into_iter().enumerate().map(outline).collect()
        })
    }

    proptest! {
        #[test]
        fn extents_partition_the_positions_and_hold_what_is_in_reach(
            outlines in outlines(),
            positions in 1..5000_u64,
            parts in 1..20_u32,
            radius in 0.5..30.0_f64,
            between in any::<bool>(),
        ) {
            let trajectory = Trajectory {
                kind: MotionKind::Helix,
                from: -5.0,
                step: 3.0,
                points_per_revolution: 40,
                positions,
            };
            let job = job(radius, between.then_some(0.01));
            let extents = split(&trajectory, &outlines, &job, parts);
            prop_assert!(extents.len() <= parts as usize);
            let mut next = 0;
            for (i, e) in extents.iter().enumerate() {
                prop_assert_eq!((e.id as usize, e.first), (i, next));
                prop_assert!(e.count > 0);
                next += e.count;
                let last = e.first + e.count - u64::from(!between || next == positions);
                for index in [e.first, last] {
                    let x = trajectory.travel(index);
                    for (id, o) in (0u32..).zip(&outlines) {
                        if o.x.low <= x + radius && o.x.high >= x - radius {
                            prop_assert!(e.rows.contains(&id));
                            prop_assert!(!o.joins_next || e.rows.contains(&(id + 1)));
                        }
                    }
                }
            }
            prop_assert_eq!(next, positions);
        }

        #[test]
        fn every_row_that_is_needed_has_one_owner_and_the_interior_needs_no_other(
            outlines in outlines(),
            positions in 1..5000_u64,
            parts in 1..20_u32,
            radius in 0.5..30.0_f64,
            between in any::<bool>(),
        ) {
            let job = job(radius, between.then_some(0.01));
            let trajectory = Trajectory {
                kind: MotionKind::Rings,
                from: -5.0,
                step: 3.0,
                points_per_revolution: 40,
                positions,
            };
            let extents = split(&trajectory, &outlines, &job, parts);
            let sorted = |rows: &mut dyn Iterator<Item = u32>| {
                let mut rows: Vec<u32> = rows.collect();
                rows.sort_unstable();
                rows
            };
            let owned = sorted(&mut extents.iter().flat_map(|e| e.own.clone()));
            let mut needed = sorted(&mut extents.iter().flat_map(|e| e.rows.clone()));
            needed.dedup();
            prop_assert_eq!(owned, needed);
            for e in &extents {
                let halo = e.halo.iter().flat_map(|h| h.rows.clone());
                prop_assert_eq!(&sorted(&mut e.own.iter().copied().chain(halo)), &e.rows);
                for h in &e.halo {
                    let owner = &extents[h.extent as usize];
                    prop_assert!(h.extent != e.id && !h.rows.is_empty());
                    prop_assert!(h.rows.iter().all(|r| owner.own.contains(r)));
                }
                let mut runs = interior_first(&trajectory, &outlines, &job, e);
                if runs.len() > 1 {
                    prop_assert!(runs[0].rows.iter().all(|r| e.own.contains(r)));
                }
                runs.sort_by_key(|r| r.first);
                let mut next = e.first;
                for run in runs {
                    prop_assert_eq!(run.first, next);
                    prop_assert!(run.count > 0);
                    next += run.count;
                    let within = seen(&trajectory, &job, run.first..run.first + run.count);
                    let within = within.widened(job.cutter.half_width() + REACH_SLACK);
                    prop_assert_eq!(&run.rows, &rows_within(&outlines, within));
                    prop_assert!(run.rows.iter().all(|r| e.rows.contains(r)));
                }
                prop_assert_eq!(next, e.first + e.count);
            }
        }
    }

    #[test]
    fn work_is_shared_where_the_part_is() {
        let outlines: Vec<Outline> = (0..100)
            .map(|i| Outline {
                x: Interval {
                    low: f64::from(i),
                    high: f64::from(i + 1),
                },
                joins_next: false,
                points: 100,
                facets: 0,
            })
            .collect();
        let trajectory = Trajectory {
            kind: MotionKind::Helix,
            from: -100.0,
            step: 1.0,
            points_per_revolution: 100,
            positions: 20_001,
        };
        let halves = split(&trajectory, &outlines, &job(1.0, None), 2);
        let cut = trajectory.travel(halves[1].first);
        assert!(
            (cut - 50.0).abs() < 2.0,
            "the empty first half is free: {cut}"
        );
    }
}
