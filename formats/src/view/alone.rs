//! A part without a path: its bodies as they are in their files, and the edges at which a mesh is open.

use horma_core::{Part, Shape};
use serde::Serialize;

use super::thin::Shown;
use super::{View, solid};
use crate::inspect::Inspection;
use crate::preview::sheets;

/// Most open edges that are marked.
const EDGES: usize = 50_000;

/// What the page says of a part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartFigures {
    /// Version of horma that wrote it.
    pub version: String,
    /// The files that were read.
    pub files: Vec<FileFigures>,
    /// Their bodies, in the order of the files.
    pub bodies: Vec<BodyFigures>,
    /// What reading them brought up.
    pub warnings: Vec<String>,
    /// Edges that do not lie between exactly two triangles.
    pub open_edges: usize,
}

/// A file of a part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FileFigures {
    /// Its name.
    pub name: String,
    /// The unit of its lengths, in words.
    pub unit: String,
}

/// A body of a part, in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BodyFigures {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: String,
    /// Its size along the axes.
    pub size: String,
    /// Its least corner.
    pub from: String,
}

/// What there is to see of parts that were inspected, and what is said of them.
pub fn part(inspected: &[(Inspection, Part)]) -> (View, PartFigures) {
    let bodies = inspected.iter().flat_map(|(_, part)| &part.bodies).cloned();
    let whole = Part {
        bodies: bodies.collect(),
    };
    let mut part = solid::solid(&sheets(&whole));
    let mut open_edges = 0;
    for body in &whole.bodies {
        if let Shape::Mesh(mesh) = &body.shape {
            let open = mesh.open_edges();
            open_edges += open.len();
            let ends = open.iter().map(|e| e.map(|v| mesh.vertices()[v as usize]));
            part.edges.extend(ends.take(EDGES - part.edges.len()));
        }
    }
    let files = inspected.iter().map(|(file, _)| FileFigures {
        name: file.file.clone(),
        unit: file.unit(),
    });
    let rows = inspected.iter().flat_map(|(file, _)| file.rows());
    let bodies = rows.map(|[name, kind, size, from]| BodyFigures {
        name,
        kind,
        size,
        from,
    });
    let warnings = inspected.iter().flat_map(|(file, _)| &file.warnings);
    let figures = PartFigures {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        files: files.collect(),
        bodies: bodies.collect(),
        warnings: warnings.map(ToString::to_string).collect(),
        open_edges,
    };
    let view = View {
        motion: None,
        wheel: Vec::new(),
        part,
        path: Shown {
            positions: Vec::new(),
            of: 0,
            every: 1,
        },
        errors: None,
        machined: None,
    };
    (view, figures)
}
