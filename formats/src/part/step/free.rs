//! B-spline surfaces that stand alone in a STEP file: no face lies on them.

use std::collections::HashSet;

use step_io::EntityKey;
use step_io::model::{
    BSplineSurfaceWithKnots, CartesianPointRef, ComplexEntity, PartialEntity, StepModel,
};
use step_io::scene::NurbsSurface;

use crate::error::{Error, Result};

/// What surfaces with and without weights have in common.
struct Raw<'m> {
    name: &'m str,
    degrees: [i64; 2],
    poles: &'m [Vec<CartesianPointRef>],
    knots: [(&'m [f64], &'m [i64]); 2],
    weights: Option<&'m [Vec<f64>]>,
}

/// The free surfaces with their names, in file order, those without weights first.
pub(super) fn surfaces<'m>(
    name: &str,
    model: &'m StepModel,
) -> Result<Vec<(EntityKey, &'m str, NurbsSurface)>> {
    let plain = model.all::<BSplineSurfaceWithKnots>().map(|(id, s)| {
        let raw = Raw {
            name: model.text(s.name),
            degrees: [s.u_degree, s.v_degree],
            poles: &s.control_points_list,
            knots: [
                (&s.u_knots, &s.u_multiplicities),
                (&s.v_knots, &s.v_multiplicities),
            ],
            weights: None,
        };
        (EntityKey::BSplineSurfaceWithKnots(id), raw)
    });
    let complex = model
        .all::<ComplexEntity>()
        .filter_map(|(id, c)| Some((EntityKey::ComplexEntity(id), complex(model, c)?)));
    let all: Vec<_> = plain.chain(complex).collect();
    if all.is_empty() {
        return Ok(Vec::new());
    }
    let references = model.ref_graph();
    let is_free = |key: EntityKey| {
        !references.referrers(key).iter().any(|r| {
            matches!(
                r,
                EntityKey::AdvancedFace(_)
                    | EntityKey::FaceSurface(_)
                    | EntityKey::OffsetSurface(_)
                    | EntityKey::Pcurve(_)
            )
        })
    };
    let mut seen = HashSet::new();
    all.into_iter()
        .filter(|&(key, _)| is_free(key) && seen.insert(key))
        .map(|(key, raw)| {
            let nurbs = nurbs(model, &raw).ok_or_else(|| Error::UnsupportedSurface {
                name: format!("{name}: the surface '{}'", raw.name),
                kind: "B-spline surface whose degrees, knots and poles contradict each other",
            })?;
            Ok((key, raw.name, nurbs))
        })
        .collect()
}

/// A surface with weights is several partial entities under one number.
fn complex<'m>(model: &'m StepModel, entity: &'m ComplexEntity) -> Option<Raw<'m>> {
    let mut name = "";
    let mut net = None;
    let mut knots = None;
    let mut weights = None;
    for part in &entity.parts {
        match part {
            PartialEntity::RepresentationItem { name: text } => name = model.text(*text),
            PartialEntity::BSplineSurface {
                u_degree,
                v_degree,
                control_points_list,
                ..
            } => net = Some(([*u_degree, *v_degree], &control_points_list[..])),
            PartialEntity::BSplineSurfaceWithKnots {
                u_knots,
                u_multiplicities,
                v_knots,
                v_multiplicities,
                ..
            } => {
                let pair = |k: &'m Vec<f64>, m: &'m Vec<i64>| (&k[..], &m[..]);
                let u = pair(u_knots, u_multiplicities);
                knots = Some([u, pair(v_knots, v_multiplicities)]);
            }
            PartialEntity::RationalBSplineSurface { weights_data } => {
                weights = Some(&weights_data[..]);
            }
            _ => {}
        }
    }
    let (degrees, poles) = net?;
    // Without knots of its own the surface fails later, by name.
    let knots = knots.unwrap_or([(&[], &[]); 2]);
    Some(Raw {
        name,
        degrees,
        poles,
        knots,
        weights,
    })
}

fn nurbs(model: &StepModel, raw: &Raw) -> Option<NurbsSurface> {
    let columns = raw.poles.first()?.len();
    if raw.poles.iter().any(|row| row.len() != columns) {
        return None;
    }
    let point = |r: &CartesianPointRef| {
        let CartesianPointRef::CartesianPoint(id) = r else {
            return None;
        };
        <[f64; 3]>::try_from(&model.get(*id)?.coordinates[..]).ok()
    };
    let rows = raw.poles.iter();
    let control_points: Vec<Vec<[f64; 3]>> = rows
        .map(|row| row.iter().map(point).collect())
        .collect::<Option<_>>()?;
    let weights = match raw.weights {
        Some(weights) => weights.to_vec(),
        None => vec![vec![1.0; columns]; raw.poles.len()],
    };
    let [u, v] = raw.degrees.map(|d| usize::try_from(d).ok());
    Some(NurbsSurface {
        knots_u: expanded(raw.knots[0], raw.poles.len().checked_add(u?)?)?,
        knots_v: expanded(raw.knots[1], columns.checked_add(v?)?)?,
        degree_u: u?,
        degree_v: v?,
        control_points,
        weights,
    })
}

/// Each knot as often as its multiplicity says: `last + 1` of them, where `last` is the number of
/// poles plus the degree.
fn expanded((knots, multiplicities): (&[f64], &[i64]), last: usize) -> Option<Vec<f64>> {
    let mut all = Vec::new();
    for (&knot, &multiplicity) in knots.iter().zip(multiplicities) {
        let count = usize::try_from(multiplicity).ok()?;
        if count > last + 1 - all.len() {
            return None;
        }
        all.extend(std::iter::repeat_n(knot, count));
    }
    (all.len() == last + 1).then_some(all)
}
