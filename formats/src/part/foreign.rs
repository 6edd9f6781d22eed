//! Files that are no parts here: what they are, by their names or by how they begin, and what to do.

/// What to do with points.
pub(super) const POINTS: &str = "points have no surface that a cutter could touch; make one of them, in \
    MeshLab (Filters, Remeshing, Screened Poisson) or CloudCompare (Plugins, PoissonRecon), and export that as STL or PLY";

/// What to do with the files of a CAD system.
const EXPORT: &str =
    "export the part as STEP (AP214 or AP242) with untrimmed surfaces, or as a mesh (STL)";

/// What to do with other meshes.
const MESH: &str = "export or convert it as STL, OBJ, PLY or 3MF";

/// What to do with drawings.
const DRAWING: &str =
    "a drawing has no surfaces; export the solid or surface model as STEP, IGES or STL";

/// What to do with archives.
const ARCHIVE: &str = "unpack it and name the file in it";

/// Names of formats, by the extension.
const EXTENSIONS: [(&[&str], &str, &str); 28] = [
    (
        &[
            "asc", "xyz", "pts", "ptx", "txt", "csv", "pcd", "xyzn", "xyzrgb",
        ],
        "a list of points",
        POINTS,
    ),
    (&["las", "laz", "e57"], "a point scan", POINTS),
    (
        &["dxf", "dwg", "svg", "pdf", "eps", "ai"],
        "a drawing",
        DRAWING,
    ),
    (
        &["x_t", "x_b", "xmt_txt", "xmt_bin"],
        "a Parasolid file",
        EXPORT,
    ),
    (&["sat", "sab"], "an ACIS file", EXPORT),
    (&["sldprt", "sldasm"], "a SOLIDWORKS file", EXPORT),
    (&["ipt", "iam"], "an Inventor file", EXPORT),
    (&["catpart", "catproduct", "cgr"], "a CATIA file", EXPORT),
    (&["par", "psm"], "a Solid Edge file", EXPORT),
    (&["f3d", "f3z"], "a Fusion file", EXPORT),
    (&["fcstd"], "a FreeCAD file", EXPORT),
    (&["3dm"], "a Rhino file", EXPORT),
    (&["jt"], "a JT file", EXPORT),
    (&["skp"], "a SketchUp file", MESH),
    (&["brep", "brp"], "an Open CASCADE file", EXPORT),
    (&["stpz", "p21z"], "a compressed STEP file", ARCHIVE),
    (
        &["stpx", "stpxz"],
        "a STEP file in XML",
        "export it as plain STEP (.stp)",
    ),
    (&["vda", "vdafs"], "a VDA-FS file", EXPORT),
    (&["gltf", "glb"], "a glTF file", MESH),
    (&["amf"], "an AMF file", MESH),
    (&["off", "noff"], "an OFF file", MESH),
    (&["wrl", "vrml", "x3d"], "a VRML or X3D file", MESH),
    (
        &[
            "fbx", "dae", "3ds", "blend", "max", "ma", "mb", "c4d", "lwo", "usd", "usda", "usdc",
            "usdz",
        ],
        "a scene of a modeller",
        MESH,
    ),
    (
        &["msh", "inp", "bdf", "nas", "unv", "vtk", "vtu", "vtp"],
        "a mesh for simulation",
        MESH,
    ),
    (
        &["ctm", "drc", "zpr", "ztl", "zbr"],
        "a compressed mesh",
        MESH,
    ),
    (
        &["zip", "gz", "7z", "rar", "tar", "bz2", "xz", "zst"],
        "an archive",
        ARCHIVE,
    ),
    (
        &["toml"],
        "a job",
        "horma run JOB works it out; name the part files in it",
    ),
    (
        &["ngc", "nc", "tap", "mpf", "gcode", "cnc", "apt"],
        "a program",
        "name the part that it is for",
    ),
];

/// Names of formats, by the first bytes.
const BEGINNINGS: [(&[u8], &str, &str); 21] = [
    (b"**ABCDEFGHIJKLMNOPQRSTUVWXYZ", "a Parasolid file", EXPORT),
    (b"**PARASOLID", "a Parasolid file", EXPORT),
    (b"ACIS BinaryFile", "an ACIS file", EXPORT),
    (
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "the file of a CAD system",
        EXPORT,
    ),
    (b"V5_CFV2", "a CATIA file", EXPORT),
    (b"3D Geometry File Format", "a Rhino file", EXPORT),
    (b"DBRep_DrawableShape", "an Open CASCADE file", EXPORT),
    (b"CASCADE Topology", "an Open CASCADE file", EXPORT),
    (b"glTF", "a glTF file", MESH),
    (b"Kaydara FBX Binary", "a scene of a modeller", MESH),
    (b"BLENDER", "a scene of a modeller", MESH),
    (b"#VRML", "a VRML or X3D file", MESH),
    (b"OFF\n", "an OFF file", MESH),
    (b"OFF\r\n", "an OFF file", MESH),
    (b"AC10", "a drawing", DRAWING),
    (b"%PDF", "a drawing", DRAWING),
    (b"AutoCAD Binary DXF", "a drawing", DRAWING),
    (b"# .PCD", "a list of points", POINTS),
    (b"LASF", "a point scan", POINTS),
    (b"\x1f\x8b", "an archive", ARCHIVE),
    (b"PK\x03\x04", "an archive", ARCHIVE),
];

/// What a file with this extension, in lower case, is, and what to do.
pub(super) fn by_extension(extension: &str) -> Option<(&'static str, &'static str)> {
    let known = EXTENSIONS
        .iter()
        .find(|(all, _, _)| all.contains(&extension));
    known.map(|&(_, what, advice)| (what, advice))
}

/// What a file that begins so is, and what to do.
pub(super) fn by_content(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let text = bytes.trim_ascii_start();
    if let Some(&(_, what, advice)) = BEGINNINGS.iter().find(|(b, _, _)| text.starts_with(b)) {
        return Some((what, advice));
    }
    let head = String::from_utf8_lossy(&text[..text.len().min(2000)]);
    if head.contains("<amf") {
        return Some(("an AMF file", MESH));
    }
    if head.starts_with("0\n") || head.starts_with("0\r\n") {
        let second = head.lines().nth(1).unwrap_or_default().trim();
        return (second == "SECTION").then_some(("a drawing", DRAWING));
    }
    if head.starts_with('{') && head.contains("\"asset\"") {
        return Some(("a glTF file", MESH));
    }
    is_points(&head).then_some(("a list of points", POINTS))
}

/// Whether the first lines are nothing but numbers, as many in each and three at least.
fn is_points(head: &str) -> bool {
    let all: Vec<&str> = head.lines().map(str::trim).collect();
    // The last one may be cut.
    let whole = &all[..all.len().saturating_sub(1).min(8)];
    let count = |line: &str| {
        let words = line.split(|c: char| c.is_whitespace() || c == ',' || c == ';');
        let words: Vec<&str> = words.filter(|w| !w.is_empty()).collect();
        let numbers = words.iter().all(|w| w.parse::<f64>().is_ok());
        (numbers && words.len() >= 3).then_some(words.len())
    };
    let first = whole.first().and_then(|line| count(line));
    whole.len() >= 2 && first.is_some() && whole.iter().all(|line| count(line) == first)
}
