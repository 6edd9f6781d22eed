//! Tangent planes of F, eight at a time.

use fearless_simd::{Simd, f32x8, prelude::*};

use crate::cutter::Cutter;
use crate::tolerance::WELL_WITHIN;

/// Tangent planes of G(d, z) = √(m(d)² − z²), at eight places well within the reach.
pub(super) struct Slopes<S: Simd> {
    pub d: f32x8<S>,
    pub z: f32x8<S>,
    pub rise: f32x8<S>,
    pub by_d: f32x8<S>,
    pub by_z: f32x8<S>,
}

impl<S: Simd> Slopes<S> {
    /// At the places nearest to points seen from the cutter.
    #[inline(always)]
    pub fn at(simd: S, cutter: &Cutter, [d, _, z]: [f32x8<S>; 3]) -> Self {
        let inside = WELL_WITHIN as f32;
        let w = cutter.half_width() as f32 * inside;
        let d = d.max(-w).min(w);
        // One division for both slopes: √(m² − z²) and, of a torus, √(r² − d²) have a common multiple.
        let (m, root, by_root) = slopes(simd, cutter, d);
        let edge = m * inside;
        let z = z.max(-edge).min(edge);
        let rise = ((m - z) * (m + z)).sqrt();
        let share = f32x8::splat(simd, 1.0) / (root * rise);
        Self {
            d,
            z,
            rise,
            by_d: m * by_root * share,
            by_z: -z * root * share,
        }
    }

    /// The plane's slopes together, the attack axis's own included.
    #[inline(always)]
    pub fn steep(&self) -> f32x8<S> {
        self.by_d.abs() + self.by_z.abs() + 1.0
    }
}

/// About m(d), well within the width, a root, and the slope of m times that root.
#[inline(always)]
fn slopes<S: Simd>(simd: S, cutter: &Cutter, d: f32x8<S>) -> (f32x8<S>, f32x8<S>, f32x8<S>) {
    match *cutter {
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            let r = f32x8::splat(simd, minor_radius as f32);
            let root = ((r - d) * (r + d)).sqrt();
            (root + major_radius as f32, root, -d)
        }
        Cutter::Cone { radius, slope, .. } => {
            let slope = slope as f32;
            let m = d * slope + radius as f32;
            (m, f32x8::splat(simd, 1.0), f32x8::splat(simd, slope))
        }
    }
}
