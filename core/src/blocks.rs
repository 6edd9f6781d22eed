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
                let mut numbers: Vec<u32> = (0..points.len() as u32).collect();
                let fits = |lot: &[u32]| lot.len() <= POINTS;
                scatter(first, points, &mut numbers, POINTS, &fits, &mut bundles);
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
                let mut numbers: Vec<u32> = (0..facets.len() as u32).collect();
                let fits =
                    |lot: &[u32]| lot.len() <= SCATTERED && corners(facets, lot).1 <= VERTICES;
                scatter(
                    first,
                    &middles,
                    &mut numbers,
                    SCATTERED,
                    &fits,
                    &mut bundles,
                );
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

/// Halves candidates until the leaves of each lot fit into a bundle; a leaf has `full` candidates at most.
fn scatter(
    row: usize,
    middles: &[Point],
    numbers: &mut [u32],
    full: usize,
    fits: &impl Fn(&[u32]) -> bool,
    bundles: &mut Vec<Bundle>,
) {
    let mut lots = vec![numbers];
    while let Some(lot) = lots.pop() {
        if lot.len() <= LANES * full {
            let mut blocks = Vec::with_capacity(LANES);
            let mut parts = vec![&mut *lot];
            while let Some(part) = parts.pop() {
                if part.is_empty() {
                    // A row from outside may have nothing in it.
                } else if fits(part) {
                    blocks.push(Block::Scattered {
                        row: row as u32,
                        numbers: (&*part).into(),
                    });
                } else {
                    parts.extend(halves(middles, part, full));
                }
            }
            if blocks.len() <= LANES {
                let sum = lot.iter().fold([0.0; 3], |sum, n| {
                    add_scaled(sum, 1.0, middles[*n as usize])
                });
                if !blocks.is_empty() {
                    let middle = sum.map(|s| s / lot.len() as f64);
                    bundles.push(Bundle { middle, blocks });
                }
                continue;
            }
        }
        lots.extend(halves(middles, lot, full));
    }
}

/// Halves candidates along their longest side, with full leaves on the left if there is more than one.
fn halves<'a>(middles: &[Point], lot: &'a mut [u32], full: usize) -> [&'a mut [u32]; 2] {
    let at = |n: &u32| middles[*n as usize];
    let axis = longest_side(lot.iter().map(at));
    let half = match lot.len().div_ceil(full) / 2 * full {
        0 => lot.len() / 2,
        half => half,
    };
    lot.select_nth_unstable_by(half, |a, b| at(a)[axis].total_cmp(&at(b)[axis]));
    lot.split_at_mut(half).into()
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
    let mut leaf = PointLeaf::EMPTY;
    each_point(rows, block, |row, i| {
        leaf.push(row.candidate(i), row.points[i]);
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
}
