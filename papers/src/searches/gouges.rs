//! Eq. (6), how deep a wheel sinks into the gaps of a grid, beside what paths over grids do to the surface.

use horma_core::{Method, verify_everywhere};

use crate::error::Result;
use crate::report::{Block, Claim, Verdict, three};

use super::experiments::RADII;
use crate::subject::{Subject, Turning};

/// How the paths turn that are held against the surface, and how far samples of this are apart, mm.
const TURNING: Turning = Turning {
    points_per_revolution: 180,
    step: 2.0,
};
const SPACING: f64 = 1.0;

/// The gap in print, and what eq. (6) makes of it with R 40, mm.
const GAP: f64 = 2.0;
const PRINTED: f64 = 0.0125;
/// What a last allows, mm.
const ALLOWED: f64 = 0.1;

/// Grids and tori.
const CASES: [([u32; 2], [f64; 2]); 6] = [
    ([80, 60], RADII),
    ([159, 120], RADII),
    ([318, 240], RADII),
    ([159, 120], [40.0, 4.0]),
    ([159, 120], [20.0, 8.0]),
    ([159, 120], [80.0, 8.0]),
];
/// Which of them is in print.
const IN_PRINT: usize = 1;

/// Eq. (6): how deep a circle sinks between two points, mm.
fn sunk(radius: f64, gap: f64) -> f64 {
    radius - (radius * radius - gap * gap / 4.0).sqrt()
}

/// How deep a torus of radii R and r sinks between four points of a plane that are a gap apart both ways, mm.
fn sunk_in_plane([major, minor]: [f64; 2], gap: f64) -> f64 {
    let rim = major + minor - sunk(minor, gap);
    major + minor - rim + sunk(rim, gap)
}

/// A path over points, held against the surface; mm.
#[derive(Debug)]
struct Found {
    grid: [u32; 2],
    radii: [f64; 2],
    /// The median and the largest gap.
    gaps: [f64; 2],
    /// The deepest gouge, and how far along the spindle.
    deepest: f64,
    at: f64,
    /// What 99 % of the samples are not gouged beyond.
    percentile: f64,
    /// The share of the samples that are gouged beyond what is allowed.
    beyond: f64,
}

impl Found {
    fn new((grid, radii): ([u32; 2], [f64; 2])) -> Result<Self> {
        let subject = Subject::new(grid, TURNING, radii)?;
        let (path, _) = subject.path(Method::Exact);
        let (found, clearances) = verify_everywhere(
            &subject.part,
            &subject.plan.job.cutter,
            Some(TURNING.step),
            &path.positions(),
            Some(SPACING),
        )?;
        let mut depths: Vec<f64> = clearances.normal.iter().map(|c| (-c).max(0.0)).collect();
        depths.sort_by(f64::total_cmp);
        let within = depths.partition_point(|&d| d <= ALLOWED);
        let count = depths.len() as f64;
        let deepest = found.normal.gouge;
        Ok(Self {
            grid,
            radii,
            gaps: subject.gaps(),
            deepest: deepest.map_or(0.0, |g| g.depth),
            at: deepest.map_or(0.0, |g| g.point[0]),
            percentile: depths[(0.99 * count) as usize],
            beyond: 1.0 - within as f64 / count,
        })
    }

    /// Eq. (6) with the largest gap.
    fn printed(&self) -> f64 {
        sunk(self.radii[0], self.gaps[1])
    }

    fn row(&self) -> Vec<String> {
        let Self { grid, radii, .. } = self;
        vec![
            format!("{} × {}", grid[0], grid[1]),
            format!("R {} r {}", radii[0], radii[1]),
            self.gaps.map(three).join(", "),
            three(self.printed()),
            three(sunk_in_plane(*radii, self.gaps[1])),
            three(self.deepest),
            format!("{:.0}", self.at),
            three(self.percentile),
            format!("{:.1} %", 100.0 * self.beyond),
        ]
    }
}

/// What there is to tell of eq. (6).
///
/// # Errors
/// None, for the sample last.
pub fn blocks() -> Result<Vec<Block>> {
    let found: Vec<Found> = CASES.into_iter().map(Found::new).collect::<Result<_>>()?;
    let heads = [
        "grid",
        "torus",
        "gaps: median, largest",
        "eq. (6), largest gap",
        "in a plane, by R and r",
        "deepest gouge",
        "at x",
        "99 % below",
        "of the surface beyond 0.1",
    ];
    Ok(vec![
        Block::text(
            "Eq. (6) is `e = R − √(R² − D²/4)`, the plane of the wheel alone. The paper's wheel is a torus: along the \
             spindle it is the small radius r that sinks between two points, several times as deep, and between four \
             points of a plane both add up, to `R + r − √((R + √(r² − D²/4))² − D²/4)`. On a last there is more: the \
             surface stands out between points where it bends, which the paper leaves aside as the error of the grid. \
             Below, paths over points are held against the designed surface, which is sampled to 1 mm, normal to it; \
             gaps are those of holders too.",
        ),
        Block::table(
            "Eq. (6) beside what is found on the sample last; mm",
            &heads,
            found.iter().map(Found::row).collect(),
        ),
        Block::Claims(claims(&found)),
    ])
}

fn claims(found: &[Found]) -> Vec<Claim> {
    let printed = &found[IN_PRINT];
    let plane = sunk_in_plane(RADII, GAP);
    let beyond = found.iter().filter(|f| f.deepest > f.printed()).count();
    let [slim, small, large] = [3, 4, 5].map(|k: usize| found[k].deepest);
    vec![
        Claim::new(
            "eq. (6) with R 40 and gaps of 2 mm",
            "0.0125 mm",
            format!("{:.4} mm", sunk(RADII[0], GAP)),
            Verdict::of((sunk(RADII[0], GAP) - PRINTED).abs() < 5.0e-5),
        ),
        Claim::new(
            "how deep a torus R 40 r 8 sinks between points of a plane 2 mm apart",
            "0.0125 mm at most",
            format!("{plane:.4} mm"),
            Verdict::of(plane <= PRINTED),
        ),
        Claim::new(
            "deepest gouge on the last, grid 159 × 120",
            format!(
                "0.0125 mm; {} with its largest gap",
                three(printed.printed())
            ),
            format!("{} mm", three(printed.deepest)),
            Verdict::of(printed.deepest <= printed.printed()),
        ),
        Claim::new(
            "no gouge is deeper than eq. (6) with the largest gap",
            "yes",
            format!("{beyond} of {} are", found.len()),
            Verdict::of(beyond == 0),
        ),
        Claim::new(
            "the error depends on R; deepest gouge with R 20, 40, 80 and r 8, and with R 40 and r 4",
            "as 1/R",
            format!(
                "{}, {}, {}; {} mm",
                three(small),
                three(printed.deepest),
                three(large),
                three(slim)
            ),
            Verdict::of(large < 0.6 * printed.deepest && small > 1.6 * printed.deepest),
        ),
        Claim::new(
            "a grid of 159 × 120 is fine enough for a last, which allows 0.1 mm",
            "implied",
            format!(
                "{:.1} % of the surface is gouged deeper",
                100.0 * printed.beyond
            ),
            Verdict::of(printed.deepest <= ALLOWED),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use horma_core::{Digitizer, Job, Model, MotionKind, Simd, Trajectory};

    #[test]
    fn a_wheel_sinks_into_a_plane_of_points_by_both_radii() {
        let at = |k: i32| GAP * (f64::from(k) - 4.5);
        let grid = (0..10).map(|i| (0..10).map(|j| [at(i), 0.0, at(j)]).collect());
        let model = Model::of_grids(&[grid.collect()]).expect("a grid");
        let trajectory = Trajectory {
            kind: MotionKind::Helix,
            from: 0.0,
            step: 1.0,
            points_per_revolution: 1,
            positions: 1,
        };
        for radii in [RADII, [20.0, 8.0], [40.0, 4.0]] {
            let subject = Subject::new([8, 8], TURNING, radii).expect("the sample");
            let job: Job = subject.plan.job;
            let digitizer = Digitizer::new(&job, &model.rows, Simd::best());
            let (path, _) = digitizer.path(&trajectory);
            let height = path.touches[0].expect("in reach").height;
            let found = radii[0] + radii[1] - height;
            assert!((found - sunk_in_plane(radii, GAP)).abs() < 1e-12, "{found}");
            assert!(found > 3.0 * sunk(radii[0], GAP), "{found}");
        }
    }

    #[test]
    fn paths_over_points_gouge_by_the_small_radius_and_hardly_by_the_large_one() {
        let found = |k: usize| Found::new(CASES[k]).expect("the sample");
        let [printed, slim, small, large] = [IN_PRINT, 3, 4, 5].map(found);
        assert!((0.1..0.2).contains(&printed.deepest), "{printed:?}");
        assert!(printed.deepest > 10.0 * PRINTED, "{printed:?}");
        assert!(slim.deepest > 1.5 * printed.deepest, "{slim:?}");
        assert!(small.deepest < 1.1 * large.deepest, "{small:?} {large:?}");
    }
}
