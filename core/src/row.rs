//! Rows: the unit in which a part is searched and distributed.
//!
//! A row stands for itself: it carries its points, and its number in the part fixes the number of
//! every candidate in it, so that a worker that holds some rows and a process that holds all of them
//! speak of the same candidates. Facets of a grid lie between consecutive rows that are both held.

use crate::error::{Error, Result};
use crate::part::check_points;
use crate::vector::{Interval, Point};

/// One isoline of a grid, or one slab of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Number in the part, counted over all bodies.
    pub id: u32,
    /// Points, mm.
    pub points: Vec<Point>,
    /// What the points belong to.
    pub kind: RowKind,
}

/// What a row's points belong to.
#[derive(Debug, Clone, PartialEq)]
pub enum RowKind {
    /// One u-isoline of a surface.
    Isoline {
        /// Whether row `id + 1` is the next isoline of the same surface.
        joins_next: bool,
    },
    /// Triangles of a mesh that lie near each other along the spindle.
    Slab {
        /// Indices into the row's points.
        facets: Vec<[u32; 3]>,
    },
}

/// What a plan has to know of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// Extent along the spindle of the row and of its facets, those up to the next row included.
    pub x: Interval,
    /// Whether its facets need row `id + 1`.
    pub joins_next: bool,
    /// Number of points.
    pub points: u64,
    /// Number of facets.
    pub facets: u64,
}

impl Outline {
    /// Extent along the spindle of all of these.
    pub fn span(outlines: &[Self]) -> Interval {
        outlines.iter().fold(Interval::EMPTY, |x, o| x.hull(o.x))
    }
}

impl Row {
    /// The facets it has by itself, as places among its points.
    pub(crate) fn facets(&self) -> &[[u32; 3]] {
        match &self.kind {
            RowKind::Isoline { .. } => &[],
            RowKind::Slab { facets } => facets,
        }
    }

    /// Checks a row that came from outside.
    ///
    /// # Errors
    /// [`Error::BadRow`] if a facet names a point that is not there; those of points that are not
    /// finite or too far out.
    pub fn validate(&self) -> Result<()> {
        check_points("a row", "point", &self.points)?;
        let points = self.points.len();
        let beyond = |f: &[u32; 3]| f.iter().any(|&p| p as usize >= points);
        match self.facets().iter().position(beyond) {
            None => Ok(()),
            Some(facet) => Err(Error::BadRow {
                row: self.id,
                facet,
                points,
            }),
        }
    }

    /// Checks that the facets between this row and the next one held can be made.
    ///
    /// # Errors
    /// [`Error::UnequalRows`] if they are joined isolines of different lengths.
    pub fn validate_next(&self, next: &Self) -> Result<()> {
        let joined = self.kind == RowKind::Isoline { joins_next: true } && next.id == self.id + 1;
        if joined && self.points.len() != next.points.len() {
            return Err(Error::UnequalRows {
                row: self.id,
                points: self.points.len(),
                next: next.points.len(),
            });
        }
        Ok(())
    }

    /// The number in the part of its `i`-th candidate, point or facet.
    pub(crate) fn candidate(&self, i: usize) -> u64 {
        u64::from(self.id) << 32 | i as u64
    }

    /// Its outline, but for the strip to the next row.
    pub(crate) fn outline(&self) -> Outline {
        let points = self.points.len() as u64;
        let (joins_next, facets) = match &self.kind {
            RowKind::Isoline { joins_next: true } => (true, 2 * (points - 1)),
            RowKind::Isoline { joins_next: false } => (false, 0),
            RowKind::Slab { facets } => (false, facets.len() as u64),
        };
        Outline {
            x: Interval::of(self.points.iter().map(|p| p[0])),
            joins_next,
            points,
            facets,
        }
    }
}

/// A facet, by the rows that are at hand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facet {
    /// Place of its row among them.
    pub row: usize,
    /// Its number in that row.
    pub number: usize,
    /// Its corners, as indices into the points of all of them, one row after the other.
    pub corners: [u32; 3],
}

/// The row's id and the place in it of a candidate by its number.
pub(crate) fn row_and_place(candidate: u64) -> (u32, usize) {
    ((candidate >> 32) as u32, candidate as u32 as usize)
}

/// The two facets of the cell whose first corners are `a` in its own row and `b` in the next one.
pub(crate) fn cell(a: u32, b: u32) -> [[u32; 3]; 2] {
    [[a, b, b + 1], [a, b + 1, a + 1]]
}

/// Where the points of each row begin among the points of all of them.
pub(crate) fn starts(rows: &[Row]) -> Vec<u32> {
    let starts = rows.iter().scan(0u32, |sum, row| {
        let start = *sum;
        *sum += row.points.len() as u32;
        Some(start)
    });
    starts.collect()
}

/// The facets of rows that are in order of their ids; between isolines only where both are there.
pub(crate) fn facets(rows: &[Row]) -> impl Iterator<Item = Facet> {
    starts(rows)
        .into_iter()
        .enumerate()
        .flat_map(move |(i, start)| {
            let row = &rows[i];
            let next = rows.get(i + 1).filter(|next| next.id == row.id + 1);
            let (slab, columns) = match (&row.kind, next) {
                (RowKind::Slab { facets }, _) => (&facets[..], 0),
                (RowKind::Isoline { joins_next: true }, Some(_)) => {
                    (&[][..], row.points.len() as u32)
                }
                (RowKind::Isoline { .. }, _) => (&[][..], 0),
            };
            let own = slab.iter().map(move |f| f.map(|c| start + c));
            let cells = 0..columns.saturating_sub(1);
            let between = cells.flat_map(move |k| cell(start + k, start + columns + k));
            let all = own.chain(between).enumerate();
            all.map(move |(number, corners)| Facet {
                row: i,
                number,
                corners,
            })
        })
}

/// Makes outlines of single rows, which are those of a body in order, reach to the next row where
/// they join it.
pub(crate) fn join(outlines: &mut [Outline]) {
    for i in 1..outlines.len() {
        if outlines[i - 1].joins_next {
            outlines[i - 1].x = outlines[i - 1].x.hull(outlines[i].x);
        }
    }
}
