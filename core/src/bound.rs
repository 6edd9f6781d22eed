//! Upper bounds: how high the cutter can be touched anywhere within a piece of the part.
//!
//! F is concave, so its tangent plane at any place within the reach lies above it everywhere. Taken
//! near the piece, where the cutter is tangent to it, the bound's slack is of second order in the
//! piece's size; taken at the highest touch so far, it rules out whatever lies behind that touch. Out
//! of reach a cylinder around the cutter bounds, to first order. Bounds decide only what is skipped:
//! they need to be safe, not the same everywhere, so they make do with single precision, multiply and add in
//! one step where there is an instruction for it, and have a slack for both.

mod dome;
mod lid;

use fearless_simd::{Simd, SimdBase};

pub(crate) use dome::{Dome, NearDome, Spots};
pub(crate) use lid::{Frame, Lids, Swing, View, lid_bounds};

/// Points or other triples, one in each lane.
#[inline(always)]
pub(crate) fn load<S: Simd, V: SimdBase<S, Element = f32>, const N: usize>(
    simd: S,
    axes: &[[f32; N]; 3],
) -> [V; 3] {
    [
        V::from_slice(simd, &axes[0]),
        V::from_slice(simd, &axes[1]),
        V::from_slice(simd, &axes[2]),
    ]
}

#[cfg(test)]
mod tests {
    use crate::contact::Pose;
    use crate::cutter::Cutter;

    pub(super) fn cutter(which: usize) -> Cutter {
        let cutters = [
            Cutter::torus(40.0, 8.0),
            Cutter::ball(5.0),
            Cutter::cylinder(10.0, 6.0),
            Cutter::cone(10.0, 20.0, 45.0),
        ];
        cutters[which].clone().expect("valid")
    }

    pub(super) fn pose(x: f64, degrees: f64) -> Pose {
        let angle = degrees.to_radians();
        Pose {
            x,
            cos: libm::cos(angle),
            sin: libm::sin(angle),
        }
    }
}
