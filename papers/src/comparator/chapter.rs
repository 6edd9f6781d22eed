//! What is told of the two paths.

use horma_formats::lasts::ALLOWED;
use horma_formats::plot::{Curve, Plot, Scale};

use crate::error::Result;
use crate::report::{Block, Chapter, Claim, Verdict, three};

use super::path::{Compared, MAJOR, MINOR, Made, ROUNDING, TURNING, all_by_shank};

/// What there is to tell.
///
/// # Errors
/// None, for the sample last.
pub fn chapter() -> Result<Chapter> {
    let compared = Compared::new()?;
    let left = compared.left();
    let blocks = vec![
        Block::text(
            "The paper set its path beside one that a general library, MSML, made of the same last for a three-axis \
             machine, by a Z-constant strategy: 27,000 points. Figure 11 had the two spirals side by side, and they “do not \
             coincide due to the limitations of the 3-axis CNC strategy”. The library and the figure are not at hand; how \
             the last stood, and which mill it was, is not said.",
        ),
        Block::text(format!(
            "A Z-constant path is a spiral around the last if the mill's axis is along the last. So here the sample last, \
             without its holders, stands on its heel, or on its toe, and a ball of radius {MINOR} mm below a shank as thick goes \
             around it from above. Ball and shank are digitized, over the same facets as the wheel, R {MAJOR} r {MINOR}, at the \
             same travels and angles: step {} mm, {} positions of a turn. The mill's speed is that of this \
             search, not of a library.",
            TURNING.step, TURNING.points_per_revolution,
        )),
        Block::Figure("figure11", spirals(&compared)),
        Block::Figure("figure11-side", sides(&compared)),
        Block::text(
            "Whatever is wide above keeps the shank out below: with the toe up the mill comes neither into the waist and under \
             the heel, nor behind the top of the cone. The wheel comes from beside, wherever the last faces it. With the \
             last turned over the mill makes up for most of it, in two set-ups and with twice the points.",
        ),
        table(&compared, &left),
        Block::Claims(claims(&compared, &left)),
        Block::Timed(vec![Claim::new(
            "time of the Z-constant path, and of the turned one",
            "1,890 s",
            format!(
                "{} s, {} s",
                three(compared.mills[0].seconds),
                three(compared.wheel.seconds)
            ),
            Verdict::Differs,
        )]),
    ];
    Ok(Chapter {
        name: "comparator",
        title: "A three-axis path beside the turned one",
        source: "the FPGA paper, its last experiment and figure 11",
        blocks,
    })
}

fn table(compared: &Compared, left: &[Vec<f64>; 3]) -> Block {
    let [toe, heel, wheel] = left;
    let both: Vec<f64> = toe.iter().zip(heel).map(|(a, b)| a.min(*b)).collect();
    let points = compared.wheel.path.touches.len();
    let row = |name: &str, points: usize, left: &[f64]| {
        let mut sorted = left.to_vec();
        sorted.sort_by(f64::total_cmp);
        let within = |share: f64| three(sorted[((sorted.len() - 1) as f64 * share) as usize]);
        vec![
            name.to_owned(),
            points.to_string(),
            within(0.5),
            within(0.9),
            within(0.99),
            within(1.0),
            percent(share(left, |l| *l > ALLOWED)),
        ]
    };
    Block::table(
        "What the paths leave at the corners of the facets, along the shortest way, mm",
        &[
            "path",
            "points",
            "half within",
            "90 % within",
            "99 % within",
            "all within",
            "beyond 0.1",
        ],
        vec![
            row("Z-constant, toe up", points, toe),
            row("Z-constant, heel up", points, heel),
            row("one after the other", 2 * points, &both),
            row("turned", points, wheel),
        ],
    )
}

fn claims(compared: &Compared, left: &[Vec<f64>; 3]) -> Vec<Claim> {
    let Compared { mills, wheel, .. } = compared;
    let mill = &mills[0];
    let points = mill.path.touches.len();
    let beyond = mill.beyond(wheel);
    let apart = share(&beyond, |b| b.abs() > ALLOWED);
    let most = beyond.iter().copied().fold(0.0, f64::max);
    let least = beyond.iter().copied().fold(0.0, f64::min);
    let by_shank = share(&mill.by_shank, |held| *held);
    let gouges = left.iter().flatten().any(|l| *l < -ROUNDING);
    vec![
        Claim::new(
            "points of the trajectory",
            "27,000",
            format!("{points}, by choice of step and positions of a turn"),
            Verdict::Fitted,
        ),
        Claim::new(
            "the trajectories do not coincide",
            "yes",
            format!(
                "ball and rim are more than 0.1 mm apart at {} of the positions",
                percent(apart)
            ),
            Verdict::of(apart > 0.5),
        ),
        Claim::new(
            "due to the limitations of the three-axis strategy",
            "yes",
            format!(
                "wherever the ball is further off than the rim, at {} and by {} mm at most, the shank holds it off",
                percent(share(&beyond, |b| *b > ALLOWED)),
                three(most)
            ),
            Verdict::of(all_by_shank(mill, &beyond)),
        ),
        Claim::new(
            "due to nothing else",
            "",
            format!(
                "no: the ball is closer at {}, by {} mm at most, for a place that slants is touched by the wide wheel \
                 beside where it faces it",
                percent(share(&beyond, |b| *b < -ALLOWED)),
                three(-least)
            ),
            Verdict::Unsaid,
        ),
        Claim::new(
            "positions at which the shank holds the mill off",
            "",
            percent(by_shank),
            Verdict::Unsaid,
        ),
        Claim::new(
            "virtual digitizing avoids collision by its own definition",
            "yes",
            format!(
                "of {} corners none is inside a tool at any position of the three",
                left[0].len()
            ),
            Verdict::of(!gouges),
        ),
    ]
}

/// The share of all for which something holds.
fn share<T>(all: &[T], holds: impl Fn(&T) -> bool) -> f64 {
    all.iter().filter(|one| holds(one)).count() as f64 / all.len() as f64
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Figure 11: both spirals, the mill's above the wheel's.
fn spirals(compared: &Compared) -> Plot {
    /// Turns from one that is drawn to the next, and positions: with all of them nothing would be seen.
    const TURNS: u32 = 3;
    const POSITIONS: u32 = 4;
    /// How far the last is turned away from a view from its side, degrees.
    const AWAY: f64 = 20.0;
    /// How far one spiral is above the other, mm.
    const ABOVE: f64 = 130.0;
    let (sin, cos) = libm::sincos(AWAY.to_radians());
    let spiral = |made: &Made, name: &str, color, above: f64| {
        let turn = TURNING.points_per_revolution;
        let drawn = (0..).zip(made.middles()).filter(|(k, _)| {
            // From lowest place to lowest place, where the way to the next turn that is drawn is not seen.
            let turned = k + 3 * turn / 4;
            (turned / turn).is_multiple_of(TURNS) && k.is_multiple_of(POSITIONS)
        });
        let points = drawn.map(|(_, [x, y, z])| [x * cos - y * sin, z + above]);
        curve(name, color, points.collect())
    };
    Plot {
        title: "The spirals of figure 11".to_owned(),
        subtitle: format!(
            "the middle of ball and rim, one turn of {TURNS}; seen {AWAY}° from the side"
        ),
        x: "mm".to_owned(),
        y: format!("z, mm; the mill's spiral {ABOVE} mm higher"),
        scales: [Scale::Even, Scale::ToScale],
        curves: vec![
            spiral(&compared.mills[0], "mill, toe up", 0, ABOVE),
            spiral(&compared.wheel, "wheel", 1, 0.0),
        ],
    }
}

/// Where the two paths pass above and below the last.
fn sides(compared: &Compared) -> Plot {
    let outline = |furthest: fn(f64, f64) -> f64| {
        let rows = compared.subject.plan.model.rows.iter();
        let place = rows.filter_map(|row| {
            let z = row.points.iter().map(|p| p[2]).reduce(furthest)?;
            Some([row.points.first()?[0], z])
        });
        place.collect()
    };
    let turn = TURNING.points_per_revolution as usize;
    let path = |made: &Made, from: usize| {
        let facing = made.middles().skip(from).step_by(turn);
        facing.map(|[x, _, z]| [x, z]).collect()
    };
    let (mill, wheel) = (&compared.mills[0], &compared.wheel);
    let (below, above) = (turn / 4, 3 * turn / 4);
    Plot {
        title: "Where a mill cannot go".to_owned(),
        subtitle: "the middle of ball and rim above and below the last, from the side".to_owned(),
        x: "travel, mm".to_owned(),
        y: "z, mm".to_owned(),
        scales: [Scale::Even, Scale::ToScale],
        curves: vec![
            curve("mill, toe up", 0, path(mill, above)),
            curve("wheel", 1, path(wheel, above)),
            curve("the last", 3, outline(f64::max)),
            curve("", 0, path(mill, below)),
            curve("", 1, path(wheel, below)),
            curve("", 3, outline(f64::min)),
        ],
    }
}

fn curve(name: &str, color: usize, points: Vec<[f64; 2]>) -> Curve {
    Curve {
        name: name.to_owned(),
        color,
        dashed: false,
        points,
    }
}
