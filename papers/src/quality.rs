//! Table 4 of the FPGA paper: nine lasts measured as designed and as a path leaves them.
//!
//! The lasts are the sample's, in other sizes, for the other foot and of other shapes. Each goes the way of a run:
//! facets to a chordal tolerance, the exact search, rays, measures. There is no machine and no digitizer in it, so
//! that errors are those of the path alone.

use horma_core::{
    Contact, Coordinates, Cutter, Designed, Digitizer, Discretization, Frame, Grading, Hold,
    Interval, Job, Last, Measures, Method, Motion, MotionKind, Plan, Rays, Shaped, Simd, System,
    machined, shape,
};
use horma_formats::lasts::ALLOWED;
use horma_formats::plot::{Curve, Plot, Scale};
use horma_formats::sample::{self, LastStyle};
use rayon::prelude::*;

use crate::error::Result;
use crate::report::{Block, Chapter, Claim, Verdict, three};

/// Chordal tolerance of the facets, and the torus, mm.
const TOLERANCE: f64 = 0.01;
const RADII: [f64; 2] = [40.0, 8.0];
/// Positions to a millimetre of travel, as in print.
const PER_MILLIMETRE: f64 = 200.0;
/// Travel of a revolution for the nine lasts, and what it is varied to on the first, mm.
const STEP: f64 = 0.5;
const STEPS: [f64; 3] = [STEP, 1.0, 2.0];
/// Positions of a revolution that stray little from it.
const DENSE: u32 = 360;
/// How far rays are apart along the spindle, as for a run's report, mm; and how many go around.
const SPACING: f64 = 0.5;
const COLUMNS: u32 = 180;
/// Memory that is more than enough, bytes.
const MEMORY: u64 = 4 << 30;

/// A last of the set.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Kind {
    name: &'static str,
    style: LastStyle,
    /// The size of the style as it is, in Paris points, and the size that is made of it.
    base: f64,
    size: f64,
    /// For the left foot.
    left: bool,
}

const fn kind(name: &'static str, style: LastStyle, [base, size]: [f64; 2], left: bool) -> Kind {
    Kind {
        name,
        style,
        base,
        size,
        left,
    }
}

const HIGH: LastStyle = LastStyle {
    heel_height: 70.0,
    toe_spring: 8.0,
    ..LastStyle::WOMEN
};
const FLAT: LastStyle = LastStyle {
    heel_height: 20.0,
    toe_spring: 12.0,
    ..LastStyle::WOMEN
};
const WIDE: LastStyle = LastStyle {
    ball_width: 98.0,
    cone_height: 92.0,
    ..LastStyle::WOMEN
};

/// As many as in print; the first is the sample.
const SET: [Kind; 9] = [
    kind("women's", LastStyle::WOMEN, [37.0, 37.0], false),
    kind("women's", LastStyle::WOMEN, [37.0, 37.0], true),
    kind("women's", LastStyle::WOMEN, [37.0, 35.0], false),
    kind("women's", LastStyle::WOMEN, [37.0, 40.0], true),
    kind("women's, high heel", HIGH, [37.0, 37.0], false),
    kind("women's, flat", FLAT, [37.0, 38.0], true),
    kind("women's, wide", WIDE, [37.0, 39.0], false),
    kind("men's", LastStyle::MEN, [42.0, 42.0], false),
    kind("men's", LastStyle::MEN, [42.0, 45.0], true),
];

/// Positions of a revolution of so much travel, mm.
fn points_in_print(step: f64) -> u32 {
    (PER_MILLIMETRE * step) as u32
}

/// The measures of table 4, as they are called.
const NAMES: [&str; 4] = [
    "centre line",
    "bottom length",
    "cone heel line",
    "ball girth",
];

fn four(measures: &Measures) -> [f64; 4] {
    [
        measures.centre_line,
        measures.bottom_length,
        measures.cone_heel_line,
        measures.ball_girth,
    ]
}

/// A last, designed and ready to be machined.
#[derive(Debug)]
struct Subject {
    last: Last,
    shaped: Shaped,
}

/// What became of a last.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Made {
    /// As designed, and machined less designed, mm.
    designed: [f64; 4],
    errors: [f64; 4],
    /// The share of it that the tool comes to.
    known: f64,
    positions: u64,
}

impl Subject {
    fn new(kind: &Kind) -> Result<Self> {
        let LastStyle {
            length,
            heel_height,
            ..
        } = kind.style;
        let last = Last {
            bodies: vec!["last".to_owned()],
            frame: Frame::new(true, [-heel_height, 0.0, length], true)?,
            choices: Vec::new(),
        };
        let grading = Grading {
            base: kind.base,
            system: System::Paris,
            geometric: false,
            hold: Hold {
                heel_height: true,
                toe_spring: true,
                toe_thickness: true,
            },
        };
        let graded = kind.size != kind.base;
        let size = graded.then_some((&grading, kind.size));
        let shaped = shape(&sample::last(&kind.style)?, &last, size, kind.left)?;
        Ok(Self { last, shaped })
    }

    /// Machines it, ends included, with so much travel of a revolution, mm, and so many positions.
    fn machine(&self, step: f64, points_per_revolution: u32) -> Result<Made> {
        let long = Interval {
            low: 0.0,
            high: self.shaped.measures.length,
        };
        let job = Job {
            discretization: Discretization::Tolerance(TOLERANCE),
            cutter: Cutter::torus(RADII[0], RADII[1])?,
            motion: Motion {
                from: Some(long.low - RADII[1]),
                to: Some(long.high + RADII[1]),
                ..Motion::new(MotionKind::Helix, step, points_per_revolution)
            },
            coordinates: Coordinates::Double,
            contact: Contact::Facet,
            method: Method::Exact,
        };
        let plan = Plan::new(&self.shaped.part, job, MEMORY)?;
        let (rows, trajectory) = (&plan.model.rows, plan.trajectory);
        let digitizer = Digitizer::new(&job, rows, Simd::best());
        let path = digitizer.path(&trajectory).0.positions();
        let rays = Rays::over(long, SPACING, COLUMNS)?;
        let designed = Designed::of(digitizer, &plan.model).expect("it digitized facets exactly");
        let surface = machined(&designed, &job.cutter, &path, rays, Simd::best())?;
        let (measures, known) = self.last.machined(&self.shaped, &surface, step)?;
        Ok(Made {
            designed: four(&self.shaped.measures),
            errors: four(&measures.less(&self.shaped.measures)),
            known,
            positions: trajectory.positions,
        })
    }
}

impl Made {
    /// The greatest error, mm.
    fn worst(&self) -> f64 {
        greatest(self.errors)
    }
}

fn greatest(errors: impl IntoIterator<Item = f64>) -> f64 {
    errors.into_iter().fold(0.0, |most, e| e.abs().max(most))
}

/// What there is to tell.
///
/// # Errors
/// None, for the sample's lasts.
pub fn chapter() -> Result<Chapter> {
    let first = Subject::new(&SET[0])?;
    let by_step: Vec<(f64, Made)> = STEPS
        .into_par_iter()
        .map(|step| Ok((step, first.machine(step, points_in_print(step))?)))
        .collect::<Result<_>>()?;
    let others = SET[1..].par_iter();
    let others = others.map(|kind| Subject::new(kind)?.machine(STEP, points_in_print(STEP)));
    let others: Vec<Made> = others.collect::<Result<_>>()?;
    let set = [vec![by_step[0].1], others].concat();
    let blocks = vec![
        Block::text(
            "The paper machined nine lasts, took their surfaces with precision digitizers, and compared four measures \
             with those of the models; table 4 had the greatest error of each beside a typical value. Which lasts they \
             were is not said, and the values are lost in our text, so that there is nothing to compare with but the \
             0.1 mm that a last is allowed.",
        ),
        Block::text(format!(
            "Here nine lasts are made of the sample, in other sizes, for the other foot and of other shapes, and \
             machined by paths as a run computes them: facets to {TOLERANCE} mm, torus R 40 r 8, step {STEP} mm, \
             {PER_MILLIMETRE} positions to a millimetre as in print. The surface that the path leaves is measured \
             by rays 0.5 mm apart, between the landmarks of the designed one, a tape lying on the ridges between turns. \
             There is no machine and no digitizer in it: these are the errors of the path alone. Girths that are too short \
             are due to straight moves between so few positions of a turn, which cut in. Centre line and bottom length go \
             into every hollow, and end beside the holders, where the tool does not reach and the last counts as designed."
        )),
        Block::table(
            "Four measures as designed, mm, with what the machined last has more, mm",
            &[
                "last",
                "size",
                "foot",
                NAMES[0],
                NAMES[1],
                NAMES[2],
                NAMES[3],
                "positions",
                "machined",
            ],
            SET.iter().zip(&set).map(|(k, m)| row(k, m)).collect(),
        ),
        Block::Claims(claims(&set, &first.machine(STEP, DENSE)?)),
        Block::Figure("table4", plot(&by_step)),
    ];
    Ok(Chapter {
        name: "quality",
        title: "Quality over several lasts",
        source: "the FPGA paper, table 4 and figure 9",
        blocks,
    })
}

fn row(kind: &Kind, made: &Made) -> Vec<String> {
    let measure = |k: usize| format!("{:.1} {:+.3}", made.designed[k], made.errors[k]);
    vec![
        kind.name.to_owned(),
        kind.size.to_string(),
        if kind.left { "left" } else { "right" }.to_owned(),
        measure(0),
        measure(1),
        measure(2),
        measure(3),
        made.positions.to_string(),
        format!("{:.1} %", 100.0 * made.known),
    ]
}

fn claims(set: &[Made], dense: &Made) -> Vec<Claim> {
    let mut claims: Vec<Claim> = (0..NAMES.len())
        .map(|k| {
            let error = greatest(set.iter().map(|m| m.errors[k]));
            Claim::new(
                format!("table 4: greatest error of the {}", NAMES[k]),
                "",
                format!(
                    "{} mm, typical value {:.0}",
                    three(error),
                    set[0].designed[k]
                ),
                Verdict::Lost,
            )
        })
        .collect();
    let worst = greatest(set.iter().map(Made::worst));
    let girths = greatest(set.iter().flat_map(|m| [m.errors[2], m.errors[3]]));
    claims.extend([
        Claim::new(
            "greatest error of all four over nine lasts",
            "±0.1 mm for copying lathes (2001 paper)",
            format!("{} mm at most", three(worst)),
            Verdict::of(worst < ALLOWED),
        ),
        Claim::new(
            "of the girths, cone heel line and ball",
            "±0.1 mm for copying lathes (2001 paper)",
            format!("{} mm at most", three(girths)),
            Verdict::of(girths < ALLOWED),
        ),
        Claim::new(
            "errors of the first last with 360 positions of a turn instead of 100, in the order above",
            "",
            format!("{} mm", dense.errors.map(|e| format!("{e:+.3}")).join(", ")),
            Verdict::Unsaid,
        ),
    ]);
    claims
}

fn plot(by_step: &[(f64, Made)]) -> Plot {
    let curve = |k: usize| Curve {
        name: NAMES[k].to_owned(),
        color: k,
        dashed: false,
        points: by_step
            .iter()
            .map(|(step, m)| [*step, m.errors[k]])
            .collect(),
    };
    let mut curves: Vec<Curve> = (0..NAMES.len()).map(curve).collect();
    curves.push(Curve {
        name: "allowed".to_owned(),
        color: 3,
        dashed: true,
        points: [STEPS[0], STEPS[STEPS.len() - 1]]
            .map(|s| [s, ALLOWED])
            .to_vec(),
    });
    Plot {
        title: "How much more a machined last measures".to_owned(),
        subtitle: "the sample last, torus R 40 r 8, 200 positions to a millimetre".to_owned(),
        x: "step, mm".to_owned(),
        y: "machined less designed, mm".to_owned(),
        scales: [Scale::Even; 2],
        curves,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn girths_of_a_fine_path_keep_what_is_allowed_and_those_of_a_coarse_one_do_not() {
        let first = Subject::new(&SET[0]).expect("a last");
        let made = |step, points| first.machine(step, points).expect("a path");
        let [fine, coarse] = [STEPS[0], STEPS[2]].map(|step| made(step, points_in_print(step)));
        assert!(
            greatest([fine.errors[2], fine.errors[3]]) < ALLOWED,
            "{fine:?}"
        );
        assert!(fine.worst() < 2.0 * ALLOWED, "{fine:?}");
        assert!(fine.known > 0.9, "{fine:?}");
        // Ridges lie outside.
        assert!(
            coarse.errors[2] > ALLOWED && coarse.errors[3] > ALLOWED,
            "{coarse:?}"
        );
        // With many positions nothing is cut off between them.
        let dense = made(STEP, DENSE);
        assert!(dense.errors[2] > 0.0 && dense.errors[3] > 0.0, "{dense:?}");
    }
}
