//! Passes in the numbers of a program: least increments of each axis, rounded once and for all.
//!
//! Everything after this counts in them, so that what is planned and checked is what the file says.

use std::ops::{Range, RangeInclusive};

use horma_core::{Cutter, MachineAxis, Station};

use super::{Angles, Pass, Program, Programmed, Spot};
use crate::error::{Error, Result};

/// Passes in least increments.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Each position of all passes, in the order of [`MachineAxis::ALL`].
    pub increments: Vec<[i64; 3]>,
    /// The passes.
    pub legs: Vec<Leg>,
    /// Height of the cutter's centre when it is retracted, mm.
    pub safe: f64,
    /// The attack axis then.
    pub retracted: i64,
    /// Where it says to be at each position, in mm and degrees.
    pub stations: Vec<Station>,
    /// mm or degrees in an increment, negative where an axis counts the other way.
    scale: [f64; 3],
    /// Where the course says to be, before anything is rounded.
    spots: Vec<Spot>,
}

/// A pass that was placed.
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    /// What it is called.
    pub title: String,
    /// Feed of its plunge, mm/min.
    pub feed: f64,
    /// Its positions.
    pub positions: Range<usize>,
}

impl Placed {
    /// Places passes, of which there is at least one. Retracted, the cutter is the program's clearance above
    /// their highest position and above `clear`, mm. Angles go on from one pass to the next.
    ///
    /// # Errors
    /// [`Error::TooManyDigits`] for a position that the control's numbers do not hold.
    pub fn new(
        passes: &[Pass],
        clear: Option<f64>,
        cutter: &Cutter,
        program: &Program,
    ) -> Result<Self> {
        let tip = match program.point {
            Programmed::Centre => 0.0,
            Programmed::Tip => cutter.max_radius(),
        };
        let scale: [f64; 3] = std::array::from_fn(|axis| {
            let unit = match MachineAxis::ALL[axis] {
                MachineAxis::Travel | MachineAxis::Attack => program.units.length(),
                MachineAxis::Rotation => 1.0,
            };
            let sign = if program.words[axis].negative {
                -1.0
            } else {
                1.0
            };
            sign * unit / 10_f64.powi(i32::from(program.decimals[axis]))
        });
        let shift = [0.0, -tip, 0.0];
        let said = |axis: usize, value: f64| ((value + shift[axis]) / scale[axis]).round() as i64;
        let stations = passes.iter().flat_map(|p| p.course);
        let highest = stations.map(|s| s.axes[1]).chain(clear);
        let safe = highest.fold(f64::MIN, f64::max) + program.clearance;
        let count = passes.iter().map(|p| p.course.len()).sum();
        let mut placed = Self {
            increments: Vec::with_capacity(count),
            legs: Vec::new(),
            safe,
            retracted: said(1, safe),
            stations: Vec::with_capacity(count),
            scale,
            spots: Vec::with_capacity(count),
        };
        let mut turned = 0.0;
        for pass in passes {
            let first = placed.increments.len();
            for station in pass.course {
                let [x, y, angle] = station.axes;
                let axes = [x, y, turned + angle];
                let place: [i64; 3] = std::array::from_fn(|axis| said(axis, axes[axis]));
                placed.increments.push(place);
                placed.stations.push(Station {
                    axes: std::array::from_fn(|axis| {
                        place[axis] as f64 * scale[axis] - shift[axis]
                    }),
                    ..*station
                });
                placed.spots.push(Spot { x, angle });
            }
            placed.legs.push(Leg {
                title: pass.title.to_owned(),
                feed: pass.feed,
                positions: first..placed.increments.len(),
            });
            let last = pass.course.last().map_or(0.0, |s| s.axes[2]);
            turned += 360.0 * (last / 360.0).ceil();
        }
        placed.check_digits(program)?;
        Ok(placed)
    }

    /// The passes as the program says them.
    pub fn passes(&self) -> impl Iterator<Item = Pass<'_>> {
        self.legs.iter().map(|leg| Pass {
            title: &leg.title,
            course: &self.stations[leg.positions.clone()],
            feed: leg.feed,
        })
    }

    /// Where position `index` is, for messages.
    pub(super) fn spot(&self, index: usize) -> Spot {
        self.spots[index]
    }

    /// What the program says of an axis, mm or degrees, its own sign and point included.
    fn value(&self, axis: usize, increments: i64) -> f64 {
        increments as f64 * self.scale[axis].abs()
    }

    fn check_digits(&self, program: &Program) -> Result<()> {
        let dialect = program.control.dialect();
        // Turns that are counted anew are not counted here.
        let axes = match (program.angles, program.split) {
            (Angles::Unwound, _) | (Angles::Rezero, None) => 3,
            (Angles::Modulo, _) | (Angles::Rezero, Some(_)) => 2,
        };
        let turn = program.turn();
        let mut found = self.legs.iter().flat_map(|leg| {
            let [.., behind] = self.increments[leg.positions.start];
            let behind = match program.angles {
                Angles::Rezero => behind / turn * turn,
                Angles::Unwound | Angles::Modulo => 0,
            };
            leg.positions.clone().filter_map(move |i| {
                let [x, y, a] = self.increments[i];
                let place = [x, y, a - behind];
                let mut place = place[..axes].iter();
                Some((i, place.position(|v| v.abs() > dialect.most)?))
            })
        });
        let Some((index, axis)) = found.next() else {
            return Ok(());
        };
        Err(Error::TooManyDigits {
            axis: MachineAxis::ALL[axis].name(),
            decimals: program.decimals[axis],
            limit: dialect.most as f64 / 10_f64.powi(i32::from(program.decimals[axis])),
            control: dialect.title,
            spot: self.spot(index),
        })
    }

    /// Checks that the program stays within these ranges of travel and attack, mm as it says them: all of
    /// its positions, and the attack axis when it is retracted.
    ///
    /// # Errors
    /// [`Error::OutsideTravel`] for the first position that does not, [`Error::RetractOutside`].
    pub fn check_range(&self, ranges: &[Option<RangeInclusive<f64>>; 2]) -> Result<()> {
        for (axis, range) in ranges.iter().enumerate() {
            let Some(range) = range else { continue };
            let values = self.increments.iter().map(|p| self.value(axis, p[axis]));
            let outside = |value: &f64| !range.contains(value);
            if let Some((index, value)) = values.enumerate().find(|(_, v)| outside(v)) {
                return Err(Error::OutsideTravel {
                    axis: MachineAxis::ALL[axis].name(),
                    value,
                    least: *range.start(),
                    most: *range.end(),
                    spot: self.spot(index),
                });
            }
            let retracted = self.value(1, self.retracted);
            if axis == 1 && outside(&retracted) {
                return Err(Error::RetractOutside {
                    value: retracted,
                    least: *range.start(),
                    most: *range.end(),
                });
            }
        }
        Ok(())
    }
}
