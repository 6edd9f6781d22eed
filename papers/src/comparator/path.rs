//! The paths of the mill and of the wheel, and what they leave.
//!
//! A Z-constant strategy keeps the mill's height for each way around the part. Figure 11 has spirals on both
//! sides, so the mill's axis is along the spindle here: the last stands on one of its ends, and the mill goes
//! around it as the wheel does, position by position. It is a ball below a shank, a cylinder longer than the
//! last. Both are digitized like any other cutter, over the same facets as the wheel; whichever is held further
//! off tells where the mill stands.

use std::time::Instant;

use horma_core::{
    Contact, Cutter, Digitizer, Job, Plan, Point, Simd, ToolPath, Trajectory, length,
};
use rayon::prelude::*;

use crate::error::Result;
use crate::subject::{Subject, Turning};

/// Points of the last, rows and columns.
const GRID: [u32; 2] = [159, 120];
/// The wheel's radii; the mill's is that of the rim, so that both reach the last at the same travels. mm
pub(super) const MAJOR: f64 = 40.0;
pub(super) const MINOR: f64 = 8.0;
/// How both go around, in about as many positions as in print.
pub(super) const TURNING: Turning = Turning {
    points_per_revolution: 196,
    step: 2.0,
};
/// Longer than the last, mm.
const SHANK: f64 = 400.0;
/// What rounding may do to a height, mm.
pub(super) const ROUNDING: f64 = 1.0e-6;

/// A tool, its axis along the spindle.
#[derive(Debug, Clone, Copy)]
enum Tool {
    Wheel,
    /// Which way along the spindle is up: 1 if the last stands on its heel, −1 on its toe.
    Mill(f64),
}

/// Where the centre of a tool is: travel, direction of the attack axis, height along it.
#[derive(Debug, Clone, Copy)]
struct Stand {
    x: f64,
    cos: f64,
    sin: f64,
    height: f64,
}

/// A path by one of the tools.
pub(super) struct Made {
    tool: Tool,
    pub(super) path: ToolPath,
    /// Whether it is the shank that holds the mill off, position by position.
    pub(super) by_shank: Vec<bool>,
    /// How long it took, s.
    pub(super) seconds: f64,
}

impl Tool {
    /// Radius of the circle that the middle of the rim goes around, mm; a ball is nothing but rim.
    fn major(self) -> f64 {
        match self {
            Self::Wheel => MAJOR,
            Self::Mill(_) => 0.0,
        }
    }

    /// How far a point is from where it stands, mm; less than nothing inside.
    fn distance(self, p: Point, at: &Stand) -> f64 {
        let along = match self {
            Self::Wheel => p[0] - at.x,
            // Above the middle of the ball there is the shank.
            Self::Mill(up) => (up * (p[0] - at.x)).min(0.0),
        };
        let y = p[1] * at.cos - p[2] * at.sin - at.height;
        let z = p[1] * at.sin + p[2] * at.cos;
        let out = (y * y + z * z).sqrt() - self.major();
        length([along, out.max(0.0), 0.0]) - MINOR
    }
}

impl Made {
    fn new(subject: &Subject, tool: Tool) -> Result<Self> {
        let trajectory = subject.plan.trajectory;
        let begin = Instant::now();
        let (path, by_shank) = match tool {
            Tool::Wheel => {
                let wheel = digitize(subject, Cutter::torus(MAJOR, MINOR)?, trajectory);
                (wheel, Vec::new())
            }
            Tool::Mill(up) => {
                let ball = digitize(subject, Cutter::ball(MINOR)?, trajectory);
                let from = trajectory.from + up * SHANK / 2.0;
                let beside = Trajectory { from, ..trajectory };
                let shank = digitize(subject, Cutter::cylinder(MINOR, SHANK)?, beside);
                held_off(ball, &shank)
            }
        };
        Ok(Self {
            tool,
            path,
            by_shank,
            seconds: begin.elapsed().as_secs_f64(),
        })
    }

    fn stands(&self) -> impl Iterator<Item = Stand> + '_ {
        let trajectory = self.path.trajectory;
        let touches = (0..).zip(&self.path.touches);
        touches.filter_map(move |(k, touch)| {
            let (cos, sin) = trajectory.direction_at(k, 0.0);
            touch.map(|touch| Stand {
                x: trajectory.travel(k),
                cos,
                sin,
                height: touch.height,
            })
        })
    }

    /// Where the middle of its rim is, mm: of each tool as far from what it touches.
    pub(super) fn middles(&self) -> impl Iterator<Item = Point> + '_ {
        self.stands().map(|at| {
            let out = at.height - self.tool.major();
            [at.x, out * at.cos, -out * at.sin]
        })
    }

    /// What it leaves at each of some points, along the shortest way, mm.
    fn left(&self, points: &[Point]) -> Vec<f64> {
        let stands: Vec<Stand> = self.stands().collect();
        let left = |&p: &Point| {
            let distances = stands.iter().map(|at| self.tool.distance(p, at));
            distances.fold(f64::INFINITY, f64::min)
        };
        points.par_iter().map(left).collect()
    }

    /// How much further off than that of another the middle of its rim is, position by position, mm.
    pub(super) fn beyond(&self, other: &Self) -> Vec<f64> {
        let further = other.tool.major() - self.tool.major();
        let pairs = self.stands().zip(other.stands());
        pairs.map(|(a, b)| a.height - b.height + further).collect()
    }
}

fn digitize(subject: &Subject, cutter: Cutter, trajectory: Trajectory) -> ToolPath {
    let Plan { job, model, .. } = &subject.plan;
    let job = Job {
        cutter,
        contact: Contact::Facet,
        ..*job
    };
    let digitizer = Digitizer::new(&job, &model.rows, Simd::best());
    digitizer.path(&trajectory).0
}

/// A ball's path where its shank lets it, and whether that holds it off.
fn held_off(mut ball: ToolPath, shank: &ToolPath) -> (ToolPath, Vec<bool>) {
    let pairs = ball.touches.iter_mut().zip(&shank.touches);
    let by_shank = pairs.map(|(ball, shank)| match (*ball, shank) {
        (Some(b), Some(s)) if s.height > b.height => {
            *ball = *shank;
            true
        }
        _ => false,
    });
    let by_shank = by_shank.collect();
    (ball, by_shank)
}

/// The mill with either end of the last up, and the wheel, on the same last.
pub(super) struct Compared {
    pub(super) subject: Subject,
    pub(super) mills: [Made; 2],
    pub(super) wheel: Made,
}

impl Compared {
    pub(super) fn new() -> Result<Self> {
        let subject = Subject::alone(GRID, TURNING, [MAJOR, MINOR])?;
        let mill = |up| Made::new(&subject, Tool::Mill(up));
        Ok(Self {
            mills: [mill(1.0)?, mill(-1.0)?],
            wheel: Made::new(&subject, Tool::Wheel)?,
            subject,
        })
    }

    /// What the three leave at the corners of the facets, mm, in the order of the fields.
    pub(super) fn left(&self) -> [Vec<f64>; 3] {
        let rows = self.subject.plan.model.rows.iter();
        let corners: Vec<Point> = rows.flat_map(|r| r.points.iter().copied()).collect();
        let [toe, heel] = &self.mills;
        [toe, heel, &self.wheel].map(|made| made.left(&corners))
    }
}

/// Whether the mill is nowhere further off than the wheel but for its shank.
pub(super) fn all_by_shank(mill: &Made, beyond: &[f64]) -> bool {
    let mut all = mill.by_shank.iter().zip(beyond);
    all.all(|(by_shank, beyond)| *by_shank || *beyond < ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_gouges_and_only_the_shank_holds_the_mill_further_off_than_the_wheel() {
        let compared = Compared::new().expect("the sample");
        for left in compared.left() {
            let least = left.iter().copied().fold(f64::INFINITY, f64::min);
            assert!((-ROUNDING..0.1).contains(&least), "{least}");
        }
        for made in compared.mills.iter().chain([&compared.wheel]) {
            assert!(made.path.touches.iter().all(Option::is_some));
        }
        for mill in &compared.mills {
            assert!(all_by_shank(mill, &mill.beyond(&compared.wheel)));
            assert!(mill.by_shank.contains(&true) && mill.by_shank.contains(&false));
        }
    }

    #[test]
    fn what_keeps_the_mill_out_keeps_it_out_all_the_way_down() {
        let compared = Compared::new().expect("the sample");
        let turn = TURNING.points_per_revolution as usize;
        for mill in &compared.mills {
            let Tool::Mill(up) = mill.tool else {
                unreachable!("a wheel")
            };
            let heights: Vec<f64> = mill.stands().map(|at| at.height).collect();
            for (low, high) in heights.iter().zip(&heights[turn..]) {
                assert!(up * (low - high) > -ROUNDING, "{up}: {low} {high}");
            }
        }
    }
}
