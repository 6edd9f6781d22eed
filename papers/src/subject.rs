//! The sample last between its holders, over grids of points: what all the experiments are about.

use std::ops::Range;
use std::time::Instant;

use horma_core::{
    Contact, Coordinates, Counters, Culling, Cutter, Digitizer, Discretization, Heuristic, Job,
    Local, Method, Motion, MotionKind, Part, Plan, Point, RowKind, Simd, ToolPath, Window,
    discretize, length, sub,
};
use horma_formats::sample::{self, LastStyle};

use crate::error::Result;

/// Memory that is more than enough, bytes.
const MEMORY: u64 = 4 << 30;

/// How a part turns beside the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turning {
    /// Positions of a revolution.
    pub points_per_revolution: u32,
    /// Travel of a revolution, mm.
    pub step: f64,
}

/// The sample last with its holders, three surfaces with a grid of the same size each.
#[derive(Debug)]
pub struct Subject {
    /// As designed.
    pub part: Part,
    /// Points and positions.
    pub plan: Plan,
}

impl Subject {
    /// With so many rows and columns to a surface, and a torus of radii R and r, mm.
    ///
    /// # Errors
    /// None, for sizes that there can be.
    pub fn new(grid: [u32; 2], turning: Turning, radii: [f64; 2]) -> Result<Self> {
        Self::of(sample::last(&LastStyle::WOMEN)?, grid, turning, radii)
    }

    /// The same without its holders.
    ///
    /// # Errors
    /// None, for sizes that there can be.
    pub fn alone(grid: [u32; 2], turning: Turning, radii: [f64; 2]) -> Result<Self> {
        let mut part = sample::last(&LastStyle::WOMEN)?;
        part.bodies.truncate(1);
        Self::of(part, grid, turning, radii)
    }

    fn of(
        part: Part,
        [rows, columns]: [u32; 2],
        turning: Turning,
        [major, minor]: [f64; 2],
    ) -> Result<Self> {
        let discretization = Discretization::Grid { rows, columns };
        let job = Job {
            discretization,
            cutter: Cutter::torus(major, minor)?,
            motion: Motion::new(
                MotionKind::Helix,
                turning.step,
                turning.points_per_revolution,
            ),
            coordinates: Coordinates::Double,
            contact: Contact::Point,
            method: Method::Exact,
        };
        let plan = Plan::over(discretize(&part, discretization)?, job, MEMORY)?;
        Ok(Self { part, plan })
    }

    /// The same with packed coordinates.
    ///
    /// # Errors
    /// Those of [`Plan::new`], for a part that is larger than the sample.
    pub fn packed(&self) -> Result<Self> {
        let job = Job {
            coordinates: Coordinates::Packed21,
            ..self.plan.job
        };
        let part = self.part.clone();
        let plan = Plan::new(&part, job, MEMORY)?;
        Ok(Self { part, plan })
    }

    /// Points of all grids.
    pub fn points(&self) -> u64 {
        self.plan.model.outlines.iter().map(|o| o.points).sum()
    }

    /// Positions of the trajectory.
    pub fn positions(&self) -> u64 {
        self.plan.trajectory.positions
    }

    /// The path, and what it cost.
    pub fn path(&self, method: Method) -> (ToolPath, Counters) {
        self.digitizer(method).path(&self.plan.trajectory)
    }

    fn digitizer(&self, method: Method) -> Digitizer {
        let job = Job {
            method,
            ..self.plan.job
        };
        Digitizer::new(&job, &self.plan.model.rows, Simd::best())
    }

    /// The papers' search by windows alone.
    pub fn heuristic(&self, culling: Culling) -> Heuristic {
        let local = Local {
            window: None,
            culling,
            fallback: false,
        };
        let Plan {
            job,
            model,
            trajectory,
            ..
        } = &self.plan;
        Heuristic::new(job, local, &model.rows, trajectory, Simd::best())
    }

    /// Seconds of a position by windows, on one thread.
    pub fn time_windows(&self, window: Window) -> f64 {
        let heuristic = self.heuristic(Culling::default());
        let begin = Instant::now();
        heuristic.run(window);
        begin.elapsed().as_secs_f64() / self.positions() as f64
    }

    /// Seconds of a position by brute force, on one thread, sampled all along the trajectory.
    pub fn time_brute(&self) -> f64 {
        // Shorter than a chunk, which one thread takes alone.
        const STRETCH: u64 = 64;
        const STRETCHES: u64 = 8;
        let digitizer = self.digitizer(Method::Brute);
        let stretch = |k: u64| -> Range<u64> {
            let first = (self.positions() - STRETCH) * k / (STRETCHES - 1);
            first..first + STRETCH
        };
        let begin = Instant::now();
        for k in 0..STRETCHES {
            digitizer.run_chunks(&self.plan.trajectory, stretch(k), |_, _| true);
        }
        begin.elapsed().as_secs_f64() / (STRETCH * STRETCHES) as f64
    }

    /// The ways from points of a grid to their neighbours, mm: the median and the longest, D of eq. (6).
    pub fn gaps(&self) -> [f64; 2] {
        let rows = &self.plan.model.rows;
        let apart = |a: &Point, b: &Point| length(sub(*a, *b));
        let along = rows
            .iter()
            .flat_map(|r| r.points.windows(2).map(|p| apart(&p[0], &p[1])));
        let joined = rows
            .windows(2)
            .filter(|r| r[0].kind == RowKind::Isoline { joins_next: true });
        let across = joined.flat_map(|r| {
            let pairs = r[0].points.iter().zip(&r[1].points);
            pairs.map(|(a, b)| apart(a, b))
        });
        let mut gaps: Vec<f64> = along.chain(across).collect();
        gaps.sort_by(f64::total_cmp);
        [gaps[gaps.len() / 2], gaps[gaps.len() - 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brute_force_evaluates_every_point_at_every_position_and_gives_the_same_path() {
        let turning = Turning {
            points_per_revolution: 40,
            step: 8.0,
        };
        let subject = Subject::new([60, 48], turning, [40.0, 8.0]).expect("the sample");
        let (exact, few) = subject.path(Method::Exact);
        let (brute, all) = subject.path(Method::Brute);
        assert_eq!(exact, brute);
        assert_eq!(all.evaluations, subject.points() * subject.positions());
        assert!(few.evaluations * 20 < all.evaluations, "{few:?}");
    }

    #[test]
    fn what_is_counted_is_the_same_for_every_instruction_set() {
        let turning = Turning {
            points_per_revolution: 60,
            step: 4.0,
        };
        let subject = Subject::new([60, 48], turning, [40.0, 8.0]).expect("the sample");
        let Plan {
            job,
            model,
            trajectory,
            ..
        } = &subject.plan;
        let mut counted = Simd::available().into_iter().map(|simd| {
            let digitizer = Digitizer::new(job, &model.rows, simd);
            digitizer.path(trajectory).1
        });
        let first = counted.next().expect("one at least");
        assert!(counted.all(|counters| counters == first));
    }
}
