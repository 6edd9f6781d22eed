//! STEP: the surfaces of shells and solids, and those that stand alone.
//!
//! Every face whose trim is the natural boundary of its surface becomes that surface, in
//! millimetres and where its assembly puts it. Analytic surfaces become the rational B-splines that
//! are exactly the same. A face that is trimmed inside its surface, a surface of another kind and a
//! surface that got lost in reading are refused by name: machined without, the part would be
//! gouged. On demand trimmed faces count as their whole surfaces.

mod assembly;
mod free;
mod loss;
mod trim;

use horma_core::{Body, Direction, Shape, Surface};
use step_io::scene::{Face, NurbsSurface, Scene, SurfaceKind};

use super::matrix::{IDENTITY, Matrix, apply};
use super::{Loaded, Reading, Trims, Warning, label};
use crate::error::{Error, Result};

/// Reads a STEP file called `name` (ISO 10303-21; AP203, AP214, AP242).
///
/// # Errors
/// [`Error::StepSyntax`], [`Error::StepLoss`], [`Error::Units`], [`Error::StepAssembly`],
/// [`Error::Trimmed`], [`Error::UnreadableTrim`], [`Error::UnsupportedSurface`],
/// [`Error::NoSurface`], and those of [`Surface::new`].
pub fn parse(name: &str, bytes: &[u8], reading: &Reading) -> Result<Loaded> {
    let (model, report) = step_io::read(bytes).map_err(|source| Error::StepSyntax {
        name: name.to_owned(),
        source: Box::new(source),
    })?;
    let mut warnings = loss::check(name, bytes, &report)?;
    let scene = model.scene();
    let unit = loss::unit(name, &scene)?;
    let scale = unit.as_ref().map_or(reading.scale(), |u| u.millimetres);
    let mut trims = Trims::new(reading);
    let tree = assembly::walk(name, &scene)?;

    let mut bodies = Vec::new();
    let mut number = 0;
    let mut keep = |own: &str, key, nurbs: &NurbsSurface| -> Result<()> {
        number += 1;
        for (copy, placement) in (1..).zip(tree.of(name, key)?) {
            let mut name = label(name, number, [own, &placement.label]);
            if copy > 1 {
                name = format!("{name}, copy {copy}");
            }
            let surface = surface(&name, nurbs, &placement.matrix, scale)?;
            bodies.push(Body {
                name,
                shape: Shape::Surface(surface),
            });
        }
        Ok(())
    };
    for (number, face) in (1..).zip(scene.all_faces()) {
        let label = label(name, number, [face.name(), ""]);
        let nurbs = untrimmed(&label, &scene, &face, scale, &mut trims)?;
        keep(face.name(), face.key(), &nurbs)?;
    }
    for (key, own, nurbs) in free::surfaces(name, &model)? {
        keep(own, key, &nurbs)?;
    }
    if bodies.is_empty() {
        return Err(Error::NoSurface {
            name: name.to_owned(),
        });
    }
    match &unit {
        None if reading.unit.is_none() => warnings.push(Warning::NoUnit {
            name: name.to_owned(),
            unit: "mm".to_owned(),
        }),
        Some(unit) if unit.millimetres != 1.0 => warnings.push(Warning::Converted {
            name: name.to_owned(),
            unit: unit.name.clone(),
            factor: unit.millimetres,
        }),
        None | Some(_) => {}
    }
    warnings.extend(loss::navigation(name, &scene));
    warnings.extend(trims.warning(name));
    Ok(Loaded {
        bodies,
        stated: unit.is_some(),
        unit: unit.unwrap_or_else(|| reading.assumed()),
        warnings,
    })
}

/// The whole surface under a face, if the face is all of it or whole surfaces count.
fn untrimmed(
    label: &str,
    scene: &Scene,
    face: &Face,
    scale: f64,
    trims: &mut Trims,
) -> Result<NurbsSurface> {
    let nurbs = face.to_nurbs().ok_or_else(|| Error::UnsupportedSurface {
        name: label.to_owned(),
        kind: kind(face),
    })?;
    let here = surface(label, &nurbs, &IDENTITY, scale)?;
    match trim::check(label, face, &here, scale, scene.units().precision) {
        Err(Error::Trimmed { .. }) => trims.inside(label)?,
        Err(_) if trims.count_whole() => trims.inside(label)?,
        checked => checked?,
    }
    Ok(nurbs)
}

fn kind(face: &Face) -> &'static str {
    match face.surface().kind() {
        SurfaceKind::Plane(_) => "plane without extent",
        SurfaceKind::Cylindrical(_) => "cylinder without extent",
        SurfaceKind::Conical(_) => "cone without extent",
        SurfaceKind::Offset(_) => "offset surface",
        SurfaceKind::LinearExtrusion(_) => "surface of linear extrusion",
        SurfaceKind::Revolution(_) => "surface of revolution",
        SurfaceKind::BSpline(_)
        | SurfaceKind::BSplineWithKnots(_)
        | SurfaceKind::Bezier(_)
        | SurfaceKind::QuasiUniform(_)
        | SurfaceKind::Uniform(_)
        | SurfaceKind::Other("COMPLEX") => {
            "B-spline surface whose degrees, knots and poles contradict each other"
        }
        SurfaceKind::Other(keyword) => keyword,
        _ => "surface of an unknown kind",
    }
}

/// `nurbs` where `matrix` puts it, in millimetres.
fn surface(name: &str, nurbs: &NurbsSurface, matrix: &Matrix, scale: f64) -> Result<Surface> {
    let direction = |degree, knots: &[f64]| Direction {
        degree,
        knots: knots.to_vec(),
    };
    let poles = nurbs.control_points.iter().flatten();
    let poles = poles.map(|&p| apply(matrix, p, scale)).collect();
    Ok(Surface::new(
        name,
        direction(nurbs.degree_u, &nurbs.knots_u),
        direction(nurbs.degree_v, &nurbs.knots_v),
        poles,
        Some(nurbs.weights.concat()),
    )?)
}

#[cfg(test)]
pub(super) mod tests;
