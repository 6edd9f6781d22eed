//! Packed coordinates: how far a path is from that of doubles.
//!
//! No point moves by more than the stated error, and no place of a facet by more than its corners. So a torus
//! whose tube is thinner by that error, over doubles, is let further in at every position than the torus over
//! packed points, and one whose tube is thicker is kept further out.

use std::cell::Cell;

use crate::common::Case;
use horma_core::{Coordinates, Cutter, Digitizer, Job, Plan, Simd, ToolPath};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// Slack for rounding, mm.
const SLACK: f64 = 1.0e-9;

fn digitized(case: &Case, job: Job) -> Option<(Plan, ToolPath)> {
    let plan = Plan::new(&case.part, job, 1 << 30).ok()?;
    let few = plan.trajectory.positions < 700;
    few.then(|| {
        let digitizer = Digitizer::new(&job, &plan.model.rows, Simd::best());
        let path = digitizer.path(&plan.trajectory).0;
        (plan, path)
    })
}

/// Compares every position; how many are touched.
fn check(case: &Case) -> Result<usize, TestCaseError> {
    let Cutter::Torus {
        major_radius,
        minor_radius,
    } = case.job.cutter
    else {
        return Ok(0);
    };
    let mut job = case.job;
    job.motion.path_tolerance = None;
    job.coordinates = Coordinates::Packed21;
    let Some((plan, packed)) = digitized(case, job) else {
        return Ok(0);
    };
    // The same positions, for these depend on where rows end.
    let first = plan.trajectory;
    let bound = job.coordinates.error() + SLACK;
    let doubles = |change: f64| {
        let cutter = Cutter::torus(major_radius, minor_radius + change).ok()?;
        let coordinates = Coordinates::Double;
        let job = Job {
            cutter,
            coordinates,
            ..job
        };
        let plan = Plan::new(&case.part, job, 1 << 30).ok()?;
        let digitizer = Digitizer::new(&job, &plan.model.rows, Simd::best());
        Some(digitizer.path(&first).0.touches)
    };
    let Some((thin, thick)) = doubles(-bound).zip(doubles(bound)) else {
        return Ok(0);
    };
    let all = packed.touches.iter().zip(thin.iter().zip(&thick));
    let mut touched = 0;
    for (i, (packed, (thin, thick))) in all.enumerate() {
        let [packed, thin, thick] =
            [packed, thin, thick].map(|t| t.map_or(f64::NEG_INFINITY, |t| t.height));
        prop_assert!(
            thin <= packed && packed <= thick,
            "{i}: {thin} {packed} {thick}"
        );
        touched += usize::from(packed.is_finite());
    }
    Ok(touched)
}

#[test]
fn a_path_over_packed_points_lies_between_those_of_a_thinner_and_a_thicker_wheel() {
    let config = ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(4000)
    };
    let mut runner = TestRunner::new(config);
    let touched = Cell::new(0);
    let cases = prop::collection::vec(any::<u8>(), 0..96);
    let compared = runner.run(&cases, |bytes| {
        if let Some(case) = Case::from_bytes(&bytes) {
            touched.set(touched.get() + check(&case)?);
        }
        Ok(())
    });
    compared.unwrap_or_else(|error| panic!("{error}"));
    assert!(touched.get() > 10_000, "{}", touched.get());
}
