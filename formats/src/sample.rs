//! A part of our own making: a parametric shoe last and the two holders that carry it on the lathe.
//!
//! The last is a right one, as a last maker draws it: feather edge, ball, shank, instep, cone, heel
//! and toe box from tables of measures along it. It knows nothing about feet: no grading, no fit.

mod loft;
mod shape;

use std::path::Path;

use horma_core::{Body, Part, Point, Shape, Surface};

use crate::error::{Error, Result};
use crate::{output, step_out};
use loft::loft;

/// What tells one last from another, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LastStyle {
    /// From the back of the heel to the tip of the toe, along the spindle.
    pub length: f64,
    /// Greatest width, at the ball.
    pub ball_width: f64,
    /// From the bottom to the front of the cone's plateau.
    pub cone_height: f64,
    /// From the ground to the heel seat.
    pub heel_height: f64,
    /// From the ground to the tip of the toe.
    pub toe_spring: f64,
}

impl LastStyle {
    /// A women's last with a medium heel.
    pub const WOMEN: Self = Self {
        length: 260.0,
        ball_width: 90.0,
        cone_height: 87.0,
        heel_height: 45.0,
        toe_spring: 10.0,
    };
    /// A men's last with a low heel.
    pub const MEN: Self = Self {
        length: 285.0,
        ball_width: 101.0,
        cone_height: 93.0,
        heel_height: 25.0,
        toe_spring: 13.0,
    };
}

/// Name of the sample's job file.
pub const JOB: &str = "job.toml";
/// Name of the sample's part.
pub const PART: &str = "last.step";

/// Sections of the toe holder: distance from the toe's tip, half width and half height, mm. A neck
/// that enters the toe, and the bar that the lathe grips.
const TOE_HOLDER: [(f64, f64, f64); 9] = [
    (-6.0, 7.0, 5.0),
    (-2.0, 7.0, 5.0),
    (3.0, 7.0, 5.0),
    (8.0, 8.5, 7.5),
    (12.0, 15.0, 15.0),
    (18.0, 16.0, 16.0),
    (26.0, 16.0, 16.0),
    (34.0, 16.0, 16.0),
    (40.0, 16.0, 16.0),
];
/// The same for the heel holder and its distance from the back of the heel.
const HEEL_HOLDER: [(f64, f64, f64); 9] = [
    (-6.0, 8.5, 11.0),
    (-2.0, 8.5, 11.0),
    (3.0, 8.5, 11.0),
    (8.0, 10.0, 12.0),
    (12.0, 15.0, 15.0),
    (18.0, 16.0, 16.0),
    (26.0, 16.0, 16.0),
    (34.0, 16.0, 16.0),
    (40.0, 16.0, 16.0),
];

/// Poles around a holder.
const HOLDER_POLES: usize = 12;

/// The sample part: the last, its toe holder and its heel holder, three bicubic surfaces. u runs
/// along the spindle from heel to toe, v around it and is closed, normals point outwards. The
/// spindle is the x axis, z is up, and the inner side of the foot is at positive y.
///
/// # Errors
/// Those of [`Surface::new`], for a style whose numbers are not finite.
pub fn last(style: &LastStyle) -> Result<Part> {
    let toe = TOE_HOLDER.map(|(d, y, z)| ellipse(style.length + d, y, z));
    let mut heel = HEEL_HOLDER.map(|(d, y, z)| ellipse(-d, y, z));
    heel.reverse();
    let body = |name: &str, sections: &[Vec<Point>]| -> Result<Body> {
        Ok(Body {
            name: name.to_owned(),
            shape: Shape::Surface(loft(name, sections)?),
        })
    };
    let bodies = vec![
        body("last", &shape::sections(style))?,
        body("toe holder", &toe)?,
        body("heel holder", &heel)?,
    ];
    Ok(Part { bodies })
}

/// Poles of a section that comes close to an ellipse, from the bottom up the outer side.
fn ellipse(x: f64, half_width: f64, half_height: f64) -> Vec<Point> {
    let step = std::f64::consts::TAU / HOLDER_POLES as f64;
    // A cubic with uniform knots lies inside its poles: this much further out, it meets the ellipse.
    let out = 3.0 / (2.0 + libm::cos(step));
    let pole = |k| {
        let angle = step * k as f64;
        let y = -half_width * out * libm::sin(angle);
        let z = -half_height * out * libm::cos(angle);
        [x, y, z]
    };
    (0..HOLDER_POLES).map(pole).collect()
}

/// The sample job.
pub fn job_toml() -> &'static str {
    include_str!("../../examples/last/job.toml")
}

/// The sample part as a STEP file.
///
/// # Errors
/// Those of [`last`].
pub fn last_step(style: &LastStyle) -> Result<String> {
    let part = last(style)?;
    let surfaces: Vec<(&str, &Surface)> = part
        .bodies
        .iter()
        .filter_map(|b| match &b.shape {
            Shape::Surface(s) => Some((b.name.as_str(), s)),
            Shape::Mesh(_) => None,
        })
        .collect();
    Ok(step_out::write(PART, &surfaces))
}

/// Writes the sample, [`JOB`] and [`PART`], into `dir`, which is created if it is missing.
///
/// # Errors
/// [`Error::Exists`] if either file is there already, and then neither is written; [`Error::Io`].
pub fn write_sample(dir: &Path) -> Result<()> {
    let files = [
        (PART, last_step(&LastStyle::WOMEN)?),
        (JOB, job_toml().to_owned()),
    ];
    if let Some((name, _)) = files.iter().find(|(name, _)| dir.join(name).exists()) {
        return Err(Error::Exists {
            path: dir.join(name),
        });
    }
    std::fs::create_dir_all(dir).map_err(|e| Error::io(dir, e))?;
    for (name, text) in files {
        output::write(&dir.join(name), |file| {
            std::io::Write::write_all(file, text.as_bytes())
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
