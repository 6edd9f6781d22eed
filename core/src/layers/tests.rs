use super::*;
use crate::digitize::Digitizer;
use crate::job::{Contact, Coordinates, Discretization, Job, Method};
use crate::motion::{Motion, MotionKind};
use crate::part::{Body, Mesh, Part, Shape};
use crate::path::Waypoint;
use crate::plan::Plan;
use crate::simd::Simd;
use crate::solid::Section;
use crate::vector::Interval;
use crate::verify::verify;

/// A prism of so many sides from x = 0 to 60, with this radius at each corner.
fn prism(sides: u32, radius: impl Fn(f64) -> f64) -> Part {
    let ring = |x: f64| {
        let corners = 0..sides;
        let radius = &radius;
        corners.map(move |i| {
            let angle = 2.0 * std::f64::consts::PI * f64::from(i) / f64::from(sides);
            let r = radius(angle);
            [x, r * angle.cos(), r * angle.sin()]
        })
    };
    let n = sides;
    let side = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, j, n + j], [i, n + j, n + i]]
    });
    let ends = (1..n - 1).flat_map(|i| [[0, i + 1, i], [n, n + i, n + i + 1]]);
    let vertices = ring(0.0).chain(ring(60.0)).collect();
    let mesh = Mesh::new("prism", vertices, side.chain(ends).collect());
    Part {
        bodies: vec![Body {
            name: "prism".to_owned(),
            shape: Shape::Mesh(mesh.expect("valid")),
        }],
    }
}

fn digitized(part: &Part, cutter: Cutter, motion: Motion) -> ToolPath {
    let job = Job {
        discretization: Discretization::Tolerance(0.01),
        cutter,
        motion,
        coordinates: Coordinates::Double,
        contact: Contact::Facet,
        method: Method::Exact,
    };
    let plan = Plan::new(part, job, u64::MAX).expect("a plan");
    let digitizer = Digitizer::new(&job, &plan.model.rows, Simd::best());
    digitizer.path(&plan.trajectory).0
}

const MOTION: Motion = Motion::new(MotionKind::Helix, 5.0, 72);

const EVERYWHERE: Interval = Interval {
    low: f64::NEG_INFINITY,
    high: f64::INFINITY,
};

fn cylinder(radius: f64) -> Solid {
    Solid {
        x: EVERYWHERE,
        section: Section::Disc { radius },
    }
}

fn heights(path: &ToolPath) -> Vec<Option<f64>> {
    path.waypoints()
        .map(|w| w.touch.map(|t| t.height))
        .collect()
}

#[test]
fn a_cylinder_comes_down_by_the_depth_of_cut() {
    // So many sides that the prism is round within 0.15 µm.
    let part = prism(1000, |_| 30.0);
    let ball = Cutter::ball(8.0).expect("valid");
    let target = digitized(&part, ball.grown(1.0).expect("valid"), MOTION);
    let layers = layers(&target, &ball, &cylinder(50.0), 6.0).expect("few");
    // From 58 by sixes to 39, where the grown ball touches; at the ends it sinks beside the part.
    let middle = |path: &ToolPath| {
        let inside = |w: &Waypoint| w.x > 0.0 && w.x < 60.0;
        let heights = path
            .waypoints()
            .filter(inside)
            .map(|w| w.touch.expect("part").height);
        heights.collect::<Vec<_>>()
    };
    for (layer, expected) in layers.iter().zip([52.0, 46.0, 40.0, 39.0]) {
        let heights = middle(&layer.path);
        assert!(heights.len() > 800);
        let off = heights.iter().map(|h| (h - expected).abs());
        assert!(off.fold(0.0, f64::max) < 2e-4, "{expected}");
        assert!((layer.deepest - 6.0).abs() < 1e-9);
    }
    // The rim of the grown ball at the end's edge: 30 mm and next to nothing more.
    assert_eq!(layers.len(), ((58.0_f64 - 30.0) / 6.0).ceil() as usize);
}

/// Of a three-lobed part in a block.
fn lobes(motion: Motion) -> (Part, Cutter, ToolPath, Vec<Layer>) {
    let part = prism(240, |angle| 30.0 + 8.0 * (3.0 * angle).sin());
    let torus = Cutter::torus(40.0, 8.0).expect("valid");
    let target = digitized(&part, torus.grown(0.7).expect("valid"), motion);
    let block = Solid {
        x: Interval {
            low: 10.0,
            high: 48.0,
        },
        section: Section::Rectangle {
            height: 90.0,
            width: 80.0,
        },
    };
    let made = layers(&target, &torus, &block, 4.0).expect("few");
    assert!(made.len() > 4);
    let tops = tops(&target, &torus, &block);
    assert!(tops.iter().any(Option::is_some) && tops.iter().any(Option::is_none));
    let mut before: Vec<Option<f64>> = tops.clone();
    for layer in &made {
        let now = heights(&layer.path);
        let all = now.iter().zip(&before).zip(&tops);
        let mut deepest = 0.0_f64;
        for ((now, before), top) in all {
            let (Some(now), Some(before), Some(_)) = (now, before, top) else {
                continue;
            };
            let taken = before - now;
            assert!(taken <= 4.0 + 1e-9, "{before} to {now}");
            deepest = deepest.max(taken);
        }
        assert_eq!(layer.deepest, deepest);
        assert!(deepest > 0.0);
        // Where it is out of the stock, it is at the target.
        let out = now.iter().zip(heights(&target)).zip(&tops);
        assert!(
            out.into_iter()
                .all(|((n, t), top)| top.is_some() || *n == t)
        );
        before = now;
    }
    let monotone = made.windows(2).all(|w| {
        let both = heights(&w[0].path).into_iter().zip(heights(&w[1].path));
        both.into_iter().all(|(a, b)| a >= b)
    });
    assert!(monotone);
    assert_eq!(made.last().expect("some").path, target);
    (part, torus, target, made)
}

#[test]
fn layers_go_down_to_the_target_and_none_takes_too_much() {
    for kind in [MotionKind::Helix, MotionKind::Rings] {
        lobes(Motion { kind, ..MOTION });
    }
}

#[test]
fn inserted_positions_belong_to_every_layer() {
    let (_, _, target, made) = lobes(Motion {
        path_tolerance: Some(0.005),
        ..MOTION
    });
    assert!(target.between.len() > 100);
    let names = |path: &ToolPath| path.between.iter().map(|i| i.index).collect::<Vec<_>>();
    assert!(made.iter().all(|l| names(&l.path) == names(&target)));
}

#[test]
fn the_allowance_is_left_normal_to_the_surface() {
    let (part, torus, _, made) = lobes(Motion {
        path_tolerance: Some(0.02),
        ..MOTION
    });
    for layer in &made {
        // The verification of the cutter itself, which knows nothing of grown ones: all samples that are
        // reached keep the allowance, but for what straight moves may stray.
        let positions = layer.path.positions();
        let found = verify(&part, &torus, None, &positions, Some(1.0)).expect("verified");
        assert_eq!(
            (found.normal.gouge, found.normal.motion_gouge),
            (None, None)
        );
        let grown = torus.grown(0.7 - 0.02 - 1e-6).expect("valid");
        let found = verify(&part, &grown, None, &positions, Some(1.0)).expect("verified");
        assert_eq!(
            (found.normal.gouge, found.normal.motion_gouge),
            (None, None)
        );
    }
    // And it is not much more: grown by a little more, the last one gouges nearly all along.
    let last = made.last().expect("some").path.positions();
    let more = torus.grown(0.7 + 1e-3).expect("valid");
    let found = verify(&part, &more, None, &last, Some(1.0)).expect("verified");
    let depth = found.normal.gouge.expect("more than there is").depth;
    assert!((0.0..=1.01e-3).contains(&depth), "{depth}");
}

#[test]
fn too_many_layers_are_refused_and_none_are_made_of_air() {
    let part = prism(60, |_| 30.0);
    let ball = Cutter::ball(8.0).expect("valid");
    let target = digitized(&part, ball, MOTION);
    let refused = layers(&target, &ball, &cylinder(50.0), 0.01);
    assert!(matches!(
        refused,
        Err(Error::TooManyLayers { limit: 200, .. })
    ));
    // Nowhere is the cutter higher than 8 over the stock, nor lower than 30.
    let none = layers(&target, &ball, &cylinder(21.9), 1.0).expect("none");
    assert_eq!(none, vec![]);
    let empty = ToolPath {
        touches: vec![None; target.touches.len()],
        ..target.clone()
    };
    assert_eq!(layers(&empty, &ball, &cylinder(50.0), 5.0), Ok(vec![]));
    let deepest = deepest_cut(&target, &ball, &cylinder(50.0));
    assert!((28.0 - 0.1..=28.1).contains(&deepest), "{deepest}");
}
