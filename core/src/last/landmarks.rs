//! Landmarks: where the measures of a last begin, end and pass.
//!
//! All of them but the ball's are in the median plane, which holds the spindle and is square to the last's width.

use serde::Serialize;

use super::Frame;
use super::curve::Loop;
use super::measures::{median, upright};
use super::skin::Skin;
use crate::error::{Error, Result};
use crate::vector::Point;

/// A landmark of a last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Landmark {
    /// Where the feather line is rearmost: the corner between bottom and back.
    Heel,
    /// Where the feather line is foremost: the corner between bottom and toe.
    Toe,
    /// Where the last stands: its lowest place at the ball.
    Tread,
    /// The widest place at the ball on the foot's inner side.
    BallInner,
    /// The same on its outer side.
    BallOuter,
    /// The top of the ball's section.
    Vamp,
    /// The corner between cone and instep.
    Instep,
}

impl Landmark {
    /// All of them, in the order of [`Landmarks`].
    pub const ALL: [Self; 7] = [
        Self::Heel,
        Self::Toe,
        Self::Tread,
        Self::BallInner,
        Self::BallOuter,
        Self::Vamp,
        Self::Instep,
    ];

    /// What it is called wherever it is typed or shown.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Heel => "heel",
            Self::Toe => "toe",
            Self::Tread => "tread",
            Self::BallInner => "ball_inner",
            Self::BallOuter => "ball_outer",
            Self::Vamp => "vamp",
            Self::Instep => "instep",
        }
    }
}

/// Where a landmark is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// Here, in the part frame of the last as it is in its files, mm.
    At(Point),
    /// At this share of the last's length from the heel, where it otherwise would be looked for.
    Share(f64),
}

/// The places of [`Landmark::ALL`], in coordinates of the last: along it from heel to toe, across it, up, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landmarks(pub [Point; 7]);

impl Landmarks {
    /// Where one is.
    pub fn get(&self, landmark: Landmark) -> Point {
        self.0[landmark as usize]
    }

    /// The same with every place moved.
    pub(super) fn map(&self, f: impl Fn(Point) -> Point) -> Self {
        Self(self.0.map(f))
    }
}

/// Where the ball is looked for, in shares of the length.
const BALL: [f64; 2] = [0.5, 0.85];
/// Where the corner between cone and instep is.
const INSTEP: [f64; 2] = [0.2, 0.65];

/// Finds the landmarks that are not given.
pub(super) fn find(
    skin: &Skin,
    frame: &Frame,
    choices: &[(Landmark, Choice)],
) -> Result<Landmarks> {
    let along = skin.along();
    let at = |share: f64| along.low + share * (along.high - along.low);
    let within = |s: f64, [low, high]: [f64; 2]| (at(low)..=at(high)).contains(&s);
    let lost = |what: &'static str| Error::NotALast { what };
    let curve = median(skin, frame)?;
    let in_median = |[s, h]: [f64; 2]| [s, 0.0, h];

    // The curve begins where it is lowest; towards the toe it goes up and back over the top.
    let [toe_end, heel_end] = [1.0, -1.0].map(|side| curve.greatest(|p| side * p[0]));
    let share = |landmark| {
        let mut chosen = choices.iter().filter(|c| c.0 == landmark);
        chosen.next().map(|c| c.1)
    };
    let bottom_at = |s: f64| curve.crossed(s).map(|[low, _]| [s, 0.0, low]);
    let top_at = |s: f64| curve.crossed(s).map(|[_, high]| [s, 0.0, high]);
    let place = |landmark: Landmark,
                 on_share: &dyn Fn(f64) -> Option<Point>,
                 found: &dyn Fn() -> Option<Point>| {
        let place = match share(landmark) {
            Some(Choice::At(p)) => Some(frame.inward(p)),
            Some(Choice::Share(share)) => on_share(at(share)),
            None => found(),
        };
        place.ok_or(lost(landmark.name()))
    };
    let corner = |from, to, allowed: &dyn Fn([f64; 2]) -> bool| {
        curve
            .corner(from, to, allowed)
            .map(|at| in_median(curve.place(at)))
    };
    let heel = place(Landmark::Heel, &bottom_at, &|| {
        corner(heel_end, curve.length(), &|_| true)
    })?;
    let toe = place(Landmark::Toe, &bottom_at, &|| {
        corner(0.0, toe_end, &|_| true)
    })?;
    let tread = place(Landmark::Tread, &bottom_at, &|| {
        let low = |p: [f64; 2]| frame.above(in_median(p), [0.0; 3]);
        let lowest = curve.greatest(|p| {
            if within(p[0], BALL) {
                -low(p)
            } else {
                f64::NEG_INFINITY
            }
        });
        Some(in_median(curve.place(lowest)))
    })?;
    let ball = |landmark, side: f64| {
        let widest = |points: &mut dyn Iterator<Item = Point>| {
            points.reduce(|a, b| if side * b[1] > side * a[1] { b } else { a })
        };
        place(
            landmark,
            &|s| {
                let section = skin.section(&upright([s, 0.0, 0.0], [s, 1.0, 0.0])?);
                widest(&mut section.into_iter())
            },
            &|| widest(&mut skin.points.iter().copied().filter(|p| within(p[0], BALL))),
        )
    };
    let [left, right] = [
        ball(Landmark::BallInner, 1.0)?,
        ball(Landmark::BallOuter, -1.0)?,
    ];
    let vamp = place(Landmark::Vamp, &top_at, &|| {
        let section = skin.section(&upright(left, right)?);
        section
            .into_iter()
            .reduce(|a, b| if b[2] > a[2] { b } else { a })
    })?;
    let instep = place(Landmark::Instep, &top_at, &|| {
        corner(toe_end, heel_end, &|p| within(p[0], INSTEP))
    })?;
    Ok(Landmarks([heel, toe, tread, left, right, vamp, instep]))
}

/// The curve of the median section that [`find`] and the measures share.
pub(super) fn begin_at_lowest(frame: &Frame, points: Vec<[f64; 2]>) -> Option<Loop> {
    let frame = *frame;
    let along = points.iter().map(|p| p[0]);
    let along = crate::vector::Interval::of(along);
    let ball = BALL.map(|share| along.low + share * (along.high - along.low));
    Loop::new(points, move |[s, h]| {
        if (ball[0]..=ball[1]).contains(&s) {
            frame.above([s, 0.0, h], [0.0; 3])
        } else {
            f64::INFINITY
        }
    })
}
