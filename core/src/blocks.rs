//! From rows to leaves: which candidates lie together.
//!
//! A run of joined isolines is cut into blocks along its own lines, which costs nothing; the triangles
//! and points of slabs are halved along their longest side until a leaf holds them.

use crate::leaf::{FACETS, FacetLeaf, POINTS, PointLeaf};
use crate::row::{Row, RowKind};
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
    /// Of the rows from `row` on and the columns from `column` on.
    Cells {
        row: u32,
        rows: u32,
        column: u32,
        columns: u32,
    },
    /// Of one slab, by number.
    Scattered { row: u32, numbers: Vec<u32> },
}

/// The number of a row's `i`-th candidate in the part.
fn number(row: &Row, i: usize) -> u64 {
    u64::from(row.id) << 32 | i as u64
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
        let (rows, columns) = (side.0.min(size.0 - row), side.1.min(size.1 - column));
        Block {
            middle: run[row + rows / 2].points[column + columns / 2],
            what: What::Cells {
                row: (first + row) as u32,
                rows: rows as u32,
                column: column as u32,
                columns: columns as u32,
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
    let mut numbers: Vec<u32> = (0..middles.len() as u32).collect();
    let mut blocks = Vec::new();
    let mut lots = vec![&mut numbers[..]];
    while let Some(lot) = lots.pop() {
        if lot.len() <= leaf {
            let sum = lot.iter().fold([0.0; 3], |sum, &n| {
                [0, 1, 2].map(|k| sum[k] + middles[n as usize][k])
            });
            blocks.push(Block {
                middle: sum.map(|s| s / lot.len() as f64),
                what: What::Scattered {
                    row: row as u32,
                    numbers: lot.to_vec(),
                },
            });
        } else {
            let at = |n: &u32| middles[*n as usize];
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
    match &block.what {
        &What::Cells {
            row,
            rows: height,
            column,
            columns,
        } => {
            let rows = &rows[row as usize..(row + height) as usize];
            PointLeaf::new(rows.iter().flat_map(|row| {
                let numbers = column as usize..(column + columns) as usize;
                numbers.map(|i| (number(row, i), row.points[i]))
            }))
        }
        What::Scattered { row, numbers } => {
            let row = &rows[*row as usize];
            let points = numbers.iter().map(|&n| n as usize);
            PointLeaf::new(points.map(|i| (number(row, i), row.points[i])))
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
        &What::Cells {
            row,
            rows: height,
            column,
            columns,
        } => {
            let cells = (row..row + height)
                .flat_map(|row| (column..column + columns).map(move |column| (row, column)));
            FacetLeaf::new(
                points,
                cells.flat_map(|(row, column)| {
                    // As in `row::facets`.
                    let row = row as usize;
                    let first = number(&rows[row], 2 * column as usize);
                    let (a, b) = (starts[row] + column, starts[row + 1] + column);
                    [([a, b, b + 1], first), ([a, b + 1, a + 1], first + 1)]
                }),
            )
        }
        What::Scattered { row, numbers } => {
            let (row, start) = (&rows[*row as usize], starts[*row as usize]);
            let facets: &[[u32; 3]] = match &row.kind {
                RowKind::Slab { facets } => facets,
                RowKind::Isoline { .. } => &[],
            };
            let numbered = numbers.iter().map(|&n| n as usize);
            FacetLeaf::new(
                points,
                numbered.map(|n| (facets[n].map(|c| start + c), number(row, n))),
            )
        }
    }
}
