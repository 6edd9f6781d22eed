use super::measure::to_triangle;
use super::*;
use crate::simd::Simd;
use crate::surface::tests::quarter_cylinder;
use crate::surface::{Direction, MAX_DEGREE};
use crate::vector::Point;

/// Clamped knots at the integers.
fn direction(degree: usize, count: usize) -> Direction {
    let last = (count - degree) as f64;
    let inner = (1..count - degree).map(|i| i as f64);
    let knots = std::iter::repeat_n(0.0, degree + 1).chain(inner);
    Direction {
        degree,
        knots: knots.chain(std::iter::repeat_n(last, degree + 1)).collect(),
    }
}

/// A surface whose poles are given by their numbers.
fn surface(u: Direction, v: Direction, pole: impl Fn(f64, f64) -> Point) -> Surface {
    let (m, n) = (u.count(), v.count());
    let all = (0..m).flat_map(|i| (0..n).map(move |j| (i as f64, j as f64)));
    let poles = all.map(|(i, j)| pole(i, j)).collect();
    Surface::new("s", u, v, poles, None).expect("valid")
}

fn wavy(degree: usize) -> Surface {
    surface(direction(degree, 14), direction(degree, 11), |i, j| {
        [
            8.0 * i,
            3.0 * (0.9 * i).sin() + 5.0 * (0.5 * j).cos(),
            6.0 * j + (i * 0.3).sin(),
        ]
    })
}

/// A ring of poles for each x, shrinking to a point at both ends.
fn pointed() -> Surface {
    surface(direction(3, 9), direction(3, 12), |i, j| {
        let (r, angle) = (4.0 * i * (8.0 - i), 0.5 * j);
        [20.0 * i, r * angle.cos(), r * angle.sin()]
    })
}

/// Two cubic pieces that meet at an angle.
fn creased() -> Surface {
    let u = Direction {
        degree: 3,
        knots: [[0.0; 4].as_slice(), &[0.37; 3], &[1.0; 4]].concat(),
    };
    surface(u, direction(2, 5), |i, j| {
        [10.0 * i, 7.0 * (i - 3.0).abs(), 10.0 * j + i * j]
    })
}

/// Nearly flat pieces of one millimetre and of a hundred in parameters that tell nothing of it.
fn ill_parametrized() -> Surface {
    let mut v = direction(3, 12);
    let stretched = |k: &mut f64| *k = if *k < 4.0 { *k * 1e-4 } else { *k * *k };
    v.knots.iter_mut().for_each(stretched);
    surface(direction(2, 5), v, |i, j| {
        [9.0 * i * i, (1.3 * j).sin() * 4.0, j * j * j]
    })
}

/// One piece, flat but for one pole far up.
fn bump() -> Surface {
    let d = || direction(MAX_DEGREE, MAX_DEGREE + 1);
    surface(d(), d(), |i, j| {
        let up = if (i, j) == (9.0, 5.0) { 60.0 } else { 0.0 };
        [4.0 * i, up, 4.0 * j]
    })
}

/// A short spike in a long surface of many pieces, which a coarse sampling does not meet.
fn spike() -> Surface {
    let mut u = direction(3, 40);
    let shrunk = |k: &mut f64| {
        *k = if *k > 20.0 {
            20.0 + (*k - 20.0) * 1e-2
        } else {
            *k
        }
    };
    u.knots.iter_mut().for_each(shrunk);
    surface(u, direction(1, 2), |i, j| {
        let up = if i == 30.0 { 2.0 } else { 0.0 };
        let x = if i > 20.0 { 200.0 + i / 10.0 } else { 10.0 * i };
        [x, up, 50.0 * j]
    })
}

fn all() -> Vec<(&'static str, Surface)> {
    vec![
        ("linear", wavy(1)),
        ("quadratic", wavy(2)),
        ("cubic", wavy(3)),
        ("quintic", wavy(5)),
        ("arc", quarter_cylinder(50.0, 100.0)),
        ("pointed", pointed()),
        ("creased", creased()),
        ("ill parametrized", ill_parametrized()),
        ("bump", bump()),
        ("spike", spike()),
    ]
}

/// Largest distance of a surface from the facets of a grid, at 7 × 7 places to a cell that are
/// not those of the measuring: to the nearest facet of the cell and of those around it.
fn deviation(surface: &Surface, us: &[f64], vs: &[f64]) -> f64 {
    const PLACES: usize = 7;
    let n = vs.len();
    let corners = surface.grid(us, vs);
    let places = |lines: &[f64]| -> Vec<f64> {
        let at = |w: &[f64], k: usize| w[0] + (w[1] - w[0]) * ((k as f64 + 0.43) / PLACES as f64);
        let cells = lines.windows(2);
        cells
            .flat_map(|w| (0..PLACES).map(move |k| at(w, k)))
            .collect()
    };
    let across = places(vs);
    let mut worst = 0.0_f64;
    for (i, &u) in places(us).iter().enumerate() {
        let row = i / PLACES;
        for (j, p) in surface.grid(&[u], &across).into_iter().enumerate() {
            let column = j / PLACES;
            let mut least = f64::INFINITY;
            for a in row.saturating_sub(1)..=(row + 1).min(us.len() - 2) {
                for b in column.saturating_sub(1)..=(column + 1).min(n - 2) {
                    let k = a * n + b;
                    let [w, x, y, z] = [k, k + 1, k + n, k + n + 1].map(|k| corners[k]);
                    least = least.min(to_triangle(p, [w, y, z]).0);
                    least = least.min(to_triangle(p, [w, z, x]).0);
                }
            }
            worst = worst.max(least);
        }
    }
    worst
}

#[test]
fn every_level_lays_the_same_lines() {
    let surfaces = [
        wavy(1),
        wavy(2),
        wavy(3),
        wavy(4),
        wavy(5),
        pointed(),
        creased(),
    ];
    let rational = quarter_cylinder(20.0, 30.0);
    for surface in surfaces.iter().chain([&rational]) {
        let lines = |simd: Simd| {
            let net = Net::by(simd.token(), surface);
            let lines = refine_net("s", &net, 0.02).expect("reached");
            let points = net.grid(&lines.us, &lines.vs);
            (lines.us, lines.vs, lines.deviation, points)
        };
        let scalar = lines(Simd::Scalar);
        for simd in Simd::available() {
            assert_eq!(lines(simd), scalar, "{simd}");
        }
    }
}

#[test]
fn the_tolerance_holds_between_the_samples() {
    for (name, surface) in all() {
        for tolerance in [1.0, 0.1, 0.02] {
            let grid = refine("s", &surface, tolerance).expect("reachable");
            let told = grid.deviation.expect("measured");
            let found = deviation(&surface, &grid.us, &grid.vs);
            let size = (grid.us.len(), grid.vs.len());
            assert!(told <= tolerance, "{name} {tolerance}: {told}");
            assert!(found <= tolerance, "{name} {tolerance}: {found} {size:?}");
        }
    }
}

/// Every second line, and the last.
fn halved(lines: &[f64]) -> Vec<f64> {
    let mut half: Vec<f64> = lines.iter().copied().step_by(2).collect();
    half.extend(lines.last().filter(|_| lines.len().is_multiple_of(2)));
    half
}

#[test]
fn half_the_lines_in_either_direction_would_not_do() {
    for (name, surface) in all() {
        for tolerance in [0.1, 0.01] {
            // Creases are lines, needed or not, and half the lines may by chance meet a peak.
            if name == "linear" || name == "spike" {
                continue;
            }
            let Lines { us, vs, .. } = refine("s", &surface, tolerance).expect("reachable");
            if us.len() > 2 {
                let found = deviation(&surface, &halved(&us), &vs);
                assert!(
                    found > SEEN * tolerance,
                    "{name} {tolerance}: {} rows, {found}",
                    us.len()
                );
            }
            if vs.len() > 2 {
                let found = deviation(&surface, &us, &halved(&vs));
                assert!(
                    found > SEEN * tolerance,
                    "{name} {tolerance}: {} columns, {found}",
                    vs.len()
                );
            }
        }
    }
}

#[test]
fn a_cylinder_gets_what_its_curvature_needs_and_no_more() {
    let surface = quarter_cylinder(50.0, 100.0);
    for tolerance in [1.0, 0.1, 0.01, 0.001] {
        let grid = refine("s", &surface, tolerance).expect("reachable");
        assert_eq!(grid.us.len(), 2, "straight along x");
        assert!(grid.deviation.expect("measured") <= tolerance);
        // The chord of an arc of angle a sags by r(1 − cos(a/2)).
        let angle = 2.0 * (1.0 - tolerance / 50.0_f64).acos();
        let needed = (std::f64::consts::FRAC_PI_2 / angle).ceil();
        let cells = (grid.vs.len() - 1) as f64;
        assert!(
            cells >= needed && cells <= 1.25 * needed,
            "{cells} {needed}"
        );
    }
}

#[test]
fn a_plane_is_one_cell_however_many_pieces_it_has() {
    let plane = surface(direction(3, 9), direction(2, 7), |i, j| {
        [5.0 * i, 2.0 * j, i - j]
    });
    let grid = refine("s", &plane, 0.001).expect("reachable");
    assert_eq!((grid.us.len(), grid.vs.len()), (2, 2));
}

#[test]
fn creases_are_lines() {
    for tolerance in [10.0, 0.1] {
        let grid = refine("s", &creased(), tolerance).expect("reachable");
        assert!(grid.us.contains(&0.37));
    }
    let grid = refine("s", &wavy(1), 100.0).expect("reachable");
    assert_eq!((grid.us.len(), grid.vs.len()), (14, 11));
}

#[test]
fn lines_are_the_same_for_any_number_of_threads() {
    for (name, surface) in all() {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().expect("a pool");
            let lines = pool.install(|| refine("s", &surface, 0.05).expect("reachable"));
            (lines.us, lines.vs, lines.deviation)
        };
        assert_eq!(with(1), with(2), "{name}");
    }
}

#[test]
fn an_unreachable_tolerance_is_refused() {
    let bump = surface(direction(2, 3), direction(2, 3), |i, j| {
        let (x, z) = (i * 1e5, j * 1e5);
        [x, (x * z).sqrt(), z]
    });
    let Err(Error::ToleranceNotReached { deviation, .. }) = refine("bump", &bump, 1e-6) else {
        panic!("it has too many points");
    };
    assert!(deviation > 1e-6);
}

/// On top of a torus the surface bends in one direction only, so that it takes the whole budget.
#[test]
fn a_torus_of_revolution_is_refined() {
    let s = std::f64::consts::FRAC_1_SQRT_2;
    // A full circle of four quarters: poles on a square, with its corners weighted.
    let square = [
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [-1.0, 1.0],
        [-1.0, 0.0],
        [-1.0, -1.0],
        [0.0, -1.0],
        [1.0, -1.0],
        [1.0, 0.0],
    ];
    let weight = |i: usize| if i % 2 == 1 { s } else { 1.0 };
    let knots = vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0];
    let direction = || Direction {
        degree: 2,
        knots: knots.clone(),
    };
    let (mut poles, mut weights) = (Vec::new(), Vec::new());
    for (i, [along, out]) in square.into_iter().enumerate() {
        for (j, [y, z]) in square.into_iter().enumerate() {
            let radius = 30.0 + 10.0 * out;
            poles.push([10.0 * along, radius * y, radius * z]);
            weights.push(weight(i) * weight(j));
        }
    }
    let torus = Surface::new("t", direction(), direction(), poles, Some(weights)).expect("valid");
    for tolerance in [0.1, 0.005] {
        let grid = refine("t", &torus, tolerance).expect("reachable");
        assert!(grid.deviation.expect("measured") <= tolerance);
    }
}
