//! Courses to write programs of.

use horma_core::{Cutter, Station};

/// The cutter of these tests: 48 mm from its centre to its tip.
pub fn cutter() -> Cutter {
    Cutter::torus(40.0, 8.0).expect("a wheel")
}

/// A helix around a shape that `shape` makes up.
pub fn course(positions: usize, points: usize, shape: u32) -> Vec<Station> {
    let part = |n: u32| f64::from(shape >> (8 * n) & 255) / 255.0;
    let station = |i: usize| {
        let turn = i as f64 / points as f64;
        let angle = 2.0 * std::f64::consts::PI * turn;
        let bump = (angle + part(0)).sin() + part(1) * (3.0 * angle).cos();
        let height = 80.0 + 30.0 * part(2) * bump + 0.123_456_7 * turn;
        Station {
            axes: [-8.25 + 2.0 * turn, height, 360.0 * turn],
            reach: 30.0 + 10.0 * bump,
        }
    };
    (0..positions).map(station).collect()
}
