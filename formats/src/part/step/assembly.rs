//! Where the assembly of a STEP file puts each of its faces.

use std::collections::HashMap;

use step_io::EntityKey;
use step_io::scene::{ProductDef, Scene, SetElement};

use super::super::matrix::{self, IDENTITY, Matrix};
use crate::error::{Error, Result};

/// Most components of an assembly; nested often enough, a small file could ask for any number.
const MAX_COMPONENTS: usize = 100_000;

/// Deepest nesting of assemblies.
const MAX_DEPTH: usize = 64;

/// One place in which a face or a free surface appears.
pub(super) struct Placement {
    pub(super) matrix: Matrix,
    /// Name of the body or product that it belongs to.
    pub(super) label: String,
}

/// The assembly, flattened.
pub(super) struct Tree {
    placements: HashMap<EntityKey, Vec<Placement>>,
    components: usize,
    /// Whether anything is placed at all; if not, everything is where it is.
    is_assembly: bool,
}

/// Flattens the assembly.
pub(super) fn walk(name: &str, scene: &Scene) -> Result<Tree> {
    let mapped = |i: step_io::scene::MappedInstance| {
        i.solids().next().is_some() || i.surface_models().next().is_some()
    };
    if scene.all_mapped_instances().any(mapped) {
        return Err(refused(
            name,
            "bodies are placed by MAPPED_ITEM, which is not read",
        ));
    }
    let mut tree = Tree {
        placements: HashMap::new(),
        components: 0,
        is_assembly: false,
    };
    for root in scene.root_definitions() {
        tree.add(name, &root, &IDENTITY, 0)?;
    }
    Ok(tree)
}

impl Tree {
    /// The places of the face or free surface `key`; where it is, if nothing places it.
    pub(super) fn of(&self, name: &str, key: EntityKey) -> Result<Vec<&Placement>> {
        const UNPLACED: &Placement = &Placement {
            matrix: IDENTITY,
            label: String::new(),
        };
        match self.placements.get(&key) {
            Some(placements) => Ok(placements.iter().collect()),
            None if self.is_assembly => Err(refused(name, "a surface is outside the assembly")),
            None => Ok(vec![UNPLACED]),
        }
    }

    fn add(&mut self, name: &str, def: &ProductDef, outer: &Matrix, depth: usize) -> Result<()> {
        self.components += 1;
        if self.components > MAX_COMPONENTS || depth > MAX_DEPTH {
            return Err(refused(
                name,
                "it is nested too deeply or has too many components",
            ));
        }
        let product = def.product().map_or("", |p| p.name());
        let mut put = |key, own: &str| {
            let label = if own.is_empty() { product } else { own };
            self.placements.entry(key).or_default().push(Placement {
                matrix: *outer,
                label: label.to_owned(),
            });
        };
        for solid in def.solids() {
            let cavities = solid.voids().flat_map(|(shell, _)| shell.faces());
            for face in solid.faces().chain(cavities) {
                put(face.key(), solid.name());
            }
        }
        for model in def.surface_models() {
            model.faces().for_each(|face| put(face.key(), model.name()));
        }
        for set in def.geometric_sets() {
            for element in set.elements() {
                if let SetElement::Other(key) = element {
                    put(key, set.name());
                }
            }
        }
        for occurrence in def.occurrences() {
            self.is_assembly = true;
            let Some(child) = occurrence.definition() else {
                return Err(refused(name, "a component has no definition"));
            };
            let Some(step) = occurrence.transform().and_then(|t| t.matrix()) else {
                return Err(refused(name, "the placement of a component cannot be read"));
            };
            self.add(name, &child, &matrix::product(outer, &step), depth + 1)?;
        }
        Ok(())
    }
}

fn refused(name: &str, reason: &'static str) -> Error {
    Error::StepAssembly {
        name: name.to_owned(),
        reason,
    }
}
