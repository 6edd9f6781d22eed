//! The vertices under a hierarchy, leaf by leaf and a coordinate at a time: what its lids are set around.

use std::ops::Range;

use rayon::prelude::*;

use crate::blocks::Block;
use crate::bound::Frame;
use crate::slices::Axes;
use crate::vector::{Interval, Point};

/// Leaves of which the vertices are gathered together.
const LOT: usize = 512;

/// The vertices of all leaves, in order.
pub(crate) struct Vertices(Vec<Lot>);

/// Those of some leaves.
#[derive(Default)]
struct Lot {
    at: [Vec<f64>; 3],
    /// Where those of each leaf begin, and where the last end.
    starts: Vec<usize>,
}

impl Vertices {
    /// Those that `vertices` leaves to its last argument for each leaf's block, gathered in parallel on the
    /// current thread pool.
    pub fn of(
        blocks: &[Block],
        vertices: impl Fn(&Block, &mut dyn FnMut(&[Point])) + Sync + Send,
    ) -> Self {
        let lots = blocks.par_chunks(LOT).map(|blocks| {
            let mut lot = Lot::default();
            for block in blocks {
                let next = lot.at[0].len();
                if lot.starts.len() == 1 {
                    // Most leaves have as many as the first.
                    let all = |axis: &mut Vec<f64>| axis.reserve(next * blocks.len());
                    lot.at.iter_mut().for_each(all);
                }
                lot.starts.push(next);
                vertices(block, &mut |some| {
                    for (k, axis) in lot.at.iter_mut().enumerate() {
                        axis.extend(some.iter().map(|p| p[k]));
                    }
                });
            }
            lot.starts.push(lot.at[0].len());
            lot
        });
        Self(lots.collect())
    }

    /// Those of some leaves.
    pub fn under(&self, leaves: Range<usize>) -> impl Iterator<Item = Axes<'_>> + Clone {
        let lots = leaves.start / LOT..leaves.end.div_ceil(LOT);
        lots.map(move |number| {
            let lot = &self.0[number];
            let within = |leaf: usize| (leaf - number * LOT).min(lot.starts.len() - 1);
            let from = lot.starts[within(leaves.start.max(number * LOT))];
            let to = lot.starts[within(leaves.end)];
            lot.at.each_ref().map(|axis| &axis[from..to])
        })
    }

    /// Where they are.
    pub fn frame(&self) -> Frame {
        let x = Interval::of(self.0.iter().flat_map(|lot| lot.at[0].iter().copied()));
        let across = self
            .0
            .iter()
            .flat_map(|lot| lot.at[1].iter().zip(&lot.at[2]));
        let square = across.map(|(y, z)| y * y + z * z).fold(0.0, f64::max);
        Frame::new(x, square.sqrt())
    }
}
