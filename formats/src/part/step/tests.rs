use horma_core::Point;
use step_io::build::{
    CurveInput, FaceBoundInput, Frame, LengthUnit, Part, SurfaceInput, UnitsInput,
};
use step_io::{Orientation, StepBuilder};

use super::*;

/// Two surfaces without a face, one of them rational, and no unit.
pub(crate) const FREE: &str = "ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));
ENDSEC;
DATA;
#1=CARTESIAN_POINT('',(0.,0.,0.));
#2=CARTESIAN_POINT('',(0.,20.,0.));
#3=CARTESIAN_POINT('',(10.,0.,0.));
#4=CARTESIAN_POINT('',(10.,20.,0.));
#5=B_SPLINE_SURFACE_WITH_KNOTS('lone',1,1,((#1,#2),(#3,#4)),.UNSPECIFIED.,.F.,.F.,.U.,
  (2,2),(2,2),(0.,1.),(0.,1.),.UNSPECIFIED.);
#6=(BOUNDED_SURFACE()B_SPLINE_SURFACE(1,1,((#1,#2),(#3,#4)),.UNSPECIFIED.,.F.,.F.,.U.)
  B_SPLINE_SURFACE_WITH_KNOTS((2,2),(2,2),(0.,1.),(0.,1.),.UNSPECIFIED.)
  GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_SURFACE(((1.,2.),(1.,1.)))
  REPRESENTATION_ITEM('heavy')SURFACE());
#7=GEOMETRIC_SET('',(#5,#6));
ENDSEC;
END-ISO-10303-21;
";

/// A flat surface of 10 × 20.
fn patch() -> SurfaceInput {
    SurfaceInput::Nurbs(NurbsSurface {
        degree_u: 1,
        degree_v: 1,
        control_points: vec![
            vec![[0.0, 0.0, 0.0], [0.0, 20.0, 0.0]],
            vec![[10.0, 0.0, 0.0], [10.0, 20.0, 0.0]],
        ],
        weights: vec![vec![1.0; 2]; 2],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
    })
}

const WHOLE: [Point; 4] = [
    [0.0, 0.0, 0.0],
    [10.0, 0.0, 0.0],
    [10.0, 20.0, 0.0],
    [0.0, 20.0, 0.0],
];

/// A straight-edged loop through `corners`.
fn outline(b: &mut StepBuilder, corners: &[Point]) -> FaceBoundInput {
    let corners: Vec<_> = corners.iter().map(|&p| b.vertex(p).expect("ok")).collect();
    let mut edges = Vec::new();
    for (i, &start) in corners.iter().enumerate() {
        let end = corners[(i + 1) % corners.len()];
        let edge = b.edge(start, end, CurveInput::Line).expect("ok");
        edges.push((edge, Orientation::Forward));
    }
    FaceBoundInput::outer(edges)
}

/// A full circle of `radius` about Z at the height `z`.
fn ring(b: &mut StepBuilder, radius: f64, z: f64) -> FaceBoundInput {
    let v = b.vertex([radius, 0.0, z]).expect("ok");
    let circle = CurveInput::Circle(frame([0.0, 0.0, z]), radius);
    let edge = b.edge(v, v, circle).expect("ok");
    FaceBoundInput::outer(vec![(edge, Orientation::Forward)])
}

fn frame(origin: Point) -> Frame {
    Frame {
        origin,
        axis: [0.0, 0.0, 1.0],
        ref_dir: [1.0, 0.0, 0.0],
    }
}

fn add(b: &mut StepBuilder, part: Part, surface: SurfaceInput, bounds: Vec<FaceBoundInput>) {
    let face = b.face(surface, Orientation::Forward, bounds).expect("ok");
    b.solid(part, "body", vec![face]).expect("ok");
}

fn text(b: StepBuilder) -> Vec<u8> {
    let mut bytes = Vec::new();
    step_io::write(&b.finish(), &mut bytes).expect("written");
    bytes
}

/// A file with one face on `surface`.
fn one(surface: SurfaceInput, bounds: impl Fn(&mut StepBuilder) -> Vec<FaceBoundInput>) -> Vec<u8> {
    let mut b = StepBuilder::new();
    let part = b.part("last");
    let bounds = bounds(&mut b);
    add(&mut b, part, surface, bounds);
    text(b)
}

fn whole_patch() -> Vec<u8> {
    one(patch(), |b| vec![outline(b, &WHOLE)])
}

fn surfaces(bytes: &[u8]) -> Vec<(String, Surface)> {
    let bodies = parse("t.step", bytes, &Reading::default())
        .expect("valid")
        .bodies;
    let surface = |b: Body| match b.shape {
        Shape::Surface(surface) => (b.name, surface),
        Shape::Mesh(_) => unreachable!("STEP has surfaces only"),
    };
    bodies.into_iter().map(surface).collect()
}

#[track_caller]
fn refused(bytes: &[u8], expected: &str) {
    let error = parse("t.step", bytes, &Reading::default())
        .expect_err(expected)
        .to_string();
    assert!(
        error.starts_with("t.step: ") && error.contains(expected),
        "{error}"
    );
}

#[test]
fn an_untrimmed_face_is_its_surface() {
    let all = surfaces(&whole_patch());
    assert_eq!(all.len(), 1);
    assert_eq!(all[0].0, "t.step: surface 1 'body'");
    assert_eq!(all[0].1.poles()[2], [10.0, 0.0, 0.0]);
    assert_eq!(all[0].1.weights(), None);
    assert_eq!(
        parse("t.step", &whole_patch(), &Reading::default())
            .expect("valid")
            .warnings,
        []
    );
}

#[test]
fn a_trimmed_face_is_refused_by_name() {
    let cut = WHOLE.map(|p| if p[1] > 0.0 { [p[0], 19.0, 0.0] } else { p });
    refused(
        &one(patch(), |b| vec![outline(b, &cut)]),
        "surface 1 is trimmed inside",
    );
    let hole = WHOLE.map(|p| p.map(|c| c / 4.0 + 1.0));
    let holed = |b: &mut StepBuilder| vec![outline(b, &WHOLE), outline(b, &hole)];
    refused(
        &one(patch(), holed),
        "export it untrimmed, or the part as a mesh",
    );
}

#[test]
fn analytic_surfaces_become_the_same_splines() {
    let cylinder = SurfaceInput::Cylinder(frame([0.0; 3]), 5.0);
    let bytes = one(cylinder, |b| vec![ring(b, 5.0, 1.0), ring(b, 5.0, 9.0)]);
    let (_, surface) = surfaces(&bytes).remove(0);
    let points = surface.grid(&[0.3, 2.9], &[0.0, 1.0]);
    for (p, z) in points.iter().zip([1.0, 9.0, 1.0, 9.0]) {
        assert!((p[0].hypot(p[1]) - 5.0).abs() < 1e-12 && p[2] == z, "{p:?}");
    }
    let plane = || SurfaceInput::Plane(frame([0.0; 3]));
    let (_, surface) = surfaces(&one(plane(), |b| vec![outline(b, &WHOLE)])).remove(0);
    assert_eq!(surface.u().degree, 1);
    refused(
        &one(plane(), |b| vec![ring(b, 5.0, 0.0)]),
        "is trimmed inside",
    );
}

#[test]
fn lengths_become_millimetres() {
    let units = UnitsInput {
        length: LengthUnit::Metre,
        ..UnitsInput::default()
    };
    let mut b = StepBuilder::new_with(&units).expect("ok");
    let part = b.part("last");
    let bounds = vec![outline(&mut b, &WHOLE)];
    add(&mut b, part, patch(), bounds);
    let bytes = text(b);
    let loaded = parse("t.step", &bytes, &Reading::default()).expect("valid");
    let (_, surface) = surfaces(&bytes).remove(0);
    assert!((surface.poles()[2][0] - 10_000.0).abs() < 1e-9);
    let converted = "lengths are converted from metre to mm, times 1000";
    assert!(
        loaded.warnings[0].to_string().contains(converted),
        "{:?}",
        loaded.warnings
    );
}

#[test]
fn an_assembly_puts_its_parts_in_place() {
    let mut b = StepBuilder::new();
    let (pair, last) = (b.part("pair"), b.part("last"));
    let bounds = vec![outline(&mut b, &WHOLE)];
    add(&mut b, last, patch(), bounds);
    b.place(pair, last, frame([1.0, 2.0, 3.0])).expect("ok");
    let turned = Frame {
        ref_dir: [0.0, 1.0, 0.0],
        ..frame([100.0, 0.0, 0.0])
    };
    b.place(pair, last, turned).expect("ok");
    let all = surfaces(&text(b));
    assert_eq!(all.len(), 2);
    assert_eq!(all[1].0, "t.step: surface 1 'body', copy 2");
    assert_eq!(all[0].1.poles()[2], [11.0, 2.0, 3.0]);
    assert_eq!(all[1].1.poles()[2], [100.0, 10.0, 0.0]);
}

#[test]
fn free_surfaces_are_read_with_a_warning_about_units() {
    let all = surfaces(FREE.as_bytes());
    let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        ["t.step: surface 1 'lone'", "t.step: surface 2 'heavy'"]
    );
    assert_eq!(all[0].1.weights(), None);
    assert_eq!(all[1].1.weights(), Some(&[1.0, 2.0, 1.0, 1.0][..]));
    let warnings = parse("t.step", FREE.as_bytes(), &Reading::default())
        .expect("valid")
        .warnings;
    assert!(
        warnings[0].to_string().contains("lengths are taken as mm"),
        "{warnings:?}"
    );
}

#[test]
fn what_contradicts_itself_is_refused() {
    let check = |old: &str, new: &str, expected: &str| {
        assert!(FREE.contains(old), "{old}");
        refused(FREE.replacen(old, new, 1).as_bytes(), expected);
    };
    check("(2,2),(2,2)", "(2,3),(2,2)", "contradict each other");
    check(
        "((#1,#2),(#3,#4))",
        "((#1,#2),(#3))",
        "contradict each other",
    );
    check("1.,2.", "1.,-2.", "weight 1 is -2");
    check("(10.,0.,0.)", "(1.E20,0.,0.)", "beyond the 1000000 mm");
    check(
        "#4=",
        "#44=",
        "B_SPLINE_SURFACE_WITH_KNOTS cannot be read (cascade",
    );
    check("#5=B_SPLINE", "#5=C_SPLINE", "GEOMETRIC_SET cannot be read");
    check("10.,20.", "1.E400,20.", "numeric literal out of range");
    check("10.,20.", "NAN,20.", "not a readable STEP file");
    check("DATA;", "", "not a readable STEP file");
}

#[test]
fn a_file_without_a_surface_is_refused() {
    let points = FREE.split("#5=").next().expect("there").to_owned();
    refused(
        (points + "ENDSEC;\nEND-ISO-10303-21;\n").as_bytes(),
        "no surface",
    );
    refused(b"ISO-10303-21;", "not a readable STEP file");
    refused(b"not a STEP file", "not a readable STEP file");
}

#[test]
fn a_truncated_file_is_refused() {
    let bytes = whole_patch();
    for cut in (0..bytes.len() - 20).step_by(97) {
        assert!(
            parse("t.step", &bytes[..cut], &Reading::default()).is_err(),
            "cut at {cut}"
        );
    }
}
