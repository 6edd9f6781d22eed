//! Grading: one last in all sizes.
//!
//! Along the spindle a last grows by λ, across it and upwards by γ: an affine map, which takes surfaces to
//! surfaces exactly. What is held changes that smoothly along the last, and in height alone:
//! `h′ = k(s)·h + c(s)`. k goes from γ at the tread to 1 at the toe where the toe's thickness is held; c is
//! none at the tread, and as much at heel and toe as takes these to the heights that are held. Such a map is
//! applied to poles and vertices; between poles of a surface it is followed to within what a surface with
//! these poles can, some hundredths of a millimetre on the sample.

use serde::{Deserialize, Serialize};

use super::Frame;
use super::landmarks::{Landmark, Landmarks};
use super::measures::{Measures, TOE_THICKNESS, ball_girth};
use super::skin::Skin;
use crate::error::{Result, bounded};
use crate::vector::Point;

/// How a last grows from size to size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grading {
    /// The size of the last as it is in its files.
    pub base: f64,
    /// How much a size is.
    pub system: System,
    /// Whether every size is as many percent larger than the last one, in length and width alike, or as
    /// many millimetres, in length and girth.
    pub geometric: bool,
    /// What does not change with the size.
    pub hold: Hold,
}

/// How much a size is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum System {
    /// Paris points: two thirds of a centimetre, and half a centimetre of girth.
    Paris,
    /// Sizes of the United Kingdom: a third of an inch, and a quarter of girth.
    Uk,
    /// Sizes of the United States: steps as in the United Kingdom.
    Us,
}

impl System {
    /// What a size adds to length and ball girth, mm.
    pub const fn steps(self) -> [f64; 2] {
        match self {
            Self::Paris => [20.0 / 3.0, 5.0],
            Self::Uk | Self::Us => [25.4 / 3.0, 25.4 / 4.0],
        }
    }
}

/// What does not change with the size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hold {
    /// The heel's height over the ground.
    pub heel_height: bool,
    /// The toe's height over the ground.
    pub toe_spring: bool,
    /// The toe's thickness.
    pub toe_thickness: bool,
}

/// How much larger than the base.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Along the last: λ.
    pub length: f64,
    /// Across it and upwards: γ.
    pub girth: f64,
}

/// A map from the base to a size, in coordinates of the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grade {
    pub scale: Scale,
    /// The ball girth that is wanted, mm, unless the growth of the length decides on it.
    pub girth: Option<f64>,
    /// Where the heel ends, mm along the base: that place stays.
    heel_end: f64,
    /// Where what is held at the heel ends, where at the toe it begins, and the tread between them, mm
    /// along the base.
    zones: [f64; 3],
    /// k at the toe.
    toe: f64,
    /// c at the heel and at the toe, mm.
    shift: [f64; 2],
}

/// Where what is held at the heel ends, and where at the toe it begins, in shares of the length.
const ZONES: [f64; 2] = [0.2, 0.9];
/// Least and greatest growth of a last, in length and in girth.
const GROWTH: [f64; 2] = [0.5, 2.0];
/// How exactly the ball girth is met, mm.
const CLOSE: f64 = 1.0e-9;

impl Grade {
    /// The map that leaves everything where it is.
    pub fn none() -> Self {
        Self {
            scale: Scale {
                length: 1.0,
                girth: 1.0,
            },
            girth: None,
            heel_end: 0.0,
            zones: [0.0; 3],
            toe: 1.0,
            shift: [0.0; 2],
        }
    }

    /// Where a place along the base has come to.
    pub fn along(&self, s: f64) -> f64 {
        self.heel_end + self.scale.length * (s - self.heel_end)
    }

    /// Where a point of the base has come to.
    pub fn point(&self, [s, w, h]: Point) -> Point {
        let [heel, tread, toe] = self.zones;
        let gamma = self.scale.girth;
        let [to_heel, to_toe] = [(tread - s, tread - heel), (s - tread, toe - tread)].map(smooth);
        let stretch = gamma + (self.toe - gamma) * to_toe;
        let shift = self.shift[0] * to_heel + self.shift[1] * to_toe;
        [self.along(s), gamma * w, stretch * h + shift]
    }
}

/// From 0 at the beginning of a way to 1 at its end and beyond, with no slope at either.
fn smooth((gone, way): (f64, f64)) -> f64 {
    if way <= 0.0 {
        return 0.0;
    }
    let t = (gone / way).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The map to a size of a last with this skin, these landmarks and these measures. Where a ball girth is aimed
/// at, it is at one that is larger by `correction`.
pub(super) fn grade(
    grading: &Grading,
    size: f64,
    frame: &Frame,
    (base, landmarks, measures): (&Skin, &Landmarks, &Measures),
    correction: f64,
) -> Result<Grade> {
    let steps = size - grading.base;
    let [longer, wider] = grading.system.steps();
    let ratio = 1.0 + longer / measures.length;
    let length = if grading.geometric {
        libm::pow(ratio, steps)
    } else {
        1.0 + steps * longer / measures.length
    };
    let in_bounds = |growth: f64| {
        let ok = (GROWTH[0]..=GROWTH[1]).contains(&growth);
        bounded(
            "size",
            size,
            ok,
            "such that the last is half to twice as large as its base",
        )
    };
    in_bounds(length)?;
    let along = base.along();
    let at = |share: f64| along.low + share * (along.high - along.low);
    let tread = landmarks.get(Landmark::Tread);
    let map = |girth: f64| {
        let mut grade = Grade {
            scale: Scale { length, girth },
            girth: None,
            heel_end: along.low,
            zones: [
                at(ZONES[0]),
                tread[0].clamp(at(ZONES[0] + 0.1), at(ZONES[1] - 0.05)),
                at(ZONES[1]),
            ],
            toe: if grading.hold.toe_thickness {
                1.0
            } else {
                girth
            },
            shift: [0.0; 2],
        };
        let held = [
            (grading.hold.heel_height, landmarks.get(Landmark::Heel)),
            (grading.hold.toe_spring, landmarks.get(Landmark::Toe)),
        ];
        grade.shift = held.map(|(held, place)| {
            let now = frame.above(grade.point(place), grade.point(tread));
            let missing = frame.above(place, tread) - now;
            if held { missing / frame.ground[1] } else { 0.0 }
        });
        grade
    };
    if grading.geometric {
        return Ok(map(length));
    }
    let wanted = measures.ball_girth + steps * wider;
    in_bounds(wanted / measures.ball_girth)?;
    // The ball's section lies aslant, so that its girth grows neither by λ nor by γ: found by secants.
    let off = |girth: f64| {
        let grade = map(girth);
        let moved = base.mapped(|p| grade.point(p));
        Ok(ball_girth(&moved, &landmarks.map(|p| grade.point(p)))? - wanted - correction)
    };
    let mut last = (1.0, off(1.0)?);
    let mut next = wanted / measures.ball_girth;
    for _ in 0..20 {
        let here = (next, off(next)?);
        if here.1.abs() <= CLOSE || here.1 == last.1 {
            break;
        }
        next -= here.1 * (here.0 - last.0) / (here.1 - last.1);
        last = here;
        in_bounds(next)?;
    }
    Ok(Grade {
        girth: Some(wanted),
        ..map(next)
    })
}

/// What is held lies within the zone at the toe.
const _: () = assert!(TOE_THICKNESS >= ZONES[1]);
