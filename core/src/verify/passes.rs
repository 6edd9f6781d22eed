//! The samples held against the positions: chunks of them, that threads take in turn.
//!
//! A chunk starts without a hint and without a gouge to beat, so what it finds does not depend on
//! which thread has it, and chunks are put together in order.

use rayon::prelude::*;

use super::body::Solid;
use super::hierarchy::Hierarchy;
use super::search::{Clearance, Least, Stack};
use crate::vector::Point;

/// Samples that one thread takes at a time.
const CHUNK: usize = 2048;

/// The lowest clearance of all samples; of equal ones that of the first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Worst {
    /// mm; negative.
    pub value: f64,
    /// The sample.
    pub sample: usize,
    /// The number of the position.
    pub index: usize,
}

/// The worst so far, or what is found for a later sample; only gouges count.
fn worse(so_far: [Option<Worst>; 2], found: [Least; 2], sample: usize) -> [Option<Worst>; 2] {
    std::array::from_fn(|m| {
        let (worst, least) = (so_far[m], found[m]);
        let limit = worst.map_or(0.0, |w| w.value);
        if least.is_found() && least.value < limit {
            return Some(Worst {
                value: least.value,
                sample,
                index: least.index,
            });
        }
        worst
    })
}

fn worst_of(chunks: impl Iterator<Item = Option<Worst>>) -> Option<Worst> {
    // In order of the samples: of equals, the first stays.
    chunks
        .flatten()
        .reduce(|a, b| if b.value < a.value { b } else { a })
}

/// What holding samples against positions gives, in order of the samples; lengths in mm.
#[derive(Debug, Default)]
pub(super) struct AtPositions {
    /// Normal excess; of no sample if there is no position.
    pub normal: Vec<f64>,
    /// Excess along the attack axis, `None` where no position reaches the sample.
    pub attack: Vec<Option<f64>>,
    /// Deepest gouges, normal and along the attack axis.
    pub gouges: [Option<Worst>; 2],
}

/// Excess of each sample, and the deepest gouges.
pub(super) fn at_positions(hierarchy: &Hierarchy<impl Solid>, points: &[Point]) -> AtPositions {
    let chunks: Vec<AtPositions> = points
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, points)| {
            let mut stack = Stack::new();
            let mut last = Clearance::NONE;
            let mut found = AtPositions::default();
            for (i, &p) in points.iter().enumerate() {
                // Where its neighbour's winners are, its own are not far.
                last = hierarchy.least(p, Clearance::NONE, &last, &mut stack);
                let [n, a] = [last.normal, last.attack];
                let sample = chunk * CHUNK + i;
                found.gouges = worse(found.gouges, [n, a], sample);
                found.normal.extend(n.is_found().then(|| n.value.max(0.0)));
                found.attack.push(a.is_found().then(|| a.value.max(0.0)));
            }
            found
        })
        .collect();
    let mut all = AtPositions {
        gouges: [0, 1].map(|m| worst_of(chunks.iter().map(|c| c.gouges[m]))),
        ..AtPositions::default()
    };
    for chunk in chunks {
        all.normal.extend(chunk.normal);
        all.attack.extend(chunk.attack);
    }
    all
}

/// The deepest gouges, normal and along the attack axis. Only what is deeper than the deepest so far
/// is searched for.
pub(super) fn between_positions(
    hierarchy: &Hierarchy<impl Solid>,
    points: &[Point],
) -> [Option<Worst>; 2] {
    let chunks: Vec<[Option<Worst>; 2]> = points
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, points)| {
            let mut stack = Stack::new();
            let mut gouges = [None; 2];
            for (i, &p) in points.iter().enumerate() {
                let [normal, attack] =
                    gouges.map(|g: Option<Worst>| Least::below(g.map_or(0.0, |w| w.value)));
                let start = Clearance { normal, attack };
                let found = hierarchy.least(p, start, &Clearance::NONE, &mut stack);
                let sample = chunk * CHUNK + i;
                gouges = worse(gouges, [found.normal, found.attack], sample);
            }
            gouges
        })
        .collect();
    [0, 1].map(|m| worst_of(chunks.iter().map(|c| c[m])))
}
