//! The papers' local search loses the winner where a part has lobes; with its fallback it does not.

use horma_core::{
    Body, Contact, Coordinates, Counters, Culling, Cutter, Digitizer, Direction, Discretization,
    Heuristic, Job, Local, Method, Motion, MotionKind, Part, Plan, Shape, Simd, Surface, Touch,
    Window,
};

/// A bar 100 mm long whose section has three lobes of 30 ± 12 mm.
fn star() -> Part {
    let (rows, columns) = (51_u32, 121_u32);
    let poles = (0..rows).flat_map(|i| {
        (0..columns).map(move |j| {
            // The last column is the first one.
            let angle = (f64::from(j % (columns - 1)) * 3.0).to_radians();
            let radius = 30.0 + 12.0 * libm::cos(3.0 * angle);
            [
                2.0 * f64::from(i),
                radius * libm::cos(angle),
                radius * libm::sin(angle),
            ]
        })
    });
    let linear = |count: u32| {
        let inner = (0..count).map(f64::from);
        Direction {
            degree: 1,
            knots: [0.0]
                .into_iter()
                .chain(inner)
                .chain([f64::from(count - 1)])
                .collect(),
        }
    };
    let surface = Surface::new("star", linear(rows), linear(columns), poles.collect(), None);
    Part {
        bodies: vec![Body {
            name: "star".to_owned(),
            shape: Shape::Surface(surface.expect("valid")),
        }],
    }
}

fn plan(method: Method) -> Plan {
    let job = Job {
        discretization: Discretization::Grid {
            rows: 51,
            columns: 121,
        },
        cutter: Cutter::torus(40.0, 8.0).expect("valid"),
        motion: Motion {
            from: Some(0.0),
            to: Some(100.0),
            ..Motion::new(MotionKind::Helix, 2.0, 72)
        },
        coordinates: Coordinates::Double,
        contact: Contact::Point,
        method,
    };
    Plan::new(&star(), job, 1 << 30).expect("fits")
}

fn run(method: Method) -> (Vec<Option<Touch>>, Counters) {
    let plan = plan(method);
    let digitizer = Digitizer::new(&plan.job, &plan.model.rows, Simd::best());
    let mut touches = Vec::new();
    let all = 0..plan.trajectory.positions;
    let counters = digitizer.run_chunks(&plan.trajectory, all, |chunk, _| {
        touches.extend(chunk.touches);
        true
    });
    (touches, counters)
}

const PAPERS: Window = Window {
    delta_u: 8,
    delta_v: 20,
};

fn local(window: Window, culling: Culling) -> Local {
    Local {
        window: Some(window),
        culling,
        fallback: true,
    }
}

#[test]
fn a_star_is_wrong_without_the_fallback_and_right_with_it() {
    let (exact, _) = run(Method::Brute);
    let plan = plan(Method::Exact);
    let papers = local(PAPERS, Culling::default());
    let heuristic = Heuristic::new(
        &plan.job,
        papers,
        &plan.model.rows,
        &plan.trajectory,
        Simd::best(),
    );

    let (alone, counters) = heuristic.run(PAPERS);
    let wrong = alone
        .iter()
        .zip(&exact)
        .filter(|(a, e)| a.map(|t| t.height) != e.map(|t| t.height));
    assert_eq!(wrong.count() as u64, counters.lost);
    assert!(
        counters.lost > 10 && counters.largest_loss > 0.1,
        "{counters:?}"
    );

    let on = [false, true];
    for (back_faces, beyond_reach) in on.into_iter().flat_map(|b| on.map(|r| (b, r))) {
        let culling = Culling {
            back_faces,
            beyond_reach,
        };
        let (right, counters) = run(Method::Local(local(PAPERS, culling)));
        assert_eq!(right, exact, "{culling:?}");
        assert!(
            counters.lost > 0,
            "it had something to fall back from: {counters:?}"
        );
    }

    let window = heuristic.smallest_window();
    assert!(
        window.delta_v > PAPERS.delta_v || window.delta_u > PAPERS.delta_u,
        "{window:?}"
    );
    let (touches, counters) = heuristic.run(window);
    assert_eq!((touches, counters.lost), (exact, 0));
    let smaller = Window {
        delta_v: window.delta_v - 1,
        ..window
    };
    assert!(
        heuristic.run(smaller).1.lost > 0,
        "{window:?} is not the smallest"
    );
}

#[test]
fn culling_evaluates_fewer_points() {
    let evaluations = |back_faces, beyond_reach| {
        let culling = Culling {
            back_faces,
            beyond_reach,
        };
        run(Method::Local(local(Window::EVERYTHING, culling)))
            .1
            .evaluations
    };
    let all = evaluations(false, false);
    assert!(
        evaluations(true, false) < all * 6 / 10,
        "half of them face away"
    );
    assert!(evaluations(false, true) < all / 4, "the cutter is narrow");
    assert!(evaluations(true, true) < evaluations(false, true));
}

#[test]
fn between_positions_windows_with_the_fallback_are_as_good_as_any() {
    let between = |method| {
        let mut plan = plan(method);
        plan.job.motion.path_tolerance = Some(0.01);
        let digitizer = Digitizer::new(&plan.job, &plan.model.rows, Simd::best());
        let mut parts = Vec::new();
        let all = 0..plan.trajectory.positions;
        digitizer.run_chunks(&plan.trajectory, all, |run, _| {
            parts.push(run);
            true
        });
        parts
    };
    let exact = between(Method::Exact);
    assert!(exact.iter().map(|r| r.between.len()).sum::<usize>() > 1000);
    let tiny = Window {
        delta_u: 2,
        delta_v: 2,
    };
    assert_eq!(between(Method::Brute), exact);
    assert_eq!(
        between(Method::Local(local(tiny, Culling::default()))),
        exact
    );
}
