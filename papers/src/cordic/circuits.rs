//! CORDIC's circuits, clocked register by register.
//!
//! The bit-parallel one does an iteration in a cycle, with barrel shifters and three adders as wide as their
//! words. The bit-serial one has three adders of one bit, and takes an iteration bit by bit. Both take the
//! gain back with a constant multiplier, a cycle or a word's time after the last iteration.

use crate::fixed::wrap;
use crate::resources::Resource;

use super::{Angle, Cordic, guard};

/// The bit-parallel circuit.
#[derive(Debug, Clone)]
pub struct Parallel<'a> {
    cordic: &'a Cordic,
    /// Cycles so far.
    pub cycles: u64,
}

impl<'a> Parallel<'a> {
    /// The circuit of an arithmetic.
    pub fn new(cordic: &'a Cordic) -> Self {
        Self { cordic, cycles: 0 }
    }

    /// A point turned by an angle.
    pub fn rotate(&mut self, point: [i64; 2], angle: Angle) -> [i64; 2] {
        let cordic = self.cordic;
        let (width, narrow) = (cordic.width(), cordic.bits + 1);
        let mut words = cordic.enter(point, angle.quarters).map(|w| wrap(w, width));
        let mut left = wrap(angle.rest, narrow);
        for (i, &step) in cordic.angles.iter().enumerate() {
            let shifted = words.map(|w| w >> i);
            let back = left < 0;
            let sum =
                |a: i64, b: i64, minus: bool, bits| wrap(if minus { a - b } else { a + b }, bits);
            words = [
                sum(words[0], shifted[1], !back, width),
                sum(words[1], shifted[0], back, width),
            ];
            left = sum(left, step, !back, narrow);
            self.cycles += 1;
        }
        self.cycles += 1;
        words.map(|w| cordic.leave(w))
    }
}

/// A shift register of one word, the last bit first.
#[derive(Debug, Clone, Copy)]
struct Word {
    held: u64,
    bits: u32,
}

impl Word {
    fn load(word: i64, bits: u32) -> Self {
        let held = word as u64 & (u64::MAX >> (64 - bits));
        Self { held, bits }
    }

    #[inline(always)]
    fn last(self) -> bool {
        self.held & 1 == 1
    }

    #[inline(always)]
    fn sign(self) -> bool {
        self.held >> (self.bits - 1) & 1 == 1
    }

    /// Drops the last bit and takes one in at the other end.
    #[inline(always)]
    fn clock(&mut self, bit: bool) {
        self.held = self.held >> 1 | u64::from(bit) << (self.bits - 1);
    }

    fn word(self) -> i64 {
        wrap(self.held as i64, self.bits)
    }
}

/// An adder of one bit, with the carry that it keeps; it subtracts by adding what is turned over, and one.
#[derive(Debug, Clone, Copy)]
struct OneBit {
    minus: bool,
    carry: bool,
}

impl OneBit {
    fn new(minus: bool) -> Self {
        Self {
            minus,
            carry: minus,
        }
    }

    #[inline(always)]
    fn clock(&mut self, a: bool, b: bool) -> bool {
        let b = b ^ self.minus;
        let sum = a ^ b ^ self.carry;
        self.carry = (a & b) | (self.carry & (a ^ b));
        sum
    }
}

/// The bit-serial circuit.
#[derive(Debug, Clone)]
pub struct Serial<'a> {
    cordic: &'a Cordic,
    /// Cycles so far.
    pub cycles: u64,
}

impl<'a> Serial<'a> {
    /// The circuit of an arithmetic.
    pub fn new(cordic: &'a Cordic) -> Self {
        Self { cordic, cycles: 0 }
    }

    /// A point turned by an angle.
    pub fn rotate(&mut self, point: [i64; 2], angle: Angle) -> [i64; 2] {
        let cordic = self.cordic;
        let (width, narrow) = (cordic.width(), cordic.bits + 1);
        let [mut x, mut y] = cordic
            .enter(point, angle.quarters)
            .map(|w| Word::load(w, width));
        let mut left = Word::load(angle.rest, narrow);
        for (i, &step) in (0..).zip(&cordic.angles) {
            let back = left.sign();
            let signs = [x.sign(), y.sign()];
            let mut of_x = OneBit::new(!back);
            let mut of_y = OneBit::new(back);
            let mut of_left = OneBit::new(!back);
            for k in 0..width {
                // The other coordinate's bit that is worth 2ⁱ times as much, and its sign beyond the first.
                let shifted = |word: Word, sign| {
                    if k + i < width {
                        word.held >> i & 1 == 1
                    } else {
                        sign
                    }
                };
                let (dx, dy) = (shifted(y, signs[1]), shifted(x, signs[0]));
                let (next_x, next_y) = (of_x.clock(x.last(), dx), of_y.clock(y.last(), dy));
                x.clock(next_x);
                y.clock(next_y);
                if k < narrow {
                    let next = of_left.clock(left.last(), step >> k & 1 == 1);
                    left.clock(next);
                }
                self.cycles += 1;
            }
        }
        self.cycles += u64::from(width);
        [x, y].map(|w| cordic.leave(w.word()))
    }
}

/// What the bit-serial or the bit-parallel circuit is made of, for coordinates of so many bits.
pub fn resources(bits: u32, serial: bool) -> Vec<Resource> {
    let (width, narrow) = (bits + 2 + guard(bits), bits + 1);
    let list = if serial {
        [
            Resource::register("shift register", 2, width),
            Resource::register("angle shift register", 1, narrow),
            Resource::other("multiplexer of the tap", 2, 1),
            Resource::other("table of angles", 1, narrow),
            Resource::accumulator("serial adder/subtracter", 3, 1),
        ]
    } else {
        [
            Resource::register("register", 2, width),
            Resource::register("angle register", 1, narrow),
            Resource::other("barrel shifter", 2, width),
            Resource::other("table of angles", 1, narrow),
            Resource::adder("adder/subtracter (one narrower)", 3, width),
        ]
    };
    let mut list = list.to_vec();
    list.push(Resource::other(
        "constant multiplier for the gain",
        2,
        width,
    ));
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::Format;

    #[test]
    fn a_million_points_leave_both_circuits_as_the_arithmetic_has_them() {
        let mut random = fastrand::Rng::with_seed(8);
        for (bits, points) in [(16, 1_000_000_u64), (21, 100_000), (32, 100_000)] {
            let cordic = Cordic::new(bits).expect("valid");
            let most = Format::new(bits, 0).expect("valid").greatest();
            let (mut parallel, mut serial) = (Parallel::new(&cordic), Serial::new(&cordic));
            for k in 0..points {
                let point = match k % 16 {
                    0 => [most, -most - 1],
                    1 => [-most - 1, -most - 1],
                    _ => [random.i64(-most - 1..=most), random.i64(-most - 1..=most)],
                };
                let angle = cordic.angle(720.0 * (random.f64() - 0.5));
                let expected = cordic.rotate(point, angle);
                assert_eq!(
                    parallel.rotate(point, angle),
                    expected,
                    "{bits} {point:?} {angle:?}"
                );
                assert_eq!(
                    serial.rotate(point, angle),
                    expected,
                    "{bits} {point:?} {angle:?}"
                );
            }
            let (iterations, width) = (u64::from(bits) + 1, u64::from(cordic.width()));
            assert_eq!(parallel.cycles, points * (iterations + 1));
            assert_eq!(serial.cycles, points * (iterations + 1) * width);
        }
    }
}
