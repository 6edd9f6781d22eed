use std::path::PathBuf;

use proptest::prelude::*;

use super::*;
use crate::inspect::inspect;

const TRIANGLE: &str = "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n\
    vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid t\n";

fn check(file: &str, content: &[u8], expected: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(file);
    fs::write(&path, content).expect("written");
    let error = read(&path).expect_err(file).to_string();
    assert!(error.contains(expected), "{file}: {error}");
}

#[test]
fn what_is_not_a_part_is_refused_by_name() {
    check("last.dwg", b"x", "STL, OBJ and STEP");
    check("last", b"x", "STL, OBJ and STEP");
    check("last.igs", b"x", "IGES files are not read yet");
    check("last.PLY", b"ply\n", "PLY files are not read yet");
    check("last.3mf", b"x", "3MF files are not read yet");
    check("last.stl", b"", "last.stl: the file is empty");
    check("last.obj", b" \n", "last.obj: the file is empty");
    check("last.stl", b"ISO-10303-21;", "its content is STEP");
    check("last.step", b"ply\n", "its content is PLY");
}

#[test]
fn what_cannot_be_opened_is_refused_by_path() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let missing = read(&folder.path().join("none.stl")).expect_err("missing");
    assert!(missing.to_string().contains("none.stl"), "{missing}");
    let path = folder.path().join("folder.stl");
    fs::create_dir(&path).expect("made");
    let error = read(&path).expect_err("a folder").to_string();
    assert!(error.contains("is a folder"), "{error}");
}

#[test]
fn several_files_are_one_part_in_order() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let paths = ["b.STL", "a.stl"].map(|f| folder.path().join(f));
    for path in &paths {
        fs::write(path, TRIANGLE).expect("written");
    }
    let (part, warnings) = read_all(&paths).expect("valid");
    let names: Vec<&str> = part.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["b.STL", "a.stl"]);
    assert_eq!(warnings.len(), 2);
    let open = "a.stl: 3 edges are open; the mesh is machined as it is";
    assert_eq!(warnings[1].to_string(), open);
    assert!(read_all(&[]).is_err(), "an empty part");
}

#[test]
fn triangles_without_area_are_counted() {
    let text = TRIANGLE.replace("vertex 0 1 0", "vertex 2 0 0");
    let loaded = parse("t.stl", Format::Stl, text.as_bytes()).expect("valid");
    let facets = |w: &Warning| matches!(w, Warning::DegenerateFacets { facets: 1, .. });
    assert!(loaded.warnings.iter().any(facets), "{:?}", loaded.warnings);
}

/// A file of the data that is shared between projects and not part of this one.
fn shared(file: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let path = folder.join(file);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is not there", path.display());
    None
}

/// Points on every surface of a part, on a grid of each.
fn sampled(file: &str) -> Option<(usize, Vec<[f64; 3]>)> {
    let loaded = read(&shared(file)?).expect(file);
    let mut points = Vec::new();
    for body in &loaded.bodies {
        let Shape::Surface(surface) = &body.shape else {
            unreachable!("{file} has surfaces only");
        };
        let [us, vs] = [surface.u(), surface.v()].map(|d| {
            let (first, last) = d.domain();
            let at = |i| first + (last - first) * f64::from(i) / 30.0;
            (0..=30).map(at).collect::<Vec<f64>>()
        });
        points.extend(surface.grid(&us, &vs));
    }
    Some((loaded.bodies.len(), points))
}

#[test]
fn a_sphere_of_rational_patches_is_a_sphere() {
    let Some((surfaces, points)) = sampled("rational_sphere.step") else {
        return;
    };
    assert_eq!(surfaces, 6);
    for p in points {
        assert!((length(p) - 1.0).abs() < 1e-9, "{p:?}");
    }
}

#[test]
fn a_torus_of_patches_is_a_torus() {
    let Some((surfaces, points)) = sampled("bspline_torus.step") else {
        return;
    };
    assert_eq!(surfaces, 30);
    for [x, y, z] in points {
        // Its patches are polynomial, so that the tube's radius is 0.5 to 0.006 only.
        let r = (x.hypot(y) - 2.0).hypot(z - 0.986_314_773);
        assert!((r - 0.5).abs() < 0.006, "{r} at {x} {y} {z}");
    }
}

#[test]
fn the_lasts_are_read_as_they_are_described() {
    if let Some(path) = shared("last_3surfaces.step") {
        let shown = inspect(&path).expect("valid").to_string();
        assert!(
            shown.starts_with("last_3surfaces.step: 3 bodies, millimetre\n"),
            "{shown}"
        );
        assert!(shown.contains("degree 3 × 3, 90 × 72 poles"), "{shown}");
        assert_eq!(shown.matches("6 × 16 poles").count(), 2, "{shown}");
    }
    if let Some(path) = shared("last_scan.stl") {
        let shown = inspect(&path).expect("valid").to_string();
        assert!(
            shown.contains("6784 triangles, 3394 vertices, watertight, 841.4 cm³"),
            "{shown}"
        );
        assert!(shown.contains("245.05 × 90.71 × 103.33 mm"), "{shown}");
    }
    if let Some(path) = shared("bunny_open.obj") {
        let loaded = read(&path).expect("valid");
        let open = |w: &Warning| matches!(w, Warning::OpenEdges { edges: 1.., .. });
        assert!(loaded.warnings.iter().any(open), "{:?}", loaded.warnings);
    }
    if let Some(path) = shared("hammer.iges") {
        assert!(matches!(read(&path), Err(Error::NotYet { .. })));
    }
}

const FORMATS: [Format; 3] = [Format::Stl, Format::Obj, Format::Step];

/// Starts of files that lead the parsers further in than noise does.
const STARTS: [&str; 4] = ["", "solid t\nfacet", "v 0 0 0\nf 1", step::tests::FREE];

proptest! {
    #[test]
    fn no_bytes_make_a_parser_panic(
        start in 0..STARTS.len(),
        bytes in prop::collection::vec(any::<u8>(), 0..300),
    ) {
        let bytes = [STARTS[start].as_bytes(), &bytes].concat();
        for format in FORMATS {
            let _ = parse("fuzz", format, &bytes);
        }
    }

    #[test]
    fn no_damage_makes_a_parser_panic(
        cut in 0.0..1.0f64,
        places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
    ) {
        let valid = [TRIANGLE, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -1\n", step::tests::FREE];
        for (format, valid) in FORMATS.into_iter().zip(valid) {
            let mut bytes = valid.as_bytes().to_vec();
            for (place, byte) in &places {
                let place = place.index(bytes.len());
                bytes[place] = *byte;
            }
            let _ = parse("fuzz", format, &bytes);
            bytes.truncate((cut * bytes.len() as f64) as usize);
            let _ = parse("fuzz", format, &bytes);
        }
    }
}
