//! Random parts and jobs, from bytes: what the property test and the fuzz target both feed on.
//!
//! Almost every string of bytes is a case, with zeros for what is missing, so that shrinking bytes shrinks
//! cases. The bytes decide what there is and how large; where the noise falls comes from
//! a generator that they seed. Numbers are often rounded to eighths: only then are heights equal, and
//! ties are what the lowest candidate has to win.

use std::sync::OnceLock;

use horma_core::{
    Body, Contact, Coordinates, Cutter, Digitizer, Direction, Discretization, Extent, Inserted,
    Job, Mesh, Method, Motion, MotionKind, Part, Plan, Point, Row, Shape, Simd, SubTrajectory,
    Surface, Touch, stitch,
};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A part, what to do with it, and in how many extents.
#[derive(Debug, Clone)]
pub struct Case {
    /// What is cut.
    pub part: Part,
    /// How; its method is of no account.
    pub job: Job,
    /// Extents to cut the positions into.
    pub extents: u32,
}

/// Most positions of a case: more than a chunk of the digitizer's has, few enough for brute force.
const POSITIONS: u64 = 700;

/// The same where positions are inserted between them.
const POSITIONS_BETWEEN: u64 = 300;

impl Case {
    /// The case that bytes stand for, or `None` if its numbers are out of bounds.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut dice = Dice::new(bytes);
        let part = part(&mut dice)?;
        let size = size(&part);
        let cutter = cutter(&mut dice, size)?;
        let motion = motion(&mut dice, &part, &cutter);
        let coordinates = [
            Coordinates::Double,
            Coordinates::Double,
            Coordinates::Packed21,
        ];
        let coordinates = *dice.pick(&coordinates);
        let rows = 2 + dice.below(11) as u32;
        let columns = 2 + dice.below(25) as u32;
        let mut job = Job {
            discretization: Discretization::Grid { rows, columns },
            coordinates,
            cutter,
            motion,
            contact: *dice.pick(&[Contact::Facet, Contact::Point]),
            method: Method::Exact,
        };
        let extents = *dice.pick(&[1, 2, 3, 5, 16]);
        let share = *dice.pick(&[None, Some(0.1), Some(0.01), Some(0.002)]);
        job.motion.path_tolerance = share.map(|s: f64| (s * size).max(1.0e-6));
        Some(Self { part, job, extents })
    }

    /// Digitizes the case by brute force and in every other way there is, and compares bit by bit.
    /// Returns the number of positions compared; `Err` tells where the first difference is.
    pub fn check(&self) -> Result<usize, String> {
        let Ok(plan) = Plan::new(&self.part, self.job, 1 << 30) else {
            return Ok(0);
        };
        let between = self.job.motion.path_tolerance.is_some();
        let most = if between {
            POSITIONS_BETWEEN
        } else {
            POSITIONS
        };
        if plan.trajectory.positions > most {
            return Ok(0);
        }
        let all = 0..plan.trajectory.positions;
        let brute = Job {
            method: Method::Brute,
            ..self.job
        };
        let rows = &plan.model.rows;
        let levels = Simd::available();
        let wanted = run(&plan, brute, rows, levels[0], 2, all.clone());
        let mut compared = 0;
        for &simd in &levels {
            if self.job.contact == Contact::Point {
                let got = run(&plan, brute, rows, simd, 1, all.clone());
                compared += same(&wanted, &got).map_err(|e| format!("brute {simd}: {e}"))?;
            }
            for threads in [1, 3] {
                let got = run(&plan, self.job, rows, simd, threads, all.clone());
                let name = || format!("exact {simd} on {threads} threads");
                compared += same(&wanted, &got).map_err(|e| format!("{}: {e}", name()))?;
            }
        }
        for (name, job) in [("exact", self.job), ("brute", brute)] {
            let (mut parts, mut beyond) = (Vec::new(), 0);
            for extent in plan.split(self.extents) {
                let (rows, range) = (rows_of(&plan, &extent), positions(&extent));
                let got = run(&plan, job, &rows, Simd::best(), 1, range.clone());
                beyond += got.beyond;
                parts.push(got.path);
            }
            let path = stitch(plan.trajectory, parts).map_err(|e| e.to_string())?;
            let got = Run {
                path: SubTrajectory {
                    first: 0,
                    touches: path.touches,
                    between: path.between,
                },
                beyond,
            };
            let name = || format!("{name} in {} extents", self.extents);
            compared += same(&wanted, &got).map_err(|e| format!("{}: {e}", name()))?;
        }
        Ok(compared)
    }
}

fn rows_of(plan: &Plan, extent: &Extent) -> Vec<Row> {
    let rows = extent.rows.iter();
    rows.map(|&id| plan.model.rows[id as usize].clone())
        .collect()
}

fn positions(extent: &Extent) -> std::ops::Range<u64> {
    extent.first..extent.first + extent.count
}

/// What digitizing gives, and how many moves stray all the same.
struct Run {
    path: SubTrajectory,
    beyond: u64,
}

/// The touches of some positions, and what is inserted, on a pool of so many threads.
fn run(
    plan: &Plan,
    job: Job,
    rows: &[Row],
    simd: Simd,
    threads: usize,
    positions: std::ops::Range<u64>,
) -> Run {
    static POOLS: [OnceLock<ThreadPool>; 4] = [const { OnceLock::new() }; 4];
    let pool = POOLS[threads].get_or_init(|| {
        let builder = ThreadPoolBuilder::new().num_threads(threads);
        builder.build().expect("threads can be started")
    });
    pool.install(|| {
        let mut path = SubTrajectory {
            first: positions.start,
            ..SubTrajectory::default()
        };
        let digitizer = Digitizer::new(&job, rows, simd);
        let counters = digitizer.run_chunks(&plan.trajectory, positions, |chunk, _| {
            assert_eq!(chunk.first, path.end());
            path.touches.extend(chunk.touches);
            path.between.extend(chunk.between);
            true
        });
        let beyond = counters.beyond_tolerance;
        Run { path, beyond }
    })
}

fn bits(touch: &Option<Touch>) -> Option<[u64; 4]> {
    let [x, y, z] = touch.as_ref()?.contact.map(f64::to_bits);
    Some([touch.as_ref()?.height.to_bits(), x, y, z])
}

/// Compares bit by bit.
fn same(wanted: &Run, got: &Run) -> Result<usize, String> {
    let (touches, between) = (&wanted.path.touches, &wanted.path.between);
    let counts = |r: &Run| {
        [
            r.path.touches.len(),
            r.path.between.len(),
            r.beyond as usize,
        ]
    };
    for (index, (wanted, got)) in touches.iter().zip(&got.path.touches).enumerate() {
        if bits(wanted) != bits(got) {
            return Err(format!("position {index}: {got:?}, not {wanted:?}"));
        }
    }
    for (wanted, got) in between.iter().zip(&got.path.between) {
        let all = |i: &Inserted| (i.index, bits(&i.touch));
        if all(wanted) != all(got) {
            return Err(format!("between: {got:?}, not {wanted:?}"));
        }
    }
    if counts(wanted) != counts(got) {
        let (got, wanted) = (counts(got), counts(wanted));
        return Err(format!(
            "positions, inserted, beyond: {got:?}, not {wanted:?}"
        ));
    }
    Ok(touches.len() + between.len())
}

/// Decisions, read off bytes.
struct Dice<'a> {
    bytes: &'a [u8],
}

impl<'a> Dice<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    fn byte(&mut self) -> u8 {
        match self.bytes.split_first() {
            Some((&first, rest)) => {
                self.bytes = rest;
                first
            }
            None => 0,
        }
    }

    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    fn pick<'b, T>(&mut self, choices: &'b [T]) -> &'b T {
        &choices[self.below(choices.len())]
    }

    /// From 0 to 1, both included.
    fn share(&mut self) -> f64 {
        let high = f64::from(self.byte());
        (high * 256.0 + f64::from(self.byte())) / 65535.0
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }

    fn noise(&mut self) -> Noise {
        Noise(u64::from(self.byte()) << 8 | u64::from(self.byte()))
    }
}

/// SplitMix64.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From −1 to 1.
    fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn point(&mut self) -> Point {
        [self.signed(), self.signed(), self.signed()]
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Vertices and triangles, before they are scaled.
#[derive(Clone)]
struct Net {
    points: Vec<Point>,
    shape: NetShape,
}

#[derive(Clone)]
enum NetShape {
    Triangles(Vec<[u32; 3]>),
    /// Degrees and the number of poles along v.
    Poles([usize; 2], usize),
}

fn part(dice: &mut Dice) -> Option<Part> {
    let mut nets: Vec<Net> = Vec::new();
    for _ in 0..=dice.below(3) {
        let net = net(dice);
        // The same once more: in the same place, mirrored, inside, beside, or cut otherwise.
        let map: Option<fn(Point) -> Point> = match dice.below(12) {
            0 => Some(|p| p),
            1 => Some(|[x, y, z]| [x, y, -z]),
            2 => Some(|[x, y, z]| [-x, y, z]),
            3 => Some(|[x, y, z]| [x, y * 0.75, z * 0.75]),
            4 => Some(|[x, y, z]| [x, y * (1.0 + 1e-9), z]),
            5 => Some(|[x, y, z]| [x + 64.0, y, z]),
            6 => Some(|[x, y, z]| [x, z, -y]),
            _ => None,
        };
        if let Some(map) = map {
            let mut copy = net.clone();
            copy.points = copy.points.into_iter().map(map).collect();
            if let NetShape::Triangles(triangles) = &mut copy.shape {
                triangles.reverse();
                triangles.iter_mut().for_each(|t| t.rotate_left(1));
            }
            nets.push(copy);
        }
        nets.push(net);
    }
    let rounded = dice.below(3) == 0;
    let scale = *dice.pick(&[1.0, 1.0, 1.0, 1.0, 0.01, 3.0e-5, 10.0, 300.0]);
    let x = *dice.pick(&[0.0, 0.0, 0.0, 1.0e3, -1.0e5, 1.0e5]);
    let y = *dice.pick(&[0.0, 0.0, 0.0, 0.0, 30.0, -2000.0]);
    let z = *dice.pick(&[0.0, 0.0, 0.0, 0.0, 5.0, 3.0e4]);
    let place = |p: Point| {
        let p = if rounded { p.map(eighths) } else { p };
        [p[0] * scale + x, p[1] * scale + y, p[2] * scale + z]
    };
    let mut bodies = Vec::new();
    for (i, net) in nets.into_iter().enumerate() {
        let name = i.to_string();
        let points: Vec<Point> = net.points.into_iter().map(place).collect();
        let shape = match net.shape {
            NetShape::Triangles(triangles) => {
                Shape::Mesh(Mesh::new(&name, points, triangles).ok()?)
            }
            NetShape::Poles([u, v], columns) => {
                let rows = points.len() / columns;
                let (u, v) = (direction(u, rows), direction(v, columns));
                Shape::Surface(Surface::new(&name, u, v, points, None).ok()?)
            }
        };
        bodies.push(Body { name, shape });
    }
    Some(Part { bodies })
}

fn eighths(x: f64) -> f64 {
    (x * 8.0).round() / 8.0
}

/// Clamped, with even knots.
fn direction(degree: usize, count: usize) -> Direction {
    let inner = (1..count - degree).map(|i| i as f64);
    let ends = |t: f64| std::iter::repeat_n(t, degree + 1);
    let knots = ends(0.0).chain(inner).chain(ends((count - degree) as f64));
    Direction {
        degree,
        knots: knots.collect(),
    }
}

fn net(dice: &mut Dice) -> Net {
    match dice.below(8) {
        0 => point_like(dice),
        1 => soup(dice),
        2 => fins(dice),
        3 => slivers(dice),
        4 => stepped(dice),
        5 => flats(dice),
        _ => lobed(dice),
    }
}

/// One triangle, down to none.
fn point_like(dice: &mut Dice) -> Net {
    let size = *dice.pick(&[0.0, 1.0e-12, 1.0e-6, 1.0e-3, 1.0]);
    let mut noise = dice.noise();
    let middle = noise.point().map(|c| 16.0 * c);
    let corner = |by: Point| [0, 1, 2].map(|k| middle[k] + size * by[k]);
    let points = vec![
        corner(noise.point()),
        corner(noise.point()),
        corner(noise.point()),
    ];
    Net {
        points,
        shape: NetShape::Triangles(vec![[0, 1, 2]]),
    }
}

/// Triangles between any of a few points, degenerate ones among them.
fn soup(dice: &mut Dice) -> Net {
    let count = 1 + 2 * dice.below(150);
    let points = 3 + dice.below(100);
    let size = *dice.pick(&[32.0, 8.0, 1.0, 1.0e-3]);
    let mut noise = dice.noise();
    let points: Vec<Point> = (0..points)
        .map(|_| noise.point().map(|c| size * c))
        .collect();
    let mut corner = || noise.below(points.len()) as u32;
    let triangles = (0..count).map(|_| [corner(), corner(), corner()]);
    Net {
        shape: NetShape::Triangles(triangles.collect()),
        points,
    }
}

/// Plates on edge around the spindle or across it, thin or without any thickness.
fn fins(dice: &mut Dice) -> Net {
    let count = 1 + dice.below(24);
    let thick = *dice.pick(&[0.0, 1.0e-9, 1.0e-3, 0.25]);
    let across = dice.below(2) == 0;
    let mut noise = dice.noise();
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..count {
        let angle = std::f64::consts::TAU * i as f64 / count as f64;
        let (sin, cos) = angle.sin_cos();
        let (low, high) = (4.0 + noise.signed(), 14.0 + noise.signed());
        let at = 2.0 * i as f64;
        for side in [-thick, thick] {
            let first = points.len() as u32;
            for (x, r) in [(-16.0, low), (16.0, low), (16.0, high), (-16.0, high)] {
                points.push(if across {
                    [at + side, r * cos, x * 0.5 + r * sin]
                } else {
                    [x, r * cos - side * sin, r * sin + side * cos]
                });
            }
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|c| first + c)));
        }
    }
    Net {
        points,
        shape: NetShape::Triangles(triangles),
    }
}

/// Long triangles that are hardly wider than nothing, lying, leaning or nearly upright.
fn slivers(dice: &mut Dice) -> Net {
    let count = 1 + dice.below(80);
    let width = *dice.pick(&[1.0e-13, 1.0e-9, 1.0e-6, 1.0e-3, 0.1]);
    let tilt = *dice.pick(&[0.0, 1.0e-9, 1.0e-6, 2.0e-6, 1.0e-3, 1.0]);
    let mut noise = dice.noise();
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let first = points.len() as u32;
        let a = noise.point().map(|c| 16.0 * c);
        let way = noise.point().map(|c| 16.0 * c);
        let side = noise.point().map(|c| width * c);
        let lean = tilt * noise.signed();
        points.push(a);
        points.push([a[0] + way[0], a[1] + way[1] * lean, a[2] + way[2]]);
        points.push([
            a[0] + 0.5 * way[0] + side[0],
            a[1] + 0.5 * way[1] * lean + side[1] * tilt,
            a[2] + 0.5 * way[2] + side[2],
        ]);
        triangles.push([first, first + 1, first + 2]);
        // An upright one on the same edge.
        points.push([a[0] + width * noise.signed(), a[1] + 8.0, a[2]]);
        triangles.push([first, first + 1, first + 3]);
    }
    Net {
        points,
        shape: NetShape::Triangles(triangles),
    }
}

/// A shaft in steps: cylinders of few sides between upright rings.
fn stepped(dice: &mut Dice) -> Net {
    let sides = 3 + dice.below(14);
    let steps = 1 + dice.below(6);
    let mut noise = dice.noise();
    let mut profile = Vec::new();
    for i in 0..steps {
        let r = 8.0 + 6.0 * noise.signed();
        profile.extend([(6.0 * i as f64, r), (6.0 * (i + 1) as f64, r)]);
    }
    revolve(&profile, sides, |(x, r), j| {
        let angle = std::f64::consts::TAU * j as f64 / sides as f64;
        [x, r * angle.cos(), r * angle.sin()]
    })
}

/// A sheet of triangles, level or at a slant, cut finely.
fn flats(dice: &mut Dice) -> Net {
    let (rows, columns) = (2 + dice.below(12), 1 + dice.below(16));
    let slant = *dice.pick(&[0.0, 0.5, 1.0, 1.0e-7]);
    let lines: Vec<(f64, f64)> = (0..rows).map(|i| (2.0 * i as f64, 0.0)).collect();
    revolve(&lines, columns, |(x, _), j| {
        let z = 2.0 * (j as f64 - columns as f64 / 2.0);
        [x, 10.0 + slant * x, z]
    })
}

/// A net over a profile, `columns` cells wide, as triangles.
fn revolve(
    profile: &[(f64, f64)],
    columns: usize,
    point: impl Fn((f64, f64), usize) -> Point,
) -> Net {
    let mut points = Vec::new();
    for &place in profile {
        points.extend((0..=columns).map(|j| point(place, j)));
    }
    Net {
        points,
        shape: NetShape::Triangles(cells(profile.len(), columns + 1)),
    }
}

fn cells(rows: usize, columns: usize) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for i in 1..rows {
        for j in 1..columns {
            let (a, b) = ((i - 1) * columns + j, i * columns + j);
            let corners = [a - 1, a, b, b - 1].map(|c| c as u32);
            let [a, b, c, d] = corners;
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// A star: a body of revolution whose radius has lobes, as a mesh or as a surface.
fn lobed(dice: &mut Dice) -> Net {
    let (rows, columns) = (2 + dice.below(14), 4 + dice.below(20));
    let lobes = dice.below(7) as f64;
    let depth = *dice.pick(&[0.0, 0.1, 0.6, 1.0]);
    let rough = *dice.pick(&[0.0, 0.0, 1.0e-9, 0.02, 0.5]);
    let long = *dice.pick(&[40.0, 10.0, 100.0, 1.0]);
    let degree = dice.below(4);
    let mut noise = dice.noise();
    let mut points = Vec::new();
    for i in 0..rows {
        let s = i as f64 / (rows - 1) as f64;
        for j in 0..columns {
            // The seam meets itself to the bit.
            let turn = (j % (columns - 1)) as f64 / (columns - 1) as f64;
            let angle = std::f64::consts::TAU * turn;
            let body = 12.0 * (1.0 - (2.0 * s - 1.0).powi(2)).max(0.0).sqrt();
            let wave = 1.0 + depth * (lobes * angle + 2.0 * s).cos();
            let r = body * wave * (1.0 + rough * noise.signed());
            points.push([s * long, r * angle.cos(), r * angle.sin()]);
        }
    }
    let shape = if degree == 0 {
        NetShape::Triangles(cells(rows, columns))
    } else {
        NetShape::Poles([degree.min(rows - 1), degree], columns)
    };
    Net { points, shape }
}

/// Half the greatest extent of a part, mm, and never nothing.
fn size(part: &Part) -> f64 {
    let points: Vec<Point> = points(part).collect();
    let extent = |k: usize| {
        let low = points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
        let high = points.iter().map(|p| p[k]).fold(-f64::INFINITY, f64::max);
        high - low
    };
    let extent = extent(0).max(extent(1)).max(extent(2)) / 2.0;
    if extent > 1.0e-6 { extent } else { 1.0 }
}

fn points(part: &Part) -> impl Iterator<Item = Point> {
    part.bodies.iter().flat_map(|b| match &b.shape {
        Shape::Mesh(mesh) => mesh.vertices().to_vec(),
        Shape::Surface(surface) => surface.poles().to_vec(),
    })
}

/// A cutter that suits a part of this size, more or less.
fn cutter(dice: &mut Dice, size: f64) -> Option<Cutter> {
    let unit = if dice.below(3) == 0 { 20.0 } else { size };
    let smallest = *dice.pick(&[1.0e-4 * unit, 1.0e-9]);
    let mut length = |low: f64| {
        let x = unit * dice.within(low, 1.0).powi(2);
        if dice.below(3) == 0 { eighths(x) } else { x }
    };
    let (first, second) = (length(0.1), length(0.02).max(smallest));
    let big = first.max(smallest);
    let cutter = match dice.below(6) {
        0 => Cutter::torus(2.0 * first, second),
        1 => Cutter::ball(big),
        2 => Cutter::cylinder(big, second),
        // As steep as it may be, but for a share, either way: from a roller to a cone with a tip.
        kind => {
            let share = *dice.pick(&[1.0, 0.999_999, 0.5, 0.01]);
            let steepest = (2.0 * big / second).atan().to_degrees();
            let sign = if kind == 3 { 1.0 } else { -1.0 };
            let steep = share * steepest;
            let cone = Cutter::cone(big, second, sign * steep);
            // Rounding may have made the tip's radius negative.
            return cone
                .or_else(|_| Cutter::cone(big, second, sign * steep * (1.0 - 1.0e-9)))
                .ok();
        }
    };
    cutter.ok()
}

/// A few revolutions over the part, or over some of it.
fn motion(dice: &mut Dice, part: &Part, cutter: &Cutter) -> Motion {
    let xs = || points(part).map(|p| p[0]);
    let low = xs().fold(f64::INFINITY, f64::min);
    let high = xs().fold(f64::NEG_INFINITY, f64::max);
    let w = cutter.half_width();
    let points_per_revolution = *dice.pick(&[8, 1, 4, 7, 12, 16, 33, 40]);
    let revolutions = dice.within(2.0, 9.0);
    // Exactly at the rim, at the ends, or well inside.
    let (from, to) = match dice.below(4) {
        0 => (None, None),
        1 => (Some(low - w), Some(high + w)),
        2 => (Some(low), Some(high)),
        _ => {
            let from = dice.within(low, high);
            (Some(from), Some(dice.within(from, high)))
        }
    };
    let length = (to.unwrap_or(high + w) - from.unwrap_or(low - w)).max(1.0e-5);
    let step = length / revolutions;
    let kind = *dice.pick(&[MotionKind::Helix, MotionKind::Rings]);
    let step = match dice.below(3) {
        0 => eighths(step).max(0.125),
        _ => step.max(1.0e-6),
    };
    Motion {
        from,
        to,
        ..Motion::new(kind, step, points_per_revolution)
    }
}
