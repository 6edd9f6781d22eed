use std::f64::consts::FRAC_1_SQRT_2;

use proptest::prelude::*;

use super::*;
use crate::part::{Body, Mesh, Shape};
use crate::surface::{Direction, Surface};

/// A surface of revolution about the line y = `off`, z = 0 with radii at travels, straight between.
fn turned(profile: &[(f64, f64)], off: f64) -> Part {
    let c = FRAC_1_SQRT_2;
    let ring = [
        (1.0, 0.0, 1.0),
        (1.0, 1.0, c),
        (0.0, 1.0, 1.0),
        (-1.0, 1.0, c),
        (-1.0, 0.0, 1.0),
        (-1.0, -1.0, c),
        (0.0, -1.0, 1.0),
        (1.0, -1.0, c),
        (1.0, 0.0, 1.0),
    ];
    let poles = profile
        .iter()
        .flat_map(|&(x, r)| ring.map(|(y, z, _)| [x, off + r * y, r * z]))
        .collect();
    let weights = ring.map(|(_, _, w)| w).repeat(profile.len());
    let n = profile.len();
    let knot = |i: usize| i.saturating_sub(1).min(n - 1) as f64;
    let u = Direction {
        degree: 1,
        knots: (0..n + 2).map(knot).collect(),
    };
    let v = Direction {
        degree: 2,
        knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0],
    };
    let surface = Surface::new("turned", u, v, poles, Some(weights)).expect("valid");
    Part {
        bodies: vec![Body {
            name: "turned".to_owned(),
            shape: Shape::Surface(surface),
        }],
    }
}

fn mesh(vertices: Vec<Point>, triangles: Vec<[u32; 3]>) -> Part {
    Part {
        bodies: vec![Body {
            name: "mesh".to_owned(),
            shape: Shape::Mesh(Mesh::new("mesh", vertices, triangles).expect("valid")),
        }],
    }
}

/// A helix from `from` to `to`, with a height for each angle.
fn helix(
    from: f64,
    to: f64,
    step: f64,
    ppr: usize,
    height: impl Fn(f64) -> Option<f64>,
) -> Vec<Position> {
    let count = ((to - from) / step * ppr as f64) as usize;
    (0..=count)
        .map(|i| {
            let angle = 360.0 * i as f64 / ppr as f64;
            Position {
                x: from + step * i as f64 / ppr as f64,
                angle,
                height: height(angle.to_radians()),
            }
        })
        .collect()
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found}, but {expected} expected"
    );
}

/// The search that this module is there to avoid: every sample against every position.
fn brute(
    part: &Part,
    cutter: &Cutter,
    positions: &[Position],
    spacing: Option<f64>,
) -> Verification {
    let samples = sample::sample(part, spacing).expect("valid");
    let body: Box<dyn Solid> = match *cutter {
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => Box::new(Torus {
            major_radius,
            minor_radius,
        }),
        Cutter::Cone {
            radius,
            width,
            slope,
            ..
        } => Box::new(Cone::new(radius, width, slope)),
    };
    let clearances = |[x, angle, height]: [f64; 3], p: Point| {
        let (sin, cos) = libm::sincos(angle);
        let seen = [
            p[0] - x,
            (p[1] * cos - p[2] * sin) - height,
            p[1] * sin + p[2] * cos,
        ];
        [body.normal_clearance(seen), body.attack_clearance(seen)]
    };
    // Each sample's least and its number, for one measure.
    let least = |poses: &[(usize, [f64; 3])], measure: usize| -> Vec<Option<(f64, usize)>> {
        let of_sample = |&p: &Point| {
            let all = poses
                .iter()
                .map(|&(i, pose)| (clearances(pose, p)[measure], i));
            all.filter(|(value, _)| *value < f64::INFINITY)
                .reduce(|a, b| if b.0 < a.0 { b } else { a })
        };
        samples.points.iter().map(of_sample).collect()
    };
    let gouge = |found: &[Option<(f64, usize)>], each: usize| {
        let mut deepest = None;
        for (sample, l) in found.iter().enumerate() {
            let Some((value, index)) = *l else { continue };
            if value < deepest.map_or(0.0, |(v, _, _)| v) {
                deepest = Some((value, sample, index));
            }
        }
        deepest.map(|(value, sample, number)| {
            let share = if each == 1 {
                0.0
            } else {
                hierarchy::share(number % each)
            };
            let [x, angle, height] = at(positions, number / each, share);
            Gouge {
                depth: -value,
                point: samples.points[sample],
                position: (number / each) as u64,
                x,
                angle,
                height,
            }
        })
    };
    let items = items(positions);
    let standing: Vec<_> = items.iter().map(|i| (i.index, i.at)).collect();
    let mut moving = vec![];
    for item in &items {
        for k in 0..INTERMEDIATE {
            let pose = |by| {
                (
                    INTERMEDIATE * item.index + k,
                    item.along(by, hierarchy::share(k)),
                )
            };
            moving.extend(item.by.map(pose));
        }
    }
    let deviation = |measure| {
        let found = least(&standing, measure);
        let excess = found.iter().flatten().map(|l| l.0.max(0.0)).collect();
        Deviation {
            excess: percentiles(excess),
            gouge: gouge(&found, 1),
            motion_gouge: gouge(&least(&moving, measure), INTERMEDIATE),
        }
    };
    let never = least(&standing, 1).iter().filter(|l| l.is_none()).count();
    Verification {
        samples: samples.points.len() as u64,
        spacing: samples.spacing,
        positions: standing.len() as u64,
        moves: (moving.len() / INTERMEDIATE) as u64,
        never_reached: never as f64 / samples.points.len() as f64,
        normal: deviation(0),
        attack: deviation(1),
        scallop: Scallop::default(),
    }
}

fn cutters() -> impl Strategy<Value = Cutter> {
    let size = 1.0..20.0;
    prop_oneof![
        (0.0..40.0, size.clone()).prop_map(|(a, b)| Cutter::torus(a, b)),
        size.clone().prop_map(Cutter::ball),
        (size.clone(), size.clone()).prop_map(|(a, b)| Cutter::cylinder(a, b)),
        (size, 0.5..4.0, -60.0..60.0).prop_map(|(a, b, c)| Cutter::cone(a + 4.0, b, c)),
        // Down to a point, or to within rounding of one.
        Just(Cutter::cone(10.0, 20.0, 45.0)),
        Just(Cutter::cone(10.0, 20.0, -45.0)),
    ]
    .prop_map(|c| c.expect("valid"))
}

fn parts() -> impl Strategy<Value = Part> {
    let corner = prop_oneof![
        prop::array::uniform3(-30.0..30.0_f64),
        prop::array::uniform3(-6..6_i32).prop_map(|p| p.map(|c| f64::from(c) * 4.0)),
    ];
    let soup = prop::collection::vec(corner, 3..40).prop_map(|v| {
        let n = v.len() as u32;
        let triangles = (0..n).map(|i| [i, (i + 1) % n, (i * 7 + 2) % n]).collect();
        mesh(v, triangles)
    });
    let radii = prop::collection::vec(2.0..25.0_f64, 2..6);
    let turned = (radii, -10.0..10.0).prop_map(|(radii, off)| {
        let place = |(i, &r): (usize, &f64)| (i as f64 * 12.0 - 20.0, r);
        let profile: Vec<_> = radii.iter().enumerate().map(place).collect();
        turned(&profile, off)
    });
    prop_oneof![soup, turned]
}

/// Smooth spirals, rings on top of each other, and no order at all.
fn paths() -> impl Strategy<Value = Vec<Position>> {
    let place = (
        prop_oneof![-40.0..40.0, (-5..5_i32).prop_map(|x| f64::from(x) * 4.0)],
        prop_oneof![-1e5..1e5, (-20..20_i32).prop_map(|a| f64::from(a) * 90.0)],
        prop::option::weighted(0.9, prop_oneof![-20.0..80.0, Just(40.0)]),
    );
    let anywhere = prop::collection::vec(
        place.prop_map(|(x, angle, height)| Position { x, angle, height }),
        0..150,
    );
    let spiral = (0.0..6.0, 1..24_usize, 5.0..70.0, 0.0..20.0, 0..600_usize).prop_map(
        |(step, ppr, mean, swing, count): (f64, usize, f64, f64, usize)| {
            let at = |i: usize| {
                let angle = 360.0 * i as f64 / ppr as f64;
                Position {
                    x: -30.0 + step * i as f64 / ppr as f64,
                    angle,
                    height: Some(mean + swing * libm::cos(angle.to_radians())),
                }
            };
            (0..count).map(at).collect()
        },
    );
    prop_oneof![anywhere, spiral]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn the_search_equals_going_through_everything(
        part in parts(),
        cutter in cutters(),
        positions in paths(),
    ) {
        let found = verify(&part, &cutter, None, &positions, Some(6.0)).expect("valid");
        prop_assert_eq!(found, brute(&part, &cutter, &positions, Some(6.0)));
    }
}

/// A cylinder of radius 20 under a torus that rolls over it at a constant height.
fn rolled(height: f64) -> Verification {
    let part = turned(&[(0.0, 20.0), (30.0, 20.0)], 0.0);
    let cutter = Cutter::torus(40.0, 8.0).expect("valid");
    let path = helix(-8.0, 38.0, 2.0, 720, |_| Some(height));
    verify(&part, &cutter, Some(2.0), &path, Some(0.2)).expect("valid")
}

#[test]
fn a_cylinder_keeps_its_scallops_and_no_more() {
    let found = rolled(68.0);
    assert_eq!(found.never_reached, 0.0);
    for deviation in [found.normal, found.attack] {
        let depth = |g: Option<Gouge>| g.map_or(0.0, |g| g.depth);
        near(depth(deviation.gouge), 0.0, 1e-12);
        near(depth(deviation.motion_gouge), 0.0, 1e-12);
    }
    let scallop = 8.0 - 63.0_f64.sqrt();
    // Half way between turns, and a quarter of the way along the profile for the median.
    near(found.attack.excess.expect("some").max, scallop, 1e-3);
    near(
        found.normal.excess.expect("some").max,
        65.0_f64.sqrt() - 8.0,
        1e-3,
    );
    near(
        found.normal.excess.expect("some").median,
        64.25_f64.sqrt() - 8.0,
        1e-3,
    );
    near(found.scallop.predicted.expect("known"), scallop, 1e-12);
    near(found.scallop.measured.expect("seen"), scallop, 4e-3);
}

#[test]
fn a_tenth_of_a_millimetre_too_low_is_a_tenth_too_deep() {
    let found = rolled(67.9);
    for deviation in [found.normal, found.attack] {
        for gouge in [deviation.gouge, deviation.motion_gouge] {
            let gouge = gouge.expect("gouged");
            near(gouge.depth, 0.1, 1e-4);
            // It happens right under the wheel.
            let turned = libm::atan2(gouge.point[2], gouge.point[1]).to_degrees();
            let apart = (turned + gouge.angle).rem_euclid(360.0);
            assert!(apart.min(360.0 - apart) < 0.5, "{gouge:?}");
            near(gouge.point[0], gouge.x, 0.1);
        }
    }
}

#[test]
fn a_groove_that_the_cutter_cannot_enter_is_left() {
    let groove = [
        (0.0, 20.0),
        (15.0, 20.0),
        (15.0, 17.0),
        (19.0, 17.0),
        (19.0, 20.0),
        (34.0, 20.0),
    ];
    let cutter = Cutter::torus(40.0, 8.0).expect("valid");
    // With a fine step only the groove is left; in its middle the wheel comes down on both rims.
    let low = 68.0 - (8.0 - 60.0_f64.sqrt());
    let mut path = helix(-8.0, 42.0, 0.25, 360, |_| Some(68.0));
    path.push(Position {
        x: 17.0,
        angle: 0.0,
        height: None,
    });
    path.extend((0..=360).map(|a| Position {
        x: 17.0,
        angle: f64::from(a),
        height: Some(low),
    }));
    let found =
        verify(&turned(&groove, 0.0), &cutter, Some(0.25), &path, Some(0.4)).expect("valid");
    for d in [found.normal, found.attack] {
        for gouge in [d.gouge, d.motion_gouge] {
            assert!(gouge.is_none_or(|g| g.depth < 1e-9), "{found:?}");
        }
    }
    // The bottom's corners are 2 mm off the middle, where the wheel has not come down yet.
    let deepest = found.attack.excess.expect("some").max;
    near(deepest, 3.0, 1e-3);
    let expected = (2.0_f64 * 2.0 + (60.0_f64.sqrt() + 3.0).powi(2)).sqrt() - 8.0;
    assert!(found.normal.excess.expect("some").max <= expected + 1e-3);
    assert!(found.normal.excess.expect("some").median < 1e-3);
    assert!(found.scallop.measured.expect("seen") < 2e-3);
}

/// Between twelve exact positions of a turn, the straight moves cut into a cylinder off the spindle
/// by the sagitta that both closed forms give: how far the height of a move's middle lies below the
/// exact one, and how close the two circles come.
#[test]
fn straight_moves_between_exact_positions_gouge_by_their_sagitta() {
    let (radius, off, sum) = (20.0, 6.0, 68.0);
    let exact = |t: f64| off * t.cos() + (sum * sum - (off * t.sin()).powi(2)).sqrt();
    let cutter = Cutter::torus(40.0, 8.0).expect("valid");
    let part = turned(&[(0.0, radius), (20.0, radius)], off);
    let path = helix(-8.0, 28.0, 0.2, 12, |t| Some(exact(t)));
    let found = verify(&part, &cutter, Some(0.2), &path, Some(0.1)).expect("valid");
    let (mut axis, mut normal) = (0.0_f64, 0.0_f64);
    for i in 0..12 {
        for k in 1..=INTERMEDIATE {
            let share = k as f64 / (INTERMEDIATE + 1) as f64;
            let [a, b] = [i, i + 1].map(|i| f64::from(i * 30).to_radians());
            let t = a + (b - a) * share;
            let height = exact(a) + (exact(b) - exact(a)) * share;
            axis = axis.max(exact(t) - height);
            let apart = (height - off * t.cos()).hypot(off * t.sin());
            normal = normal.max(sum - apart);
        }
    }
    assert!(axis > 0.1, "the moves are long enough to see");
    near(found.attack.motion_gouge.expect("gouged").depth, axis, 1e-3);
    near(
        found.normal.motion_gouge.expect("gouged").depth,
        normal,
        1e-3,
    );
    assert!(found.attack.gouge.is_none_or(|g| g.depth < 1e-9));
}

#[test]
fn any_number_of_threads_finds_the_same() {
    let part = turned(&[(0.0, 15.0), (20.0, 22.0), (40.0, 8.0)], 3.0);
    let cutter = Cutter::torus(20.0, 4.0).expect("valid");
    let path = helix(-4.0, 44.0, 1.0, 90, |t| Some(43.0 + 3.0 * t.cos()));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let run = || verify_everywhere(&part, &cutter, Some(1.0), &path, Some(0.5));
        pool.build().expect("threads").install(run).expect("valid")
    };
    let one = with(1);
    let (found, everywhere) = &one;
    let gouge = found.normal.gouge.expect("gouged");
    assert!(found.normal.motion_gouge.is_some());
    let least = everywhere.normal.iter().copied().fold(f64::MAX, f64::min);
    let most = everywhere.normal.iter().copied().fold(f64::MIN, f64::max);
    assert_eq!(least, -gouge.depth);
    assert_eq!(Some(most), found.normal.excess.map(|e| e.max));
    let worst = everywhere.normal.iter().position(|&c| c == least);
    assert_eq!(everywhere.points[worst.expect("there")], gouge.point);
    assert_eq!(one, with(2));
    assert_eq!(one, with(5));
}

#[test]
fn nothing_to_find_is_not_an_error() {
    let part = turned(&[(0.0, 20.0), (30.0, 20.0)], 0.0);
    let cutter = Cutter::ball(5.0).expect("valid");
    let none = |x| Position {
        x,
        angle: 0.0,
        height: None,
    };
    for path in [vec![], vec![none(0.0), none(1.0)]] {
        let found = verify(&part, &cutter, Some(1.0), &path, Some(2.0)).expect("valid");
        assert_eq!(
            (found.positions, found.moves, found.never_reached),
            (0, 0, 1.0)
        );
        assert_eq!((found.normal, found.attack), Default::default());
        assert_eq!(found.scallop.measured, None);
    }
    // One position, out of reach: far along the normal, never along the attack axis.
    let far = Position {
        x: 1000.0,
        angle: 7.0,
        height: Some(25.0),
    };
    let found = verify(&part, &cutter, None, &[far], Some(2.0)).expect("valid");
    assert_eq!((found.positions, found.never_reached), (1, 1.0));
    assert!(found.normal.excess.expect("far").median > 900.0);
    assert_eq!(found.attack.excess, None);
    assert_eq!(found.scallop, Scallop::default());
}

#[test]
fn a_gap_in_the_path_is_no_move() {
    let part = turned(&[(0.0, 20.0), (30.0, 20.0)], 0.0);
    let cutter = Cutter::ball(5.0).expect("valid");
    let at = |x, height| Position {
        x,
        angle: 0.0,
        height,
    };
    // Straight through the part, had the cutter not left it in between.
    let path = [at(-10.0, Some(0.0)), at(15.0, None), at(40.0, Some(0.0))];
    let found = verify(&part, &cutter, None, &path, Some(2.0)).expect("valid");
    assert_eq!((found.moves, found.attack.motion_gouge), (0, None));
    let path = [path[0], path[2]];
    let found = verify(&part, &cutter, None, &path, Some(2.0)).expect("valid");
    assert!(found.attack.motion_gouge.expect("gouged").depth > 20.0);
}

#[test]
fn turns_unwound_lose_nothing() {
    let part = turned(&[(0.0, 20.0), (30.0, 20.0)], 4.0);
    let cutter = Cutter::torus(10.0, 5.0).expect("valid");
    let path = helix(0.0, 30.0, 2.0, 36, |_| Some(35.0));
    let moved = |turns: f64| -> Vec<Position> {
        let by = |p: &Position| Position {
            angle: p.angle + 360.0 * turns,
            ..*p
        };
        path.iter().map(by).collect()
    };
    let near_by = verify(&part, &cutter, None, &path, Some(1.0)).expect("valid");
    for turns in [-3.0, 1e6] {
        let found = verify(&part, &cutter, None, &moved(turns), Some(1.0)).expect("valid");
        let depth = |v: &Verification| v.normal.gouge.expect("gouged").depth;
        near(depth(&found), depth(&near_by), 1e-6);
    }
}

#[test]
fn numbers_that_cannot_be_are_refused_by_name() {
    let part = turned(&[(0.0, 20.0), (30.0, 20.0)], 0.0);
    let cutter = Cutter::ball(5.0).expect("valid");
    let good = Position {
        x: 0.0,
        angle: 0.0,
        height: Some(25.0),
    };
    let refused = |step, bad, spacing| {
        let result = verify(&part, &cutter, step, &[good, bad], spacing);
        result.expect_err("refused").to_string()
    };
    let nan = Position {
        height: Some(f64::NAN),
        ..good
    };
    let message = refused(None, nan, None);
    assert!(
        message.contains("position 1 has a height of NaN"),
        "{message}"
    );
    let far = Position { x: 1e7, ..good };
    assert!(refused(None, far, None).contains("travel"));
    let wound = Position {
        angle: f64::INFINITY,
        ..good
    };
    assert!(refused(None, wound, None).contains("angle"));
    assert!(refused(Some(0.0), good, None).contains("step"));
    assert!(refused(None, good, Some(f64::NAN)).contains("spacing"));
    assert!(refused(None, good, Some(1e-5)).contains("wider spacing"));
    let empty = verify(&Part::default(), &cutter, None, &[good], None);
    assert_eq!(empty, Err(Error::EmptyPart));
}

#[test]
fn the_edge_of_what_is_allowed_is_searched_as_well() {
    let r = MAX_COORDINATE;
    let part = mesh(
        vec![[r, r, -r], [r, -r, r], [r - 9.0, r, -r], [-r, 0.0, 0.0]],
        vec![[0, 1, 2], [1, 2, 3]],
    );
    let path: Vec<Position> = (0..300)
        .map(|i| Position {
            x: r - f64::from(i % 20),
            angle: f64::from(i) * 33.0,
            height: Some(r * f64::from(i % 7) / 6.0),
        })
        .collect();
    for cutter in [Cutter::torus(1e4, 10.0), Cutter::cylinder(1e4, 1e4)] {
        let cutter = cutter.expect("valid");
        let spacing = Some(1e5);
        let found = verify(&part, &cutter, None, &path, spacing).expect("valid");
        assert_eq!(found, brute(&part, &cutter, &path, spacing));
    }
}
