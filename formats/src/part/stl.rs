//! STL, binary and ASCII.
//!
//! The format has no checksum, so everything it says about itself is compared with what is there:
//! a file that is shorter or longer than its header says is refused, since a last with a piece
//! missing would be gouged. Read here and not by a library, because those that were tried trust the
//! first word `solid`, stop silently at the first `endsolid`, and cannot say which line is wrong.

use horma_core::{Body, Mesh, Point, Shape};

use super::{Loaded, Reading, Warning};
use crate::error::{Error, Result};

const HEADER: usize = 84;
const FACET: usize = 50;

/// Reads an STL file called `name`; equal vertices become one. Several solids become one mesh.
///
/// # Errors
/// [`Error::StlLength`] if the length contradicts the header, [`Error::Syntax`] for ASCII that
/// makes no sense, [`Error::NoTriangle`], [`horma_core::Error::NotFinite`] and
/// [`horma_core::Error::TooFar`].
pub fn parse(name: &str, bytes: &[u8], reading: &Reading) -> Result<Loaded> {
    let mut warnings = Vec::new();
    let facets = if is_ascii(bytes) {
        parse_ascii(name, &String::from_utf8_lossy(bytes))?
    } else {
        let (facets, trailing) = parse_binary(name, bytes)?;
        if trailing > 0 {
            warnings.push(Warning::TrailingBytes {
                name: name.to_owned(),
                bytes: trailing,
            });
        }
        facets
    };
    if facets.is_empty() {
        return Err(Error::NoTriangle {
            name: name.to_owned(),
        });
    }
    let scale = reading.scale();
    let facets = facets
        .iter()
        .map(|facet| facet.map(|corner| corner.map(|c| c * scale)));
    let body = Body {
        name: name.to_owned(),
        shape: Shape::Mesh(Mesh::of_corners(name, facets)?),
    };
    Ok(Loaded {
        bodies: vec![body],
        unit: reading.assumed(),
        stated: false,
        warnings,
    })
}

/// Binary files may start with `solid` as well, so their length has the first word.
fn is_ascii(bytes: &[u8]) -> bool {
    let exact = stated(bytes).is_some_and(|n| bytes.len() as u64 == length_of(n));
    let start = bytes.trim_ascii_start();
    let solid = start
        .get(..5)
        .is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    !exact && solid && !bytes.contains(&0)
}

/// Number of triangles that a binary header states.
fn stated(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(80..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().ok()?))
}

fn length_of(triangles: u32) -> u64 {
    HEADER as u64 + FACET as u64 * u64::from(triangles)
}

/// The triangles, and the number of bytes after the last one.
fn parse_binary(name: &str, bytes: &[u8]) -> Result<(Vec<[Point; 3]>, usize)> {
    let stated = stated(bytes).ok_or_else(|| Error::StlTooShort {
        name: name.to_owned(),
        length: bytes.len(),
    })?;
    let body = &bytes[HEADER..];
    let present = body.len() / FACET;
    if present as u64 != u64::from(stated) {
        return Err(Error::StlLength {
            name: name.to_owned(),
            stated,
            needed: length_of(stated),
            length: bytes.len(),
            present,
        });
    }
    let facets = body.chunks_exact(FACET).enumerate();
    let facets = facets.map(|(triangle, facet)| {
        let (words, _) = facet.as_chunks::<4>();
        let number = |i: usize| f64::from(f32::from_le_bytes(words[i]));
        // The normal comes first and is not needed: it follows from the vertices.
        let corners = [3, 6, 9].map(|i| [number(i), number(i + 1), number(i + 2)]);
        check_finite(&corners, || format!("{name}: triangle {triangle}"))?;
        Ok(corners)
    });
    Ok((facets.collect::<Result<_>>()?, body.len() % FACET))
}

fn check_finite(corners: &[Point; 3], whose: impl Fn() -> String) -> Result<()> {
    for (index, corner) in corners.iter().enumerate() {
        if let Some(&value) = corner.iter().find(|c| !c.is_finite()) {
            return Err(Error::Core(horma_core::Error::NotFinite {
                name: whose(),
                what: "vertex",
                index,
                value,
            }));
        }
    }
    Ok(())
}

/// `solid … { facet normal … outer loop { vertex … } × 3 endloop endfacet } endsolid …`, one
/// statement a line, any number of times.
fn parse_ascii(name: &str, text: &str) -> Result<Vec<[Point; 3]>> {
    let wrong = |line: usize, reason: String| Error::Syntax {
        name: name.to_owned(),
        line,
        reason,
    };
    let mut facets = Vec::new();
    let mut corners: Vec<Point> = Vec::with_capacity(3);
    let mut state = State::Outside;
    let mut last = 0;
    for (line, statement) in (1..).zip(text.lines()) {
        last = line;
        let words: Vec<&str> = statement.split_ascii_whitespace().collect();
        let Some(keyword) = words.first() else {
            continue;
        };
        state = match (state, keyword.to_ascii_lowercase().as_str()) {
            (State::Outside, "solid") => State::Solid,
            (State::Solid, "endsolid") => State::Outside,
            (State::Solid, "facet") => State::Facet,
            (State::Facet, "outer") => State::Loop,
            (State::Loop, "vertex") if corners.len() < 3 => {
                corners.push(vertex(&words).map_err(|reason| wrong(line, reason))?);
                State::Loop
            }
            (State::Loop, "endloop") if corners.len() == 3 => State::EndFacet,
            (State::EndFacet, "endfacet") => {
                let facet = [corners[0], corners[1], corners[2]];
                check_finite(&facet, || {
                    format!("{name}: the triangle ending on line {line}")
                })?;
                facets.push(facet);
                corners.clear();
                State::Solid
            }
            (state, _) => {
                let expected = state.expects(corners.len());
                let reason = format!("expected {expected}, but found '{}'", shortened(statement));
                return Err(wrong(line, reason));
            }
        };
    }
    if state == State::Outside {
        Ok(facets)
    } else {
        let expected = state.expects(corners.len());
        let reason = format!("the file ends where {expected} should follow; it is cut short");
        Err(wrong(last, reason))
    }
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Outside,
    Solid,
    Facet,
    Loop,
    EndFacet,
}

impl State {
    fn expects(self, corners: usize) -> &'static str {
        match self {
            Self::Outside => "'solid'",
            Self::Solid => "'facet' or 'endsolid'",
            Self::Facet => "'outer loop'",
            Self::Loop if corners < 3 => "'vertex'",
            Self::Loop => "'endloop'",
            Self::EndFacet => "'endfacet'",
        }
    }
}

fn vertex(words: &[&str]) -> std::result::Result<Point, String> {
    let [_, coordinates @ ..] = words else {
        return Err("a vertex without coordinates".to_owned());
    };
    let numbers: Option<Vec<f64>> = coordinates.iter().map(|w| w.parse().ok()).collect();
    numbers
        .and_then(|n| Point::try_from(n).ok())
        .ok_or_else(|| {
            format!(
                "a vertex is three numbers, not '{}'",
                shortened(&coordinates.join(" "))
            )
        })
}

/// As much of a line as fits into a message.
pub(super) fn shortened(line: &str) -> String {
    let line = line.trim();
    let mut short: String = line.chars().filter(|c| !c.is_control()).take(60).collect();
    if short.len() < line.len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACETS: &str = "facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n \
        vertex 0 1 0\n endloop\n endfacet\n";

    fn ascii(facets: &str) -> Vec<u8> {
        format!("solid t\n{facets}endsolid t\n").into_bytes()
    }

    pub(crate) fn binary(header: &[u8], stated: u32, facets: &[[Point; 3]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, 0);
        bytes.extend(stated.to_le_bytes());
        for facet in facets {
            bytes.extend([0; 12]);
            for number in facet.as_flattened() {
                bytes.extend((*number as f32).to_le_bytes());
            }
            bytes.extend([0; 2]);
        }
        bytes
    }

    const FACET_A: [Point; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    const FACET_B: [Point; 3] = [[1.0, 0.0, -0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    fn mesh(bytes: &[u8]) -> Mesh {
        match parse("t.stl", bytes, &Reading::default())
            .expect("valid")
            .bodies
            .remove(0)
            .shape
        {
            Shape::Mesh(mesh) => mesh,
            Shape::Surface(_) => unreachable!("STL has meshes only"),
        }
    }

    fn refused(bytes: &[u8], expected: &str) {
        let error = parse("t.stl", bytes, &Reading::default())
            .expect_err(expected)
            .to_string();
        assert!(
            error.starts_with("t.stl: ") && error.contains(expected),
            "{error}"
        );
    }

    #[test]
    fn binary_and_ascii_give_the_same_mesh() {
        let b = mesh(&binary(b"", 1, &[FACET_A]));
        assert_eq!(b, mesh(&ascii(FACETS)));
        assert_eq!(
            b,
            mesh(&ascii(&FACETS.to_uppercase().replace('\n', "\r\n")))
        );
        assert_eq!((b.vertices().len(), b.triangles()), (3, &[[0, 1, 2]][..]));
    }

    #[test]
    fn equal_vertices_are_welded() {
        let b = mesh(&binary(b"", 2, &[FACET_A, FACET_B]));
        assert_eq!((b.vertices().len(), b.triangles().len()), (4, 2));
        assert_eq!(b.open_edges().len(), 4);
    }

    #[test]
    fn ascii_keeps_doubles_and_every_solid() {
        let precise = FACETS.replace("vertex 1 0 0", "vertex 1.0000000001 0 0");
        let two = [ascii(&precise), ascii(FACETS)].concat();
        let m = mesh(&two);
        assert_eq!(
            (m.triangles().len(), m.vertices()[1][0]),
            (2, 1.000_000_000_1)
        );
    }

    #[test]
    fn binary_may_start_with_solid() {
        let facets = [FACET_A, FACET_B];
        assert_eq!(mesh(&binary(b"solid x", 2, &facets)).triangles().len(), 2);
        let cut = binary(b"solid x", 2, &facets);
        refused(&cut[..cut.len() - 10], "the header states 2 triangles");
    }

    #[test]
    fn lengths_that_contradict_the_header_are_refused() {
        let good = binary(b"", 2, &[FACET_A, FACET_B]);
        refused(&good[..83], "83 bytes");
        refused(&good[..84], "there are 0");
        refused(&good[..183], "there are 1");
        refused(&binary(b"", 1, &[FACET_A, FACET_B]), "there are 2");
        refused(&binary(b"", u32::MAX, &[FACET_A]), "states 4294967295");
        let mut long = good.clone();
        long.extend([0; 7]);
        let loaded = parse("t.stl", &long, &Reading::default()).expect("valid");
        assert_eq!(
            loaded.warnings[0].to_string(),
            "t.stl: 7 bytes after the last triangle are not read"
        );
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut facet = FACET_A;
            facet[1][2] = bad;
            refused(
                &binary(b"", 2, &[FACET_B, facet]),
                "triangle 1: vertex 1 is",
            );
        }
        refused(
            &ascii(&FACETS.replace("1 0 0", "nan 0 0")),
            "line 8: vertex 1 is NaN",
        );
        refused(
            &ascii(&FACETS.replace("1 0 0", "1e9 0 0")),
            "beyond the 1000000 mm",
        );
    }

    #[test]
    fn ascii_that_makes_no_sense_is_refused_by_line() {
        refused(&ascii(""), "no triangle");
        refused(&binary(b"", 0, &[]), "no triangle");
        refused(
            &ascii(&FACETS.replace("vertex 1 0 0", "vertex 1 0")),
            "line 5: a vertex is three",
        );
        refused(
            &ascii(&FACETS.replace("vertex 1 0 0\n", "")),
            "line 6: expected 'vertex'",
        );
        refused(
            &ascii(&FACETS.replace("endloop", "vertex 0 0 0")),
            "line 7: expected 'endloop'",
        );
        refused(
            &ascii(&FACETS.replace("outer", "inner")),
            "line 3: expected 'outer loop'",
        );
        let text = ascii(FACETS);
        refused(
            &text[..text.len() - 11],
            "the file ends where 'facet' or 'endsolid' should follow",
        );
    }

    #[test]
    fn it_agrees_with_an_independent_reader() {
        for bytes in [binary(b"", 2, &[FACET_A, FACET_B]), ascii(FACETS)] {
            let theirs = stl_io::read_stl(&mut std::io::Cursor::new(&bytes)).expect("valid");
            let mesh = mesh(&bytes);
            let ours = mesh.triangles().iter().flatten();
            let ours = ours.map(|&v| mesh.vertices()[v as usize]);
            let theirs = theirs
                .faces
                .iter()
                .flat_map(|f| f.vertices.map(|v| theirs.vertices[v]));
            assert!(ours.eq(theirs.map(|v| v.0.map(f64::from))));
        }
    }
}
