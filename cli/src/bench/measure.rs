//! The measurements: each varies one thing, and takes turns between what it compares.
//!
//! Nothing is measured before it has been checked: exact search, brute force, instruction sets and
//! threads have to find the same positions to the last bit.

use std::sync::Arc;
use std::time::Instant;

use horma_core::{
    Contact, Coordinates, Cutter, Digitizer, Discretization, Interval, Job, Method, Motion,
    Outline, Part, Row, Shape, Simd, Trajectory, discretize,
};
use horma_proto::VERSION;
use rayon::ThreadPool;

use super::check::same;
use super::figures::{self, Density, Figures, Positions, Search, SimdLevel, Threads, Wheel};
use super::turns::{Effort, Task, Walk, shortest};
use crate::error::Result;
use crate::progress::Display;
use crate::system;

/// What is digitized.
#[derive(Debug)]
pub(super) struct Subject {
    pub name: String,
    pub part: Arc<Part>,
    pub cutter: Cutter,
    pub motion: Motion,
}

/// The papers' grid, by rows and columns: the shape of every other one.
const GRID: [u32; 2] = [159, 120];
/// Triangles of the part that the wheels meet.
const WHEEL_TRIANGLES: f64 = 40.0e3;
/// Memory for each point: four searches side by side, and what building them takes.
const POINT_BYTES: f64 = 1000.0;
/// Memory for each point of its own row.
const ROW_BYTES: f64 = size_of::<horma_core::Point>() as f64;
/// How the positions are varied: factors of the step and of the points per revolution.
const MOTIONS: [(f64, f64); 5] = [(4.0, 0.25), (2.0, 0.5), (1.0, 1.0), (0.5, 2.0), (0.25, 4.0)];

/// Measures everything.
pub(super) fn all(subject: &Subject, effort: &Effort, display: &Display) -> Result<Figures> {
    let load = system::load();
    let tell = |phase| display.tell(phase, 0, 0);
    let one = system::pool(1)?;
    tell("density");
    let (density, too_large) = densities(subject, effort, &one, display)?;
    let paper = Model::new(subject, GRID)?;
    tell("simd");
    let simd_levels = one.install(|| simd_levels(subject, effort, &paper))?;
    tell("threads");
    let threads = against_threads(subject, effort, &paper)?;
    tell("positions");
    let positions = one.install(|| against_positions(subject, effort, &paper))?;
    tell("wheels");
    let wheels = one.install(|| wheels(subject, effort))?;
    Ok(Figures {
        version: VERSION.to_owned(),
        part: subject.name.clone(),
        cutter: figures::described(&subject.cutter),
        step_mm: subject.motion.step,
        points_per_revolution: subject.motion.points_per_revolution,
        cores: system::cores(),
        load,
        simd: Simd::best().to_string(),
        turns: effort.turns,
        grid: GRID,
        density,
        too_large,
        simd_levels,
        threads,
        positions,
        wheels,
    })
}

/// The part as rows, and its extent along the spindle.
struct Model {
    rows: Vec<Row>,
    points: u64,
    facets: u64,
    x: Interval,
}

impl Model {
    fn new(subject: &Subject, [rows, columns]: [u32; 2]) -> Result<Self> {
        let model = discretize(&subject.part, Discretization::Grid { rows, columns })?;
        let outlines = model.outlines.iter();
        Ok(Self {
            points: outlines.clone().map(|o| o.points).sum(),
            facets: outlines.map(|o| o.facets).sum(),
            x: Outline::span(&model.outlines),
            rows: model.rows,
        })
    }

    fn trajectory(&self, cutter: &Cutter, motion: &Motion) -> Result<Trajectory> {
        Ok(motion.over(self.x, cutter.half_width())?)
    }

    fn digitizer(
        &self,
        (cutter, motion): (Cutter, Motion),
        contact: Contact,
        method: Method,
        simd: Simd,
    ) -> Digitizer {
        let [rows, columns] = GRID;
        let job = Job {
            // Already done.
            discretization: Discretization::Grid { rows, columns },
            coordinates: Coordinates::Double,
            cutter,
            motion,
            contact,
            method,
        };
        Digitizer::new(&job, &self.rows, simd)
    }
}

fn densities(
    subject: &Subject,
    effort: &Effort,
    one: &ThreadPool,
    display: &Display,
) -> Result<(Vec<Density>, Option<f64>)> {
    let surfaces = surfaces(&subject.part);
    let mut found = Vec::new();
    for &points in effort.densities {
        if points * POINT_BYTES > system::memory() as f64 {
            return Ok((found, Some(points)));
        }
        let grid = grid(points, surfaces);
        let model = Model::new(subject, grid)?;
        display.note(&format!("{} points", model.points));
        let mut density = one.install(|| density(subject, effort, &model))?;
        density.grid = (surfaces > 0).then_some(grid);
        found.push(density);
        if surfaces == 0 {
            // Meshes have the density that they have.
            break;
        }
    }
    Ok((found, None))
}

fn surfaces(part: &Part) -> usize {
    let bodies = part.bodies.iter();
    bodies
        .filter(|b| matches!(b.shape, Shape::Surface(_)))
        .count()
}

/// A grid of the papers' shape for each surface, of `points` on all of them.
fn grid(points: f64, surfaces: usize) -> [u32; 2] {
    let [rows, columns] = GRID.map(f64::from);
    let scale = (points / surfaces.max(1) as f64 / (rows * columns)).sqrt();
    [rows, columns].map(|n| (n * scale).round().max(2.0) as u32)
}

fn density(subject: &Subject, effort: &Effort, model: &Model) -> Result<Density> {
    let with = (subject.cutter, subject.motion);
    let make = |contact, method| model.digitizer(with, contact, method, Simd::best());
    let mut exact = [None, None];
    let builds = [Contact::Point, Contact::Facet].into_iter().zip(&mut exact);
    let builds = builds.map(|(contact, place)| -> Task {
        Box::new(move || {
            *place = None;
            let begin = Instant::now();
            *place = Some(make(contact, Method::Exact));
            begin.elapsed().as_secs_f64()
        })
    });
    let built = shortest(effort, 1, builds.collect());
    let [Some(point), Some(facet)] = exact else {
        unreachable!("every task had a turn")
    };
    let [all_points, all_facets] = [Contact::Point, Contact::Facet].map(|c| make(c, Method::Brute));
    let trajectory = model.trajectory(&subject.cutter, &subject.motion)?;
    let few = |digitizer| brute_walk(digitizer, &trajectory, effort);
    let walks = [
        Walk::along(&point, trajectory, effort.positions),
        Walk::along(&facet, trajectory, effort.positions),
        few(&all_points),
        few(&all_facets),
    ];
    for (exact, brute, what) in [
        (&point, &walks[2], "exact search for points"),
        (&facet, &walks[3], "exact search for facets"),
    ] {
        let found = brute.by(exact).touches().0;
        same(&found, &brute.touches().0, what, "brute force")?;
    }
    let us = per_position(effort, &walks);
    let search = |k: usize| {
        let walk = &walks[k];
        let (_, counters) = walk.touches();
        let positions = walk.positions() as f64;
        Search {
            exact_us: us[k],
            brute_us: us[k + 2],
            brute_over_exact: us[k + 2] / us[k],
            positions: walk.positions(),
            brute_positions: walks[k + 2].positions(),
            nodes: counters.nodes as f64 / positions,
            evaluations: counters.evaluations as f64 / positions,
            build_s: built[k],
            bytes_per_point: walk.digitizer.bytes() as f64 / model.points as f64 + ROW_BYTES,
        }
    };
    Ok(Density {
        grid: None,
        points: model.points,
        facets: model.facets,
        point: search(0),
        facet: search(1),
        facet_over_point: us[1] / us[0],
    })
}

/// As many positions as brute force is given time for.
fn brute_walk<'a>(digitizer: &'a Digitizer, along: &Trajectory, effort: &Effort) -> Walk<'a> {
    const LEAST: u64 = 4;
    const MOST: u64 = 4096;
    let trial = Walk::scattered(digitizer, along, LEAST);
    let each = trial.time() / LEAST as f64;
    let count = effort.brute.as_secs_f64() / each;
    Walk::scattered(digitizer, along, (count as u64).clamp(LEAST, MOST))
}

/// Time of a position of each walk, µs.
fn per_position(effort: &Effort, walks: &[Walk]) -> Vec<f64> {
    let tasks = walks.iter().map(|w| -> Task { Box::new(|| w.time()) });
    let times = shortest(effort, effort.turns, tasks.collect());
    let each = |(time, walk): (f64, &Walk)| time * 1.0e6 / walk.positions() as f64;
    times.into_iter().zip(walks).map(each).collect()
}

fn simd_levels(subject: &Subject, effort: &Effort, model: &Model) -> Result<Vec<SimdLevel>> {
    let with = (subject.cutter, subject.motion);
    let trajectory = model.trajectory(&subject.cutter, &subject.motion)?;
    let levels = Simd::available();
    let mut found = Vec::new();
    for (name, contact, method) in [
        ("point, exact", Contact::Point, Method::Exact),
        ("facet, exact", Contact::Facet, Method::Exact),
        ("point, brute", Contact::Point, Method::Brute),
    ] {
        let make = |&simd: &Simd| model.digitizer(with, contact, method, simd);
        let digitizers: Vec<Digitizer> = levels.iter().map(make).collect();
        let first = match method {
            Method::Brute => brute_walk(&digitizers[0], &trajectory, effort),
            _ => Walk::along(&digitizers[0], trajectory, effort.positions),
        };
        let walks: Vec<Walk> = digitizers.iter().map(|d| first.by(d)).collect();
        let reference = first.touches().0;
        for (walk, level) in walks.iter().zip(&levels).skip(1) {
            let what = format!("{name} with {level}");
            same(&walk.touches().0, &reference, &what, "the scalar set")?;
        }
        let us = per_position(effort, &walks);
        found.extend(levels.iter().zip(&us).map(|(level, &time)| SimdLevel {
            search: name,
            simd: level.to_string(),
            us: time,
            speedup: us[0] / time,
        }));
    }
    Ok(found)
}

fn against_threads(subject: &Subject, effort: &Effort, model: &Model) -> Result<Vec<Threads>> {
    let cores = system::cores();
    let doubled = (0..).map(|k| 1 << k).take_while(|&n| n < cores);
    let counts: Vec<usize> = doubled.chain([cores]).collect();
    let pools = counts.iter().map(|&n| system::pool(n));
    let pools: Vec<ThreadPool> = pools.collect::<Result<_>>()?;
    let with = (subject.cutter, subject.motion);
    let digitizer = model.digitizer(with, Contact::Facet, Method::Exact, Simd::best());
    let trajectory = model.trajectory(&subject.cutter, &subject.motion)?;
    // One run from the middle, long enough for every thread to take turns with the others.
    let count = (4 * effort.positions).min(trajectory.positions);
    let first = (trajectory.positions - count) / 2;
    let walk = Walk {
        digitizer: &digitizer,
        trajectory,
        runs: std::iter::once(first..first + count).collect(),
    };
    let reference = pools[0].install(|| walk.touches().0);
    for (pool, n) in pools.iter().zip(&counts).skip(1) {
        let found = pool.install(|| walk.touches().0);
        same(&found, &reference, &format!("{n} threads"), "one")?;
    }
    let walk = &walk;
    let tasks = pools
        .iter()
        .map(|p| -> Task { Box::new(|| p.install(|| walk.time())) });
    let times = shortest(effort, effort.turns, tasks.collect());
    let figure = |(&threads, &time): (&usize, &f64)| Threads {
        threads,
        us: time * 1.0e6 / walk.positions() as f64,
        speedup: times[0] / time,
        efficiency: times[0] / time / threads as f64,
    };
    Ok(counts.iter().zip(&times).map(figure).collect())
}

fn against_positions(subject: &Subject, effort: &Effort, model: &Model) -> Result<Vec<Positions>> {
    let with = (subject.cutter, subject.motion);
    let digitizer = model.digitizer(with, Contact::Facet, Method::Exact, Simd::best());
    let motion = |(step, points): (f64, f64)| {
        let points = f64::from(subject.motion.points_per_revolution) * points;
        Motion {
            step: subject.motion.step * step,
            points_per_revolution: points.round().max(1.0) as u32,
            ..subject.motion
        }
    };
    let motions = MOTIONS.map(motion);
    let trajectories = motions.iter().map(|m| model.trajectory(&subject.cutter, m));
    let trajectories: Vec<Trajectory> = trajectories.collect::<Result<_>>()?;
    let walk = |&t: &Trajectory| Walk::along(&digitizer, t, effort.positions);
    let walks: Vec<Walk> = trajectories.iter().map(walk).collect();
    let us = per_position(effort, &walks);
    let job = us[MOTIONS.len() / 2];
    let figure = |(t, &us): (&Trajectory, &f64)| Positions {
        step_mm: t.step,
        points_per_revolution: t.points_per_revolution,
        positions: t.positions,
        us,
        over_job: us / job,
    };
    Ok(trajectories.iter().zip(&us).map(figure).collect())
}

fn wheels(subject: &Subject, effort: &Effort) -> Result<Vec<Wheel>> {
    let surfaces = surfaces(&subject.part);
    let model = Model::new(subject, grid(WHEEL_TRIANGLES / 2.0, surfaces))?;
    let cutters = [Cutter::torus(40.0, 8.0)?, Cutter::ball(10.0)?];
    let make = |cutter| {
        let with = (cutter, subject.motion);
        model.digitizer(with, Contact::Facet, Method::Exact, Simd::best())
    };
    let digitizers = cutters.map(make);
    let walks = cutters.iter().zip(&digitizers).map(|(cutter, digitizer)| {
        let trajectory = model.trajectory(cutter, &subject.motion)?;
        Ok(Walk::along(digitizer, trajectory, effort.positions))
    });
    let walks: Vec<Walk> = walks.collect::<Result<_>>()?;
    let us = per_position(effort, &walks);
    let figure = |(cutter, &time): (&Cutter, &f64)| Wheel {
        cutter: figures::described(cutter),
        facets: model.facets,
        us: time,
        positions_per_second: 1.0e6 / time,
        over_first: time / us[0],
    };
    Ok(cutters.iter().zip(&us).map(figure).collect())
}
