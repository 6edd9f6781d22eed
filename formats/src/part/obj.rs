//! OBJ: the polygons of a Wavefront file.
//!
//! Only vertices, faces and objects are read; colours, textures, normals, groups and materials mean
//! nothing to a cutter, so a missing material library is no error. Free-form surfaces in OBJ are
//! refused. Read here and not by a library, because the one that was tried cannot say which line is
//! wrong, and refuses files for their colours and textures.

use std::collections::HashMap;

use horma_core::{Body, Mesh, Point, Shape};

use super::stl::shortened;
use super::{Loaded, Reading, foreign};
use crate::error::{Error, Result};

/// Reads an OBJ file called `name`: one mesh for each object (`o`) that has faces. Polygons become
/// fans of triangles about their first corner, which is exact for flat convex ones.
///
/// # Errors
/// [`Error::Syntax`] with the line, [`Error::NoTriangle`], [`horma_core::Error::NotFinite`] and
/// [`horma_core::Error::TooFar`].
pub fn parse(name: &str, bytes: &[u8], reading: &Reading) -> Result<Loaded> {
    let text = String::from_utf8_lossy(bytes);
    let mut vertices: Vec<Point> = Vec::new();
    let mut objects = vec![Object::default()];
    let mut continued = String::new();
    for (line, part) in (1..).zip(text.lines()) {
        if let Some(begun) = part.trim_end().strip_suffix('\\') {
            continued.push_str(begun);
            continued.push(' ');
            continue;
        }
        continued.push_str(part);
        let statement = std::mem::take(&mut continued);
        let statement = statement.split('#').next().unwrap_or_default();
        let wrong = |reason: String| Error::Syntax {
            name: name.to_owned(),
            line,
            reason,
        };
        let mut words = statement.split_whitespace();
        match words.next() {
            Some("v") => vertices.push(vertex(words).ok_or_else(|| {
                wrong(format!(
                    "a vertex is three finite numbers, not '{}'",
                    shortened(statement)
                ))
            })?),
            Some("f") => {
                let corners: Vec<u32> = words
                    .map(|w| corner(w, vertices.len()))
                    .collect::<std::result::Result<_, _>>()
                    .map_err(wrong)?;
                let [first, rest @ ..] = &corners[..] else {
                    return Err(wrong("a face without corners".to_owned()));
                };
                if rest.len() < 2 {
                    let count = corners.len();
                    return Err(wrong(format!(
                        "a face has three corners or more, not {count}"
                    )));
                }
                if let Some(object) = objects.last_mut() {
                    let fan = rest.windows(2).map(|pair| [*first, pair[0], pair[1]]);
                    object.triangles.extend(fan);
                }
            }
            Some("o") => objects.push(Object {
                name: words.collect::<Vec<_>>().join(" "),
                triangles: Vec::new(),
            }),
            Some("surf" | "curv" | "cstype") => {
                return Err(wrong(
                    "free-form geometry in OBJ is not read; export it as STEP".to_owned(),
                ));
            }
            _ => {}
        }
    }
    objects.retain(|o| !o.triangles.is_empty());
    if objects.is_empty() {
        let name = name.to_owned();
        return Err(if vertices.is_empty() {
            Error::NoTriangle { name }
        } else {
            Error::Foreign {
                name,
                what: "a list of points: it has vertices, but no faces",
                advice: foreign::POINTS,
            }
        });
    }
    let alone = objects.len() == 1;
    let bodies = (1..).zip(objects).map(|(number, object)| {
        let body = match (alone, object.name.as_str()) {
            (true, "") => name.to_owned(),
            (_, "") => format!("{name}: object {number}"),
            (_, own) => format!("{name}: {own}"),
        };
        let mesh = compact(&body, &vertices, &object.triangles, reading.scale())?;
        Ok(Body {
            name: body,
            shape: Shape::Mesh(mesh),
        })
    });
    Ok(Loaded {
        bodies: bodies.collect::<Result<_>>()?,
        unit: reading.assumed(),
        stated: false,
        warnings: Vec::new(),
    })
}

#[derive(Default)]
struct Object {
    name: String,
    /// Indices into the vertices of the whole file.
    triangles: Vec<[u32; 3]>,
}

/// The first three numbers; a weight or a colour may follow.
fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Option<Point> {
    let numbers: Vec<f64> = words
        .take(3)
        .map(|w| w.parse().ok().filter(|n: &f64| n.is_finite()))
        .collect::<Option<_>>()?;
    numbers.try_into().ok()
}

/// The vertex that `i`, `i/t`, `i//n` or `i/t/n` names: from 1, or from −1 backwards.
fn corner(word: &str, vertices: usize) -> std::result::Result<u32, String> {
    let index = word.split('/').next().unwrap_or_default();
    let number: i64 = index
        .parse()
        .map_err(|_| format!("'{}' does not name a vertex", shortened(word)))?;
    let place = match number {
        1.. => usize::try_from(number - 1).ok(),
        0 => None,
        _ => usize::try_from(number.unsigned_abs())
            .ok()
            .and_then(|back| vertices.checked_sub(back)),
    };
    place
        .filter(|&p| p < vertices)
        .and_then(|p| u32::try_from(p).ok())
        .ok_or_else(|| {
            format!("a face names vertex {number}, but {vertices} have been given so far")
        })
}

/// A mesh with only those vertices that its triangles name, times `scale`.
fn compact(name: &str, vertices: &[Point], triangles: &[[u32; 3]], scale: f64) -> Result<Mesh> {
    let mut places = HashMap::new();
    let mut own = Vec::new();
    let triangles = triangles.iter().map(|t| {
        t.map(|v| {
            *places.entry(v).or_insert_with(|| {
                own.push(vertices[v as usize].map(|c| c * scale + 0.0));
                own.len() as u32 - 1
            })
        })
    });
    let triangles = triangles.collect();
    Ok(Mesh::new(name, own, triangles)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "mtllib none.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0 1.0\nv 0 1 0\n";

    fn meshes(text: &str) -> Vec<(String, Mesh)> {
        let bodies = parse("t.obj", text.as_bytes(), &Reading::default())
            .expect("valid")
            .bodies;
        let mesh = |b: Body| match b.shape {
            Shape::Mesh(mesh) => (b.name, mesh),
            Shape::Surface(_) => unreachable!("OBJ has meshes only"),
        };
        bodies.into_iter().map(mesh).collect()
    }

    fn triangles(faces: &str, expected: &[[u32; 3]]) {
        let (name, mesh) = meshes(&format!("{SQUARE}{faces}")).remove(0);
        assert_eq!((name.as_str(), mesh.triangles()), ("t.obj", expected));
    }

    #[test]
    fn faces_in_every_spelling() {
        triangles("usemtl m\nf 1 2 3\n", &[[0, 1, 2]]);
        triangles("f 1/7/9 2//3 3/1\n", &[[0, 1, 2]]);
        triangles("f -4 -3 -2 # from behind\n", &[[0, 1, 2]]);
        triangles("f 1 2 3 4\n", &[[0, 1, 2], [0, 2, 3]]);
        triangles("g a\nf 1 2 \\\n 3\ng b\nf 1 3 4\n", &[[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn objects_are_kept_apart_with_their_own_vertices() {
        let two = meshes(&format!(
            "{SQUARE}f 1 2 3\no heel holder\nf 2 3 4\no empty\n"
        ));
        assert_eq!(two[0].0, "t.obj: object 1");
        assert_eq!(two[1].0, "t.obj: heel holder");
        assert_eq!(two[1].1.vertices()[0], [1.0, 0.0, 0.0]);
        assert_eq!(two[1].1.triangles(), [[0, 1, 2]]);
    }

    #[test]
    fn nonsense_is_refused_by_line() {
        let check = |lines: &str, expected: &str| {
            let text = format!("{SQUARE}{lines}");
            let error = parse("t.obj", text.as_bytes(), &Reading::default())
                .expect_err(lines)
                .to_string();
            assert!(error.contains(expected), "{lines}: {error}");
        };
        check("f 1 2 5\n", "t.obj: line 6: a face names vertex 5, but 4");
        check("f 0 1 2\n", "names vertex 0");
        check("f 1 2 -5\n", "names vertex -5");
        check(
            "f 1 2 -9223372036854775808\n",
            "names vertex -9223372036854775808",
        );
        check("\nf 1 2 x\n", "line 7: 'x' does not name a vertex");
        check("f 1 2\n", "three corners or more, not 2");
        check("f\n", "without corners");
        check("v 0 0\n", "three finite numbers");
        check("v 0 nan 0\nf 1 2 3\n", "three finite numbers");
        check("v 0 0 inf\nf 1 2 3\n", "three finite numbers");
        check("v 1e7 0 0\nf 1 2 5\n", "beyond the 1000000 mm");
        check("cstype bspline\n", "export it as STEP");
        check("", "a list of points");
    }

    #[test]
    fn it_agrees_with_an_independent_reader() {
        // It refuses files that colour some of their vertices only.
        let square = SQUARE.replace(" 0.5 0.5 0.5", "");
        let text = format!("{square}v 2 2 2\no a\nf 1 2 3\nf 3 -1 4 1\no b\nf 2 3 4 5 1\n");
        let options = tobj::LoadOptions {
            triangulate: true,
            ..Default::default()
        };
        let theirs = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| {
            Err(tobj::LoadError::OpenFileFailed)
        });
        let (theirs, _) = theirs.expect("valid");
        for ((_, ours), theirs) in meshes(&text).iter().zip(&theirs) {
            assert_eq!(ours.vertices().as_flattened(), theirs.mesh.positions);
            assert_eq!(ours.triangles().as_flattened(), theirs.mesh.indices);
        }
    }
}
