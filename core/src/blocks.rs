//! From rows to leaves: which candidates lie together.
//!
//! A run of joined isolines is cut into blocks along its own lines, which costs nothing; the triangles
//! and points of slabs are halved along their longest side until a leaf holds them.

use std::ops::Range;

use crate::leaf::{FACETS, FacetLeaf, POINTS, PointLeaf};
use crate::row::{Row, RowKind, cell};
use crate::vector::{Point, add_scaled, sub};

/// Rows and columns of a block of points.
const SIDE: usize = 4;

/// Rows and columns of a block of cells.
const CELLS: usize = 2;
const _: () = assert!(2 * CELLS * CELLS == FACETS && SIDE * SIDE == POINTS);

/// Candidates that will be one leaf.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// About their middle, mm.
    pub middle: Point,
    what: What,
}

#[derive(Debug, Clone)]
enum What {
    /// The points, or the cells, of these rows and columns.
    Tile {
        rows: Range<u32>,
        columns: Range<u32>,
    },
    /// Those of one row with these numbers.
    Scattered { row: u32, numbers: Box<[u32]> },
}

/// Runs of rows: joined isolines, or a slab or an isoline by itself.
pub(crate) fn runs(rows: &[Row]) -> impl Iterator<Item = (usize, &[Row])> {
    let joined =
        |a: &Row, b: &Row| a.kind == RowKind::Isoline { joins_next: true } && b.id == a.id + 1;
    let runs = rows.chunk_by(joined);
    runs.scan(0, |next, run| {
        let first = *next;
        *next += run.len();
        Some((first, run))
    })
}

/// Blocks of all points.
pub(crate) fn point_blocks(rows: &[Row]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (first, run) in runs(rows) {
        match &run[0].kind {
            RowKind::Slab { .. } => scatter(first, &run[0].points, POINTS, &mut blocks),
            RowKind::Isoline { .. } => {
                let side = run.len().min(SIDE);
                let size = [run.len(), run[0].points.len()];
                tile(first, run, size, [side, POINTS / side], &mut blocks);
            }
        }
    }
    blocks
}

/// Blocks of all facets.
pub(crate) fn facet_blocks(rows: &[Row]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (first, run) in runs(rows) {
        match &run[0].kind {
            RowKind::Slab { facets } => {
                let points = &run[0].points;
                let middle = |f: &[u32; 3]| {
                    let [a, b, c] = f.map(|c| points[c as usize]);
                    [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0)
                };
                let middles: Vec<Point> = facets.iter().map(middle).collect();
                scatter(first, &middles, FACETS, &mut blocks);
            }
            RowKind::Isoline { .. } => {
                let cells = [run.len() - 1, run[0].points.len().saturating_sub(1)];
                tile(first, run, cells, [CELLS, CELLS], &mut blocks);
            }
        }
    }
    blocks
}

/// Cuts `size` rows and columns of a run into blocks of `side`.
fn tile(first: usize, run: &[Row], size: [usize; 2], side: [usize; 2], blocks: &mut Vec<Block>) {
    blocks.reserve(size[0].div_ceil(side[0]) * size[1].div_ceil(side[1]));
    for row in (0..size[0]).step_by(side[0]) {
        let rows = row..size[0].min(row + side[0]);
        let middle = &run[rows.start + rows.len() / 2].points;
        for column in (0..size[1]).step_by(side[1]) {
            let columns = column..size[1].min(column + side[1]);
            blocks.push(Block {
                middle: middle[columns.start + columns.len() / 2],
                what: What::Tile {
                    rows: (first + rows.start) as u32..(first + rows.end) as u32,
                    columns: columns.start as u32..columns.end as u32,
                },
            });
        }
    }
}

/// Halves candidates along their longest side until each lot fits into a leaf.
fn scatter(row: usize, middles: &[Point], leaf: usize, blocks: &mut Vec<Block>) {
    let mut numbers: Vec<u32> = (0..middles.len() as u32).collect();
    let mut lots = vec![&mut numbers[..]];
    let at = |n: &u32| middles[*n as usize];
    while let Some(lot) = lots.pop() {
        if lot.is_empty() {
            // A row from outside may have nothing in it.
        } else if lot.len() <= leaf {
            let sum = lot
                .iter()
                .fold([0.0; 3], |sum, n| add_scaled(sum, 1.0, at(n)));
            blocks.push(Block {
                middle: sum.map(|s| s / lot.len() as f64),
                what: What::Scattered {
                    row: row as u32,
                    numbers: (&*lot).into(),
                },
            });
        } else {
            let axis = longest_side(lot.iter().map(at));
            // Full leaves on the left.
            let half = (lot.len().div_ceil(leaf) / 2) * leaf;
            lot.select_nth_unstable_by(half, |a, b| at(a)[axis].total_cmp(&at(b)[axis]));
            let (left, right) = lot.split_at_mut(half);
            lots.extend([left, right]);
        }
    }
}

/// The axis along which points extend most.
pub(crate) fn longest_side(points: impl Iterator<Item = Point>) -> usize {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points {
        for k in 0..3 {
            low[k] = if p[k] < low[k] { p[k] } else { low[k] };
            high[k] = if p[k] > high[k] { p[k] } else { high[k] };
        }
    }
    let extents = sub(high, low);
    (0..3).fold(0, |a, b| if extents[b] > extents[a] { b } else { a })
}

/// Leaves the vertices of a block of points to `take`, some at a time.
pub(crate) fn point_vertices(rows: &[Row], block: &Block, take: &mut dyn FnMut(&[Point])) {
    each_point(rows, block, |row, i| take(&row.points[i..=i]));
}

/// The leaf of a block of points.
pub(crate) fn point_leaf(rows: &[Row], block: &Block) -> PointLeaf {
    let mut leaf = PointLeaf::EMPTY;
    each_point(rows, block, |row, i| {
        leaf.push(row.candidate(i), row.points[i]);
    });
    leaf
}

/// Each point of a block by its row and its place there.
fn each_point(rows: &[Row], block: &Block, mut each: impl FnMut(&Row, usize)) {
    match &block.what {
        What::Tile {
            rows: some,
            columns,
        } => {
            for row in &rows[some.start as usize..some.end as usize] {
                columns.clone().for_each(|i| each(row, i as usize));
            }
        }
        What::Scattered { row, numbers } => {
            let row = &rows[*row as usize];
            numbers.iter().for_each(|&i| each(row, i as usize));
        }
    }
}

/// Leaves the vertices of a block of facets to `take`, each once, some at a time.
pub(crate) fn facet_vertices(rows: &[Row], block: &Block, take: &mut dyn FnMut(&[Point])) {
    match &block.what {
        What::Tile {
            rows: some,
            columns,
        } => {
            let columns = columns.start as usize..=columns.end as usize;
            for row in &rows[some.start as usize..=some.end as usize] {
                take(&row.points[columns.clone()]);
            }
        }
        What::Scattered { row, numbers } => {
            let row = &rows[*row as usize];
            let facets = row.facets();
            let mut corners = [0; 3 * FACETS];
            let corners = &mut corners[..3 * numbers.len()];
            for (corners, &n) in corners.chunks_exact_mut(3).zip(numbers) {
                corners.copy_from_slice(&facets[n as usize]);
            }
            corners.sort_unstable();
            for distinct in corners.chunk_by(|a, b| a == b) {
                let vertex = distinct[0] as usize;
                take(&row.points[vertex..=vertex]);
            }
        }
    }
}

/// The leaf of a block of facets; `starts` tells where the points of each row begin among `points`.
pub(crate) fn facet_leaf(
    rows: &[Row],
    starts: &[u32],
    points: &[Point],
    block: &Block,
) -> FacetLeaf {
    let (mut facets, mut count) = ([([0; 3], 0); FACETS], 0);
    let mut push = |corners, id| {
        facets[count] = (corners, id);
        count += 1;
    };
    match &block.what {
        What::Tile {
            rows: some,
            columns,
        } => {
            for row in some.start as usize..some.end as usize {
                for column in columns.clone() {
                    let first = rows[row].candidate(2 * column as usize);
                    let [a, b] = cell(starts[row] + column, starts[row + 1] + column);
                    push(a, first);
                    push(b, first + 1);
                }
            }
        }
        What::Scattered { row, numbers } => {
            let (row, start) = (&rows[*row as usize], starts[*row as usize]);
            let facets = row.facets();
            for &n in numbers {
                let n = n as usize;
                push(facets[n].map(|c| start + c), row.candidate(n));
            }
        }
    }
    FacetLeaf::new(points, &facets[..count])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_row_with_nothing_in_it_there_is_no_block() {
        let isoline = RowKind::Isoline { joins_next: false };
        for kind in [RowKind::Slab { facets: Vec::new() }, isoline] {
            let row = Row {
                id: 0,
                points: Vec::new(),
                kind,
            };
            assert!(point_blocks(std::slice::from_ref(&row)).is_empty());
            assert!(facet_blocks(&[row]).is_empty());
        }
    }
}
