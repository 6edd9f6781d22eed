//! Experiments 1 and 2, eq. (6) and eq. (10), one after the other.

use crate::error::Result;
use crate::report::{Block, Chapter};

use super::{experiments, gouges, workers};

/// What there is to tell.
///
/// # Errors
/// None, for the sample last.
pub fn chapter() -> Result<Chapter> {
    let mut blocks = vec![Block::text(
        "The sample last between its holders, three surfaces with a grid of the same size each, torus R 40 r 8, \
         contact with points. What is counted are evaluations, points whose distance is computed: by brute force every \
         point at every position (Algorithm 1); those less than δ = 8 rows and 20 columns from the last winner of \
         each surface within the tool's width (Algorithm 2); and those by horma's exact search, whose path is that of \
         brute force to the last bit.",
    )];
    blocks.extend(experiments::blocks()?);
    blocks.extend(gouges::blocks()?);
    blocks.extend(workers::blocks()?);
    Ok(Chapter {
        name: "searches",
        title: "The searches of 2001",
        source: "the 2001 paper, sections Error analysis, Optimisations, Computer architectures and Illustrative \
                 examples, eqs. (6) and (10)",
        blocks,
    })
}
