//! From rows to leaves: which candidates lie together.
//!
//! A run of joined isolines is cut into blocks along its own lines, which costs nothing; the triangles
//! and points of slabs are halved along their longest side until a leaf holds them.

use std::ops::Range;

use crate::leaf::{FACETS, FacetLeaf, POINTS, PointLeaf};
use crate::row::{Row, RowKind, cell};
use crate::vector::{Interval, Point};

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
        rows: Range<usize>,
        columns: Range<usize>,
    },
    /// Those of one row with these numbers.
    Scattered { row: usize, numbers: Vec<usize> },
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
    let blocks = |(first, run): (usize, &[Row])| match &run[0].kind {
        RowKind::Slab { .. } => {
            let points = &run[0].points;
            scatter(first, points, POINTS)
        }
        RowKind::Isoline { .. } => {
            let side = run.len().min(SIDE);
            let size = (run.len(), run[0].points.len());
            tile(first, run, size, (side, POINTS / side))
        }
    };
    runs(rows).flat_map(blocks).collect()
}

/// Blocks of all facets.
pub(crate) fn facet_blocks(rows: &[Row]) -> Vec<Block> {
    let blocks = |(first, run): (usize, &[Row])| match &run[0].kind {
        RowKind::Slab { facets } => {
            let points = &run[0].points;
            let middle = |f: &[u32; 3]| {
                let [a, b, c] = f.map(|c| points[c as usize]);
                [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0)
            };
            let middles: Vec<Point> = facets.iter().map(middle).collect();
            scatter(first, &middles, FACETS)
        }
        RowKind::Isoline { .. } => {
            let cells = (run.len() - 1, run[0].points.len().saturating_sub(1));
            tile(first, run, cells, (CELLS, CELLS))
        }
    };
    runs(rows).flat_map(blocks).collect()
}

/// Cuts `size` rows and columns of a run into blocks of `side`.
fn tile(first: usize, run: &[Row], size: (usize, usize), side: (usize, usize)) -> Vec<Block> {
    let block = |row: usize, column: usize| {
        let rows = row..size.0.min(row + side.0);
        let columns = column..size.1.min(column + side.1);
        Block {
            middle: run[rows.start + rows.len() / 2].points[columns.start + columns.len() / 2],
            what: What::Tile {
                rows: first + rows.start..first + rows.end,
                columns,
            },
        }
    };
    let starts = (0..size.0).step_by(side.0);
    starts
        .flat_map(|row| (0..size.1).step_by(side.1).map(move |column| (row, column)))
        .map(|(row, column)| block(row, column))
        .collect()
}

/// Halves candidates along their longest side until each lot fits into a leaf.
fn scatter(row: usize, middles: &[Point], leaf: usize) -> Vec<Block> {
    let mut numbers: Vec<usize> = (0..middles.len()).collect();
    let mut blocks = Vec::new();
    let mut lots = vec![&mut numbers[..]];
    while let Some(lot) = lots.pop() {
        if lot.len() <= leaf {
            let sum = lot.iter().fold([0.0; 3], |sum, &n| {
                [0, 1, 2].map(|k| sum[k] + middles[n][k])
            });
            blocks.push(Block {
                middle: sum.map(|s| s / lot.len() as f64),
                what: What::Scattered {
                    row,
                    numbers: lot.to_vec(),
                },
            });
        } else {
            let at = |n: &usize| middles[*n];
            let axis = longest_side(&lot.iter().map(at));
            // Full leaves on the left.
            let half = (lot.len().div_ceil(leaf) / 2) * leaf;
            lot.select_nth_unstable_by(half, |a, b| at(a)[axis].total_cmp(&at(b)[axis]));
            let (left, right) = lot.split_at_mut(half);
            lots.extend([left, right]);
        }
    }
    blocks
}

/// The axis along which points extend most.
pub(crate) fn longest_side(points: &(impl Iterator<Item = Point> + Clone)) -> usize {
    let extent = |axis: usize| {
        let range = Interval::of(points.clone().map(|p| p[axis]));
        range.high - range.low
    };
    let extents = [extent(0), extent(1), extent(2)];
    (0..3).fold(0, |a, b| if extents[b] > extents[a] { b } else { a })
}

/// The leaf of a block of points.
pub(crate) fn point_leaf(rows: &[Row], block: &Block) -> PointLeaf {
    let numbered = |row: &Row, i: usize| (row.candidate(i), row.points[i]);
    match &block.what {
        What::Tile {
            rows: some,
            columns,
        } => {
            let rows = rows[some.clone()].iter();
            PointLeaf::new(rows.flat_map(|row| columns.clone().map(move |i| numbered(row, i))))
        }
        What::Scattered { row, numbers } => {
            PointLeaf::new(numbers.iter().map(|&i| numbered(&rows[*row], i)))
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
    match &block.what {
        What::Tile {
            rows: some,
            columns,
        } => {
            let cells = some
                .clone()
                .flat_map(|row| columns.clone().map(move |column| (row, column)));
            let facets = cells.flat_map(|(row, column)| {
                let first = rows[row].candidate(2 * column);
                let column = column as u32;
                let [a, b] = cell(starts[row] + column, starts[row + 1] + column);
                [(a, first), (b, first + 1)]
            });
            FacetLeaf::new(points, facets)
        }
        What::Scattered { row, numbers } => {
            let (row, start) = (&rows[*row], starts[*row]);
            let facets: &[[u32; 3]] = match &row.kind {
                RowKind::Slab { facets } => facets,
                RowKind::Isoline { .. } => &[],
            };
            let facet = |&n: &usize| (facets[n].map(|c| start + c), row.candidate(n));
            FacetLeaf::new(points, numbers.iter().map(facet))
        }
    }
}
