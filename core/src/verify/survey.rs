//! The samples held against the positions: chunks of them, that threads take in turn.
//!
//! A chunk starts without a hint and without a gouge to beat, so what it finds does not depend on
//! which thread has it, and chunks are put together in order.

use rayon::prelude::*;

use super::body::Solid;
use super::hierarchy::Hierarchy;
use super::search::{Clearance, Least, Stack};
use crate::simd::{Simd, with_simd};
use crate::vector::Point;

/// Samples that one thread takes at a time.
const CHUNK: usize = 2048;

/// What holding samples against a path gives; lengths in mm.
#[derive(Debug, Default)]
pub(super) struct Survey {
    /// Normal clearance of each sample, negative where it is gouged; of none if there is no position.
    pub normal: Vec<f64>,
    /// Excess of each sample along the attack axis, `None` where no position reaches it.
    pub attack: Vec<Option<f64>>,
    /// Deepest gouges at positions, normal and along the attack axis.
    pub gouges: [Option<Worst>; 2],
    /// The same on the moves.
    pub motion_gouges: [Option<Worst>; 2],
}

/// The lowest clearance of all samples; of equal ones that of the first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Worst {
    /// mm; negative.
    pub value: f64,
    /// The sample.
    pub sample: usize,
    /// The number of the position, or of the pose on a move.
    pub index: usize,
}

/// Holds samples against a path.
pub(super) fn survey(hierarchy: &Hierarchy<impl Solid>, points: &[Point]) -> Survey {
    let simd = Simd::best().token();
    let chunks: Vec<Survey> = points
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, points)| {
            let first = chunk * CHUNK;
            with_simd!(simd, _simd => survey_chunk(hierarchy, points, first))
        })
        .collect();
    let mut all = Survey {
        normal: Vec::with_capacity(points.len()),
        attack: Vec::with_capacity(points.len()),
        ..Survey::default()
    };
    // In order of the samples: of equal gouges the first stays.
    let deeper = |a: &mut [Option<Worst>; 2], b: [Option<Worst>; 2]| {
        for (a, b) in a.iter_mut().zip(b) {
            if limit(b) < limit(*a) {
                *a = b;
            }
        }
    };
    for chunk in chunks {
        all.normal.extend(chunk.normal);
        all.attack.extend(chunk.attack);
        deeper(&mut all.gouges, chunk.gouges);
        deeper(&mut all.motion_gouges, chunk.motion_gouges);
    }
    all
}

#[inline(always)]
fn survey_chunk(hierarchy: &Hierarchy<impl Solid>, points: &[Point], first: usize) -> Survey {
    let mut stack = Stack::new();
    let mut last = Clearance::NONE;
    let mut all = Survey::default();
    for (sample, &p) in (first..).zip(points) {
        // Of the moves only what is deeper than the deepest so far is looked for.
        let [normal, attack] = all.motion_gouges;
        let (normal, attack) = (Least::below(limit(normal)), Least::below(limit(attack)));
        // Where its neighbour's winners are, its own are not far.
        let found = hierarchy.least(p, Clearance { normal, attack }, &last, &mut stack);
        last = found.standing;
        all.gouges = worse(all.gouges, found.standing, sample);
        all.motion_gouges = worse(all.motion_gouges, found.moving, sample);
        all.normal.extend(last.normal.found());
        all.attack.push(last.attack.found().map(|c| c.max(0.0)));
    }
    all
}

/// What is deeper than the worst so far is below this, mm.
fn limit(worst: Option<Worst>) -> f64 {
    worst.map_or(0.0, |w| w.value)
}

/// The worst so far, or what is found for a later sample; only gouges count.
fn worse(so_far: [Option<Worst>; 2], found: Clearance, sample: usize) -> [Option<Worst>; 2] {
    let found = [found.normal, found.attack];
    std::array::from_fn(|m| match found[m].found() {
        Some(value) if value < limit(so_far[m]) => Some(Worst {
            value,
            sample,
            index: found[m].index,
        }),
        _ => so_far[m],
    })
}
