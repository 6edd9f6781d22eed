//! PLY: the polygons of a Stanford file, ASCII or binary of either order.
//!
//! Only places of vertices and corners of faces count; colours, normals and what else there is are passed
//! over. A file of points is refused, as are strips of triangles.

use horma_core::{Body, Mesh, Point, Shape};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Property, PropertyAccess, PropertyAccessResult as Taken};

use super::{Loaded, Reading, foreign};
use crate::error::{Error, Result};

/// Reads a PLY file called `name`. Polygons become fans of triangles about their first corner, which is
/// exact for flat convex ones.
///
/// # Errors
/// [`Error::Syntax`], [`Error::Foreign`] for points, [`Error::NoTriangle`],
/// [`horma_core::Error::NotFinite`], [`horma_core::Error::TooFar`] and
/// [`horma_core::Error::NoSuchVertex`].
pub fn parse(name: &str, bytes: &[u8], reading: &Reading) -> Result<Loaded> {
    let wrong = |line: usize, reason: String| Error::Syntax {
        name: name.to_owned(),
        line,
        reason,
    };
    let failed = |e: ply_rs_bw::parser::ParseError| {
        let message = e.to_string();
        // Its second line repeats the text that is wrong, which may be long, and it begins with the line.
        let first = message.lines().next().unwrap_or_default();
        let line = format!("Line {}: ", e.line().unwrap_or_default());
        let first = first.strip_prefix(&line).unwrap_or(first);
        let reason = first.trim_end_matches('.').to_owned();
        wrong(e.line().unwrap_or_default(), reason)
    };
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader);
    let header = header.map_err(failed)?;
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces: Vec<Face> = Vec::new();
    for element in header.elements.values() {
        check(element, bytes.len()).map_err(|reason| wrong(reader.line(), reason))?;
        match element.name.as_str() {
            "vertex" => {
                let parser = Parser::<Vertex>::new();
                let read = parser.read_payload_for_element(&mut reader, element, &header);
                vertices = read.map_err(failed)?;
            }
            "face" => {
                let parser = Parser::<Face>::new();
                let read = parser.read_payload_for_element(&mut reader, element, &header);
                faces = read.map_err(failed)?;
            }
            _ => {
                let parser = Parser::<Skipped>::new();
                let read = parser.read_payload_for_element(&mut reader, element, &header);
                read.map_err(failed)?;
            }
        }
    }
    if faces.is_empty() {
        return Err(if vertices.is_empty() {
            Error::NoTriangle {
                name: name.to_owned(),
            }
        } else {
            Error::Foreign {
                name: name.to_owned(),
                what: "a list of points: it has vertices, but no faces",
                advice: foreign::POINTS,
            }
        });
    }
    let scale = reading.scale();
    let vertices: Vec<Point> = vertices
        .into_iter()
        .map(|v| v.0.map(|c| c * scale + 0.0))
        .collect();
    let mut triangles = Vec::with_capacity(faces.len());
    for (face, Face(corners)) in faces.iter().enumerate() {
        let [first, rest @ ..] = &corners[..] else {
            return Err(too_few(name, face, 0));
        };
        if rest.len() < 2 {
            return Err(too_few(name, face, corners.len()));
        }
        triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }
    let body = Body {
        name: name.to_owned(),
        shape: Shape::Mesh(Mesh::new(name, vertices, triangles)?),
    };
    Ok(Loaded {
        bodies: vec![body],
        unit: reading.assumed(),
        stated: false,
        warnings: Vec::new(),
    })
}

fn too_few(name: &str, face: usize, corners: usize) -> Error {
    Error::BadFace {
        name: name.to_owned(),
        face,
        corners,
    }
}

/// Whether what an element says of itself can be: the library would read elements without properties for
/// as long as their number says.
fn check(element: &ElementDef, length: usize) -> std::result::Result<(), String> {
    let ElementDef {
        name,
        count,
        properties,
    } = element;
    let has = |wanted: &[&str]| wanted.iter().any(|w| properties.contains_key(*w));
    if *count > length || (*count > 0 && properties.is_empty()) {
        return Err(format!(
            "the header states {count} elements '{name}', more than there are; the file is damaged, export it again"
        ));
    }
    match name.as_str() {
        "vertex" if !["x", "y", "z"].iter().all(|axis| has(&[axis])) => {
            Err("vertices should have x, y and z".to_owned())
        }
        "face" if *count > 0 && !has(&CORNERS) => {
            Err("faces should have a list vertex_indices".to_owned())
        }
        "tristrips" if *count > 0 => {
            Err("strips of triangles are not read; export it with faces".to_owned())
        }
        _ => Ok(()),
    }
}

/// What the list of a face's corners is called.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

#[derive(Default)]
struct Vertex(Point);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> Taken {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return Taken::Ignored,
        };
        self.0[axis] = match value {
            Property::Char(v) => v.into(),
            Property::UChar(v) => v.into(),
            Property::Short(v) => v.into(),
            Property::UShort(v) => v.into(),
            Property::Int(v) => v.into(),
            Property::UInt(v) => v.into(),
            Property::Float(v) => v.into(),
            Property::Double(v) => v,
            _ => return Taken::UnsupportedType,
        };
        Taken::Set
    }
}

#[derive(Default)]
struct Face(Vec<u32>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> Taken {
        if !CORNERS.contains(&name) {
            return Taken::Ignored;
        }
        // What is negative names no vertex, and u32::MAX is none either.
        fn whole<T: TryInto<u32>>(all: Vec<T>) -> Vec<u32> {
            let each = all.into_iter().map(TryInto::try_into);
            each.map(|n| n.unwrap_or(u32::MAX)).collect()
        }
        self.0 = match value {
            Property::ListChar(all) => whole(all),
            Property::ListUChar(all) => whole(all),
            Property::ListShort(all) => whole(all),
            Property::ListUShort(all) => whole(all),
            Property::ListInt(all) => whole(all),
            Property::ListUInt(all) => all,
            _ => return Taken::UnsupportedType,
        };
        Taken::Set
    }
}

/// An element of which nothing counts.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }

    fn set_property(&mut self, _: &str, _: Property) -> Taken {
        Taken::Ignored
    }
}

#[cfg(test)]
mod tests;
