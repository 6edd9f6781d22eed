//! Positions between, on a bar whose height is known in closed form at every angle.

use horma_core::{
    Body, Contact, Coordinates, Cutter, Digitizer, Discretization, Job, Mesh, Method, Motion,
    MotionKind, Part, Plan, Shape, Simd, ToolPath,
};

/// Half the side of the bar, and the radius of a plain wheel; mm.
const HALF: f64 = 10.0;
const WHEEL: f64 = 30.0;

/// A square bar of four flat sides, along the spindle.
fn bar() -> Part {
    let corners = [[HALF, HALF], [HALF, -HALF], [-HALF, -HALF], [-HALF, HALF]];
    let ring = |x: f64| corners.into_iter().map(move |[y, z]| [x, y, z]);
    let side = |j: u32| {
        let [a, b] = [j, (j + 1) % 4];
        [[a, b, b + 4], [a, b + 4, a + 4]]
    };
    let triangles = (0..4).flat_map(side).collect();
    let mesh = Mesh::new("bar", ring(0.0).chain(ring(100.0)).collect(), triangles);
    Part {
        bodies: vec![Body {
            name: "bar".to_owned(),
            shape: Shape::Mesh(mesh.expect("valid")),
        }],
    }
}

/// The height of the wheel over the bar at an angle, degrees: it touches a side, or else an edge.
fn height(angle: f64) -> f64 {
    let from_side = (angle + 45.0).rem_euclid(90.0) - 45.0;
    let (sin, cos) = from_side.to_radians().abs().sin_cos();
    let over_side = (HALF + WHEEL) / cos;
    if over_side * sin <= HALF {
        return over_side;
    }
    let (y, z) = (HALF * (cos + sin), HALF * (cos - sin));
    y + (WHEEL * WHEEL - z * z).sqrt()
}

fn job(kind: MotionKind, path_tolerance: Option<f64>) -> Job {
    Job {
        discretization: Discretization::Tolerance(0.1),
        cutter: Cutter::cylinder(WHEEL, 8.0).expect("valid"),
        motion: Motion {
            from: Some(10.0),
            to: Some(60.0),
            path_tolerance,
            ..Motion::new(kind, 5.0, 13)
        },
        coordinates: Coordinates::Double,
        contact: Contact::Facet,
        method: Method::Exact,
    }
}

/// The path, and how many moves stray all the same.
fn path(kind: MotionKind, path_tolerance: Option<f64>) -> (ToolPath, u64) {
    let job = job(kind, path_tolerance);
    let plan = Plan::new(&bar(), job, 1 << 30).expect("fits");
    let digitizer = Digitizer::new(&plan.job, &plan.model.rows, Simd::best());
    let (path, counters) = digitizer.path(&plan.trajectory);
    (path, counters.beyond_tolerance)
}

/// How far the straight moves of a path stray from the bar's heights, mm.
fn strays(path: &ToolPath) -> f64 {
    let mut most = 0.0_f64;
    for pair in path.positions().windows(2) {
        let [from, to] = [0, 1].map(|k| (pair[k].angle, pair[k].height.expect("in reach")));
        for share in (0..=100).map(|k| f64::from(k) / 100.0) {
            let line = from.1 + (to.1 - from.1) * share;
            most = most.max((line - height(from.0 + (to.0 - from.0) * share)).abs());
        }
    }
    most
}

#[test]
fn straight_moves_over_a_square_bar_stay_within_the_tolerance() {
    for kind in [MotionKind::Helix, MotionKind::Rings] {
        let (coarse, _) = path(kind, None);
        assert_eq!(coarse.between, vec![]);
        assert!(strays(&coarse) > 1.0, "{}", strays(&coarse));
        let mut before = 0;
        for tolerance in [0.1, 0.01, 0.001] {
            let (fine, beyond) = path(kind, Some(tolerance));
            assert_eq!(beyond, 0, "no height of the bar jumps");
            assert_eq!(fine.touches, coarse.touches, "positions stay what they are");
            for w in fine.waypoints() {
                let found = w.touch.expect("in reach").height;
                assert!((found - height(w.angle)).abs() < 1e-9, "{w:?}");
            }
            // What a sharp edge can hide between two poses that are looked at.
            let strays = strays(&fine);
            assert!(strays <= tolerance / 0.85, "{strays} of {tolerance}");
            assert!(fine.between.len() > before);
            before = fine.between.len();
        }
        // Ten times finer takes about three times as many.
        assert!(before < 64 * coarse.touches.len(), "{before}");
    }
}

#[test]
fn what_is_inserted_is_bounded_by_the_memory_that_is_left() {
    let plan = |memory: u64, path_tolerance: Option<f64>| {
        Plan::new(&bar(), job(MotionKind::Helix, path_tolerance), memory)
    };
    let scarce = plan(50_000, Some(0.01)).expect("fits");
    assert!(
        (1..125).contains(&scarce.most_inserted),
        "{}",
        scarce.most_inserted
    );
    assert_eq!(scarce.check_inserted(scarce.most_inserted), Ok(()));
    let error = scarce.check_inserted(125).expect_err("too many");
    assert!(
        error.is_impossible() && error.to_string().contains("path_tolerance"),
        "{error}"
    );
    // Nobody asked for any.
    assert_eq!(plan(1 << 30, None).expect("fits").most_inserted, 0);
}
