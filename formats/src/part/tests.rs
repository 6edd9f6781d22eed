use std::path::PathBuf;

use super::*;
use crate::inspect::inspect;

const READING: Reading = Reading {
    unit: None,
    trimmed: Trimmed::Refuse,
};

const TRIANGLE: &str = "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n\
    vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid t\n";

fn check(file: &str, content: &[u8], expected: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(file);
    fs::write(&path, content).expect("written");
    let error = read(&path, &READING).expect_err(file).to_string();
    assert!(error.contains(expected), "{file}: {error}");
}

#[test]
fn what_is_not_a_part_is_refused_by_name() {
    check("last.xyy", b"x", "STEP, IGES, STL, OBJ, PLY and 3MF");
    check("last", b"x", "STEP, IGES, STL, OBJ, PLY and 3MF");
    check("last.dwg", b"x", "a drawing");
    check(
        "last.SLDPRT",
        b"x",
        "a SOLIDWORKS file, which is no part that is read; export the part as STEP",
    );
    check("last.x_t", b"x", "a Parasolid file");
    check("last.3dm", b"x", "a Rhino file");
    check(
        "last.glb",
        b"x",
        "a glTF file, which is no part that is read; export or convert",
    );
    check("last.amf", b"x", "an AMF file");
    check("last.xyz", b"0 0 0", "Screened Poisson");
    check("last.toml", b"[part]", "horma run JOB");
    check("last.stl", b"", "last.stl: the file is empty");
    check("last.obj", b" \n", "last.obj: the file is empty");
    check("last.stl", b"ISO-10303-21;", "its content is STEP");
    check("last.step", b"ply\n", "its content is PLY");
    check("last.step", &iges::tests::patch(), "its content is IGES");
    check(
        "last.stl",
        &threemf::tests::tetrahedron(),
        "its content is 3MF",
    );
    check(
        "last.step",
        &threemf::tests::package(&[("x", "y")]),
        "an archive",
    );
    check("last.stl", b"0\r\nSECTION\r\n2\r\nHEADER\r\n", "a drawing");
    check(
        "last.step",
        b"**ABCDEFGHIJKLMNOPQRSTUVWXYZ abc",
        "a Parasolid file",
    );
    check("last.obj", b"1 2 3\n4.5 5 6\n7 8 9\n", "a list of points");
    check(
        "last.stl",
        b"1;2;3;9\n4.5;5;6;9\n7;8;9;9\n",
        "a list of points",
    );
    check("last.obj", b"v 1 2 3\nv 1 2 4\n", "a list of points");
    check("last.ply", b"{ \"asset\": {} }", "a glTF file");
}

#[test]
fn what_cannot_be_opened_is_refused_by_path() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let missing = read(&folder.path().join("none.stl"), &READING).expect_err("missing");
    assert!(missing.to_string().contains("none.stl"), "{missing}");
    let path = folder.path().join("folder.stl");
    fs::create_dir(&path).expect("made");
    let error = read(&path, &READING).expect_err("a folder").to_string();
    assert!(error.contains("is a folder"), "{error}");
}

#[test]
fn several_files_are_one_part_in_order() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let paths = ["b.STL", "a.stl"].map(|f| folder.path().join(f));
    for path in &paths {
        fs::write(path, TRIANGLE).expect("written");
    }
    let Assembled {
        part,
        sources,
        warnings,
    } = read_all(&paths, &READING).expect("valid");
    let files: Vec<&str> = sources.iter().map(|s| s.file.as_str()).collect();
    assert_eq!(files, ["b.STL", "a.stl"]);
    let names: Vec<&str> = part.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["b.STL", "a.stl"]);
    assert_eq!(warnings.len(), 2);
    let open = "a.stl: 3 edges are open; the mesh is machined as it is";
    assert_eq!(warnings[1].to_string(), open);
    assert!(read_all(&[], &READING).is_err(), "an empty part");
}

#[test]
fn triangles_without_area_are_counted() {
    let text = TRIANGLE.replace("vertex 0 1 0", "vertex 2 0 0");
    let loaded = parse("t.stl", Format::Stl, text.as_bytes(), &READING).expect("valid");
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
    let loaded = read(&shared(file)?, &READING).expect(file);
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
        let shown = inspect(&path, None).expect("valid").0.to_string();
        assert!(
            shown.starts_with("last_3surfaces.step: 3 bodies, millimetre\n"),
            "{shown}"
        );
        assert!(shown.contains("degree 3 × 3, 90 × 72 poles"), "{shown}");
        assert_eq!(shown.matches("6 × 16 poles").count(), 2, "{shown}");
    }
    if let Some(path) = shared("last_scan.stl") {
        let shown = inspect(&path, None).expect("valid").0.to_string();
        assert!(
            shown.contains("6784 triangles, 3394 vertices, watertight, 841.4 cm³"),
            "{shown}"
        );
        assert!(shown.contains("245.05 × 90.71 × 103.33 mm"), "{shown}");
    }
    if let Some(path) = shared("bunny_open.obj") {
        let loaded = read(&path, &READING).expect("valid");
        let open = |w: &Warning| matches!(w, Warning::OpenEdges { edges: 1.., .. });
        assert!(loaded.warnings.iter().any(open), "{:?}", loaded.warnings);
    }
}

#[test]
fn units_are_said_for_files_that_have_none() {
    let inch = Reading {
        unit: Unit::named("inch"),
        ..READING
    };
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let all = [
        (Format::Stl, TRIANGLE),
        (Format::Obj, obj),
        (Format::Ply, ply),
    ];
    for (format, text) in all {
        let loaded = parse("t", format, text.as_bytes(), &inch).expect("valid");
        let Shape::Mesh(mesh) = &loaded.bodies[0].shape else {
            unreachable!("a mesh")
        };
        assert_eq!(mesh.vertices()[1], [25.4, 0.0, 0.0], "{format}");
        assert_eq!((loaded.unit.name.as_str(), loaded.stated), ("inch", false));
    }
    let free = parse("t", Format::Step, step::tests::FREE.as_bytes(), &inch).expect("valid");
    let Shape::Surface(surface) = &free.bodies[0].shape else {
        unreachable!("a surface")
    };
    assert_eq!(surface.poles()[2], [254.0, 0.0, 0.0]);
    assert!(free.warnings.is_empty(), "{:?}", free.warnings);
    // What a file says itself counts.
    let package = threemf::tests::tetrahedron();
    let loaded = parse("t", Format::ThreeMf, &package, &inch).expect("valid");
    assert_eq!((loaded.unit.millimetres, loaded.stated), (1.0, true));
}

#[test]
fn iges_and_step_of_one_last_are_the_same_surfaces() {
    let (Some((a, step)), Some((b, iges))) = (
        sampled("last_3surfaces.step"),
        sampled("last_3surfaces.igs"),
    ) else {
        return;
    };
    assert_eq!((a, b), (3, 3));
    let apart = step.iter().zip(&iges).map(|(&p, &q)| length(sub(p, q)));
    let apart = apart.fold(0.0, f64::max);
    assert!(apart < 1e-6, "{apart} mm");
}

#[test]
fn foreign_iges_is_read_whole_or_refused() {
    let Some(path) = shared("hammer.iges") else {
        return;
    };
    let error = read(&path, &READING).expect_err("its faces are trimmed");
    assert!(matches!(error, Error::Trimmed { .. }), "{error}");
    let (shown, _) = inspect(&path, None).expect("valid");
    assert_eq!(shown.bodies.len(), 45);
    assert!(
        shown
            .to_string()
            .contains("faces are trimmed inside their surfaces")
    );
}

#[test]
fn everything_that_is_shared_is_read_or_refused_with_what_to_do() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let Ok(entries) = fs::read_dir(&folder) else {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    for path in paths {
        match read(&path, &READING) {
            Ok(loaded) => assert!(!loaded.bodies.is_empty(), "{}", path.display()),
            Err(error) => {
                let advice = ["export", "name ", "unpack", "make one"];
                let error = error.to_string();
                assert!(advice.iter().any(|a| error.contains(a)), "{error}");
            }
        }
    }
}
