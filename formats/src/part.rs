//! Parts in: STEP, IGES, STL, OBJ, PLY and 3MF files become bodies in millimetres, in file order.
//!
//! Every surface and every mesh is kept apart. A file that contradicts itself is refused with its
//! name and the place; what can be machined all the same comes with a [`Warning`]. Nothing here
//! guesses at geometry: what a reader cannot take exactly as it is, it refuses by name. Meshes are
//! healed of what exports get wrong, as far as that moves nothing that could be seen ([`heal`]).

mod foreign;
pub mod heal;
pub mod iges;
mod matrix;
pub mod obj;
pub mod ply;
mod reading;
pub mod step;
pub mod stl;
pub mod threemf;
mod unit;
mod warning;

use std::fs;
use std::path::{Path, PathBuf};

use horma_core::{Body, Mesh, Part, Shape, cross, length, sub};

use self::reading::Trims;
pub use self::reading::{Reading, Trimmed};
pub use self::unit::{NAMES as UNIT_NAMES, Unit};
pub use self::warning::Warning;
use crate::error::{Error, Result};

/// What a file holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loaded {
    /// Its surfaces and meshes, mm, in file order.
    pub bodies: Vec<Body>,
    /// The unit in which its lengths were.
    pub unit: Unit,
    /// Whether the file states it.
    pub stated: bool,
    /// What the operator should know about them.
    pub warnings: Vec<Warning>,
}

/// What was read of a file, for reports.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Source {
    /// Its name.
    pub file: String,
    /// The unit in which its lengths were.
    pub unit: String,
    /// Millimetres in one of it.
    pub millimetres: f64,
    /// Whether the file states it.
    pub stated: bool,
    /// How many surfaces and meshes are in it.
    pub bodies: usize,
}

/// The part of several files, and what there is to know of them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Assembled {
    /// The part: the bodies of all files.
    pub part: Part,
    /// Where they come from.
    pub sources: Vec<Source>,
    /// What the operator should know about them.
    pub warnings: Vec<Warning>,
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
    /// Initial Graphics Exchange Specification, fixed ASCII.
    Iges,
    /// Polygon file format, binary or ASCII.
    Ply,
    /// 3D manufacturing format.
    ThreeMf,
}

impl Format {
    /// All there are, each with its extensions.
    pub const ALL: [(Self, &'static [&'static str]); 6] = [
        (Self::Step, &["step", "stp"]),
        (Self::Iges, &["iges", "igs"]),
        (Self::Stl, &["stl"]),
        (Self::Obj, &["obj"]),
        (Self::Ply, &["ply"]),
        (Self::ThreeMf, &["3mf"]),
    ];
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
pub fn read_all(paths: &[PathBuf], reading: &Reading) -> Result<Assembled> {
    let mut all = Assembled::default();
    for path in paths {
        let loaded = read(path, reading)?;
        all.sources.push(Source {
            file: name_of(path),
            unit: loaded.unit.name,
            millimetres: loaded.unit.millimetres,
            stated: loaded.stated,
            bodies: loaded.bodies.len(),
        });
        all.part.bodies.extend(loaded.bodies);
        all.warnings.extend(loaded.warnings);
    }
    all.part.validate()?;
    Ok(all)
}

/// Reads one file. Its extension says what it is, in either case; content that is plainly another
/// format is refused.
///
/// # Errors
/// [`Error::Io`], [`Error::Folder`], [`Error::FileTooLarge`], [`Error::EmptyFile`],
/// [`Error::UnknownFormat`], [`Error::Foreign`], [`Error::OtherContent`], and those of the format's own
/// reader.
pub fn read(path: &Path, reading: &Reading) -> Result<Loaded> {
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
    parse(&name_of(path), format, &bytes, reading)
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Reads the content of a file called `name`.
///
/// # Errors
/// Those of [`read`], except for what concerns the file system.
pub fn parse(name: &str, format: Format, bytes: &[u8], reading: &Reading) -> Result<Loaded> {
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
    // What is wrong with an archive that is called 3MF is for its reader to say.
    let foreign = foreign::by_content(bytes).filter(|_| format != Format::ThreeMf);
    if let Some((what, advice)) = foreign {
        return Err(Error::Foreign {
            name: name.to_owned(),
            what,
            advice,
        });
    }
    let mut loaded = match format {
        Format::Stl => stl::parse(name, bytes, reading)?,
        Format::Obj => obj::parse(name, bytes, reading)?,
        Format::Step => step::parse(name, bytes, reading)?,
        Format::Iges => iges::parse(name, bytes, reading)?,
        Format::Ply => ply::parse(name, bytes, reading)?,
        Format::ThreeMf => threemf::parse(name, bytes)?,
    };
    for body in &mut loaded.bodies {
        if let Shape::Mesh(mesh) = &mut body.shape {
            loaded.warnings.extend(heal::heal(&body.name, mesh)?);
            loaded.warnings.extend(check_mesh(&body.name, mesh));
        }
    }
    Ok(loaded)
}

fn format_of(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    let known = Format::ALL.into_iter();
    let mut known = known.filter(|(_, all)| all.contains(&&*extension));
    if let Some((format, _)) = known.next() {
        return Ok(format);
    }
    match foreign::by_extension(&extension) {
        Some((what, advice)) => Err(Error::Foreign {
            name: path.display().to_string(),
            what,
            advice,
        }),
        None => Err(Error::UnknownFormat {
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
    } else if text.starts_with(b"PK\x03\x04") && has(text, b"3D/") {
        Some(Format::ThreeMf)
    } else if is_iges(bytes) {
        Some(Format::Iges)
    } else {
        None
    }
}

fn has(bytes: &[u8], wanted: &[u8]) -> bool {
    bytes.windows(wanted.len()).any(|w| w == wanted)
}

/// Whether the first line is numbered as IGES numbers it: a letter and seven columns for the number.
fn is_iges(bytes: &[u8]) -> bool {
    bytes.get(72..80).is_some_and(|end| {
        let number = end[1..].trim_ascii();
        matches!(end[0], b'S' | b'C' | b'B')
            && bytes[..72].iter().all(|b| *b >= b' ')
            && number.iter().all(u8::is_ascii_digit)
            && number.ends_with(b"1")
    })
}

/// What the operator should know about a mesh.
fn check_mesh(name: &str, mesh: &Mesh) -> Vec<Warning> {
    let has_no_area = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        length(cross(sub(b, a), sub(c, a))) == 0.0
    };
    let facets = mesh.triangles().iter().filter(has_no_area).count();
    let edges = mesh.open_edges().len();
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

/// File, number, and the first of `names` that says something.
fn label(file: &str, number: usize, names: [&str; 2]) -> String {
    // Writers fill the mandatory name with these when there is none.
    let says_nothing = |n: &&str| {
        n.is_empty() || n.eq_ignore_ascii_case("none") || n.starts_with("Open CASCADE STEP")
    };
    match names.into_iter().find(|n| !says_nothing(n)) {
        Some(own) => format!("{file}: surface {number} '{own}'"),
        None => format!("{file}: surface {number}"),
    }
}

#[cfg(test)]
mod tests;
