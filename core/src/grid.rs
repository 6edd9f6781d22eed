//! Grids without their points: a surface, and the parameters of those of its rows that are wanted.
//!
//! The one place where isolines are made, whether a process makes all of them or a worker its own: a
//! point is the same bits beside whichever other points it is computed, so a row is the same bits
//! whoever makes it. How fine a grid is, is decided elsewhere.

use crate::discretize::Lines;
use crate::error::{Error, Result};
use crate::evaluate::{Isoline, Isolines, Net};
use crate::job::Coordinates;
use crate::row::{Row, RowKind};
use crate::surface::Surface;

/// Rows of a surface, not made yet.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceGrid {
    /// Name of the surface.
    pub name: String,
    /// The surface, u along the spindle.
    pub surface: Surface,
    /// Id of each row, ascending, and its u.
    pub us: Vec<(u32, f64)>,
    /// The v of each point of a row.
    pub vs: Vec<f64>,
    /// Id of the surface's last row, which joins none.
    pub last: u32,
    /// What the points are rounded to.
    pub coordinates: Coordinates,
}

impl SurfaceGrid {
    /// All rows of a surface, their ids counted on from `first`.
    pub(crate) fn whole(
        name: &str,
        surface: &Surface,
        lines: &Lines,
        coordinates: Coordinates,
        first: u32,
    ) -> Self {
        let us: Vec<(u32, f64)> = (first..).zip(lines.us.iter().copied()).collect();
        Self {
            name: name.to_owned(),
            surface: surface.clone(),
            last: us.last().map_or(first, |u| u.0),
            us,
            vs: lines.vs.clone(),
            coordinates,
        }
    }

    /// The same with only the rows in `ids`, which ascend; nothing if it has none of them.
    pub fn only(&self, ids: &[u32]) -> Option<Self> {
        let wanted = |&(id, _): &(u32, f64)| ids.binary_search(&id).is_ok();
        let us: Vec<_> = self.us.iter().copied().filter(|u| wanted(u)).collect();
        (!us.is_empty()).then(|| Self { us, ..self.clone() })
    }

    /// Checks a grid that came from outside.
    ///
    /// # Errors
    /// [`Error::BadSurface`] unless the rows ascend to the last and every parameter is in its domain.
    pub fn validate(&self) -> Result<()> {
        let bad = |reason: String| {
            Err(Error::BadSurface {
                name: self.name.clone(),
                reason,
            })
        };
        if let Some(pair) = self.us.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
            return bad(format!("row {} comes out of order", pair[1].0));
        }
        if let Some(&(id, _)) = self.us.last().filter(|u| u.0 > self.last) {
            return bad(format!("row {id} comes after the last, {}", self.last));
        }
        let us = self.us.iter().map(|u| u.1);
        for (which, direction, mut values) in [
            ("u", self.surface.u(), us.collect::<Vec<_>>()),
            ("v", self.surface.v(), self.vs.clone()),
        ] {
            let (low, high) = direction.domain();
            values.retain(|t| !(low..=high).contains(t));
            if let Some(t) = values.first() {
                return bad(format!("{which} is {t}, but must be from {low} to {high}"));
            }
        }
        Ok(())
    }

    /// Makes the rows, one after the other: eq. (3) of the 2001 paper.
    pub fn rows(&self, take: &mut dyn FnMut(Row)) {
        let net = Net::new(&self.surface);
        let isolines = Isolines::new(&net, &self.vs);
        let mut line = Isoline::default();
        for &(id, u) in &self.us {
            isolines.at(u, &mut line);
            let point = |j| self.coordinates.round(line.point(j));
            let points = (0..self.vs.len()).map(point);
            take(Row {
                id,
                points: points.collect(),
                kind: RowKind::Isoline {
                    joins_next: id < self.last,
                },
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretize::discretize;
    use crate::job::{Coordinates, Discretization};
    use crate::part::{Body, Part, Shape};
    use crate::surface::tests::quarter_cylinder;

    fn made(grid: &SurfaceGrid) -> Vec<Row> {
        let mut rows = Vec::new();
        grid.rows(&mut |row| rows.push(row));
        rows
    }

    #[test]
    fn some_rows_are_made_as_among_all() {
        let surface = quarter_cylinder(5.0, 10.0);
        let part = Part {
            bodies: vec![Body {
                name: "body".to_owned(),
                shape: Shape::Surface(surface.clone()),
            }],
        };
        let (rows, columns) = (40, 17);
        let size = Discretization::Grid { rows, columns };
        let all = discretize(&part, size).expect("valid").rows;
        let evenly = |n: u32| (0..n).map(move |i| f64::from(i) / f64::from(n - 1));
        let lines = Lines {
            us: evenly(rows).collect(),
            vs: evenly(columns).collect(),
            deviation: None,
        };
        let whole = |coordinates| {
            SurfaceGrid::whole("body", &surface.clone().along_x(), &lines, coordinates, 0)
        };
        let grid = whole(Coordinates::Double);
        assert_eq!(made(&grid), all);
        let some = grid.only(&[3, 4, 39, 50]).expect("three of them");
        some.validate().expect("valid");
        let wanted = [3, 4, 39].map(|i: usize| all[i].clone());
        assert_eq!(made(&some), wanted);
        assert_eq!(grid.only(&[40]), None);

        for (rounded, row) in made(&whole(Coordinates::Packed21)).iter().zip(&all) {
            let expected = row.points.iter().map(|&p| Coordinates::Packed21.round(p));
            assert_eq!(rounded.points, expected.collect::<Vec<_>>());
            assert_ne!(rounded.points, row.points);
        }
    }

    #[test]
    fn what_leads_out_of_the_surface_is_refused() {
        let good = SurfaceGrid {
            name: "body".to_owned(),
            surface: quarter_cylinder(5.0, 10.0),
            us: vec![(3, 0.0), (4, 1.0)],
            vs: vec![0.0, 0.5],
            last: 4,
            coordinates: Coordinates::Double,
        };
        good.validate().expect("valid");
        let bad: [fn(&mut SurfaceGrid); 5] = [
            |g| g.us[1].0 = 3,
            |g| g.last = 3,
            |g| g.us[1].1 = 1.5,
            |g| g.vs[0] = f64::NAN,
            |g| g.vs[1] = -0.5,
        ];
        for spoil in bad {
            let mut grid = good.clone();
            spoil(&mut grid);
            assert!(grid.validate().is_err(), "{grid:?}");
        }
    }
}
