//! Parts in: STL, OBJ and STEP files become bodies in millimetres, in file order.
//!
//! Every surface and every mesh is kept apart. A file that contradicts itself is refused with its
//! name and the place; what can be machined all the same comes with a [`Warning`]. Nothing here
//! guesses at geometry: what a reader cannot take exactly as it is, it refuses by name.

pub mod obj;
pub mod step;
pub mod stl;

use std::fs;
use std::path::{Path, PathBuf};

use horma_core::{Body, Mesh, Part, Shape, cross, length, sub};

use crate::error::{Error, Result};

/// What a file holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loaded {
    /// Its surfaces and meshes, mm, in file order.
    pub bodies: Vec<Body>,
    /// The unit of length that the file states, if its format can state one.
    pub unit: Option<Unit>,
    /// What the operator should know about them.
    pub warnings: Vec<Warning>,
}

/// A unit of length.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Its name, in lower case.
    pub name: String,
    /// How many millimetres it has.
    pub millimetres: f64,
}

/// What is worth knowing about a file that is machined all the same.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Warning {
    /// A mesh that is not watertight.
    #[error("{name}: {edges} edges are open; the mesh is machined as it is")]
    OpenEdges {
        /// The mesh.
        name: String,
        /// Edges that do not lie between exactly two triangles.
        edges: usize,
    },
    /// Triangles without an area.
    #[error("{name}: {facets} triangles have no area; they are machined as edges and points")]
    DegenerateFacets {
        /// The mesh.
        name: String,
        /// How many of them.
        facets: usize,
    },
    /// Bytes after the last triangle.
    #[error("{name}: {bytes} bytes after the last triangle are not read")]
    TrailingBytes {
        /// The file.
        name: String,
        /// How many of them.
        bytes: usize,
    },
    /// Lengths that were converted.
    #[error("{name}: lengths are converted from {unit} to mm, times {factor}")]
    Converted {
        /// The file.
        name: String,
        /// The unit that the file states.
        unit: String,
        /// Millimetres in one of it.
        factor: f64,
    },
    /// A file whose format has units, but that states none.
    #[error("{name}: no unit of length is stated; lengths are taken as mm")]
    NoUnit {
        /// The file.
        name: String,
    },
    /// Something in a STEP file that was read as far as possible. Never a surface: a file of which
    /// a surface cannot be read is refused.
    #[error("{name}: {what}")]
    Repaired {
        /// The file.
        name: String,
        /// What the reader reports.
        what: String,
    },
}

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Stereolithography, binary or ASCII.
    Stl,
    /// Wavefront.
    Obj,
    /// ISO 10303-21.
    Step,
    /// Initial Graphics Exchange Specification; not read yet.
    Iges,
    /// Polygon file format; not read yet.
    Ply,
    /// 3D manufacturing format; not read yet.
    ThreeMf,
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Stl => "STL",
            Self::Obj => "OBJ",
            Self::Step => "STEP",
            Self::Iges => "IGES",
            Self::Ply => "PLY",
            Self::ThreeMf => "3MF",
        })
    }
}

/// Longest file that is read, bytes: what is in it still has 32-bit indices.
const MAX_LENGTH: u64 = 16 << 30;

/// Reads several files into one part: a last and its two holders, say.
///
/// # Errors
/// Those of [`read`], and [`horma_core::Error::EmptyPart`] if `paths` is empty.
pub fn read_all(paths: &[PathBuf]) -> Result<(Part, Vec<Warning>)> {
    let mut part = Part::default();
    let mut warnings = Vec::new();
    for path in paths {
        let loaded = read(path)?;
        part.bodies.extend(loaded.bodies);
        warnings.extend(loaded.warnings);
    }
    part.validate()?;
    Ok((part, warnings))
}

/// Reads one file. Its extension says what it is, in either case; content that is plainly another
/// format is refused.
///
/// # Errors
/// [`Error::Io`], [`Error::Folder`], [`Error::FileTooLarge`], [`Error::EmptyFile`],
/// [`Error::UnknownFormat`], [`Error::NotYet`], [`Error::OtherContent`], and those of the format's own reader.
pub fn read(path: &Path) -> Result<Loaded> {
    let io = |source| Error::Io {
        path: path.to_owned(),
        source,
    };
    let metadata = fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return Err(Error::Folder {
            path: path.to_owned(),
        });
    }
    if metadata.len() > MAX_LENGTH {
        return Err(Error::FileTooLarge {
            path: path.to_owned(),
            length: metadata.len(),
            limit: MAX_LENGTH,
        });
    }
    let format = format_of(path)?;
    let bytes = fs::read(path).map_err(io)?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    parse(&name.to_string_lossy(), format, &bytes)
}

/// Reads the content of a file called `name`.
///
/// # Errors
/// Those of [`read`], except for what concerns the file system.
pub fn parse(name: &str, format: Format, bytes: &[u8]) -> Result<Loaded> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(Error::EmptyFile {
            name: name.to_owned(),
        });
    }
    if let Some(found) = content_of(bytes).filter(|&found| found != format) {
        return Err(Error::OtherContent {
            name: name.to_owned(),
            claimed: format,
            found,
        });
    }
    let mut loaded = match format {
        Format::Stl => stl::parse(name, bytes)?,
        Format::Obj => obj::parse(name, bytes)?,
        Format::Step => step::parse(name, bytes)?,
        Format::Iges | Format::Ply | Format::ThreeMf => {
            return Err(Error::NotYet {
                name: name.to_owned(),
                format,
            });
        }
    };
    for body in &loaded.bodies {
        if let Shape::Mesh(mesh) = &body.shape {
            loaded.warnings.extend(check_mesh(&body.name, mesh));
        }
    }
    Ok(loaded)
}

fn format_of(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match extension.to_lowercase().as_str() {
        "stl" => Ok(Format::Stl),
        "obj" => Ok(Format::Obj),
        "step" | "stp" => Ok(Format::Step),
        "iges" | "igs" => Ok(Format::Iges),
        "ply" => Ok(Format::Ply),
        "3mf" => Ok(Format::ThreeMf),
        _ => Err(Error::UnknownFormat {
            path: path.to_owned(),
        }),
    }
}

/// What the content plainly is, whatever the file is called.
fn content_of(bytes: &[u8]) -> Option<Format> {
    let start = bytes.trim_ascii_start();
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    if text.starts_with(b"ISO-10303-21") {
        Some(Format::Step)
    } else if text.starts_with(b"ply\n") || text.starts_with(b"ply\r\n") {
        Some(Format::Ply)
    } else if text.starts_with(b"PK\x03\x04") {
        Some(Format::ThreeMf)
    } else if bytes.get(72..80).is_some_and(|s| s == b"S      1") {
        Some(Format::Iges)
    } else {
        None
    }
}

/// What the operator should know about a mesh.
fn check_mesh(name: &str, mesh: &Mesh) -> Vec<Warning> {
    let has_no_area = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        length(cross(sub(b, a), sub(c, a))) == 0.0
    };
    let facets = mesh.triangles().iter().filter(has_no_area).count();
    let edges = mesh.open_edges();
    let name = || name.to_owned();
    let degenerate = (facets > 0).then(|| Warning::DegenerateFacets {
        name: name(),
        facets,
    });
    let open = (edges > 0).then(|| Warning::OpenEdges {
        name: name(),
        edges,
    });
    degenerate.into_iter().chain(open).collect()
}

#[cfg(test)]
mod tests;
