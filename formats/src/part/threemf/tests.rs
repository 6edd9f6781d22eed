use std::io::Write;

use horma_core::Part;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::*;

const RELATIONS: &str = r#"<?xml version="1.0"?><Relationships
    xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r"
    Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/a.model"/></Relationships>"#;

const TETRAHEDRON: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
    <vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles>
    <triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/>
    <triangle v1="2" v2="0" v3="3"/></triangles></mesh>"#;

/// An archive of these files.
pub(crate) fn package(files: &[(&str, &str)]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (path, text) in files {
        let options = SimpleFileOptions::default();
        archive.start_file(*path, options).expect("written");
        archive.write_all(text.as_bytes()).expect("written");
    }
    archive.finish().expect("written").into_inner()
}

fn model(attributes: &str, resources: &str, build: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><model {attributes}
        xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
        xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
        ><resources>{resources}</resources><build>{build}</build></model>"#
    )
}

/// A package with this model alone.
fn one(attributes: &str, resources: &str, build: &str) -> Vec<u8> {
    let text = model(attributes, resources, build);
    package(&[("_rels/.rels", RELATIONS), ("3D/a.model", &text)])
}

fn object(attributes: &str) -> String {
    format!("<object {attributes}>{TETRAHEDRON}</object>")
}

pub(crate) fn tetrahedron() -> Vec<u8> {
    one("", &object(r#"id="1""#), r#"<item objectid="1"/>"#)
}

fn meshes(bytes: &[u8]) -> Vec<(String, Mesh)> {
    let bodies = parse("t.3mf", bytes).expect("valid").bodies;
    let part = Part { bodies };
    let mesh = |b: Body| match b.shape {
        Shape::Mesh(mesh) => (b.name, mesh),
        Shape::Surface(_) => unreachable!("3MF has meshes only"),
    };
    part.bodies.into_iter().map(mesh).collect()
}

#[track_caller]
fn refused(bytes: &[u8], expected: &str) {
    let error = parse("t.3mf", bytes).expect_err(expected).to_string();
    assert!(
        error.starts_with("t.3mf") && error.contains(expected),
        "{error}"
    );
}

#[test]
fn what_is_built_is_read_where_it_is_put() {
    let (name, mesh) = meshes(&tetrahedron()).remove(0);
    assert_eq!(
        (name.as_str(), mesh.triangles().len()),
        ("t.3mf: object 1", 4)
    );
    assert_eq!(mesh.open_edges().len(), 0);
    // The second puts the first twice, once moved and once mirrored; what is not built does not count.
    let pair = r#"<object id="2" name="pair"><components><component objectid="1"
        transform="1 0 0 0 1 0 0 0 1 10 0 0"/><component objectid="1"
        transform="-1 0 0 0 1 0 0 0 1 0 0 0"/></components></object>"#;
    let resources = [
        object(r#"id="1" name="tip""#),
        pair.to_owned(),
        object(r#"id="3""#),
    ]
    .concat();
    // About Z by 90°: x goes to y.
    let build = r#"<item objectid="2" transform="0 1 0 -1 0 0 0 0 1 0 0 5"/>"#;
    let all = meshes(&one(r#"unit="inch""#, &resources, build));
    let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["t.3mf: tip", "t.3mf: tip, copy 2"]);
    let near = |p: Point, [x, y, z]: Point| {
        let off = horma_core::length(horma_core::sub(p, [x * 25.4, y * 25.4, z * 25.4]));
        assert!(off < 1e-9, "{p:?}");
    };
    near(all[0].1.vertices()[1], [0.0, 11.0, 5.0]);
    near(all[1].1.vertices()[1], [0.0, -1.0, 5.0]);
    // Its outside is out still.
    assert_eq!(all[1].1.triangles()[0], [0, 1, 2]);
    let read = parse("t.3mf", &one(r#"unit="inch""#, &resources, build)).expect("valid");
    assert_eq!((read.unit.millimetres, read.stated), (25.4, true));
}

#[test]
fn objects_may_be_in_other_models_of_the_package() {
    let root = model(
        r#"requiredextensions="p""#,
        r#"<object id="1"><components><component p:path="/3D/b.model" objectid="1"/></components></object>"#,
        r#"<item objectid="1"/>"#,
    );
    let other = |attributes| model(attributes, &object(r#"id="1""#), "");
    let all = |other: &str| {
        package(&[
            ("_rels/.rels", RELATIONS),
            ("3D/b.model", other),
            ("3D/a.model", &root),
        ])
    };
    assert_eq!(meshes(&all(&other(""))).len(), 1);
    refused(&all(&other(r#"unit="meter""#)), "several units of length");
    let gone = package(&[("_rels/.rels", RELATIONS), ("3D/a.model", &root)]);
    refused(&gone, "3D/b.model");
}

#[test]
fn supports_are_left_out() {
    let resources = [object(r#"id="1""#), object(r#"id="2" type="support""#)].concat();
    let build = r#"<item objectid="1"/><item objectid="2"/>"#;
    let read = parse("t.3mf", &one("", &resources, build)).expect("valid");
    assert_eq!(read.bodies.len(), 1);
    assert!(read.warnings[0].to_string().ends_with("1 × support"));
}

#[test]
fn nonsense_is_refused_with_its_place() {
    let tip = object(r#"id="1""#);
    let item = r#"<item objectid="1"/>"#;
    refused(b"PK\x03\x04", "no ZIP archive");
    refused(&package(&[("x", "y")]), "3D/3dmodel.model");
    refused(&one("", &tip, r#"<item objectid="7"/>"#), "no object 7");
    refused(&one("", &tip, ""), "no triangle");
    refused(&one(r#"unit="ell""#, &tip, item), "'ell'");
    refused(
        &one(
            r#"requiredextensions="b" xmlns:b="http://x/beamlattice/2017/02""#,
            &tip,
            item,
        ),
        "extension b",
    );
    refused(
        &one("", &tip.replace("v1=\"0\"", "v1=\"x\""), item),
        "at byte",
    );
    refused(
        &one("", &tip.replace("x=\"1\"", "x=\"inf\""), item),
        "x of a vertex is 'inf'",
    );
    refused(
        &one("", &tip.replace("v3=\"1\"", "v3=\"9\""), item),
        "vertex 9",
    );
    let cut = model("", &tip, item);
    let cut = package(&[
        ("_rels/.rels", RELATIONS),
        ("3D/a.model", &cut[..cut.len() - 40]),
    ]);
    refused(&cut, "at byte");
    let round = r#"<object id="1"><components><component objectid="1"/><component objectid="1"/></components></object>"#;
    refused(&one("", round, item), "nested too deeply");
}
