//! The transform unit: points packed in 64 bits go in, one each cycle, and come out turned and moved, if the
//! tool may reach them (coprocessor paper, section 4).
//!
//! Five stages with a register behind each: fetch from the banks, unpack and compare with the tool's influence
//! area, multiply, add and round, pack and store.

use std::cmp::Ordering;

use horma_core::{pack_words, unpack_words};

use crate::fixed::{Format, Rounding};
use crate::multirotator::cos_sin;

/// Stages of the pipeline.
pub const STAGES: u64 = 5;

/// Coordinates: 21 bits, 11 of them after the point.
pub fn coordinates() -> Format {
    Format::new(21, 11).expect("21 bits hold 11 after the point")
}

/// Entries of the matrix: 21 bits, from −2 to 2.
fn entries() -> Format {
    Format::new(21, 19).expect("21 bits hold 19 after the point")
}

/// A turn about the spindle and a travel along it, as the paper's matrix: `p′ = p·TR`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transform {
    /// Rows of the rotation, whose entries have 19 bits after the point.
    rotation: [[i64; 3]; 3],
    /// What is added, a coordinate.
    translation: [i64; 3],
    /// The tool's influence area: travels of points within its reach, before they are moved.
    area: [i64; 2],
}

impl Transform {
    /// For a tool of such a half width, at a travel and an angle.
    pub fn new(travel: f64, degrees: f64, half_width: f64) -> Self {
        let [c, s] = cos_sin(degrees).map(|k| entries().word(k));
        let one = entries().word(1.0);
        let word = |x: f64| coordinates().word(x);
        Self {
            rotation: [[one, 0, 0], [0, c, s], [0, -s, c]],
            translation: [word(-travel), 0, 0],
            area: [word(travel - half_width), word(travel + half_width)],
        }
    }

    /// Whether a point comes before the tool's influence area along the spindle, is in it, or comes after it.
    pub fn place(&self, point: [i32; 3]) -> Ordering {
        let x = i64::from(point[0]);
        if x < self.area[0] {
            Ordering::Less
        } else if x > self.area[1] {
            Ordering::Greater
        } else {
            Ordering::Equal
        }
    }

    /// Whether the tool may reach a point.
    pub fn influences(&self, point: [i32; 3]) -> bool {
        self.place(point) == Ordering::Equal
    }

    /// A point seen from the tool.
    pub fn apply(&self, point: [i32; 3]) -> [i32; 3] {
        sums(&self.products(point), self.translation)
    }

    fn products(&self, point: [i32; 3]) -> [[i64; 3]; 3] {
        std::array::from_fn(|i| self.rotation[i].map(|entry| i64::from(point[i]) * entry))
    }
}

fn sums(products: &[[i64; 3]; 3], translation: [i64; 3]) -> [i32; 3] {
    std::array::from_fn(|k| {
        let sum = products[0][k] + products[1][k] + products[2][k];
        let rounded = Rounding::Nearest.shift(i128::from(sum), entries().fraction());
        (rounded + translation[k]) as i32
    })
}

/// The unit, with what is in the register behind each stage.
#[derive(Debug, Clone, Default)]
pub struct Unit {
    fetched: Option<u64>,
    unpacked: Option<[i32; 3]>,
    multiplied: Option<[[i64; 3]; 3]>,
    added: Option<[i32; 3]>,
    stored: Option<u64>,
    /// Cycles so far.
    pub cycles: u64,
}

impl Unit {
    /// One cycle: what was fetched in it, if anything, and what was stored.
    pub fn clock(&mut self, transform: &Transform, fetched: Option<u64>) -> Option<u64> {
        // From behind, so that each stage takes what the one before it left in the cycle before.
        self.stored = self.added.map(pack_words);
        self.added = self.multiplied.map(|p| sums(&p, transform.translation));
        self.multiplied = self.unpacked.map(|point| transform.products(point));
        let unpacked = self.fetched.map(unpack_words);
        self.unpacked = unpacked.filter(|&point| transform.influences(point));
        self.fetched = fetched;
        self.cycles += 1;
        self.stored
    }

    /// All points of a surface; stores those within the tool's influence area, in their order.
    pub fn run(&mut self, transform: &Transform, surface: &[u64], stored: &mut Vec<u64>) {
        for &packed in surface {
            stored.extend(self.clock(transform, Some(packed)));
        }
        for _ in 1..STAGES {
            stored.extend(self.clock(transform, None));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_stores_what_the_arithmetic_has_a_point_a_cycle() {
        let mut random = fastrand::Rng::with_seed(9);
        let points: Vec<[i32; 3]> = (0..1_000_000)
            .map(|_| std::array::from_fn(|_| random.i32(-300 << 11..300 << 11)))
            .collect();
        let surface: Vec<u64> = points.iter().map(|&p| pack_words(p)).collect();
        let transform = Transform::new(37.25, 211.5, 150.0);
        let (mut unit, mut stored) = (Unit::default(), Vec::new());
        unit.run(&transform, &surface, &mut stored);
        assert_eq!(unit.cycles, points.len() as u64 + STAGES - 1);
        let reached = points.iter().filter(|&&p| transform.influences(p));
        let expected: Vec<[i32; 3]> = reached.map(|&p| transform.apply(p)).collect();
        assert!(expected.len() > 400_000 && expected.len() < 600_000);
        assert!(stored.iter().map(|&w| unpack_words(w)).eq(expected));
    }

    #[test]
    fn a_point_comes_out_in_the_fifth_cycle() {
        let transform = Transform::new(0.0, 90.0, 1.0);
        let mut unit = Unit::default();
        let point = pack_words([0, 2048, 0]);
        let out: Vec<Option<u64>> = (0..6)
            .map(|k| unit.clock(&transform, (k == 0).then_some(point)))
            .collect();
        let turned = Some(pack_words([0, 0, 2048]));
        assert_eq!(out, [None, None, None, None, turned, None]);
    }

    #[test]
    fn a_transformed_point_is_within_its_bound_of_doubles() {
        let mut random = fastrand::Rng::with_seed(10);
        // Two products whose entries are off by half a last place, the sum's rounding, and the coordinates'.
        let bound = |size: f64| {
            2.0 * size * entries().ulp() / 2.0 + (1.0 + 2.0_f64.sqrt()) * coordinates().ulp() / 2.0
        };
        for _ in 0..100_000 {
            let degrees = 360.0 * random.f64();
            let point: [f64; 3] = std::array::from_fn(|_| 200.0 * (random.f64() - 0.5));
            let transform = Transform::new(0.0, degrees, 1.0);
            let words = point.map(|c| coordinates().word(c) as i32);
            let turned = transform
                .apply(words)
                .map(|w| coordinates().value(i64::from(w)));
            let [c, s] = cos_sin(degrees);
            let [_, y, z] = point;
            let size = y.abs().max(z.abs());
            assert!(
                (turned[1] - (y * c - z * s)).abs() <= bound(size),
                "{degrees} {point:?}"
            );
            assert!(
                (turned[2] - (y * s + z * c)).abs() <= bound(size),
                "{degrees} {point:?}"
            );
        }
    }
}
