//! A course in the numbers of a program: least increments of each axis, rounded once and for all.
//!
//! Everything after this counts in them, so that what is planned and checked is what the file says.

use std::ops::RangeInclusive;

use horma_core::{Cutter, MachineAxis, Station};

use super::{Angles, Program, Programmed, Spot};
use crate::error::{Error, Result};

/// A course in least increments.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Each position, in the order of [`MachineAxis::ALL`].
    pub increments: Vec<[i64; 3]>,
    /// The attack axis when the cutter is retracted.
    pub retracted: i64,
    /// Where it says to be, in mm and degrees.
    pub stations: Vec<Station>,
    /// mm or degrees in an increment, negative where an axis counts the other way.
    scale: [f64; 3],
    /// Where the course says to be, before anything is rounded.
    spots: Vec<Spot>,
}

impl Placed {
    /// Places a course of at least one position.
    ///
    /// # Errors
    /// [`Error::TooManyDigits`] for a position that the control's numbers do not hold.
    pub fn new(course: &[Station], cutter: &Cutter, program: &Program) -> Result<Self> {
        let tip = match program.point {
            Programmed::Centre => 0.0,
            Programmed::Tip => cutter.max_radius(),
        };
        let scale = std::array::from_fn(|axis| {
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
        let place = |s: &Station| std::array::from_fn(|axis| said(axis, s.axes[axis]));
        let increments: Vec<[i64; 3]> = course.iter().map(place).collect();
        let highest = course.iter().map(|s| s.axes[1]).fold(f64::MIN, f64::max);
        let meant = |s: &Station, place: &[i64; 3]| Station {
            axes: std::array::from_fn(|axis| place[axis] as f64 * scale[axis] - shift[axis]),
            ..*s
        };
        let stations = course.iter().zip(&increments);
        let placed = Self {
            stations: stations.map(|(s, place)| meant(s, place)).collect(),
            increments,
            retracted: said(1, highest + program.clearance),
            scale,
            spots: course
                .iter()
                .map(|s| Spot {
                    x: s.axes[0],
                    angle: s.axes[2],
                })
                .collect(),
        };
        placed.check_digits(program)?;
        Ok(placed)
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
        let too_large =
            |place: &[i64; 3]| place[..axes].iter().position(|v| v.abs() > dialect.most);
        let found = self.increments.iter().enumerate();
        let mut found = found.filter_map(|(i, place)| Some((i, too_large(place)?)));
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
