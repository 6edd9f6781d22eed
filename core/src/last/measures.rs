//! The measures of a last, each a number of millimetres.

use serde::{Deserialize, Serialize};

use super::Frame;
use super::curve::Loop;
use super::landmarks::{Landmark, Landmarks, begin_at_lowest};
use super::skin::{Plane, Skin, hull, stretch, tape};
use crate::error::{Error, Result};
use crate::vector::{Interval, Point, add_scaled, dot, sub, unit};

/// What is measured on a last, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// From end to end along the spindle.
    pub length: f64,
    /// Along the bottom in the median plane, from the rearmost to the foremost point of the feather line.
    pub bottom_length: f64,
    /// The same by a tape that does not go into hollows.
    pub bottom_length_taped: f64,
    /// In the median plane from the foremost point of the feather line over vamp, instep and cone, and down
    /// the heel to its rearmost.
    pub centre_line: f64,
    /// A tape around the ball: through its widest points on both sides and the vamp point.
    pub ball_girth: f64,
    /// Between the planes across the last that touch the ball on both sides.
    pub ball_width: f64,
    /// A tape through the instep point and the rearmost point of the feather line, square to the median
    /// plane: the long heel.
    pub cone_heel_line: f64,
    /// Of the rearmost point of the feather line over the ground.
    pub heel_height: f64,
    /// Of the foremost point of the feather line over the ground.
    pub toe_spring: f64,
    /// From bottom to top in the median plane, a twentieth of the length behind the toe's end.
    pub toe_thickness: f64,
}

/// Where the toe's thickness is measured, in shares of the length.
pub(super) const TOE_THICKNESS: f64 = 0.95;

impl Measures {
    /// Each less the other's, mm.
    #[must_use]
    pub fn less(&self, other: &Self) -> Self {
        Self {
            length: self.length - other.length,
            bottom_length: self.bottom_length - other.bottom_length,
            bottom_length_taped: self.bottom_length_taped - other.bottom_length_taped,
            centre_line: self.centre_line - other.centre_line,
            ball_girth: self.ball_girth - other.ball_girth,
            ball_width: self.ball_width - other.ball_width,
            cone_heel_line: self.cone_heel_line - other.cone_heel_line,
            heel_height: self.heel_height - other.heel_height,
            toe_spring: self.toe_spring - other.toe_spring,
            toe_thickness: self.toe_thickness - other.toe_thickness,
        }
    }

    /// Each with its name, in their order.
    pub fn named(&self) -> [(&'static str, f64); 10] {
        [
            ("length", self.length),
            ("bottom_length", self.bottom_length),
            ("bottom_length_taped", self.bottom_length_taped),
            ("centre_line", self.centre_line),
            ("ball_girth", self.ball_girth),
            ("ball_width", self.ball_width),
            ("cone_heel_line", self.cone_heel_line),
            ("heel_height", self.heel_height),
            ("toe_spring", self.toe_spring),
            ("toe_thickness", self.toe_thickness),
        ]
    }
}

/// Sections of a last that show its measures, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Sections {
    /// In the median plane, along and up.
    pub median: Vec<[f64; 2]>,
    /// Of the ball girth, across and up.
    pub ball: Vec<[f64; 2]>,
    /// Of the cone heel line, across and along its plane.
    pub cone_heel: Vec<[f64; 2]>,
    /// The places of [`Landmark::ALL`]: along, across, up.
    pub landmarks: [Point; 7],
}

/// The sections in which measures are taken.
pub(super) fn sections(skin: &Skin, frame: &Frame, landmarks: &Landmarks) -> Result<Sections> {
    let curve = median(skin, frame)?;
    let cut = |plane: Option<Plane>| plane.map_or_else(Vec::new, |p| skin.section(&p));
    let ball = cut(ball_plane(landmarks));
    // From the instep down to the heel.
    let cone_heel = cut(across(landmarks));
    let [instep, heel] = [Landmark::Instep, Landmark::Heel].map(|l| landmarks.get(l));
    let down = unit(sub(heel, instep)).unwrap_or_default();
    Ok(Sections {
        median: curve.between(0.0, curve.length() * (1.0 - 1e-9)),
        ball: ball.iter().map(|p| [p[1], p[2]]).collect(),
        cone_heel: cone_heel.iter().map(|&p| [p[1], -dot(p, down)]).collect(),
        landmarks: landmarks.0,
    })
}

/// Takes all measures. The toe is as thick as it is where that is measured on a last that extends over `along`.
pub(super) fn measure(
    skin: &Skin,
    frame: &Frame,
    landmarks: &Landmarks,
    along: Interval,
) -> Result<Measures> {
    let curve = median(skin, frame)?;
    let at = |landmark| {
        let [s, _, h] = landmarks.get(landmark);
        curve.nearest([s, h])
    };
    let [heel, toe] = [at(Landmark::Heel), at(Landmark::Toe)];
    let bottom = curve.between(heel, toe);
    let [under, _] = hull(bottom.clone());
    let own = skin.along();
    let thick = curve.crossed(along.low + TOE_THICKNESS * (along.high - along.low));
    let [low, high] = thick.ok_or(Error::NotALast { what: "toe" })?;
    let place = |landmark| landmarks.get(landmark);
    Ok(Measures {
        length: own.high - own.low,
        bottom_length: stretch(&bottom),
        bottom_length_taped: stretch(&under),
        centre_line: stretch(&curve.between(toe, heel)),
        ball_girth: ball_girth(skin, landmarks)?,
        ball_width: (place(Landmark::BallInner)[1] - place(Landmark::BallOuter)[1]).abs(),
        cone_heel_line: girth(skin, across(landmarks), "cone heel line")?,
        heel_height: frame.above(place(Landmark::Heel), place(Landmark::Tread)),
        toe_spring: frame.above(place(Landmark::Toe), place(Landmark::Tread)),
        toe_thickness: high - low,
    })
}

/// A tape around the ball.
pub(super) fn ball_girth(skin: &Skin, landmarks: &Landmarks) -> Result<f64> {
    girth(skin, ball_plane(landmarks), "ball")
}

/// The plane of the ball girth.
fn ball_plane(landmarks: &Landmarks) -> Option<Plane> {
    let [inner, outer, vamp] =
        [Landmark::BallInner, Landmark::BallOuter, Landmark::Vamp].map(|l| landmarks.get(l));
    Plane::through(inner, outer, vamp)
}

/// The plane of the cone heel line.
fn across(landmarks: &Landmarks) -> Option<Plane> {
    let [instep, heel] = [Landmark::Instep, Landmark::Heel].map(|l| landmarks.get(l));
    Plane::through(instep, heel, add_scaled(heel, 1.0, [0.0, 1.0, 0.0]))
}

fn girth(skin: &Skin, plane: Option<Plane>, what: &'static str) -> Result<f64> {
    let lost = Error::NotALast { what };
    let plane = plane.ok_or(lost.clone())?;
    let section = skin.section(&plane);
    if section.len() < 3 {
        return Err(lost);
    }
    Ok(tape(plane.within(&section)))
}

/// The plane through two points that holds the last's upward direction.
pub(super) fn upright(a: Point, b: Point) -> Option<Plane> {
    Plane::through(a, b, add_scaled(a, 1.0, [0.0, 0.0, 1.0])).filter(|_| sub(a, b) != [0.0; 3])
}

/// The outline in the median plane, along and up; it begins at the tread and runs to the toe.
pub(super) fn median(skin: &Skin, frame: &Frame) -> Result<Loop> {
    let plane = Plane {
        point: [0.0; 3],
        normal: [0.0, 1.0, 0.0],
    };
    let points = skin.section(&plane).iter().map(|p| [p[0], p[2]]).collect();
    begin_at_lowest(frame, points).ok_or(Error::NotALast {
        what: "median plane",
    })
}
