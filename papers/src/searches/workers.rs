//! Eq. (10), what each of p processors has to do, beside what extents hold.

use std::time::Instant;

use horma_core::{Digitizer, Extent, Method, Plan, Row, Simd};
use horma_formats::plot::{Curve, Plot, Scale};

use crate::error::Result;
use crate::report::{Block, Claim, Verdict, three};

use super::experiments::RADII;
use crate::subject::{Subject, Turning};

/// As many processors as there are at most.
const MOST: u32 = 8;
const TURNING: Turning = Turning {
    points_per_revolution: 360,
    step: 2.0,
};
const GRID: [u32; 2] = [159, 120];

/// What there is to be done by brute force, and by the one of some workers who has to do most.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shared {
    /// p.
    workers: u32,
    /// n.
    points: u64,
    /// All positions.
    positions: u64,
    /// Points that the busiest holds, m.
    held: u64,
    /// Of these, the ones that others own.
    halo: u64,
    /// Its positions.
    own_positions: u64,
}

impl Shared {
    fn new(subject: &Subject, workers: u32) -> Self {
        let outlines = &subject.plan.model.outlines;
        let points =
            |rows: &[u32]| -> u64 { rows.iter().map(|&r| outlines[r as usize].points).sum() };
        let work = |e: &Extent| points(&e.rows) * e.count;
        let extents = subject.plan.split(workers);
        let busiest = extents.iter().max_by_key(|e| work(e));
        let [held, own] = busiest.map_or([0; 2], |e| [&e.rows, &e.own].map(|rows| points(rows)));
        Self {
            workers,
            points: subject.points(),
            positions: subject.positions(),
            held,
            halo: held - own,
            own_positions: busiest.map_or(0, |e| e.count),
        }
    }

    /// n/p.
    fn even(&self) -> f64 {
        self.points as f64 / f64::from(self.workers)
    }

    /// o, as eq. (10) defines it.
    fn overhead(&self) -> f64 {
        self.held as f64 - self.even()
    }

    /// Evaluations of the busiest.
    fn evaluations(&self) -> u64 {
        self.held * self.own_positions
    }

    /// How many times as many one alone has.
    fn speedup(&self) -> f64 {
        (self.points * self.positions) as f64 / self.evaluations() as f64
    }

    /// The same by eq. (10), where the cost of n points is as n², and that of m points as m².
    fn printed(&self) -> f64 {
        let ratio = self.points as f64 / self.held as f64;
        ratio * ratio
    }
}

/// Workers that are timed.
const TIMED: [u32; 3] = [2, 4, 8];

/// How long the busiest of so many takes for its positions by brute force, s.
fn seconds(subject: &Subject, workers: u32) -> f64 {
    let Plan {
        job,
        model,
        trajectory,
        ..
    } = &subject.plan;
    let rows = |e: &Extent| -> Vec<Row> {
        let ids = e.rows.iter();
        ids.map(|&id| model.rows[id as usize].clone()).collect()
    };
    let extents = subject.plan.split(workers);
    let all = extents.iter().map(|e| {
        let digitizer = Digitizer::new(job, &rows(e), Simd::best());
        let begin = Instant::now();
        digitizer.run_chunks(trajectory, e.first..e.first + e.count, |_, _| true);
        begin.elapsed().as_secs_f64()
    });
    all.fold(0.0, f64::max)
}

fn timed(subject: &Subject, shared: &[Shared]) -> Vec<Claim> {
    let alone = seconds(subject, 1);
    let claim = |p: u32| {
        let of = &shared[p as usize - 1];
        Claim::new(
            format!("time alone over that of the busiest of {p}"),
            "",
            format!(
                "{}; by evaluations {}, by eq. (10) {}",
                three(alone / seconds(subject, p)),
                three(of.speedup()),
                three(of.printed())
            ),
            Verdict::Unsaid,
        )
    };
    TIMED.into_iter().map(claim).collect()
}

/// For 1 and more workers.
fn shared(subject: &Subject) -> Vec<Shared> {
    (1..=MOST).map(|p| Shared::new(subject, p)).collect()
}

/// The last without holders, by brute force.
fn subject() -> Result<Subject> {
    let mut subject = Subject::alone(GRID, TURNING, RADII)?;
    subject.plan.job.method = Method::Brute;
    Ok(subject)
}

/// What there is to tell of eq. (10).
///
/// # Errors
/// None, for the sample last.
pub fn blocks() -> Result<Vec<Block>> {
    let subject = subject()?;
    let shared = shared(&subject);
    let rows = shared.iter().map(|s| {
        vec![
            s.workers.to_string(),
            s.held.to_string(),
            format!("{:.0}", s.even()),
            format!("{:.0}", s.overhead()),
            s.halo.to_string(),
            s.own_positions.to_string(),
            three(s.evaluations() as f64 / 1.0e6),
            three(s.speedup()),
            three(s.printed()),
        ]
    });
    let heads = [
        "p",
        "points held, m",
        "n/p",
        "o",
        "of others",
        "positions",
        "evaluations, millions",
        "times less than alone",
        "by eq. (10)",
    ];
    Ok(vec![
        Block::text(
            "Eq. (10) has `m = n/p + o` points for each of p processors, and a cost of O(m²), as for n points and about \
             as many positions it is O(n²). The paper did not try it. Here n is as in eq. (7): the points of the last, \
             without holders, 159 × 120. Its first job is cut into p extents as for a cluster, along the spindle and by \
             predicted work, and o is counted rather than timed: what the busiest worker, the one with most evaluations \
             by brute force, holds beyond n/p.",
        ),
        Block::table("The busiest of p workers", &heads, rows.collect()),
        Block::Figure("workers", plot(&shared)),
        Block::Claims(claims(&shared)),
        Block::Timed(timed(&subject, &shared)),
        Block::text(
            "That p workers have more than p times less to do is brute force's own waste: alone it looks at all points \
             for every position, of which the tool reaches those within its width; the fewer a worker holds, the fewer it \
             looks at in vain. One process that looks only at rows in reach gains the same without any other, and then p \
             workers gain p times at most.",
        ),
    ])
}

fn claims(shared: &[Shared]) -> Vec<Claim> {
    let [four, eight] = [4, 8].map(|p: usize| &shared[p - 1]);
    let bounded = |s: &Shared| s.speedup() >= s.printed();
    vec![
        Claim::new(
            "the cost is at most as m²",
            "yes",
            format!(
                "{} times less to do with 8, {} by eq. (10)",
                three(eight.speedup()),
                three(eight.printed())
            ),
            Verdict::of(shared.iter().all(bounded)),
        ),
        Claim::new(
            "the cost is as m²: halos add points to a worker but no positions",
            "",
            format!(
                "as m·N/p: {} with 8",
                three(8.0 * eight.points as f64 / eight.held as f64)
            ),
            Verdict::Unsaid,
        ),
        Claim::new(
            "points of the busiest that are others', with 4 workers and with 8",
            "",
            format!(
                "{:.0} %, {:.0} %",
                100.0 * four.halo as f64 / four.held as f64,
                100.0 * eight.halo as f64 / eight.held as f64
            ),
            Verdict::Unsaid,
        ),
    ]
}

fn plot(shared: &[Shared]) -> Plot {
    let curve = |name: &str, color, dashed, value: &dyn Fn(&Shared) -> f64| Curve {
        name: name.to_owned(),
        color,
        dashed,
        points: shared
            .iter()
            .map(|s| [f64::from(s.workers), value(s)])
            .collect(),
    };
    let workers = |s: &Shared| f64::from(s.workers);
    Plot {
        title: "What the busiest of p workers is spared".to_owned(),
        subtitle: "brute force, the sample last, a grid of 159 × 120, torus R 40 r 8".to_owned(),
        x: "workers, p".to_owned(),
        y: "times fewer evaluations than alone".to_owned(),
        scales: [Scale::Even, Scale::Logarithmic],
        curves: vec![
            curve("found", 0, false, &Shared::speedup),
            curve("eq. (10), o as found", 1, false, &Shared::printed),
            curve("eq. (10) without o: p²", 1, true, &|s| {
                workers(s) * workers(s)
            }),
            curve("p", 3, true, &workers),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_has_its_share_of_the_positions_and_a_halo() {
        let shared = shared(&subject().expect("the sample"));
        assert_eq!((shared[0].held, shared[0].halo), (shared[0].points, 0));
        assert_eq!(shared[0].own_positions, shared[0].positions);
        for pair in shared.windows(2) {
            assert!(pair[1].evaluations() < pair[0].evaluations(), "{pair:?}");
            assert!(pair[1].halo > 0 && pair[1].overhead() > 0.0, "{pair:?}");
        }
    }
}
