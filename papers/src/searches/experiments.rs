//! Experiments 1 and 2: three grids and motions, with δ = 8 and 20 and without.

use horma_core::{Counters, Culling, Method, Window};

use crate::error::Result;
use crate::report::{Block, Claim, Verdict, three};

use crate::subject::{Subject, Turning};

/// δ in print.
pub const WINDOW: Window = Window {
    delta_u: 8,
    delta_v: 20,
};
/// The torus, R and r, mm.
pub const RADII: [f64; 2] = [40.0, 8.0];

/// A line of both tables.
struct Configuration {
    grid: [u32; 2],
    turning: Turning,
    /// With δ and without, s.
    printed: [f64; 2],
}

const fn configuration(
    grid: [u32; 2],
    points_per_revolution: u32,
    step: f64,
    printed: [f64; 2],
) -> Configuration {
    Configuration {
        grid,
        turning: Turning {
            points_per_revolution,
            step,
        },
        printed,
    }
}

const CONFIGURATIONS: [Configuration; 3] = [
    configuration([159, 120], 360, 2.0, [215.0, 2315.0]),
    configuration([137, 90], 120, 1.0, [100.0, 912.0]),
    configuration([140, 100], 90, 5.0, [5.0, 42.0]),
];

impl Configuration {
    fn grid(&self) -> String {
        format!("{} × {}", self.grid[0], self.grid[1])
    }

    /// How many times as long it took without δ.
    fn ratio(&self) -> f64 {
        self.printed[1] / self.printed[0]
    }

    /// Time with δ in print over positions, both in shares of those of the first line; they are on one last, so
    /// that its length does not matter.
    fn pace(&self) -> f64 {
        let positions = |c: &Self| f64::from(c.turning.points_per_revolution) / c.turning.step;
        let pace = |c: &Self| c.printed[0] / positions(c);
        pace(self) / pace(&CONFIGURATIONS[0])
    }
}

/// What a configuration took.
#[derive(Debug)]
struct Searched {
    positions: u64,
    points: u64,
    /// With δ.
    window: Counters,
    /// With δ, and without points that face away.
    facing: Counters,
    /// By horma's exact search.
    exact: Counters,
    /// Seconds of a position with δ and without.
    times: [f64; 2],
}

impl Searched {
    fn new(configuration: &Configuration) -> Result<Self> {
        let subject = Subject::new(configuration.grid, configuration.turning, RADII)?;
        let (_, exact) = subject.path(Method::Exact);
        let by_window = |culling| subject.heuristic(culling).run(WINDOW).1;
        Ok(Self {
            positions: subject.positions(),
            points: subject.points(),
            window: by_window(Culling::default()),
            facing: by_window(FACING),
            exact,
            times: [subject.time_windows(WINDOW), subject.time_brute()],
        })
    }

    /// Evaluations of a position.
    fn each(&self, counters: &Counters) -> f64 {
        counters.evaluations as f64 / self.positions as f64
    }

    /// Evaluations by brute force over those with δ.
    fn ratio(&self) -> f64 {
        self.points as f64 / self.each(&self.window)
    }
}

const FACING: Culling = Culling {
    back_faces: true,
    beyond_reach: false,
};
const WITHIN_REACH: Culling = Culling {
    back_faces: false,
    beyond_reach: true,
};

/// Shares of the points of a surface that need not be looked at, over all positions at which it is within the
/// tool's width.
#[derive(Debug)]
struct Dropped {
    /// They face away.
    away: f64,
    /// They are beyond the tool's width.
    beyond: f64,
}

impl Dropped {
    fn new() -> Result<Self> {
        let turning = Turning {
            points_per_revolution: 36,
            step: 10.0,
        };
        let subject = Subject::new(CONFIGURATIONS[0].grid, turning, RADII)?;
        let evaluated = |culling| {
            let (_, counters) = subject.heuristic(culling).run(Window::EVERYTHING);
            counters.evaluations as f64
        };
        let all = evaluated(Culling::default());
        let dropped = |culling| 1.0 - evaluated(culling) / all;
        Ok(Self {
            away: dropped(FACING),
            beyond: dropped(WITHIN_REACH),
        })
    }
}

/// What there is to tell of both experiments.
///
/// # Errors
/// None, for the sample last.
pub fn blocks() -> Result<Vec<Block>> {
    let searched = CONFIGURATIONS.iter().map(Searched::new);
    let searched: Vec<Searched> = searched.collect::<Result<_>>()?;
    let rows = CONFIGURATIONS.iter().zip(&searched).map(|(c, s)| {
        let Turning {
            points_per_revolution,
            step,
        } = c.turning;
        vec![
            c.grid(),
            format!("{points_per_revolution}, {step}"),
            s.positions.to_string(),
            s.points.to_string(),
            three(s.each(&s.window)),
            three(s.each(&s.facing)),
            three(s.each(&s.exact)),
            s.window.lost.to_string(),
        ]
    });
    let heads = [
        "grid",
        "positions of a turn, step in mm",
        "positions",
        "brute force",
        "with δ",
        "with δ, facing",
        "exact search",
        "winners lost by δ",
    ];
    Ok(vec![
        Block::table(
            "Experiments 1 and 2: evaluations of a position",
            &heads,
            rows.collect(),
        ),
        Block::Claims(claims(&searched, &Dropped::new()?)),
        Block::Timed(timed(&searched)),
    ])
}

/// Least and greatest.
fn range(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    [
        values.clone().fold(f64::INFINITY, f64::min),
        values.fold(0.0, f64::max),
    ]
}

fn joined(texts: impl Iterator<Item = String>) -> String {
    texts.collect::<Vec<_>>().join(", ")
}

fn claims(searched: &[Searched], dropped: &Dropped) -> Vec<Claim> {
    let pairs = || CONFIGURATIONS.iter().zip(searched);
    let ratios = pairs().map(|(c, s)| {
        Claim::new(
            format!("without δ over with δ, grid {}", c.grid()),
            format!("{:.1} times the time", c.ratio()),
            format!("{} times the evaluations", three(s.ratio())),
            Verdict::of((0.8..1.25).contains(&(s.ratio() / c.ratio()))),
        )
    });
    let saved = range(searched.iter().map(|s| 1.0 - 1.0 / s.ratio()))[0];
    let [low, high] = range(searched.iter().map(|s| s.each(&s.window)));
    let facing = searched.iter().map(|s| {
        let kept = s.facing.evaluations as f64 / s.window.evaluations as f64;
        format!("{:.0} %", 100.0 * (1.0 - kept))
    });
    let paces = range(CONFIGURATIONS.iter().map(Configuration::pace));
    let lost: u64 = searched.iter().map(|s| s.window.lost).sum();
    let positions: u64 = searched.iter().map(|s| s.positions).sum();
    let mut claims: Vec<Claim> = ratios.collect();
    claims.extend([
        Claim::new(
            "what δ saves",
            "about 90 % of the time",
            format!("{:.1} % of the evaluations or more", 100.0 * saved),
            Verdict::of(saved >= 0.9),
        ),
        Claim::new(
            "with δ the time follows the positions and hardly the grid",
            "yes",
            format!(
                "{} to {} evaluations of a position",
                three(low),
                three(high)
            ),
            Verdict::of(high / low < 1.2),
        ),
        Claim::new(
            "the same by the times in print: s of a position with δ, in shares of the first grid's",
            "1, 1, 1 if so",
            joined(CONFIGURATIONS.iter().map(|c| format!("{:.2}", c.pace()))),
            Verdict::of(paces[1] / paces[0] < 1.2),
        ),
        Claim::new(
            "points that face away from the tool",
            "about 50 %",
            format!("{:.0} % of all", 100.0 * dropped.away),
            Verdict::of((dropped.away - 0.5).abs() < 0.05),
        ),
        Claim::new(
            "the same of those within δ",
            "",
            joined(facing),
            Verdict::Unsaid,
        ),
        Claim::new(
            "points beyond the tool's width, which it cannot touch",
            "",
            format!("{:.0} % of all", 100.0 * dropped.beyond),
            Verdict::Unsaid,
        ),
        Claim::new(
            "δ = 8 and 20 always holds the winner on a last",
            "from experience",
            format!("lost at {lost} of {positions} positions"),
            Verdict::of(lost == 0),
        ),
    ]);
    claims
}

/// What differs from run to run.
fn timed(searched: &[Searched]) -> Vec<Claim> {
    let ratios = CONFIGURATIONS.iter().zip(searched).map(|(c, s)| {
        let ratio = s.times[1] / s.times[0];
        Claim::new(
            format!(
                "time without δ over time with δ, grid {}, one thread",
                c.grid()
            ),
            format!("{:.1}", c.ratio()),
            three(ratio),
            Verdict::of((0.8..1.25).contains(&(ratio / c.ratio()))),
        )
    });
    let paces = || searched.iter().map(|s| s.times[0] / searched[0].times[0]);
    let [low, high] = range(paces());
    let even = Claim::new(
        "time of a position with δ, in shares of the first grid's",
        joined(CONFIGURATIONS.iter().map(|c| format!("{:.2}", c.pace()))),
        joined(paces().map(|p| format!("{p:.2}"))),
        Verdict::of(high / low < 1.2),
    );
    let brute = Claim::new(
        "time of a position by brute force, ns for each point",
        "",
        joined(
            searched
                .iter()
                .map(|s| three(1.0e9 * s.times[1] / s.points as f64)),
        ),
        Verdict::Unsaid,
    );
    ratios.chain([even, brute]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_save_more_than_in_print_and_hardly_see_the_grid() {
        let searched = CONFIGURATIONS.map(|c| (c.ratio(), Searched::new(&c).expect("the sample")));
        for (printed, s) in &searched {
            assert!(s.ratio() > *printed, "{} {printed}", s.ratio());
            assert!(s.each(&s.exact) < s.each(&s.window) / 4.0);
            assert!(s.facing.evaluations < s.window.evaluations);
        }
        let [low, high] = range(searched.iter().map(|(_, s)| s.each(&s.window)));
        assert!(high / low < 1.2, "{low} {high}");
    }
}
