//! From rows to leaves: which candidates lie together, and which leaves do.
//!
//! A run of joined isolines is cut along its own lines, which costs nothing and leaves no gaps between leaves nor
//! laps of one over another; the triangles and points of slabs are halved along their longest side.

use std::ops::Range;

use crate::lanes::LANES;
use crate::leaf::{FACETS, FacetLeaf, POINTS, PointLeaf, VERTICES};
use crate::row::{Row, RowKind, cell};
use crate::vector::{Point, add_scaled, sub};

/// Candidates that will be one leaf.
#[derive(Debug)]
pub(crate) enum Block {
    /// The points, or the cells, of these rows and columns.
    Tile {
        rows: Range<u32>,
        columns: Range<u32>,
    },
    /// Those of one row with these numbers.
    Scattered { row: u32, numbers: Box<[u32]> },
}

/// Blocks that will be the leaves of one node: one to [`LANES`] of them.
#[derive(Debug)]
pub(crate) struct Bundle {
    /// About their middle, mm.
    pub middle: Point,
    pub blocks: Vec<Block>,
}

/// How a run is cut.
#[derive(Debug, Clone, Copy)]
struct Cut {
    /// Rows and columns of a block.
    block: [usize; 2],
    /// Blocks side by side in a bundle.
    bundle: [usize; 2],
}

/// That of points.
const POINT_CUT: Cut = Cut {
    block: [4, POINTS / 4],
    bundle: [2, LANES / 2],
};

/// That of cells.
const CELL_CUT: Cut = Cut {
    block: [2, 4],
    bundle: [4, LANES / 4],
};

const _: () = {
    let [rows, columns] = CELL_CUT.block;
    assert!(2 * rows * columns <= FACETS && (rows + 1) * (columns + 1) <= VERTICES);
};

/// Facets of a mesh in a leaf at most: so many that lie together have no more vertices than a leaf has room for,
/// as a rule.
const SCATTERED: usize = 12;

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

/// Bundles of all points.
pub(crate) fn point_bundles(rows: &[Row]) -> Vec<Bundle> {
    let mut bundles = Vec::new();
    for (first, run) in runs(rows) {
        let points = &run[0].points;
        match &run[0].kind {
            RowKind::Slab { .. } => {
                let scatter = Scatter {
                    row: first as u32,
                    middles: points,
                    full: POINTS,
                    fits: |_: &[u32]| true,
                };
                scatter.cut(&mut bundles);
            }
            RowKind::Isoline { .. } => {
                let rows = run.len().min(POINT_CUT.block[0]);
                let cut = Cut {
                    block: [rows, POINTS / rows],
                    ..POINT_CUT
                };
                tile(first, run, [run.len(), points.len()], cut, &mut bundles);
            }
        }
    }
    bundles
}

/// Bundles of all facets.
pub(crate) fn facet_bundles(rows: &[Row]) -> Vec<Bundle> {
    let mut bundles = Vec::new();
    for (first, run) in runs(rows) {
        let points = &run[0].points;
        match &run[0].kind {
            RowKind::Slab { facets } => {
                let middle = |f: &[u32; 3]| {
                    let [a, b, c] = f.map(|c| points[c as usize]);
                    [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0)
                };
                let middles: Vec<Point> = facets.iter().map(middle).collect();
                let scatter = Scatter {
                    row: first as u32,
                    middles: &middles,
                    full: SCATTERED,
                    fits: |lot: &[u32]| corners(facets, lot).1 <= VERTICES,
                };
                scatter.cut(&mut bundles);
            }
            RowKind::Isoline { .. } => {
                let cells = [run.len() - 1, points.len().saturating_sub(1)];
                tile(first, run, cells, CELL_CUT, &mut bundles);
            }
        }
    }
    bundles
}

/// Cuts `size` rows and columns of a run.
fn tile(first: usize, run: &[Row], size: [usize; 2], cut: Cut, bundles: &mut Vec<Bundle>) {
    let [rows, columns] = cut.block;
    let high = cut.bundle[0].min(size[0].div_ceil(rows));
    let [high, wide] = [high * rows, LANES / high.max(1) * columns];
    let parts = |whole: Range<usize>, step: usize| {
        let end = whole.end;
        whole.step_by(step).map(move |at| at..end.min(at + step))
    };
    for across in parts(0..size[0], high.max(1)) {
        let middle = &run[across.start + across.len() / 2].points;
        for along in parts(0..size[1], wide) {
            let blocks = parts(across.clone(), rows).flat_map(|rows| {
                let rows = (first + rows.start) as u32..(first + rows.end) as u32;
                parts(along.clone(), columns).map(move |columns| Block::Tile {
                    rows: rows.clone(),
                    columns: columns.start as u32..columns.end as u32,
                })
            });
            bundles.push(Bundle {
                middle: middle[along.start + along.len() / 2],
                blocks: blocks.collect(),
            });
        }
    }
}

/// Candidates of a row that lie anywhere.
struct Scatter<'a, F> {
    row: u32,
    /// About the middle of each, mm.
    middles: &'a [Point],
    /// Most of them in a leaf.
    full: usize,
    /// Whether a leaf has room for these, if they are no more.
    fits: F,
}

impl<F: Fn(&[u32]) -> bool> Scatter<'_, F> {
    /// Halves them until the leaves of each lot make a bundle.
    fn cut(&self, bundles: &mut Vec<Bundle>) {
        let mut numbers: Vec<u32> = (0..self.middles.len() as u32).collect();
        let mut lots = vec![&mut numbers[..]];
        while let Some(lot) = lots.pop() {
            let blocks = match lot.len() <= LANES * self.full {
                true => self.leaves(lot),
                false => Vec::new(),
            };
            if (1..=LANES).contains(&blocks.len()) {
                let add = |sum, n: &u32| add_scaled(sum, 1.0, self.middle(*n));
                let sum = lot.iter().fold([0.0; 3], add);
                bundles.push(Bundle {
                    middle: sum.map(|s| s / lot.len() as f64),
                    blocks,
                });
            } else if !lot.is_empty() {
                lots.extend(self.halves(lot));
            }
        }
    }

    /// Halves a lot until each part fits into a leaf. A row from outside may have nothing in it.
    fn leaves(&self, lot: &mut [u32]) -> Vec<Block> {
        let mut blocks = Vec::with_capacity(LANES);
        let mut parts = vec![lot];
        while let Some(part) = parts.pop() {
            if part.len() > self.full || !(self.fits)(part) {
                parts.extend(self.halves(part));
            } else if !part.is_empty() {
                blocks.push(Block::Scattered {
                    row: self.row,
                    numbers: (&*part).into(),
                });
            }
        }
        blocks
    }

    /// Halves a lot along its longest side, with full leaves on the left if there is more than one.
    fn halves<'a>(&self, lot: &'a mut [u32]) -> [&'a mut [u32]; 2] {
        let axis = longest_side(lot.iter().map(|&n| self.middle(n)));
        let half = match lot.len().div_ceil(self.full) / 2 * self.full {
            0 => lot.len() / 2,
            half => half,
        };
        let along = |n: &u32| self.middle(*n)[axis];
        lot.select_nth_unstable_by(half, |a, b| along(a).total_cmp(&along(b)));
        lot.split_at_mut(half).into()
    }

    fn middle(&self, number: u32) -> Point {
        self.middles[number as usize]
    }
}

/// The vertices of some facets, each once, and how many they are; no more than one too many for a leaf.
fn corners(facets: &[[u32; 3]], some: &[u32]) -> ([u32; VERTICES + 1], usize) {
    let (mut vertices, mut count) = ([0; VERTICES + 1], 0);
    for vertex in some.iter().flat_map(|&n| facets[n as usize]) {
        if count <= VERTICES && !vertices[..count].contains(&vertex) {
            vertices[count] = vertex;
            count += 1;
        }
    }
    (vertices, count)
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
    let (mut leaf, mut count) = (PointLeaf::EMPTY, 0);
    each_point(rows, block, |row, i| {
        leaf.set(count, row.candidate(i), row.points[i]);
        count += 1;
    });
    leaf
}

/// Each point of a block by its row and its place there.
fn each_point(rows: &[Row], block: &Block, mut each: impl FnMut(&Row, usize)) {
    match block {
        Block::Tile {
            rows: some,
            columns,
        } => {
            for row in &rows[some.start as usize..some.end as usize] {
                columns.clone().for_each(|i| each(row, i as usize));
            }
        }
        Block::Scattered { row, numbers } => {
            let row = &rows[*row as usize];
            numbers.iter().for_each(|&i| each(row, i as usize));
        }
    }
}

/// Leaves the vertices of a block of facets to `take`, each once, some at a time.
pub(crate) fn facet_vertices(rows: &[Row], block: &Block, take: &mut dyn FnMut(&[Point])) {
    match block {
        Block::Tile {
            rows: some,
            columns,
        } => {
            let columns = columns.start as usize..=columns.end as usize;
            for row in &rows[some.start as usize..=some.end as usize] {
                take(&row.points[columns.clone()]);
            }
        }
        Block::Scattered { row, numbers } => {
            let row = &rows[*row as usize];
            let (vertices, count) = corners(row.facets(), numbers);
            for &vertex in &vertices[..count] {
                let vertex = vertex as usize;
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
    let (mut vertices, mut different) = ([0; VERTICES], 0);
    let mut push = |corners, number| {
        facets[count] = (corners, number);
        count += 1;
    };
    match block {
        Block::Tile {
            rows: some,
            columns,
        } => {
            for start in &starts[some.start as usize..=some.end as usize] {
                for column in columns.start..=columns.end {
                    vertices[different] = start + column;
                    different += 1;
                }
            }
            let wide = columns.len() as u32 + 1;
            for (i, row) in (0..).zip(some.start as usize..some.end as usize) {
                for (j, column) in (0..).zip(columns.clone()) {
                    let slots = cell(i * wide + j, (i + 1) * wide + j);
                    let [a, b] = slots.map(|facet| facet.map(|slot| slot as u8));
                    let first = rows[row].candidate(2 * column as usize);
                    push(a, first);
                    push(b, first + 1);
                }
            }
        }
        Block::Scattered { row, numbers } => {
            let (row, start) = (&rows[*row as usize], starts[*row as usize]);
            let (known, count) = corners(row.facets(), numbers);
            for (vertex, known) in vertices.iter_mut().zip(&known[..count]) {
                *vertex = start + known;
            }
            different = count;
            for &n in numbers {
                let slot = |c| known.iter().position(|&vertex| vertex == c);
                let slots = row.facets()[n as usize].map(|c| slot(c).map_or(0, |slot| slot as u8));
                push(slots, row.candidate(n as usize));
            }
        }
    }
    FacetLeaf::new(points, &vertices[..different], &facets[..count])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_row_with_nothing_in_it_there_is_no_bundle() {
        let isoline = RowKind::Isoline { joins_next: false };
        for kind in [RowKind::Slab { facets: Vec::new() }, isoline] {
            let row = Row {
                id: 0,
                points: Vec::new(),
                kind,
            };
            assert!(point_bundles(std::slice::from_ref(&row)).is_empty());
            assert!(facet_bundles(&[row]).is_empty());
        }
    }

    /// Of each row, how often each of its points or cells is in a block.
    fn counts(bundles: &[Bundle], rows: usize, columns: usize) -> Vec<Vec<u32>> {
        let mut counts = vec![vec![0; columns]; rows];
        for bundle in bundles {
            assert!((1..=LANES).contains(&bundle.blocks.len()));
            for block in &bundle.blocks {
                match block {
                    Block::Tile { rows, columns } => {
                        for row in rows.clone() {
                            for column in columns.clone() {
                                counts[row as usize][column as usize] += 1;
                            }
                        }
                    }
                    Block::Scattered { row, numbers } => {
                        for &n in numbers {
                            counts[*row as usize][n as usize] += 1;
                        }
                    }
                }
            }
        }
        counts
    }

    #[test]
    fn each_candidate_of_a_grid_is_in_one_block() {
        for high in 1..12 {
            for wide in 1..40 {
                let row = |i: u32| Row {
                    id: i,
                    points: vec![[f64::from(i), 1.0, 0.0]; wide],
                    kind: RowKind::Isoline {
                        joins_next: i + 1 < high,
                    },
                };
                let rows: Vec<Row> = (0..high).map(row).collect();
                let points = counts(&point_bundles(&rows), rows.len(), wide);
                assert!(points.iter().flatten().all(|&n| n == 1), "{high} by {wide}");
                let cells = counts(&facet_bundles(&rows), rows.len() - 1, wide - 1);
                assert!(cells.iter().flatten().all(|&n| n == 1), "{high} by {wide}");
            }
        }
    }

    #[test]
    fn each_candidate_of_a_mesh_is_in_one_block() {
        for count in [1, 5, 6, 12, 13, 96, 97, 256] {
            // A strip, and triangles that have nothing in common.
            for step in [1, 3] {
                let corners = |i: u32| [0, 1, 2].map(|k| step * i + k);
                let facets: Vec<[u32; 3]> = (0..count).map(corners).collect();
                let point = |i: u32| {
                    let i = f64::from(i);
                    [i, libm::sin(i), libm::cos(2.0 * i)]
                };
                let row = Row {
                    id: 0,
                    points: (0..step * count + 2).map(point).collect(),
                    kind: RowKind::Slab {
                        facets: facets.clone(),
                    },
                };
                let rows = std::slice::from_ref(&row);
                let points = counts(&point_bundles(rows), 1, row.points.len());
                assert!(points.iter().flatten().all(|&n| n == 1), "{count}");
                let bundles = facet_bundles(rows);
                let blocks = counts(&bundles, 1, facets.len());
                assert!(blocks.iter().flatten().all(|&n| n == 1), "{count}");
                for block in bundles.iter().flat_map(|b| &b.blocks) {
                    facet_leaf(rows, &[0], &row.points, block);
                }
            }
        }
    }
}
