//! The path, thinned so that whatever stands out stays.

use horma_core::{Index, Touch, Waypoint};

/// Most positions that are shown.
pub(super) const MOST: usize = 240_000;

/// Positions that a run of them may keep.
const KEPT: usize = 6;

/// The positions that are shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// In order.
    pub positions: Vec<Seen>,
    /// How many positions the path has.
    pub of: u64,
    /// Of so many positions that follow each other these stay: the first, the lowest, the highest, the
    /// steepest, the one that bends most, and the first without contact; all of them if it is 1.
    pub every: u64,
}

/// A position with what its neighbours make of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Its name.
    pub index: Index,
    /// Travel along the spindle, mm.
    pub x: f64,
    /// Unwound angle, degrees.
    pub angle: f64,
    /// Where the cutter touches.
    pub touch: Option<Touch>,
    /// By how much the tool centre rises towards the next position, mm per degree.
    pub slope: Option<f64>,
    /// How that differs from the move before, mm per degree, per degree.
    pub bend: Option<f64>,
}

/// The positions of a path that are shown.
pub(super) fn shown(path: &[Waypoint]) -> Shown {
    thinned(seen(path), MOST)
}

fn seen(all: &[Waypoint]) -> Vec<Seen> {
    // A path from elsewhere may stand still.
    let finite = |rate: f64| rate.is_finite().then_some(rate);
    let slope = |i: usize| {
        let (from, to) = (all.get(i)?, all.get(i + 1)?);
        let rise = to.touch?.height - from.touch?.height;
        finite(rise / (to.angle - from.angle))
    };
    let bend = |i: usize| {
        let before = i.checked_sub(1)?;
        let turned = 0.5 * (all.get(i + 1)?.angle - all[before].angle);
        finite((slope(i)? - slope(before)?) / turned)
    };
    let seen = all.iter().enumerate().map(|(i, w)| Seen {
        index: w.index,
        x: w.x,
        angle: w.angle,
        touch: w.touch,
        slope: slope(i),
        bend: bend(i),
    });
    seen.collect()
}

fn thinned(all: Vec<Seen>, most: usize) -> Shown {
    let of = all.len();
    let every = (KEPT * of).div_ceil(most);
    let (positions, every) = if of <= most {
        (all, 1)
    } else {
        let runs = all.chunks(every);
        (runs.flat_map(outstanding).collect(), every)
    };
    Shown {
        positions,
        of: of as u64,
        every: every as u64,
    }
}

/// Those of a run that stand out, in order and once.
fn outstanding(run: &[Seen]) -> impl Iterator<Item = Seen> {
    let most = |value: fn(&Seen) -> Option<f64>| {
        let values = run.iter().enumerate();
        let values = values.filter_map(|(i, s)| Some((i, value(s)?)));
        values.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
    };
    let mut kept = [
        Some(0),
        most(|s| s.touch.map(|t| t.height)),
        most(|s| s.touch.map(|t| -t.height)),
        most(|s| s.slope.map(f64::abs)),
        most(|s| s.bend.map(f64::abs)),
        run.iter().position(|s| s.touch.is_none()),
    ];
    kept.sort_unstable();
    let mut last = None;
    kept.into_iter().flatten().filter_map(move |i| {
        let again = last.replace(i) == Some(i);
        (!again).then(|| run[i])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use horma_core::{MotionKind, ToolPath, Trajectory};

    fn path(heights: &[Option<f64>]) -> Vec<Waypoint> {
        let touch = |height| Touch {
            height,
            contact: [0.0; 3],
        };
        let path = ToolPath {
            trajectory: Trajectory {
                kind: MotionKind::Helix,
                from: 0.0,
                step: 1.0,
                points_per_revolution: 180,
                positions: heights.len() as u64,
            },
            touches: heights.iter().map(|h| h.map(touch)).collect(),
            between: Vec::new(),
        };
        path.waypoints().collect()
    }

    #[test]
    fn slopes_and_bends_are_per_degree() {
        let seen = seen(&path(&[Some(1.0), Some(2.0), Some(5.0), None, Some(3.0)]));
        let slopes: Vec<_> = seen.iter().map(|s| s.slope).collect();
        assert_eq!(slopes, [Some(0.5), Some(1.5), None, None, None]);
        let bends: Vec<_> = seen.iter().map(|s| s.bend).collect();
        assert_eq!(bends, [None, Some(0.5), None, None, None]);
    }

    #[test]
    fn a_short_path_is_shown_whole() {
        let all = seen(&path(&[Some(1.0); 100]));
        let shown = thinned(all.clone(), 100);
        assert_eq!((shown.every, shown.of), (1, 100));
        assert_eq!(shown.positions, all);
    }

    #[test]
    fn what_stands_out_stays() {
        let mut heights: Vec<Option<f64>> =
            (0..3000).map(|i| Some(50.0 + f64::from(i % 7))).collect();
        heights[1234] = Some(9.0);
        heights[2345] = Some(99.0);
        heights[777] = None;
        let all = seen(&path(&heights));
        let shown = thinned(all.clone(), 600);
        assert_eq!((shown.every, shown.of), (30, 3000));
        assert!(shown.positions.len() <= 600);
        assert!(shown.positions.is_sorted_by(|a, b| a.index < b.index));
        for index in [777, 1234, 2345] {
            assert!(shown.positions.contains(&all[index]), "{index}");
        }
        let steepest = |all: &[Seen]| {
            let slopes = all.iter().filter_map(|s| s.slope);
            slopes.map(f64::abs).fold(0.0, f64::max)
        };
        assert_eq!(steepest(&shown.positions), steepest(&all));
    }
}
