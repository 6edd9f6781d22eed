//! What is lost on the way in: entities that the reader could not take, and units.

use std::collections::{BTreeSet, HashMap};

use step_io::Report;
use step_io::model::{ComplexEntity, PartialEntity, StepModel, UnitRef};
use step_io::scene::Scene;

use super::super::{Unit, Warning};
use crate::error::{Error, Result};

/// Entities without which a surface, or the place of one, would be missing.
const SHAPES: [&str; 19] = [
    "ADVANCED_FACE",
    "FACE_SURFACE",
    "OPEN_SHELL",
    "CLOSED_SHELL",
    "ORIENTED_CLOSED_SHELL",
    "MANIFOLD_SOLID_BREP",
    "BREP_WITH_VOIDS",
    "FACETED_BREP",
    "SHELL_BASED_SURFACE_MODEL",
    "FACE_BASED_SURFACE_MODEL",
    "GEOMETRIC_SET",
    "B_SPLINE_SURFACE",
    "B_SPLINE_SURFACE_WITH_KNOTS",
    "RECTANGULAR_TRIMMED_SURFACE",
    "CURVE_BOUNDED_SURFACE",
    "RECTANGULAR_COMPOSITE_SURFACE",
    "NEXT_ASSEMBLY_USAGE_OCCURRENCE",
    "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION",
    "MAPPED_ITEM",
];

/// Most warnings of one kind; the rest are counted.
const MAX_WARNINGS: usize = 5;

/// Refuses a file that lost a shape, and reports what else was lost.
pub(super) fn check(name: &str, bytes: &[u8], report: &Report) -> Result<Vec<Warning>> {
    if report.dropped.is_empty() && report.parse_warnings.is_empty() {
        return Ok(Vec::new());
    }
    let keywords = keywords(bytes);
    let keyword = |id| keywords.get(&id).map_or("", String::as_str);
    for (id, reason) in &report.dropped {
        let mut words = keyword(*id).split(' ');
        if words.any(|w| SHAPES.contains(&w)) {
            return Err(Error::StepLoss {
                name: name.to_owned(),
                entity: *id,
                kind: keyword(*id).to_owned(),
                reason: reason.to_string(),
            });
        }
    }
    let dropped = report.dropped.iter();
    let dropped = dropped.map(|(id, why)| format!("#{id} {} is left out: {why}", keyword(*id)));
    let repaired = report.parse_warnings.iter().map(ToString::to_string);
    Ok(some(name, dropped).chain(some(name, repaired)).collect())
}

/// What the walk through the file could not follow.
pub(super) fn navigation(name: &str, scene: &Scene) -> impl Iterator<Item = Warning> {
    let warnings = scene.warnings();
    some(name, warnings.into_iter().map(|w| w.to_string()))
}

fn some(name: &str, all: impl Iterator<Item = String>) -> impl Iterator<Item = Warning> {
    let mut all: Vec<String> = all.collect();
    if all.len() > MAX_WARNINGS {
        let more = all.len() - MAX_WARNINGS;
        all.truncate(MAX_WARNINGS);
        all.push(format!("and {more} more of the kind"));
    }
    let name = name.to_owned();
    all.into_iter().map(move |what| Warning::Repaired {
        name: name.clone(),
        what,
    })
}

/// The keyword of each entity; those of a complex one joined by spaces.
fn keywords(bytes: &[u8]) -> HashMap<u64, String> {
    let text = String::from_utf8_lossy(bytes);
    let statements = text.split(';').filter_map(|statement| {
        let (id, rest) = statement.trim_start().strip_prefix('#')?.split_once('=')?;
        let id = id.trim().parse().ok()?;
        let rest = rest.trim_start();
        let keyword = match rest.strip_prefix('(') {
            None => rest.split('(').next()?.trim().to_owned(),
            Some(parts) => parts
                .split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
                .filter(|w| w.len() > 1 && w.starts_with(|c: char| c.is_ascii_uppercase()))
                .collect::<Vec<_>>()
                .join(" "),
        };
        Some((id, keyword))
    });
    statements.collect()
}

/// The file's unit of length, if it states one.
pub(super) fn unit(name: &str, scene: &Scene) -> Result<Option<Unit>> {
    let refused = |reason: String| {
        Err(Error::Units {
            name: name.to_owned(),
            reason,
        })
    };
    let all = length_units(scene.model());
    if all.len() > 1 {
        let all: Vec<String> = all.into_iter().collect();
        return refused(format!(
            "several units of length are used ({})",
            all.join(", ")
        ));
    }
    let Some(length) = scene.units().length else {
        return Ok(None);
    };
    let millimetres = length.to_si * 1000.0;
    if !(millimetres > 0.0 && millimetres.is_finite()) {
        return refused(format!("its unit of length is {} m", length.to_si));
    }
    Ok(Some(Unit {
        name: length.name.to_lowercase(),
        millimetres,
    }))
}

/// Every unit of length that a context of the file assigns.
fn length_units(model: &StepModel) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (_, context) in model.all::<ComplexEntity>() {
        for part in &context.parts {
            let PartialEntity::GlobalUnitAssignedContext { units } = part else {
                continue;
            };
            for unit in units {
                if let UnitRef::Complex(id) = unit {
                    names.extend(model.get(*id).and_then(|u| length_unit(model, u)));
                }
            }
        }
    }
    names
}

fn length_unit(model: &StepModel, unit: &ComplexEntity) -> Option<String> {
    let is_length = |p: &PartialEntity| matches!(p, PartialEntity::LengthUnit);
    unit.parts.iter().find(|p| is_length(p))?;
    unit.parts.iter().find_map(|part| match part {
        PartialEntity::SiUnit { prefix, .. } => Some(match prefix {
            Some(prefix) => format!("{prefix:?}metre").to_lowercase(),
            None => "metre".to_owned(),
        }),
        PartialEntity::ConversionBasedUnit { name, .. } => Some(model.text(*name).to_lowercase()),
        _ => None,
    })
}
