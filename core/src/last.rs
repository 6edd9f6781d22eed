//! Shoe lasts: their measures, and the same last in other sizes and for the other foot.
//!
//! A last lies along the spindle. What is its toe, and which way is up, its job says; [`Frame`] turns that
//! into coordinates of the last: along it from heel to toe, across it, and up. Measures are taken on a
//! [`Skin`], dense triangles over the last, between [`Landmarks`] that are found on it or given. Landmarks are
//! found once, on the last as it is in its files, and carried along to every size and side, as a last maker
//! does it: so measures of different sizes are of the same places.
//!
//! Nothing here knows feet, fit or sizes of shoes: a size is so many steps from the base.

mod curve;
mod grade;
mod landmarks;
mod measures;
mod skin;

#[cfg(test)]
mod tests;

use crate::error::{Error, Result};
use crate::part::{Part, Shape};
use crate::rays::Machined;
use crate::vector::{Interval, Point, cross, dot, unit};

pub use grade::{Grading, Hold, Scale, System};
pub use landmarks::{Choice, Landmark, Landmarks};
pub use measures::{Measures, Sections};
use skin::Skin;

/// What is the last in a part, and how it lies there.
#[derive(Debug, Clone, PartialEq)]
pub struct Last {
    /// Its bodies, by their files, their numbers there or their own names; all bodies if nothing is said.
    pub bodies: Vec<String>,
    /// How it lies.
    pub frame: Frame,
    /// Landmarks that are not to be found but are where this says.
    pub choices: Vec<(Landmark, Choice)>,
}

/// How a last lies along the spindle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Along it, towards the toe: X or −X.
    along: Point,
    /// Across it towards the foot's inner side, in the part frame.
    across: Point,
    /// From the bottom to the cone, square to the spindle.
    up: Point,
    /// Square to the ground: how much of it is along the last, and how much up.
    ground: [f64; 2],
}

impl Frame {
    /// A last with its toe at the greatest x, or else the least, and `up` the direction square to the
    /// ground on which it would stand, in the part frame; for the right foot or else for the left.
    ///
    /// # Errors
    /// [`Error::NoDirection`] if that has no length or is along the spindle.
    pub fn new(toe_at_greatest: bool, up: Point, right: bool) -> Result<Self> {
        let along = [if toe_at_greatest { 1.0 } else { -1.0 }, 0.0, 0.0];
        let lost = Error::NoDirection { direction: up };
        let ground = unit(up).ok_or(lost.clone())?;
        let up = unit([0.0, ground[1], ground[2]]).ok_or(lost)?;
        Ok(Self {
            along,
            across: if right {
                cross(up, along)
            } else {
                cross(along, up)
            },
            up,
            ground: [dot(ground, along), dot(ground, up)],
        })
    }

    /// A point of the part frame in coordinates of the last: along, across, up.
    fn inward(&self, p: Point) -> Point {
        [dot(p, self.along), dot(p, self.across), dot(p, self.up)]
    }

    /// A point given along the last, across it and up, in the part frame.
    #[must_use]
    pub fn outward(&self, [along, across, up]: Point) -> Point {
        std::array::from_fn(|k| along * self.along[k] + across * self.across[k] + up * self.up[k])
    }

    /// How far `a` is above `b` as the last stands on the ground; coordinates of the last, mm.
    fn above(&self, a: Point, b: Point) -> f64 {
        self.ground[0] * (a[0] - b[0]) + self.ground[1] * (a[2] - b[2])
    }
}

/// A last in its size and for its foot.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaped {
    /// The part with it.
    pub part: Part,
    /// Its landmarks.
    pub landmarks: Landmarks,
    /// What it measures.
    pub measures: Measures,
    /// How much longer and wider it is than the base.
    pub scale: Scale,
    /// Where the base's ends have come to, for travels that were given for the base, mm.
    ends: [(f64, f64); 2],
}

impl Shaped {
    /// Where a travel of the base has come to: beside the last's ends as far from them as before.
    pub fn travel(&self, x: f64) -> f64 {
        let [(low, new_low), (high, new_high)] = self.ends;
        if x <= low {
            x - low + new_low
        } else if x >= high {
            x - high + new_high
        } else {
            new_low + (x - low) * ((new_high - new_low) / (high - low))
        }
    }
}

/// Makes a last of `size`, if there is one to be made, and mirrors it if it is for the other foot. The part is
/// in place on the spindle. Bodies that are not the last keep their size, and stay at the end at which they are.
///
/// # Errors
/// [`Error::NoSuchBody`], [`Error::NotALast`], [`Error::OutOfBounds`] for a size out of proportion, and those of
/// [`crate::discretize()`].
pub fn shape(
    part: &Part,
    last: &Last,
    size: Option<(&Grading, f64)>,
    mirrored: bool,
) -> Result<Shaped> {
    let base = last.skin(part)?;
    let found = landmarks::find(&base, &last.frame, &last.choices)?;
    let measures = measures::measure(&base, &last.frame, &found, base.along())?;
    if size.is_none() && !mirrored {
        let Interval { low, high } = last.ends(base.along());
        return Ok(Shaped {
            part: part.clone(),
            landmarks: found,
            measures,
            scale: grade::Grade::none().scale,
            ends: [(low, low), (high, high)],
        });
    }
    let mut correction = 0.0;
    let mut rounds = 0..ROUNDS;
    loop {
        let grade = match size {
            None => grade::Grade::none(),
            Some((grading, size)) => {
                let of = (&base, &found, &measures);
                grade::grade(grading, size, &last.frame, of, correction)?
            }
        };
        let (moved, ends) = move_to(part, last, &grade, base.along(), mirrored)?;
        let landmarks = found.map(|p| {
            let [s, w, h] = grade.point(p);
            [s, if mirrored { -w } else { w }, h]
        });
        let skin = last.skin(&moved)?;
        let measures = measures::measure(&skin, &last.frame, &landmarks, skin.along())?;
        let off = grade.girth.map_or(0.0, |girth| measures.ball_girth - girth);
        if rounds.next().is_none() || off.abs() <= CLOSE {
            return Ok(Shaped {
                part: moved,
                landmarks,
                measures,
                scale: grade.scale,
                ends,
            });
        }
        // Poles were moved where points were meant.
        correction -= off;
    }
}

/// How exactly a size's ball girth is met, mm, and how often that is tried: each time is some hundred times closer.
const CLOSE: f64 = 1.0e-3;
const ROUNDS: usize = 4;

/// The part with its last moved by `grade` and the rest with its ends, and where these have come to.
fn move_to(
    part: &Part,
    last: &Last,
    grade: &grade::Grade,
    along: Interval,
    mirrored: bool,
) -> Result<(Part, [(f64, f64); 2])> {
    let (frame, was) = (&last.frame, last.ends(along));
    let is = last.ends(Interval::of(
        [along.low, along.high].map(|s| grade.along(s)),
    ));
    let ends = [(was.low, is.low), (was.high, is.high)];
    let mut moved = part.clone();
    for (body, chosen) in moved.bodies.iter_mut().zip(last.chosen(part)?) {
        if chosen {
            let point = |p| frame.outward(grade.point(frame.inward(p)));
            body.shape.map_points(point);
        } else {
            let ahead = body.shape.middle() > (was.low + was.high) / 2.0;
            let (from, to) = ends[usize::from(ahead)];
            body.shape.map_points(|[x, y, z]| [x + (to - from), y, z]);
        }
        if mirrored {
            body.shape = mirror(&body.shape, frame.across);
        }
    }
    moved.check_points()?;
    Ok((moved, ends))
}

impl Last {
    /// Which bodies of a part are the last.
    fn chosen(&self, part: &Part) -> Result<Vec<bool>> {
        let named = |wanted: &String| part.bodies.iter().any(|b| is_called(&b.name, wanted));
        if let Some(missing) = self.bodies.iter().find(|wanted| !named(wanted)) {
            let known: Vec<&str> = part.bodies.iter().map(|b| &*b.name).collect();
            return Err(Error::NoSuchBody {
                name: missing.clone(),
                known: known.join(", "),
            });
        }
        let is = |name: &str| {
            self.bodies.is_empty() || self.bodies.iter().any(|wanted| is_called(name, wanted))
        };
        Ok(part.bodies.iter().map(|b| is(&b.name)).collect())
    }

    /// The last of a part as dense triangles.
    fn skin(&self, part: &Part) -> Result<Skin> {
        let chosen = self.chosen(part)?;
        let bodies = part.bodies.iter().zip(chosen).filter(|(_, chosen)| *chosen);
        let bodies = bodies.map(|(body, _)| body.clone()).collect();
        Skin::of(&Part { bodies }, &self.frame)
    }

    /// What the last of `shaped` measures as a path leaves it, and the share of it of which that is known: its
    /// surface is moved along its normal by as much as the machined one is off. A tape lies on the ridges
    /// between turns of the path, `step` apart, mm.
    ///
    /// # Errors
    /// Those of [`shape`].
    pub fn machined(
        &self,
        shaped: &Shaped,
        machined: &Machined,
        step: f64,
    ) -> Result<(Measures, f64)> {
        let machined = machined.bridged(step, LEFT);
        let designed = self.skin(&shaped.part)?;
        let (moved, known) = designed.machined(&machined);
        let landmarks = designed.carried(&moved, &shaped.landmarks);
        let along = designed.along();
        let measures = measures::measure(&moved, &self.frame, &landmarks, along)?;
        Ok((measures, known))
    }

    /// The sections in which the last of `shaped` is measured, with its landmarks.
    ///
    /// # Errors
    /// Those of [`shape`].
    pub fn sections(&self, shaped: &Shaped) -> Result<Sections> {
        measures::sections(&self.skin(&shaped.part)?, &self.frame, &shaped.landmarks)
    }

    /// Extent in travel of an extent along the last.
    fn ends(&self, along: Interval) -> Interval {
        Interval::of([along.low, along.high].map(|s| s * self.frame.along[0]))
    }
}

/// Whether a body is called so: by its file, its number there or its own name, as in
/// `last.step: surface 1 'last'`.
fn is_called(name: &str, wanted: &str) -> bool {
    name.split([':', '\'']).any(|part| part.trim() == wanted)
}

/// What is left more than this, mm, is out of the cutter's reach, beside a holder or in an undercut: it is not
/// machined, and goes by hand.
const LEFT: f64 = 0.2;

/// The mirror image across the plane through the spindle that is square to `normal`. What faced outwards
/// does so again: triangles are turned round, surfaces run the other way in v.
fn mirror(shape: &Shape, normal: Point) -> Shape {
    let image = |p: Point| {
        let off = 2.0 * dot(p, normal);
        std::array::from_fn(|k| p[k] - off * normal[k])
    };
    let mut mirrored = match shape {
        Shape::Surface(surface) => Shape::Surface(surface.reversed_v()),
        Shape::Mesh(mesh) => Shape::Mesh(mesh.reversed()),
    };
    mirrored.map_points(image);
    mirrored
}

impl Shape {
    /// The middle of its extent along the spindle, mm.
    fn middle(&self) -> f64 {
        let x = match self {
            Self::Surface(surface) => Interval::of(surface.poles().iter().map(|p| p[0])),
            Self::Mesh(mesh) => mesh.x_range(),
        };
        (x.low + x.high) / 2.0
    }
}
