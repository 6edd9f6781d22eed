//! A path as columns of numbers: those of `path.csv`, for the formats that hold tables.

use horma_core::Waypoint;

use crate::csv;

/// Their names, in order.
pub fn names() -> impl Iterator<Item = &'static str> {
    csv::HEADER.split(',')
}

/// How many of them there is a number in at every position.
pub const ALWAYS: usize = 3;

/// The numbers of a position, mm and degrees; the last four are nothing where nothing is in reach.
pub fn of(waypoint: &Waypoint) -> [Option<f64>; 7] {
    let Waypoint {
        index,
        x,
        angle,
        touch,
    } = *waypoint;
    let index = index.floor() as f64 + index.share();
    let [cx, cy, cz] = [0, 1, 2].map(|k| touch.map(|t| t.contact[k]));
    let y = touch.map(|t| t.height);
    [Some(index), Some(x), Some(angle), y, cx, cy, cz]
}
