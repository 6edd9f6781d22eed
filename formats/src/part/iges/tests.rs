use horma_core::{Point, Surface, length, sub};

use super::*;
use crate::part::{Trimmed, Unit};

/// An entity to be written: type, form, matrix, status and parameters.
#[derive(Clone)]
struct Written {
    kind: u32,
    form: u32,
    matrix: usize,
    status: &'static str,
    parameters: String,
}

fn entity(kind: u32, parameters: &str) -> Written {
    Written {
        kind,
        form: 0,
        matrix: 0,
        status: "00000000",
        parameters: parameters.to_owned(),
    }
}

/// The global section in millimetres.
const GLOBAL: &str = ",,4Hpart,6Ht.iges,5Hhorma,3H0.1,32,38,6,308,15,4Hpart,1.0,2,2HMM,1,0.1,\
    15H20261128.120000,1E-6,100.,2Hme,2Hus,11,0,15H20261128.120000;";

/// Lines of 80 columns: as many of text as a section has, its letter, and a number.
fn section(letter: char, texts: &[(String, String)]) -> String {
    let numbered = (1..).zip(texts);
    numbered
        .map(|(n, (text, owner))| format!("{text:<64}{owner:>8}{letter}{n:>7}\n"))
        .collect()
}

fn chunks(text: &str, width: usize) -> Vec<String> {
    text.as_bytes()
        .chunks(width)
        .map(|c| String::from_utf8_lossy(c).into_owned())
        .collect()
}

/// An IGES file with these entities, their D numbers being 1, 3, 5 …
fn file(global: &str, entities: &[Written]) -> Vec<u8> {
    let start = section('S', &[("a test".to_owned(), String::new())]);
    let wide: Vec<_> = chunks(global, 72)
        .into_iter()
        .map(|c| {
            let padded = format!("{c:<72}");
            (padded[..64].to_owned(), padded[64..].to_owned())
        })
        .collect();
    let mut directory = Vec::new();
    let mut data = Vec::new();
    for (i, e) in entities.iter().enumerate() {
        let lines = chunks(&format!("{},{}", e.kind, e.parameters), 64);
        let first = format!(
            "{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}",
            e.kind,
            data.len() + 1,
            0,
            0,
            0,
            0,
            e.matrix,
            0
        );
        directory.push((first, e.status.to_owned()));
        let second = format!(
            "{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}",
            e.kind,
            0,
            0,
            lines.len(),
            e.form,
            "",
            "",
            ""
        );
        directory.push((second, String::new()));
        let owner = 2 * i + 1;
        data.extend(lines.into_iter().map(|l| (l, owner.to_string())));
    }
    let counts = format!(
        "S{:>7}G{:>7}D{:>7}P{:>7}",
        1,
        wide.len(),
        directory.len(),
        data.len()
    );
    let end = section('T', &[(counts, String::new())]);
    let all = [
        start,
        section('G', &wide),
        section('D', &directory),
        section('P', &data),
        end,
    ];
    all.concat().into_bytes()
}

/// A flat surface of 10 × 20, 128; u along x.
const PATCH: &str = "1,1,1,1,0,0,1,0,0,0.,0.,1.,1.,0.,0.,1.D0,1.d0,1.,1.,1.,1.,\
    0.,0.,0., 1.0E+01,0.,0., 0.,2.D1,0., 10.,20.,0., 0.,1.,0.,1.;";

/// The same with a weight.
const HEAVY: &str = "1,1,1,1,0,0,0,0,0,0.,0.,1.,1.,0.,0.,1.,1.,1.,2.,1.,1.,\
    0.,0.,0.,10.,0.,0.,0.,20.,0.,10.,20.,0.,0.,1.,0.,1.;";

pub(crate) fn patch() -> Vec<u8> {
    file(GLOBAL, &[entity(128, PATCH)])
}

fn loaded(bytes: &[u8]) -> Loaded {
    parse("t.igs", bytes, &Reading::default()).expect("valid")
}

fn surfaces(bytes: &[u8]) -> Vec<Surface> {
    let surface = |b: Body| match b.shape {
        Shape::Surface(surface) => surface,
        Shape::Mesh(_) => unreachable!("IGES has surfaces only"),
    };
    loaded(bytes).bodies.into_iter().map(surface).collect()
}

fn corners(surface: &Surface) -> Vec<Point> {
    let [u, v] = [surface.u(), surface.v()].map(horma_core::Direction::domain);
    surface.grid(&[u.0, u.1], &[v.0, v.1])
}

#[track_caller]
fn refused(bytes: &[u8], expected: &str) {
    let error = parse("t.igs", bytes, &Reading::default());
    let error = error.expect_err(expected).to_string();
    assert!(
        error.starts_with("t.igs") && error.contains(expected),
        "{error}"
    );
}

const AT: [Point; 4] = [
    [0.0, 0.0, 0.0],
    [0.0, 20.0, 0.0],
    [10.0, 0.0, 0.0],
    [10.0, 20.0, 0.0],
];

#[test]
fn a_surface_is_read_as_it_is() {
    let read = loaded(&patch());
    assert_eq!(read.warnings, []);
    assert_eq!((read.unit, read.stated), (Unit::default(), true));
    assert_eq!(read.bodies[0].name, "t.igs: surface 1");
    let all = surfaces(&file(GLOBAL, &[entity(128, PATCH), entity(128, HEAVY)]));
    assert_eq!(corners(&all[0]), AT);
    assert_eq!(all[0].weights(), None);
    // u runs fastest in the file, v in a surface: the weight is that of the corner at (10, 0).
    assert_eq!(all[1].weights(), Some(&[1.0, 1.0, 2.0, 1.0][..]));
    assert_eq!(all[1].poles()[2], [10.0, 0.0, 0.0]);
}

#[test]
fn lines_may_end_in_any_way() {
    let plain = patch();
    let text = String::from_utf8_lossy(&plain);
    let bare: Vec<u8> = text.replace('\n', "").into_bytes();
    let windows = text.replace('\n', "\r\n").into_bytes();
    let padded = text.replace('\n', "   \n\n").into_bytes();
    let with_end = [&windows[..], b"\x1a"].concat();
    for other in [bare, windows, padded, with_end] {
        assert_eq!(loaded(&other), loaded(&plain));
    }
}

#[test]
fn delimiters_and_strings_of_all_kinds() {
    let odd = GLOBAL.replace(',', "/").replace(';', "#");
    let odd = format!("1H//1H#{}", &odd[1..]).replace("4Hpart", "7H;,/#1H/");
    let entities = [entity(128, &PATCH.replace(',', "/").replace(';', "#"))];
    let mut bytes = String::from_utf8_lossy(&file(&odd, &entities)).into_owned();
    // The type of an entity is a parameter as well.
    bytes = bytes.replace("128,1/", "128/1/");
    assert_eq!(loaded(bytes.as_bytes()).bodies, loaded(&patch()).bodies);
    refused(&file("1HA1HB;", &[]), "cannot be a delimiter");
    refused(&file("1H//1H/;", &[]), "same delimiter");
    refused(&file("1H/,4Hpart;", &[]), "followed by");
    refused(&file(",,99Hpart,;", &[]), "runs over its end");
    refused(&file(",,4Hpart", &[]), "has no end");
}

#[test]
fn units_are_those_of_flag_name_and_scale() {
    let check = |from: &str, factor: f64, warnings: usize| {
        let read = loaded(&file(
            &GLOBAL.replace("1.0,2,2HMM", from),
            &[entity(128, PATCH)],
        ));
        let Shape::Surface(surface) = &read.bodies[0].shape else {
            unreachable!("a surface")
        };
        assert_eq!(
            corners(surface)[3],
            [10.0 * factor, 20.0 * factor, 0.0],
            "{from}"
        );
        assert_eq!(read.warnings.len(), warnings, "{from}: {:?}", read.warnings);
    };
    check("1.0,2,", 1.0, 0);
    check(",2,2HMM", 1.0, 0);
    check("1.0,1,4HINCH", 25.4, 1);
    check("1.0,1,2HIN", 25.4, 1);
    check("1.0,6,1HM", 1000.0, 1);
    check("1.0,3,2Hmm", 1.0, 0);
    check("1.0,,2HCM", 10.0, 1);
    check("0.5,2,2HMM", 2.0, 1);
    // Nothing at all: inches, as the standard has it.
    check("1.0,,", 25.4, 2);
    let none = file(
        &GLOBAL.replace("1.0,2,2HMM", "1.0,,"),
        &[entity(128, PATCH)],
    );
    let reading = Reading {
        unit: Unit::named("mm"),
        ..Reading::default()
    };
    let read = parse("t.igs", &none, &reading).expect("valid");
    assert_eq!((read.unit, read.stated), (Unit::default(), false));
    assert_eq!(read.warnings, []);
    let wrong = |from: &str, expected: &str| {
        let global = GLOBAL.replace("1.0,2,2HMM", from);
        refused(&file(&global, &[entity(128, PATCH)]), expected);
    };
    wrong(
        "1.0,2,2HIN",
        "flag says that its unit of length is the millimetre, but its name IN",
    );
    wrong("1.0,3,3HELL", "called 'ELL'");
    wrong("1.0,12,2HMM", "is '12', not 1 to 11");
    wrong("-1.0,2,2HMM", "scale");
}

#[test]
fn matrices_put_surfaces_where_they_belong() {
    // About Z by 90°, and then along x by 5.
    let turn = entity(124, "0.,-1.,0.,0.,1.,0.,0.,0.,0.,0.,1.,0.;");
    let turn = Written { matrix: 5, ..turn };
    let shift = entity(124, "1.,0.,0.,5.,0.,1.,0.,0.,0.,0.,1.,0.;");
    let placed = |matrix| Written {
        matrix,
        ..entity(128, PATCH)
    };
    let all = [placed(3), turn.clone(), shift];
    let surface = surfaces(&file(GLOBAL, &all)).remove(0);
    assert_eq!(corners(&surface)[3], [-15.0, 10.0, 0.0]);
    // The surface's own, and then that of its face.
    let face = Written {
        matrix: 5,
        ..entity(144, "1,0,0,0;")
    };
    let turn = Written { matrix: 0, ..turn };
    let all = [placed(3), turn.clone(), all[2].clone(), face];
    let surface = surfaces(&file(GLOBAL, &all)).remove(0);
    assert_eq!(corners(&surface)[3], [-15.0, 10.0, 0.0]);
    let round = Written { matrix: 3, ..turn };
    refused(&file(GLOBAL, &[placed(3), round]), "without an end");
    refused(&file(GLOBAL, &[placed(1)]), "matrix is not there");
}

/// A trimmed patch whose outer boundary in parameters is these curves, in a composite one.
fn trimmed(curves: &[&str]) -> Vec<u8> {
    let numbers: Vec<String> = (0..curves.len()).map(|i| (9 + 2 * i).to_string()).collect();
    let composite = format!("{},{};", curves.len(), numbers.join(","));
    let mut all = vec![
        entity(128, PATCH),
        entity(144, "1,1,0,5;"),
        entity(142, "1,1,7,0,1;"),
        entity(102, &composite),
    ];
    all.extend(curves.iter().map(|c| {
        let (kind, rest) = c.split_once(':').expect("a kind");
        entity(kind.parse().expect("a number"), rest)
    }));
    for part in &mut all[2..] {
        part.status = "00010500";
    }
    all[0].status = "00010000";
    file(GLOBAL, &all)
}

#[test]
fn a_face_that_is_its_whole_surface_is_taken() {
    let line = "110:0.,0.,0.,1.,0.,0.;";
    let spline = "126:1,1,0,0,1,0,0.,0.,1.,1.,1.,1.,1.,0.,0.,1.,1.,0.,0.,1.,0.,0.,1.;";
    let round = ["110:1.,1.,0.,0.,1.,0.;", "110:0.,1.,0.,0.,0.,0.;"];
    let read = loaded(&trimmed(&[line, spline, round[0], round[1]]));
    assert_eq!((read.bodies.len(), read.warnings), (1, vec![]));
    let untrimmed = [entity(128, PATCH), entity(144, "1,0,0,0;")];
    let read = loaded(&file(GLOBAL, &untrimmed));
    assert_eq!((read.bodies.len(), read.warnings), (1, vec![]));
    // Bounded by a curve in parameters, and a face of a solid.
    let outline = "106:1,5,0.,0.,0.,1.,0.,1.,1.,0.,1.,0.,0.;"
        .split_once(':')
        .expect("two");
    let outline = Written {
        form: 11,
        ..entity(106, outline.1)
    };
    let bounded = [
        entity(128, PATCH),
        entity(143, "1,1,1,5;"),
        entity(141, "1,1,1,1,7,1,1,7;"),
        outline.clone(),
    ];
    assert_eq!(loaded(&file(GLOBAL, &bounded)).bodies.len(), 1);
    let solid = [
        entity(128, PATCH),
        entity(510, "1,1,1,5;"),
        entity(508, "2,0,0,1,1,1,0,7,1,0,1,1,0;"),
        outline,
    ];
    assert_eq!(loaded(&file(GLOBAL, &solid)).bodies.len(), 1);
}

#[test]
fn a_face_that_is_trimmed_inside_is_refused_or_counts_whole() {
    let inside = trimmed(&["110:0.,0.,0.,1.,0.,0.;", "110:1.,0.,0.,0.,1.,0.;"]);
    let in_space = file(
        GLOBAL,
        &[
            entity(128, PATCH),
            entity(144, "1,1,0,5;"),
            entity(142, "1,1,0,7,1;"),
            entity(110, "0.,0.,0.,10.,0.,0.;"),
        ],
    );
    let part = PATCH.replace("0.,1.,0.,1.;", "0.,0.5,0.,1.;");
    let part = file(GLOBAL, &[entity(128, &part)]);
    let whole = Reading {
        trimmed: Trimmed::Whole,
        ..Reading::default()
    };
    for bytes in [inside, in_space, part] {
        refused(&bytes, "surface 1 is trimmed inside its surface");
        let read = parse("t.igs", &bytes, &whole).expect("valid");
        let faces = |w: &Warning| matches!(w, Warning::Whole { faces: 1, .. });
        assert!(read.warnings.iter().any(faces), "{:?}", read.warnings);
        assert_eq!(read.bodies.len(), 1);
    }
}

#[test]
fn patches_of_a_parametric_spline_surface_become_one() {
    // x = s, y = t, z = s²·t over two patches in s, from 0 to 1 and from 1 to 3: with s from 1 on,
    // s² is 1 + 2s + s².
    let coefficients = |x0: f64, square: [f64; 3]| {
        let mut all = [0.0; 48];
        (all[0], all[1], all[16 + 4]) = (x0, 1.0, 1.0);
        all[32 + 4..32 + 7].copy_from_slice(&square);
        all.map(|c| c.to_string()).join(",")
    };
    let [a, b] = [
        coefficients(0.0, [0.0, 0.0, 1.0]),
        coefficients(1.0, [1.0, 2.0, 1.0]),
    ];
    let nothing = [0.5; 48].map(|c| c.to_string()).join(",");
    let header = "3,1,2,1,0.,1.,3.,0.,2.";
    let bare = format!("{header},{a},{b};");
    let padded = format!("{header},{a},{nothing},{b},{nothing},{nothing},{nothing};");
    for parameters in [bare, padded] {
        let surface = surfaces(&file(GLOBAL, &[entity(114, &parameters)])).remove(0);
        for (s, t) in [(0.0, 0.0), (0.5, 2.0), (1.0, 0.5), (1.7, 1.3), (3.0, 2.0)] {
            let point = surface.grid(&[s], &[t])[0];
            let off = length(sub(point, [s, t, s * s * t]));
            assert!(off < 1e-12, "{off} at {s} {t}");
        }
    }
    let torn = format!("{header},{a},{};", coefficients(1.5, [1.0, 2.0, 1.0]));
    refused(
        &file(GLOBAL, &[entity(114, &torn)]),
        "patch 2 × 1 does not meet",
    );
    refused(&file(GLOBAL, &[entity(114, "3,1,9,9;")]), "make no sense");
}

#[test]
fn what_is_no_surface_is_passed_over_and_told() {
    let point = entity(116, "1.,2.,3.,0;");
    let hidden = Written {
        status: "01000000",
        ..entity(128, PATCH)
    };
    let group = entity(402, "1,1;");
    let all = [
        entity(128, PATCH),
        point.clone(),
        point.clone(),
        hidden.clone(),
        group,
    ];
    let warnings = loaded(&file(GLOBAL, &all)).warnings;
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings[0].contains("1 surfaces are hidden"),
        "{warnings:?}"
    );
    assert!(warnings[1].ends_with("2 × point (116)"), "{warnings:?}");
    refused(
        &file(GLOBAL, &[point, hidden]),
        "there is 1 × point (116), 1 hidden surfaces. Export",
    );
    refused(&file(GLOBAL, &[]), "there is nothing");
}

#[test]
fn surfaces_that_are_not_read_are_refused_by_name() {
    let cylinder = [entity(128, PATCH), entity(192, "1,3,5.,0;")];
    refused(
        &file(GLOBAL, &cylinder),
        "entity 192 at D3 lies on a cylinder",
    );
    let under = [entity(120, "1,1,0.,6.;"), entity(144, "1,0,0,0;")];
    refused(&file(GLOBAL, &under), "surface of revolution");
    let copies = [
        entity(128, PATCH),
        entity(308, "0,3Hsub,1,1;"),
        entity(408, "3,5.,0.,0.,1.;"),
    ];
    refused(&file(GLOBAL, &copies), "copy of shapes");
    // Drawn twice, which nobody cuts.
    let drawn = [
        entity(128, PATCH),
        entity(308, "0,3Hsub,1,7;"),
        entity(408, "3,5.,0.,0.,1.;"),
        entity(110, "0.,0.,0.,1.,0.,0.;"),
    ];
    assert_eq!(loaded(&file(GLOBAL, &drawn)).bodies.len(), 1);
}

#[test]
fn damage_is_refused_by_place() {
    let good = patch();
    let text = String::from_utf8_lossy(&good).into_owned();
    let lines: Vec<&str> = text.lines().collect();
    let without = |i: usize| {
        let mut lines = lines.clone();
        lines.remove(i);
        lines.join("\n").into_bytes()
    };
    let last = lines.len() - 1;
    refused(&without(last), "cut short");
    refused(&without(last - 1), "section P should have");
    refused(&without(last - 2), "is numbered");
    refused(
        text.replacen("S      1", "", 1).as_bytes(),
        "line 1: a line of IGES",
    );
    refused(
        text.replacen("D      1", "X      1", 1).as_bytes(),
        "has 'X'",
    );
    refused(
        text.replacen("S      1", "C      1", 1).as_bytes(),
        "compressed form",
    );
    refused(
        text.replacen("S      1", "B      1", 1).as_bytes(),
        "binary form",
    );
    let check = |from: &str, to: &str, expected: &str| {
        let changed = PATCH.replacen(from, to, 1);
        assert_ne!(changed, PATCH);
        refused(&file(GLOBAL, &[entity(128, &changed)]), expected);
    };
    check("1,1,1,1,", "x,1,1,1,", "parameter 1 is 'x'");
    check("1,1,1,1,", "99999999999,1,1,1,", "make no sense");
    check("1,1,1,1,", "1,1,2,1,", "fewer poles than its degree");
    check("1.D0", "inf", "is 'inf', not a number");
    check(
        "0.,0.,1.,1.,",
        "0.,2.,1.,1.,",
        "is smaller than the one before it",
    );
    check(",20.,0., 0.,1.,0.,1.;", ";", "numbers should follow");
    refused(
        &file(GLOBAL, &[entity(144, "99,0,0,0;")]),
        "surface D99 is not there",
    );
}
