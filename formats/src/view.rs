//! `report.html`: a run to look at, or a part alone. One file that works from disk and asks the network for
//! nothing.
//!
//! [`view()`] and [`part()`] make plain data of what was computed, thinned until a browser can hold it;
//! [`save`] writes the page around it. What is drawn, and how, is for the page alone; nothing is computed here
//! that decides anything about a path.

mod alone;
mod errors;
mod pack;
mod solid;
mod thin;
mod unrolled;

use std::io::{self, Write};
use std::path::Path;

use horma_core::{Clearances, Cutter, Index, Machined, MotionKind, Point, Trajectory, Waypoint};
use serde::Serialize;

use crate::error::Result;
use crate::output;
use crate::preview::Sheet;

pub use alone::{PartFigures, part};
pub use errors::Errors;
pub use solid::Solid;
pub use thin::{Seen, Shown};
pub use unrolled::{Cells, Unrolled};

/// Places along the profile of a wheel.
const PROFILE: usize = 32;

/// What the page shows, thinned.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// How positions follow each other; nothing if each has a place of its own.
    pub motion: Option<Motion>,
    /// The wheel's profile: axial distance from its centre and radius there, mm; empty for a part alone.
    pub wheel: Vec<[f64; 2]>,
    /// The part as triangles.
    pub part: Solid,
    /// The path; no position for a part alone.
    pub path: Shown,
    /// How far from the designed surface the path stays; nothing if that was not looked at.
    pub errors: Option<Errors>,
    /// The surface that the path leaves; nothing if that was not looked at.
    pub machined: Option<Unrolled>,
}

/// What gives travel and angle of a position from its index, as [`horma_core::Trajectory`] does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Motion {
    /// `helix` or `rings`.
    pub kind: &'static str,
    /// Travel of the first position, mm.
    pub from: f64,
    /// Travel per revolution, mm.
    pub step: f64,
    /// Positions per revolution.
    pub points_per_revolution: u32,
}

/// What is found of a path beside its positions.
#[derive(Debug, Clone, Copy, Default)]
pub struct Findings<'a> {
    /// How far from the designed surface it stays.
    pub clearances: Option<&'a Clearances>,
    /// What it leaves of the part.
    pub machined: Option<&'a Machined>,
}

/// What there is to see of a path of `cutter` around `part`, and of what was found of it. Positions of a
/// `trajectory` have their places from it, those of a path from elsewhere have their own.
pub fn view(
    part: &[Sheet],
    cutter: &Cutter,
    path: &[Waypoint],
    trajectory: Option<&Trajectory>,
    found: Findings,
) -> View {
    View {
        motion: trajectory.map(|trajectory| Motion {
            kind: match trajectory.kind {
                MotionKind::Helix => "helix",
                MotionKind::Rings => "rings",
            },
            from: trajectory.from,
            step: trajectory.step,
            points_per_revolution: trajectory.points_per_revolution,
        }),
        wheel: profile(cutter),
        part: solid::solid(part),
        path: thin::shown(path),
        errors: found.clearances.map(errors::errors),
        machined: found.machined.map(unrolled::unrolled),
    }
}

/// The wheel's profile from side to side; places lie closer together towards the sides, where a
/// rounding falls off.
fn profile(cutter: &Cutter) -> Vec<[f64; 2]> {
    let half = cutter.half_width();
    let places = (0..=PROFILE).map(|k| {
        let turn = std::f64::consts::PI * (k as f64 / PROFILE as f64);
        -half * libm::cos(turn)
    });
    let radii = places.filter_map(|d| cutter.profile(d).map(|m| [d, m]));
    radii.collect()
}

/// What the page has to know of the numbers that are packed.
#[derive(Serialize)]
struct Contents<'a> {
    motion: Option<&'a Motion>,
    wheel: &'a [[f64; 2]],
    /// The first point of each body.
    bodies: &'a [u32],
    triangles: Count,
    positions: Count,
    /// Of how many positions that follow each other the outstanding ones are shown.
    every: u64,
    samples: Option<Count>,
    /// Bounds of classes of clearances, mm, and how many samples are in each: one more than bounds.
    classes: Option<(&'a [f64], &'a [u64])>,
    /// Cells of the machined surface, and what radii are counted up to, mm.
    cells: Option<Cells>,
    radius: f64,
    /// The box that coordinates are counted in, mm.
    low: Point,
    high: Point,
}

/// How many are shown of how many.
#[derive(Serialize)]
struct Count {
    shown: u64,
    of: u64,
}

const HTML: &str = include_str!("view/page/index.html");
const STYLE: &str = include_str!("view/page/page.css");
/// One script, in the order in which one part uses another.
const SCRIPTS: [&str; 7] = [
    include_str!("view/page/data.js"),
    include_str!("view/page/colour.js"),
    include_str!("view/page/mesh.js"),
    include_str!("view/page/scene.js"),
    include_str!("view/page/plots.js"),
    include_str!("view/page/tables.js"),
    include_str!("view/page/page.js"),
];

/// Writes the page that shows `view` and the figures of `report`, a [`crate::report::Report`] or
/// [`PartFigures`]: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`], naming `file`.
pub fn save(file: &Path, view: &View, report: &impl Serialize) -> Result<()> {
    output::write(file, |out| write(out, view, report))
}

fn write(out: &mut impl Write, view: &View, report: &impl Serialize) -> io::Result<()> {
    let mut rest = HTML;
    let mut until = |out: &mut dyn Write, mark: &str| -> io::Result<()> {
        let (before, after) = rest.split_once(mark).expect("the page has its marks");
        rest = after;
        out.write_all(before.as_bytes())
    };
    until(out, "/* style */")?;
    out.write_all(STYLE.as_bytes())?;
    until(out, "<!-- data -->")?;
    numbers(out, view, report)?;
    until(out, "/* script */")?;
    for script in SCRIPTS {
        out.write_all(script.as_bytes())?;
    }
    out.write_all(rest.as_bytes())
}

/// Every number of the page, each kind in an element of its own.
fn numbers(out: &mut impl Write, view: &View, report: &impl Serialize) -> io::Result<()> {
    let View {
        part,
        path,
        errors,
        machined,
        ..
    } = view;
    let contacts = path.positions.iter().filter_map(|p| p.touch);
    let contacts = contacts.map(|t| t.contact);
    let samples = errors.iter().flat_map(|e| &e.points).copied();
    let all = part.points.iter().copied().chain(contacts).chain(samples);
    let (low, high) = pack::bounds(all);
    let radii = machined.iter().flat_map(|m| m.radii.iter().flatten());
    let radius = radii.copied().fold(0.0, f64::max);
    let contents = Contents {
        motion: view.motion.as_ref(),
        wheel: &view.wheel,
        bodies: &part.bodies,
        triangles: Count {
            shown: part.triangles.len() as u64,
            of: part.of,
        },
        positions: Count {
            shown: path.positions.len() as u64,
            of: path.of,
        },
        every: path.every,
        samples: errors.as_ref().map(|e| Count {
            shown: e.points.len() as u64,
            of: e.of,
        }),
        classes: errors.as_ref().map(|e| (&errors::BOUNDS[..], &*e.classes)),
        cells: machined.as_ref().map(|m| m.cells),
        radius,
        low,
        high,
    };
    pack::json(out, "contents", &contents)?;
    pack::json(out, "report", report)?;

    let seen = || path.positions.iter();
    let float = |value: Option<f64>| value.map_or(f32::NAN, |v| v as f32).to_le_bytes();
    let place = |p: Point| pack::place(p, low, high);
    pack::block(out, "vertices", part.points.iter().map(|&p| place(p)))?;
    let corners = part.triangles.iter().flatten();
    pack::block(out, "triangles", corners.map(|c| c.to_le_bytes()))?;
    let edges = part.edges.iter().flatten();
    pack::block(out, "edges", edges.map(|&p| place(p)))?;
    if path.positions.is_empty() {
        return Ok(());
    }
    let index = |i: Index| (i.floor() as f64 + i.share()).to_le_bytes();
    pack::block(out, "index", seen().map(|p| index(p.index)))?;
    if view.motion.is_none() {
        pack::block(out, "travels", seen().map(|p| p.x.to_le_bytes()))?;
        pack::block(out, "angles", seen().map(|p| p.angle.to_le_bytes()))?;
    }
    let heights = seen().map(|p| float(p.touch.map(|t| t.height)));
    pack::block(out, "heights", heights)?;
    let touched = seen().map(|p| place(p.touch.map_or(low, |t| t.contact)));
    pack::block(out, "contacts", touched)?;
    pack::block(out, "slopes", seen().map(|p| float(p.slope)))?;
    pack::block(out, "bends", seen().map(|p| float(p.bend)))?;
    if let Some(errors) = errors {
        pack::block(out, "samples", errors.points.iter().map(|&p| place(p)))?;
        let clearances = errors.clearances.iter().map(|&c| float(Some(c)));
        pack::block(out, "clearances", clearances)?;
    }
    if let Some(machined) = machined {
        let radii = machined.radii.iter();
        let radii = radii.map(|r| pack::part(r.unwrap_or(0.0), 0.0, radius));
        pack::block(out, "radii", radii)?;
        let deviations = machined.deviations.iter();
        pack::block(out, "deviations", deviations.map(|&d| float(d)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
