use std::f64::consts::{PI, TAU};

use super::*;
use crate::part::{Body, Mesh};

/// A mesh of a tube along x: `radii(x, angle)` gives across and up.
fn tube(xs: &[f64], around: u32, at: impl Fn(f64, f64) -> [f64; 2]) -> Part {
    let mut vertices = Vec::new();
    for &x in xs {
        for k in 0..around {
            let [y, z] = at(x, TAU * f64::from(k) / f64::from(around));
            vertices.push([x, y, z]);
        }
    }
    let mut triangles = Vec::new();
    for row in 0..xs.len() as u32 - 1 {
        for k in 0..around {
            let [a, b] = [row * around + k, row * around + (k + 1) % around];
            triangles.extend([[a, b, a + around], [b, b + around, a + around]]);
        }
    }
    let mesh = Mesh::new("last", vertices, triangles).expect("valid");
    Part {
        bodies: vec![Body {
            name: "last".to_owned(),
            shape: Shape::Mesh(mesh),
        }],
    }
}

/// An ellipsoid of these half-axes, finely.
fn ellipsoid([a, b, c]: Point) -> Part {
    let xs: Vec<f64> = (0..=900)
        .map(|i| -a * (PI * f64::from(i) / 900.0).cos())
        .collect();
    tube(&xs, 1200, |x, angle| {
        let r = (1.0 - (x / a) * (x / a)).max(0.0).sqrt();
        [b * r * angle.sin(), c * r * angle.cos()]
    })
}

/// Perimeter of an ellipse by the arithmetic-geometric mean.
fn ellipse(a: f64, b: f64) -> f64 {
    let (mut x, mut y) = (a.max(b), a.min(b));
    let mut c = x * x - y * y;
    let (mut sum, mut power) = (c / 2.0, 1.0);
    while c > 1e-24 {
        let next = (x - y) / 2.0;
        (x, y) = ((x + y) / 2.0, (x * y).sqrt());
        c = next * next;
        sum += power * c;
        power *= 2.0;
    }
    TAU / x * (a.max(b) * a.max(b) - sum)
}

fn upright_last(choices: &[(Landmark, Choice)]) -> Last {
    Last {
        bodies: Vec::new(),
        frame: Frame::new(true, [0.0, 0.0, 1.0], true).expect("up"),
        choices: choices.to_vec(),
    }
}

fn close(a: f64, b: f64, within: f64, what: &str) {
    assert!((a - b).abs() <= within, "{what}: {a} instead of {b}");
}

#[test]
fn an_ellipsoid_measures_what_closed_forms_say() {
    let [a, b, c] = [130.0, 45.0, 40.0];
    let at = |landmark, x, y, z| (landmark, Choice::At([x, y, z]));
    let last = upright_last(&[
        at(Landmark::Heel, -a, 0.0, 0.0),
        at(Landmark::Toe, a, 0.0, 0.0),
        at(Landmark::Tread, 0.0, 0.0, -c),
        at(Landmark::BallInner, 0.0, b, 0.0),
        at(Landmark::BallOuter, 0.0, -b, 0.0),
        at(Landmark::Vamp, 0.0, 0.0, c),
        at(Landmark::Instep, 0.0, 0.0, c),
    ]);
    let measures = shape(&ellipsoid([a, b, c]), &last, None, false)
        .expect("a last")
        .measures;
    close(measures.length, 2.0 * a, 1e-9, "length");
    close(measures.ball_girth, ellipse(b, c), 0.01, "ball girth");
    close(measures.ball_width, 2.0 * b, 1e-9, "ball width");
    close(
        measures.bottom_length,
        ellipse(a, c) / 2.0,
        0.01,
        "bottom length",
    );
    close(
        measures.bottom_length_taped,
        ellipse(a, c) / 2.0,
        0.01,
        "taped",
    );
    close(
        measures.centre_line,
        ellipse(a, c) / 2.0,
        0.01,
        "centre line",
    );
    close(measures.heel_height, c, 1e-9, "heel height");
    // The plane from the heel's end up to the top cuts the upper half of an ellipse through the chord's middle.
    let middle = (2.0_f64).sqrt() / 2.0;
    let half = [a.hypot(c) / 2.0, b * middle];
    close(
        measures.cone_heel_line,
        ellipse(half[0], half[1]),
        0.01,
        "cone heel line",
    );
    let thick = 2.0 * c * (1.0 - 0.9_f64 * 0.9).sqrt();
    close(measures.toe_thickness, thick, 0.01, "toe thickness");
}

#[test]
fn a_cylinder_measures_what_closed_forms_say() {
    let xs: Vec<f64> = (0..=100).map(|i| f64::from(i) * 2.0).collect();
    let part = tube(&xs, 2400, |_, angle| {
        [30.0 * angle.sin(), 30.0 * angle.cos()]
    });
    let share = |landmark, share| (landmark, Choice::Share(share));
    let last = upright_last(&[
        share(Landmark::Heel, 0.1),
        share(Landmark::Toe, 0.9),
        share(Landmark::BallInner, 0.6),
        share(Landmark::BallOuter, 0.7),
        share(Landmark::Instep, 0.5),
    ]);
    let measures = shape(&part, &last, None, false).expect("a last").measures;
    close(measures.bottom_length, 160.0, 1e-6, "bottom length");
    close(measures.toe_thickness, 60.0, 0.001, "thickness");
    // The ball's plane goes aslant: 20 mm along over 60 across.
    let slant = 20.0_f64.hypot(60.0) / 2.0;
    close(
        measures.ball_girth,
        ellipse(30.0, slant),
        0.01,
        "ball girth",
    );
    // From the bottom at 20 mm to the top at 100.
    let long = 80.0_f64.hypot(60.0) / 2.0;
    close(
        measures.cone_heel_line,
        ellipse(30.0, long),
        0.01,
        "cone heel line",
    );
}

/// Something with a bottom, a ball and a cone.
fn like_a_last() -> Part {
    let xs: Vec<f64> = (0..=520).map(|i| 0.5 * f64::from(i)).collect();
    tube(&xs, 480, |x, angle| {
        let t = x / 260.0;
        let end = (1.0 - (2.0 * t - 1.0).powi(6)).max(0.0).sqrt();
        let wide = end * (30.0 + 14.0 * (-(t - 0.68) * (t - 0.68) / 0.03).exp());
        let high = end
            * (if t < 0.4 {
                55.0
            } else {
                55.0 - 60.0 * (t - 0.4)
            });
        let low = end * (12.0 + 8.0 * t);
        let (sin, cos) = angle.sin_cos();
        let lean = if sin > 0.0 { 0.05 } else { -0.05 };
        [
            wide * sin * (1.0 + lean),
            if cos > 0.0 { high * cos } else { low * cos },
        ]
    })
}

fn grading(geometric: bool, hold: Hold) -> Grading {
    Grading {
        base: 37.0,
        system: System::Paris,
        geometric,
        hold,
    }
}

#[test]
fn a_paris_point_is_two_thirds_of_a_centimetre_and_half_a_centimetre_of_girth() {
    let last = upright_last(&[]);
    let base = shape(&like_a_last(), &last, None, false).expect("a last");
    let held = Hold {
        heel_height: true,
        toe_spring: true,
        toe_thickness: true,
    };
    for hold in [Hold::default(), held] {
        for steps in [-1.5, 1.0, 4.0] {
            let grading = grading(false, hold);
            let size = Some((&grading, 37.0 + steps));
            let other = shape(&like_a_last(), &last, size, false).expect("a last");
            let (was, is) = (base.measures, other.measures);
            close(is.length, was.length + steps * 20.0 / 3.0, 1e-6, "length");
            close(is.ball_girth, was.ball_girth + steps * 5.0, 1e-6, "girth");
            if hold == held {
                close(is.heel_height, was.heel_height, 1e-9, "heel height");
                close(is.toe_spring, was.toe_spring, 1e-9, "toe spring");
                close(is.toe_thickness, was.toe_thickness, 1e-6, "toe thickness");
            } else {
                let girth = other.scale.girth;
                close(
                    is.toe_thickness,
                    girth * was.toe_thickness,
                    1e-6,
                    "thickness",
                );
                close(is.heel_height, girth * was.heel_height, 1e-6, "heel height");
            }
        }
    }
}

#[test]
fn geometric_sizes_grow_by_the_same_share() {
    let last = upright_last(&[]);
    let grading = grading(true, Hold::default());
    let at = |size| shape(&like_a_last(), &last, Some((&grading, size)), false).expect("a last");
    let [base, one, two] = [37.0, 38.0, 39.0].map(|size| at(size).measures);
    close(one.length, base.length + 20.0 / 3.0, 1e-9, "length");
    for (((name, base), (_, one)), (_, two)) in
        base.named().iter().zip(one.named()).zip(two.named())
    {
        close(one / base, two / one, 1e-9, name);
    }
    let small = shape(&like_a_last(), &last, Some((&grading, -200.0)), false);
    assert!(matches!(
        small,
        Err(Error::OutOfBounds {
            quantity: "size",
            ..
        })
    ));
}

#[test]
fn the_other_foot_measures_the_same_and_faces_outwards() {
    let last = upright_last(&[]);
    let [right, left] =
        [false, true].map(|m| shape(&like_a_last(), &last, None, m).expect("a last"));
    for ((name, a), (_, b)) in right.measures.named().iter().zip(left.measures.named()) {
        close(*a, b, 1e-9, name);
    }
    let volume = |part: &Part| -> f64 {
        let Shape::Mesh(mesh) = &part.bodies[0].shape else {
            unreachable!("a mesh")
        };
        let corner = |t: &[u32; 3]| t.map(|v| mesh.vertices()[v as usize]);
        mesh.triangles()
            .iter()
            .map(|t| {
                let [a, b, c] = corner(t);
                dot(a, cross(b, c)) / 6.0
            })
            .sum()
    };
    close(
        volume(&left.part),
        volume(&right.part),
        1e-6,
        "volume with its sign",
    );
}

#[test]
fn what_is_not_the_last_keeps_its_size_and_its_end() {
    let bar = |name: &str, from: f64| {
        let mut body = tube(&[from, from + 30.0], 12, |_, angle| {
            [5.0 * angle.sin(), 5.0 * angle.cos()]
        })
        .bodies
        .remove(0);
        body.name = name.to_owned();
        body
    };
    let mut part = like_a_last();
    part.bodies
        .extend([bar("toe holder", 255.0), bar("heel holder", -25.0)]);
    let last = Last {
        bodies: vec!["last".to_owned()],
        ..upright_last(&[])
    };
    let grading = grading(false, Hold::default());
    let shaped = shape(&part, &last, Some((&grading, 40.0)), false).expect("a last");
    let range = |k: usize| match &shaped.part.bodies[k].shape {
        Shape::Mesh(mesh) => mesh.x_range(),
        Shape::Surface(_) => unreachable!("a mesh"),
    };
    close(range(1).low, 275.0, 1e-9, "toe holder");
    close(range(1).high, 305.0, 1e-9, "toe holder");
    close(range(2).low, -25.0, 1e-9, "heel holder");
    close(shaped.travel(300.0), 320.0, 1e-9, "travel beyond the toe");
    close(shaped.travel(130.0), 140.0, 1e-9, "travel at the middle");
    let nobody = Last {
        bodies: vec!["boot".to_owned()],
        ..last
    };
    let error = shape(&part, &nobody, None, false).expect_err("nobody");
    assert!(error.to_string().contains("heel holder"), "{error}");
}
