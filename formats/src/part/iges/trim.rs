//! Whether a face of an IGES file is the whole of its surface: none of its boundary runs inside the domain.
//!
//! Boundaries are judged by their curves in the parameters of the surface, where a side of the domain is
//! a straight line. A boundary that has none, but only a curve in space, counts as one that runs inside.

use super::file::{Entity, File, Parameters};
use super::spline::Spline;
use crate::error::Result;

/// How far from a side of the domain a boundary may lie, as a share of the domain.
const ON_SIDE: f64 = 1.0e-6;

/// Deepest nesting of composite curves.
const MAX_DEPTH: usize = 16;

/// The surface under a face, and the curves of its boundary in the surface's parameters.
pub(super) struct Face {
    pub(super) surface: usize,
    /// `None` for a boundary that is known in space only.
    boundary: Vec<Option<usize>>,
}

/// A bounded (143), trimmed (144) or topological (510) face.
pub(super) fn face(name: &str, file: &File, entity: &Entity) -> Result<Face> {
    let mut p = file.parameters(name, entity)?;
    match entity.kind {
        143 => {
            p.skip(1); // whether there are curves in parameters
            let surface = p.count()?;
            let count = p.count()?;
            Ok(Face {
                surface,
                boundary: each(name, file, p.counts(count)?, 141, bounded)?,
            })
        }
        144 => {
            let surface = p.count()?;
            let outer = p.count()? == 1;
            let count = p.count()?;
            let outer_curve = p.count()?;
            let mut curves = p.counts(count)?;
            if outer {
                curves.push(outer_curve);
            }
            Ok(Face {
                surface,
                boundary: each(name, file, curves, 142, on_surface)?,
            })
        }
        _ => {
            let surface = p.count()?;
            let count = p.count()?;
            p.skip(1); // whether the first loop is the outer one
            Ok(Face {
                surface,
                boundary: each(name, file, p.counts(count)?, 508, edges)?,
            })
        }
    }
}

/// What `curves` finds in each boundary that `numbers` refer to.
fn each(
    name: &str,
    file: &File,
    numbers: Vec<usize>,
    kind: u32,
    curves: impl Fn(&mut Parameters) -> Result<Vec<Option<usize>>>,
) -> Result<Vec<Option<usize>>> {
    let mut all = Vec::new();
    for number in numbers {
        match file.at(number).filter(|e| e.kind == kind) {
            Some(entity) => all.extend(curves(&mut file.parameters(name, entity)?)?),
            None => all.push(None),
        }
    }
    Ok(all)
}

/// A curve on a parametric surface, 142.
fn on_surface(p: &mut Parameters) -> Result<Vec<Option<usize>>> {
    p.skip(2); // how it was made, and the surface
    let curve = p.count()?;
    Ok(vec![Some(curve).filter(|&c| c != 0)])
}

/// A boundary, 141: several curves, each with its curves in parameters.
fn bounded(p: &mut Parameters) -> Result<Vec<Option<usize>>> {
    p.skip(3); // kind, preference, surface
    let count = p.count()?;
    let mut all = Vec::new();
    for _ in 0..count {
        p.skip(2); // the curve in space, and which way
        let count = p.count()?;
        parameter_curves(p.counts(count)?, &mut all);
    }
    Ok(all)
}

/// A loop, 508: edges, each with its curves in parameters, and vertices.
fn edges(p: &mut Parameters) -> Result<Vec<Option<usize>>> {
    let count = p.count()?;
    let mut all = Vec::new();
    for _ in 0..count {
        let vertex = p.count()? == 1;
        p.skip(3); // list, index, orientation
        let count = p.count()?;
        let pairs = p.counts(count.saturating_mul(2))?;
        if !vertex || count > 0 {
            parameter_curves(pairs.into_iter().skip(1).step_by(2).collect(), &mut all);
        }
    }
    Ok(all)
}

fn parameter_curves(curves: Vec<usize>, all: &mut Vec<Option<usize>>) {
    if curves.is_empty() {
        all.push(None);
    }
    all.extend(curves.into_iter().map(|c| Some(c).filter(|&c| c != 0)));
}

/// Whether the face is the whole of its surface.
pub(super) fn is_whole(name: &str, file: &File, face: &Face, surface: &Spline) -> Result<bool> {
    let domain = surface.domain();
    for curve in &face.boundary {
        let Some(curve) = *curve else {
            return Ok(false);
        };
        if !on_side(name, file, curve, domain, 0)? {
            return Ok(false);
        }
    }
    Ok(!surface.cut)
}

/// Whether a curve in parameters lies on the sides of the domain.
fn on_side(
    name: &str,
    file: &File,
    number: usize,
    domain: [(f64, f64); 2],
    depth: usize,
) -> Result<bool> {
    let Some(curve) = file
        .at(number)
        .filter(|c| c.matrix == 0 && depth < MAX_DEPTH)
    else {
        return Ok(false);
    };
    let mut p = file.parameters(name, curve)?;
    let (degree, poles) = match curve.kind {
        102 => {
            let count = p.count()?;
            for part in p.counts(count)? {
                if !on_side(name, file, part, domain, depth + 1)? {
                    return Ok(false);
                }
            }
            return Ok(true);
        }
        110 => (1, p.numbers(6)?),
        // Points of a polyline, in a plane or in space.
        106 => {
            let width = p.count()? + 1;
            let count = p.count()?;
            let plane = width == 2;
            if plane {
                p.skip(1);
            }
            if width > 3 || !matches!(curve.form, 11 | 12) {
                return Ok(false);
            }
            let numbers = p.numbers(count.saturating_mul(width))?;
            let points = numbers.chunks_exact(width);
            (1, points.flat_map(|q| [q[0], q[1], 0.0]).collect())
        }
        126 => {
            let last = p.count()?;
            let degree = p.count()?;
            p.skip(4);
            let poles = last.saturating_add(1);
            p.skip(poles.saturating_add(degree).saturating_add(1)); // knots
            p.skip(poles); // weights
            (degree, p.numbers(poles.saturating_mul(3))?)
        }
        _ => return Ok(false),
    };
    let (poles, _) = poles.as_chunks::<3>();
    if poles.is_empty() {
        return Ok(false);
    }
    // A piece lies within the hull of its poles.
    let pieces = poles.windows(degree.saturating_add(1).min(poles.len()));
    Ok(pieces.into_iter().all(|piece| {
        let sides = domain.iter().enumerate().flat_map(|(axis, &(low, high))| {
            let slack = (high - low).abs() * ON_SIDE;
            [low, high].map(|side| (axis, side, slack))
        });
        sides
            .into_iter()
            .any(|(axis, side, slack)| piece.iter().all(|q| (q[axis] - side).abs() <= slack))
    }))
}
