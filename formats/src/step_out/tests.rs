use horma_core::{Body, Shape};

use super::*;
use crate::part::{self, Format, Reading};

/// A direction of degree `degree` with `poles` poles, clamped, on irregular knots.
fn direction(degree: usize, poles: usize) -> Direction {
    let inner = (1..poles - degree).map(|i| (i * i) as f64 / 3.0);
    let end = ((poles - degree) * (poles - degree)) as f64 / 3.0;
    let mut knots = vec![0.0; degree + 1];
    knots.extend(inner);
    knots.extend(vec![end; degree + 1]);
    Direction { degree, knots }
}

/// A bumpy surface over the given net, with weights if `rational`.
fn surface(m: usize, n: usize, rational: bool, place: impl Fn(usize, usize) -> Point) -> Surface {
    let cells = || (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
    let weights = cells().map(|(i, j)| 1.0 + ((i * 7 + j * 3) % 5) as f64 / 7.0);
    Surface::new(
        "s",
        direction(2, m),
        direction(3, n),
        cells().map(|(i, j)| place(i, j)).collect(),
        rational.then(|| weights.collect()),
    )
    .expect("valid")
}

#[track_caller]
fn read_back(surfaces: &[(&str, &Surface)]) -> Vec<Body> {
    let text = write("parts.step", surfaces);
    let loaded = part::parse(
        "parts.step",
        Format::Step,
        text.as_bytes(),
        &Reading::default(),
    )
    .expect("readable");
    assert_eq!(loaded.warnings, []);
    let shapes: Vec<&Shape> = loaded.bodies.iter().map(|b| &b.shape).collect();
    let expected: Vec<Shape> = surfaces
        .iter()
        .map(|&(_, s)| Shape::Surface(s.clone()))
        .collect();
    assert_eq!(shapes, expected.iter().collect::<Vec<_>>());
    loaded.bodies
}

#[test]
fn open_surfaces_read_back_as_the_same_numbers() {
    let bump = |i: usize, j: usize| {
        let third = (i * j) as f64 / 3.0;
        [i as f64 * 10.0, j as f64 * 1.0e-7, third]
    };
    let plain = surface(5, 6, false, bump);
    let bent = surface(4, 5, true, |i, j| bump(i, j).map(|c| c - 1.0 / 7.0));
    read_back(&[("plain", &plain), ("bent", &bent)]);
}

#[test]
fn seams_and_collapsed_sides_read_back() {
    let closed = surface(4, 5, false, |i, j| {
        [
            i as f64,
            [0.0, 2.0, 3.0, -2.0, 0.0][j],
            [0.0, 0.0, 2.0, 2.0, 0.0][j],
        ]
    });
    let pointed = surface(4, 4, false, |i, j| {
        [i as f64, (i * j) as f64, (i * (3 - j)) as f64]
    });
    read_back(&[("closed", &closed), ("pointed", &pointed)]);
}

#[test]
fn names_of_every_kind_survive() {
    let s = surface(4, 4, false, |i, j| [i as f64, j as f64, 0.0]);
    for name in ["toe holder", "l'horma \\ 1", "sección 鞋 🥾"] {
        let bodies = read_back(&[(name, &s)]);
        assert!(bodies[0].name.contains(name), "{}", bodies[0].name);
    }
}

#[test]
fn numbers_are_short_and_have_a_point() {
    assert_eq!(real(-0.0), "0.");
    assert_eq!(real(260.0), "260.");
    assert_eq!(real(0.1), "0.1");
    assert_eq!(real(1.0 / 3.0), "0.3333333333333333");
}
