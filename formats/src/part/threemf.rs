//! 3MF: the objects that a package builds, each where it is put (core specification 1.3, and p:path of the
//! production extension).
//!
//! Materials, colours and supports mean nothing to a cutter. What a package says has to be understood, and
//! is not, is refused by name: there a mesh may not be all.

mod model;

use std::collections::HashMap;
use std::io::{BufReader, Cursor, Read};

use horma_core::{Body, Mesh, Point, Shape};
use zip::ZipArchive;

use self::model::{Component, Model, Object};
use super::matrix::{IDENTITY, Matrix, apply, mirrors, product};
use super::{Loaded, Warning};
use crate::error::{Error, Result};

/// Longest model that is unpacked, bytes: a small archive could hold one without an end.
const MAX_UNPACKED: u64 = 4 << 30;
/// Most objects put anywhere; nested often enough, a small file could ask for any number.
const MAX_PLACED: usize = 10_000;
/// Most triangles of all of them.
const MAX_TRIANGLES: usize = 1 << 28;
/// Deepest nesting of components.
const MAX_DEPTH: usize = 64;
/// Where the model is if the package does not say.
const USUAL: &str = "3D/3dmodel.model";

/// Reads a 3MF file called `name`: one mesh for each object with triangles, at each place where it is put.
///
/// # Errors
/// [`Error::ThreeMf`], [`Error::Units`], [`Error::NoTriangle`], [`horma_core::Error::NotFinite`],
/// [`horma_core::Error::TooFar`] and [`horma_core::Error::NoSuchVertex`].
pub fn parse(name: &str, bytes: &[u8]) -> Result<Loaded> {
    let archive = ZipArchive::new(Cursor::new(bytes));
    let archive = archive.map_err(|e| refused(name, format!("it is no ZIP archive: {e}")))?;
    let mut package = Package {
        name,
        archive,
        models: HashMap::new(),
    };
    let root = package.root()?;
    package.load(&root)?;
    let mut build = Build {
        name,
        package: &mut package,
        bodies: Vec::new(),
        copies: HashMap::new(),
        placed: 0,
        triangles: 0,
        supports: 0,
    };
    build.all(&root)?;
    let Build {
        bodies, supports, ..
    } = build;
    if bodies.is_empty() {
        return Err(Error::NoTriangle {
            name: name.to_owned(),
        });
    }
    let unit = package.models[&root].unit.clone();
    let name = || name.to_owned();
    let mut warnings = Vec::new();
    if unit.millimetres != 1.0 {
        warnings.push(Warning::Converted {
            name: name(),
            unit: unit.name.clone(),
            factor: unit.millimetres,
        });
    }
    if supports > 0 {
        warnings.push(Warning::PassedOver {
            name: name(),
            what: format!("{supports} × support"),
        });
    }
    Ok(Loaded {
        bodies,
        unit,
        stated: true,
        warnings,
    })
}

fn refused(name: &str, reason: impl Into<String>) -> Error {
    Error::ThreeMf {
        name: name.to_owned(),
        reason: reason.into(),
    }
}

/// An archive, and the models that were read from it.
struct Package<'a> {
    name: &'a str,
    archive: ZipArchive<Cursor<&'a [u8]>>,
    models: HashMap<String, Model>,
}

impl Package<'_> {
    /// Where the model is that is built.
    fn root(&mut self) -> Result<String> {
        let Ok(file) = self.archive.by_name("_rels/.rels") else {
            return Ok(USUAL.to_owned());
        };
        let targets = model::targets(BufReader::new(file.take(MAX_UNPACKED)));
        let target = targets.map_err(|e| refused(self.name, format!("_rels/.rels: {e}")))?;
        Ok(target.unwrap_or_else(|| USUAL.to_owned()))
    }

    /// Reads the model at `path`, unless that was done.
    fn load(&mut self, path: &str) -> Result<&Model> {
        if !self.models.contains_key(path) {
            let file = self.archive.by_name(path);
            let file = file.map_err(|e| refused(self.name, format!("{path}: {e}")))?;
            let model = model::read(BufReader::new(file.take(MAX_UNPACKED)));
            let model = model.map_err(|e| refused(self.name, format!("{path}: {e}")))?;
            self.models.insert(path.to_owned(), model);
        }
        Ok(&self.models[path])
    }
}

/// What is built, as far as it is.
struct Build<'b, 'a> {
    name: &'a str,
    package: &'b mut Package<'a>,
    bodies: Vec<Body>,
    /// How many there are of each name.
    copies: HashMap<String, usize>,
    placed: usize,
    triangles: usize,
    supports: usize,
}

impl Build<'_, '_> {
    /// Everything that the model at `root` builds.
    fn all(&mut self, root: &str) -> Result<()> {
        let items = std::mem::take(&mut self.load(root, root)?.items);
        for item in &items {
            self.put(root, root, item, &IDENTITY, 0)?;
        }
        Ok(())
    }

    /// The model at `path`, which has to have the same unit as that at `root`.
    fn load(&mut self, root: &str, path: &str) -> Result<&mut Model> {
        self.package.load(path)?;
        let [own, unit] = [path, root].map(|p| self.package.models[p].unit.name.clone());
        if own != unit {
            return Err(Error::Units {
                name: self.name.to_owned(),
                reason: format!("several units of length are used ({unit}, {own})"),
            });
        }
        let missing = || refused(self.name, format!("{path} is not there"));
        self.package.models.get_mut(path).ok_or_else(missing)
    }

    /// An object that something in the model at `from` puts somewhere.
    fn put(
        &mut self,
        root: &str,
        from: &str,
        component: &Component,
        outer: &Matrix,
        depth: usize,
    ) -> Result<()> {
        self.placed += 1;
        if self.placed > MAX_PLACED || depth > MAX_DEPTH {
            let reason = "its objects are nested too deeply or put in too many places";
            return Err(refused(self.name, reason));
        }
        let path = component.path.as_deref().unwrap_or(from).to_owned();
        let matrix = product(outer, &component.matrix);
        let (name, id) = (self.name, component.object);
        let model = self.load(root, &path)?;
        let scale = model.unit.millimetres;
        let Some(object) = model.objects.get(&id) else {
            return Err(refused(name, format!("{path} has no object {id}")));
        };
        if object.is_support {
            self.supports += 1;
            return Ok(());
        }
        let components = object.components.clone();
        if !object.triangles.is_empty() {
            let label = match &*object.name {
                "" => format!("{name}: object {id}"),
                own => format!("{name}: {own}"),
            };
            let shape = mesh(&label, object, &matrix, scale)?;
            self.triangles += shape.triangles().len();
            if self.triangles > MAX_TRIANGLES {
                return Err(refused(
                    name,
                    format!("it has more than {MAX_TRIANGLES} triangles"),
                ));
            }
            let copy = self.copies.entry(label.clone()).or_insert(0);
            *copy += 1;
            self.bodies.push(Body {
                name: match copy {
                    1 => label,
                    copy => format!("{label}, copy {copy}"),
                },
                shape: Shape::Mesh(shape),
            });
        }
        for component in &components {
            self.put(root, &path, component, &matrix, depth + 1)?;
        }
        Ok(())
    }
}

/// The triangles of an object where `matrix` puts them. Those of a mirrored one are turned round, so that
/// they face outwards still.
fn mesh(name: &str, object: &Object, matrix: &Matrix, scale: f64) -> Result<Mesh> {
    let vertices = object.vertices.iter();
    let vertices: Vec<Point> = vertices
        .map(|&p| apply(matrix, p, scale).map(|c| c + 0.0))
        .collect();
    let mut triangles = object.triangles.clone();
    if mirrors(matrix) {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    Ok(Mesh::new(name, vertices, triangles)?)
}

#[cfg(test)]
pub(super) mod tests;
