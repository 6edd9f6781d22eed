//! Positions as the bounds of lids see them.

use fearless_simd::{Simd, prelude::*};

use super::{Eight, Frame, Lids};
use crate::bound::load;
use crate::contact::Pose;
use crate::cutter::Cutter;

/// A position as the bounds of lids see it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    x: f32,
    pub(super) cos: f32,
    pub(super) sin: f32,
    /// Where on the cutter, `(d, z)`, the highest touch is expected.
    pub(super) place: [f32; 2],
    /// What the rounding of a length is proportional to, times the unit of single precision, mm.
    pub(super) rounding: f32,
}

impl View {
    /// Of lids that lie within `frame`.
    #[inline(always)]
    pub fn new(frame: &Frame, cutter: &Cutter, pose: &Pose, place: [f64; 2]) -> Self {
        let x = pose.x - frame.origin;
        let size = frame.size + x.abs() + cutter.max_radius() + cutter.half_width();
        Self {
            x: x as f32,
            cos: pose.cos as f32,
            sin: pose.sin as f32,
            place: place.map(|c| c as f32),
            // Some ten roundings of half a unit each at most, and as much again.
            rounding: f32::EPSILON * 8.0 * size as f32,
        }
    }

    /// The middles of lids, seen from the cutter.
    #[inline(always)]
    pub(super) fn see<S: Simd>(&self, simd: S, lids: &Lids) -> Eight<S> {
        let [x, y, z]: Eight<S> = load(simd, &lids.middle);
        [
            x - self.x,
            y.mul_add(self.cos, z * -self.sin),
            y.mul_add(self.sin, z * self.cos),
        ]
    }

    /// The highest touch is here by now, `(d, z)` on the cutter.
    #[inline(always)]
    pub fn expect(&mut self, place: [f64; 2]) {
        self.place = place.map(|c| c as f32);
    }
}

/// How far positions are from each other, at most, and how their cutter bends between them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Swing {
    /// The longest chord of the angles between them.
    pub(super) chord: f32,
    /// The longest travel, mm.
    pub(super) travel: f32,
    /// [`Cutter::least_bends`], which is asked once for all lids.
    pub(super) bends: [f32; 2],
}

/// How far small lids may move between positions that share their bounds, as a share of the cutter's radii: beyond
/// that one's planes lose more for the others than sharing them saves.
const CLOSE: f32 = 0.5;

impl Swing {
    /// Of some positions.
    #[inline(always)]
    pub fn new(cutter: &Cutter, poses: impl Iterator<Item = Pose>) -> Self {
        let [mut chord, mut travel] = [0.0_f64; 2];
        let mut first = None;
        for pose in poses {
            let from = first.get_or_insert(pose);
            let (c, s) = (pose.cos - from.cos, pose.sin - from.sin);
            chord = chord.max(c * c + s * s);
            travel = travel.max((pose.x - from.x).abs());
        }
        // No two are further apart than both from the first.
        Self {
            chord: 2.0 * chord.sqrt() as f32,
            travel: 2.0 * travel as f32,
            bends: cutter.least_bends().map(|b| b as f32),
        }
    }

    /// Of one of them by itself.
    #[inline(always)]
    pub fn alone(self) -> Self {
        Self {
            chord: 0.0,
            travel: 0.0,
            ..self
        }
    }

    /// Whether positions are close enough for the cutter to share the bounds of small lids.
    #[inline(always)]
    pub fn is_close(self, frame: &Frame) -> bool {
        let [along, across] = self.bends;
        let moved = self.travel * along;
        let turned = self.chord * frame.across as f32 * across;
        // A cutter that does not bend leaves one's planes where they are for all.
        across > 0.0 && moved.max(turned) < CLOSE
    }
}
