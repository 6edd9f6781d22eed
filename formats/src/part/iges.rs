//! IGES: B-spline surfaces (entity 128) and parametric spline surfaces (114), alone and under faces.
//!
//! Faces are bounded (143) and trimmed surfaces (144) and those of B-rep solids (510); their trimming is
//! looked at as that of STEP files is, and not applied. What else there is comes in two kinds: surfaces
//! and solids that are not read are refused by name, for machined without, the part would be gouged;
//! curves, points and drawings are passed over with a word. Read here and not by a library: the one there
//! is brings a CAD kernel's worth of crates and loses the loops of faces.

mod file;
mod spline;
mod trim;
mod units;

use std::collections::{BTreeMap, HashSet};

use horma_core::{Body, Shape};

use self::file::{Entity, File};
use self::spline::Spline;
use super::matrix::{IDENTITY, Matrix, product};
use super::{Loaded, Reading, Trims, Warning, label};
use crate::error::{Error, Result};

/// Deepest chain of transformation matrices.
const MAX_DEPTH: usize = 16;

/// Surfaces and solids that are not read.
const UNREAD: [(u32, &str); 22] = [
    (108, "plane"),
    (118, "ruled surface"),
    (120, "surface of revolution"),
    (122, "tabulated cylinder"),
    (140, "offset surface"),
    (150, "block"),
    (152, "wedge"),
    (154, "cylinder"),
    (156, "cone"),
    (158, "sphere"),
    (160, "torus"),
    (162, "solid of revolution"),
    (164, "solid of extrusion"),
    (168, "ellipsoid"),
    (180, "Boolean tree"),
    (184, "assembly of solids"),
    (190, "plane"),
    (192, "cylinder"),
    (194, "cone"),
    (196, "sphere"),
    (198, "torus"),
    (430, "placed solid"),
];

/// What carries no shape: what was deleted, matrices, colours, fonts, properties, groups, views, and what
/// only leads to faces.
const SHAPELESS: [u32; 18] = [
    0, 124, 132, 186, 302, 304, 308, 310, 312, 314, 316, 320, 322, 402, 404, 406, 410, 514,
];

/// What is passed over, as far as it has a name.
const OTHERS: [(u32, &str); 17] = [
    (100, "circular arc"),
    (102, "composite curve"),
    (104, "conic arc"),
    (106, "copious data"),
    (110, "line"),
    (112, "spline curve"),
    (116, "point"),
    (125, "flash"),
    (126, "B-spline curve"),
    (130, "offset curve"),
    (134, "node"),
    (136, "finite element"),
    (141, "boundary"),
    (142, "curve on a surface"),
    (212, "note"),
    (214, "leader"),
    (216, "dimension"),
];

/// Reads an IGES file called `name`, fixed ASCII.
///
/// # Errors
/// [`Error::Syntax`] with the line, [`Error::IgesGlobal`], [`Error::Units`], [`Error::IgesEntity`],
/// [`Error::UnsupportedSurface`], [`Error::Trimmed`], [`Error::NothingUsable`], and those of
/// [`horma_core::Surface::new`].
pub fn parse(name: &str, bytes: &[u8], reading: &Reading) -> Result<Loaded> {
    let file = File::read(name, bytes)?;
    let length = units::of(name, &file, reading)?;
    let scale = length.factor;
    let mut warnings = length.warnings;
    let under = under_faces(name, &file)?;
    let mut trims = Trims::new(reading);
    let mut bodies = Vec::new();
    let mut hidden = 0;
    let mut others = BTreeMap::new();
    for entity in &file.entities {
        let face = match entity.kind {
            143 | 144 | 510 => Some(trim::face(name, &file, entity)?),
            408 | 412 | 414 if places_shapes(name, &file, entity)? => {
                return Err(unsupported(
                    name,
                    entity,
                    "copy of shapes that are elsewhere in the file",
                ));
            }
            114 | 128 if under.contains(&entity.number) => continue,
            114 | 128 => None,
            kind => {
                let unread = UNREAD.iter().find(|(k, _)| *k == kind);
                match unread.filter(|_| !entity.blanked && !under.contains(&entity.number)) {
                    Some((_, kind)) if !is_harmless(entity) => {
                        return Err(unsupported(name, entity, kind));
                    }
                    _ if SHAPELESS.contains(&kind) || entity.dependent => {}
                    _ => *others.entry(kind).or_insert(0_usize) += 1,
                }
                continue;
            }
        };
        if entity.blanked {
            hidden += 1;
            continue;
        }
        let body = label(name, bodies.len() + 1, [&entity.label, ""]);
        let base = match &face {
            Some(face) => file.at(face.surface).ok_or_else(|| {
                let surface = face.surface;
                entity.wrong(name, format!("its surface D{surface} is not there"))
            })?,
            None => entity,
        };
        let spline = spline(name, &file, base, scale)?;
        let whole = match &face {
            Some(face) => trim::is_whole(name, &file, face, &spline)?,
            None => !spline.cut,
        };
        if !whole {
            trims.inside(&body)?;
        }
        let mut matrix = placement(name, &file, base, 0)?;
        if face.is_some() {
            matrix = product(&placement(name, &file, entity, 0)?, &matrix);
        }
        let surface = spline.placed(&body, &matrix, scale)?;
        bodies.push(Body {
            name: body,
            shape: Shape::Surface(surface),
        });
    }
    let passed = told(&others);
    if bodies.is_empty() {
        let mut found: Vec<String> = passed;
        if hidden > 0 {
            found.push(format!("{hidden} hidden surfaces"));
        }
        return Err(Error::NothingUsable {
            name: name.to_owned(),
            found: if found.is_empty() {
                "nothing".to_owned()
            } else {
                found.join(", ")
            },
        });
    }
    warnings.extend(trims.warning(name));
    if hidden > 0 {
        warnings.push(Warning::Hidden {
            name: name.to_owned(),
            surfaces: hidden,
        });
    }
    if !passed.is_empty() {
        warnings.push(Warning::PassedOver {
            name: name.to_owned(),
            what: passed.join(", "),
        });
    }
    Ok(Loaded {
        bodies,
        unit: length.unit,
        stated: length.stated,
        warnings,
    })
}

/// The surfaces on which faces lie: they count with their faces, not on their own.
fn under_faces(name: &str, file: &File) -> Result<HashSet<usize>> {
    let faces = file.entities.iter();
    let faces = faces.filter(|e| matches!(e.kind, 143 | 144 | 510));
    faces
        .map(|face| Ok(trim::face(name, file, face)?.surface))
        .collect()
}

/// Planes without bounds are for construction; what is part of something else is refused with that.
fn is_harmless(entity: &Entity) -> bool {
    match entity.kind {
        108 => entity.form == 0,
        190..=198 | 430 => entity.dependent,
        _ => false,
    }
}

/// Whether a placed subfigure, or an array of something, makes copies of surfaces or solids.
fn places_shapes(name: &str, file: &File, entity: &Entity) -> Result<bool> {
    let is_shape = |e: &Entity| {
        matches!(e.kind, 114 | 128 | 143 | 144 | 186 | 510)
            || UNREAD.iter().any(|(k, _)| *k == e.kind)
    };
    let Some(what) = file.at(file.parameters(name, entity)?.count()?) else {
        return Ok(false);
    };
    if what.kind != 308 {
        return Ok(is_shape(what));
    }
    let mut p = file.parameters(name, what)?;
    p.skip(2); // how deep it is nested, and its name
    let count = p.count()?;
    let parts = p.counts(count)?;
    Ok(parts.into_iter().filter_map(|n| file.at(n)).any(is_shape))
}

fn unsupported(name: &str, entity: &Entity, kind: &'static str) -> Error {
    Error::UnsupportedSurface {
        name: format!("{name}: entity {} at D{}", entity.kind, entity.number),
        kind,
    }
}

fn spline(name: &str, file: &File, base: &Entity, scale: f64) -> Result<Spline> {
    match base.kind {
        114 => spline::parametric(&mut file.parameters(name, base)?, scale),
        128 => spline::rational(&mut file.parameters(name, base)?),
        kind => {
            let known = UNREAD.iter().find(|(k, _)| *k == kind);
            let kind = known.map_or("surface of an unknown kind", |(_, name)| name);
            Err(unsupported(name, base, kind))
        }
    }
}

/// Where the matrices of an entity put it (124; IGES 5.3, 4.21).
fn placement(name: &str, file: &File, entity: &Entity, depth: usize) -> Result<Matrix> {
    if entity.matrix == 0 {
        return Ok(IDENTITY);
    }
    let wrong = |reason: &str| Err(entity.wrong(name, reason));
    let Some(own) = file.at(entity.matrix).filter(|m| m.kind == 124) else {
        return wrong("its transformation matrix is not there");
    };
    if depth >= MAX_DEPTH {
        return wrong("its transformation matrices refer to each other without an end");
    }
    let numbers = file.parameters(name, own)?.numbers(12)?;
    let mut matrix = IDENTITY;
    for (row, numbers) in matrix.iter_mut().zip(numbers.chunks_exact(4)) {
        row.copy_from_slice(numbers);
    }
    Ok(product(&placement(name, file, own, depth + 1)?, &matrix))
}

/// How many there are of each kind, in words.
fn told(others: &BTreeMap<u32, usize>) -> Vec<String> {
    let named = others.iter().map(|(kind, count)| {
        let known = OTHERS.iter().find(|(k, _)| k == kind);
        let name = known.map_or("entity", |(_, name)| name);
        format!("{count} × {name} ({kind})")
    });
    named.collect()
}

#[cfg(test)]
pub(super) mod tests;
