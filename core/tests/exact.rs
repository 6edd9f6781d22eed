//! The exact digitizer equals brute force bit for bit, contacts included: at every instruction set,
//! on any number of threads, and extent by extent, over parts meant to make it fail.

mod common;
mod packed;

use common::Case;
use horma_core::{
    Body, Contact, Coordinates, Cutter, Discretization, Job, Mesh, Method, Motion, MotionKind,
    Part, Shape,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Bytes that decide a case.
const BYTES: usize = 96;

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(seed()),
        max_shrink_iters: 4000,
        ..ProptestConfig::with_cases(CASES)
    })]

    #[test]
    fn exact_equals_brute_force(bytes in prop::collection::vec(any::<u8>(), 0..BYTES)) {
        if let Some(case) = Case::from_bytes(&bytes) {
            case.check().map_err(|e| TestCaseError::fail(format!("{e}\n{case:?}")))?;
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(seed()),
        max_shrink_iters: 4000,
        ..ProptestConfig::with_cases(CASES / 4)
    })]

    #[test]
    fn what_is_inserted_is_the_same_whoever_looks(
        bytes in prop::collection::vec(any::<u8>(), 0..BYTES),
        tolerance in prop::sample::select(vec![1.0, 0.05, 0.003]),
    ) {
        if let Some(mut case) = Case::from_bytes(&bytes) {
            let step = case.job.motion.step;
            case.job.motion.path_tolerance = Some((tolerance * step).max(1.0e-6));
            case.check().map_err(|e| TestCaseError::fail(format!("{e}\n{case:?}")))?;
        }
    }
}

const CASES: u32 = 2000;

/// The same cases each time, unless others are asked for with `HORMA_SEED`.
fn seed() -> u64 {
    let asked = std::env::var("HORMA_SEED").ok();
    asked.and_then(|s| s.parse().ok()).unwrap_or(2001)
}

/// A shaft of flat sides, its triangles in one order or the other.
fn shaft(sides: &[[f64; 2]], reversed: bool) -> Body {
    let n = sides.len() as u32;
    let ring = |x: f64| sides.iter().map(move |&[y, z]| [x, y, z]);
    let cells = (1..n).flat_map(|j| {
        let [a, b, c, d] = [j - 1, j, n + j, n + j - 1];
        [[a, b, c], [a, c, d]]
    });
    let mut triangles: Vec<[u32; 3]> = cells.collect();
    if reversed {
        triangles.reverse();
        triangles.iter_mut().for_each(|t| t.rotate_left(1));
    }
    let mesh = Mesh::new("shaft", ring(0.0).chain(ring(60.0)).collect(), triangles);
    Body {
        name: "shaft".to_owned(),
        shape: Shape::Mesh(mesh.expect("valid")),
    }
}

/// A lid that bends away from its points and lies along the spindle was bound too low where the
/// cutter's slope along the spindle was exactly 0.
#[test]
fn a_lid_that_bends_outward_is_not_skipped_where_the_cutter_is_level() {
    let three = [
        [126.25, 0.0],
        [-62.5, 108.75],
        [-62.5, -108.75],
        [126.25, 0.0],
    ];
    let eleven = [
        [126.25, 0.0],
        [106.25, 67.5],
        [52.5, 115.0],
        [-17.5, 125.0],
        [-82.5, 95.0],
        [-121.25, 35.0],
        [-121.25, -35.0],
        [-82.5, -95.0],
        [-17.5, -125.0],
        [52.5, -115.0],
        [106.25, -67.5],
        [126.25, 0.0],
    ];
    let bodies = vec![
        shaft(&three, true),
        shaft(&three, false),
        shaft(&eleven, true),
        shaft(&eleven, false),
    ];
    for step in [21.125, 24.75, 3.375, 3.0] {
        let case = Case {
            part: Part {
                bodies: bodies.clone(),
            },
            job: Job {
                discretization: Discretization::Tolerance(0.1),
                cutter: Cutter::torus(0.5, 0.002).expect("valid"),
                motion: Motion::new(MotionKind::Helix, step, 7),
                coordinates: Coordinates::Double,
                contact: Contact::Facet,
                method: Method::Exact,
            },
            extents: 1,
        };
        assert_eq!(case.check().err(), None, "step {step}");
    }
}

/// Where a wheel's very rim meets an edge, its height was estimated by a formula that is rounded
/// otherwise than the height itself, and the edge given up although it was higher.
#[test]
fn an_edge_at_the_rim_is_not_given_up() {
    let bytes = [
        54, 244, 0, 41, 0, 0, 37, 0, 72, 153, 18, 0, 25, 0, 116, 199, 22, 0, 0, 0, 55, 10, 0, 0,
        201, 103, 0, 0, 0, 20,
    ];
    let mut case = Case::from_bytes(&bytes).expect("within bounds");
    for points in [4, 16] {
        case.job.motion.points_per_revolution = points;
        assert_eq!(case.check().err(), None, "{points} points");
    }
}
