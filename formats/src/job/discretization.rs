//! The section on how finely the part is sampled, and in which numbers.

use horma_core::{Coordinates, Discretization};

use super::DEFAULT_TOLERANCE;
use super::raw::RawJob;
use super::source::Source;
use crate::error::Result;

pub(super) const COORDINATES: [(&str, Coordinates); 2] = [
    ("double", Coordinates::Double),
    ("packed21", Coordinates::Packed21),
];

impl Source<'_> {
    pub(super) fn discretization(&self, raw: &RawJob) -> Result<Discretization> {
        let raw = &raw.discretization;
        match (&raw.tolerance, &raw.grid) {
            (None, None) => Ok(Discretization::Tolerance(DEFAULT_TOLERANCE)),
            (Some(tolerance), None) => Ok(Discretization::Tolerance(tolerance.value)),
            (None, Some(grid)) => Ok(Discretization::Grid {
                rows: self.count(&grid.value.rows, "rows")?,
                columns: self.count(&grid.value.columns, "columns")?,
            }),
            (Some(_), Some(grid)) => {
                let what = "tolerance and grid are both given, but only one of them can hold";
                Err(self.wrong(Some(&grid.at), what))
            }
        }
    }

    pub(super) fn coordinates(&self, raw: &RawJob) -> Result<Coordinates> {
        let given = raw.discretization.coordinates.as_ref();
        self.choose(given, "coordinates", Coordinates::Double, &COORDINATES)
    }
}
