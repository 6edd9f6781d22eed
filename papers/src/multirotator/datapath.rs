//! The MultiRotator's circuit, clocked register by register (FPGA paper, figures 5 and 6).
//!
//! Four MACs with one coefficient each multiply serially: a shift register gives the bits of a coordinate, the
//! last one first, and each gates the coefficient into a scaling accumulator, which halves what it holds
//! before it adds. With 2-bit digits (the paper's parallel distributed arithmetic) even and odd bits have an
//! accumulator each. At last one adder and one subtracter join the products.
//!
//! Halving drops a bit. The paper drops it for good; here the bits dropped by the two accumulators that are
//! going to be joined are added as they come, in a serial adder of one digit, whose carry goes into the last
//! addition: so nothing is lost but what is behind the last place of the result. To round, one accumulator of
//! each pair starts at a half. Registers hold as many bits as the paper gives them and no more.

use crate::fixed::{Rounding, wrap};
use crate::resources::Resource;

use super::MultiRotator;

/// How many bits of a coordinate are taken in a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Digits {
    /// One: serial distributed arithmetic, SDA.
    One,
    /// Two: parallel distributed arithmetic, PDA.
    Two,
}

/// What joins the products.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adders {
    /// An adder and a subtracter, at once.
    Two,
    /// One that does either, one after the other.
    Shared,
}

/// A shift register.
#[derive(Debug, Clone, Copy)]
struct Shift {
    bits: u32,
    held: i64,
}

impl Shift {
    /// The last bits, which leave it. What comes in at the other end is the sign.
    #[inline(always)]
    fn clock<const D: usize>(&mut self) -> [bool; D] {
        let digits = std::array::from_fn(|k| self.held >> k & 1 == 1);
        self.held = wrap(self.held >> D, self.bits);
        digits
    }
}

/// A MAC with one coefficient: its register, and an accumulator for each bit of a digit.
#[derive(Debug, Clone, Copy)]
struct Mac<const D: usize> {
    /// n + 1 bits.
    coefficient: i64,
    /// n + 3 bits each.
    accumulators: [i64; D],
}

impl<const D: usize> Mac<D> {
    /// Starts with so much in the first accumulator.
    fn preset(&mut self, half: i64) {
        self.accumulators = [0; D];
        self.accumulators[0] = half;
    }

    /// Takes a digit; returns what the accumulators drop, each weighted as its bit of the digit.
    #[inline(always)]
    fn clock(&mut self, wiring: Wiring, digit: [bool; D], last: bool) -> i64 {
        let mut dropped = 0;
        for (k, gate) in digit.into_iter().enumerate() {
            let held = self.accumulators[k];
            dropped += (held & ((1 << D) - 1)) << k;
            let gated = if gate {
                self.coefficient << wiring.left
            } else {
                0
            };
            // The first bit of a two's complement number counts negative.
            let term = if last && k + 1 == D { -gated } else { gated };
            self.accumulators[k] = wrap((held >> D) + term, wiring.bits + 3);
        }
        dropped
    }

    /// What the accumulators make together.
    fn product(&self) -> i64 {
        let weighted = self.accumulators.iter().enumerate();
        weighted.map(|(k, held)| held << k).sum()
    }
}

/// Where the coefficient's bits meet the accumulator's.
#[derive(Debug, Clone, Copy)]
struct Wiring {
    /// Bits of a coordinate.
    bits: u32,
    /// How far to the left the coefficient goes in.
    left: u32,
    /// Digits of a coordinate.
    digits: u32,
}

/// The circuit. `D` is the number of bits in a digit.
#[derive(Debug, Clone, Copy)]
pub struct Datapath<const D: usize> {
    wiring: Wiring,
    rounding: Rounding,
    adders: Adders,
    /// Cosine and sine of a step, which the multiplexers let into the shift registers.
    step: [i64; 2],
    /// x·C and y·S, which are subtracted; y·C and x·S, which are added.
    macs: [[Mac<D>; 2]; 2],
    /// Cycles so far.
    pub cycles: u64,
}

impl<const D: usize> Datapath<D> {
    /// The circuit of an arithmetic, with the same words in its registers.
    pub fn new(rotator: &MultiRotator, adders: Adders) -> Self {
        let bits = rotator.format().bits();
        let digits = bits.div_ceil(D as u32);
        let mac = |coefficient| Mac {
            coefficient,
            accumulators: [0; D],
        };
        let [c, s] = rotator.turned().map(mac);
        Self {
            wiring: Wiring {
                bits,
                left: digits * D as u32 - 1 - rotator.format().fraction(),
                digits,
            },
            rounding: rotator.rounding(),
            adders,
            step: rotator.step(),
            macs: [[c, s], [c, s]],
            cycles: 0,
        }
    }

    /// Rotation mode: coordinates go into the shift registers, and come out turned.
    pub fn rotate(&mut self, coordinates: [i64; 2]) -> [i64; 2] {
        self.multiply(coordinates)
    }

    /// The other mode: the step goes into the shift registers, and what comes out into the MACs.
    pub fn advance(&mut self) {
        let [c, s] = self
            .multiply(self.step)
            .map(|word| wrap(word, self.wiring.bits + 1));
        for [of_cosine, of_sine] in &mut self.macs {
            (of_cosine.coefficient, of_sine.coefficient) = (c, s);
        }
    }

    /// Cosine and sine in the MACs' registers.
    pub fn turned(&self) -> [i64; 2] {
        self.macs[0].map(|mac| mac.coefficient)
    }

    fn multiply(&mut self, words: [i64; 2]) -> [i64; 2] {
        let wiring = self.wiring;
        let half = match self.rounding {
            Rounding::Truncate => 0,
            // What is halved once for each digit but the first, and once before that.
            Rounding::Nearest => 1 << (wiring.digits * D as u32 + D as u32 - 2),
        };
        for [first, second] in &mut self.macs {
            first.preset(half);
            second.preset(0);
        }
        let mut shifts = words.map(|held| Shift {
            bits: wiring.bits,
            held,
        });
        let mut carries = [0_i64; 2];
        for k in 0..wiring.digits {
            let [x, y] = shifts.each_mut().map(Shift::clock::<D>);
            let last = k + 1 == wiring.digits;
            let [[xc, ys], [yc, xs]] = &mut self.macs;
            let dropped = [
                xc.clock(wiring, x, last) - ys.clock(wiring, y, last),
                yc.clock(wiring, y, last) + xs.clock(wiring, x, last),
            ];
            for (carry, dropped) in carries.iter_mut().zip(dropped) {
                *carry = (*carry + dropped) >> D;
            }
            self.cycles += 1;
        }
        self.cycles += match self.adders {
            Adders::Two => 1,
            Adders::Shared => 2,
        };
        let [[xc, ys], [yc, xs]] = self.macs;
        let sums = [
            xc.product() - ys.product() + carries[0],
            yc.product() + xs.product() + carries[1],
        ];
        // Of a digit's bits the first counts whole, the others are fractions of it.
        sums.map(|sum| wrap(sum, wiring.bits + 3) >> (D - 1))
    }
}

/// Cycles from coordinates to turned coordinates, for words of so many bits.
pub fn cycles(bits: u32, digits: Digits, adders: Adders) -> u32 {
    let multiplying = match digits {
        Digits::One => bits,
        Digits::Two => bits.div_ceil(2),
    };
    multiplying
        + match adders {
            Adders::Two => 1,
            Adders::Shared => 2,
        }
}

/// What the circuit is made of, for words of so many bits: the paper's list, and what catches dropped bits.
pub fn resources(bits: u32, digits: Digits, adders: Adders) -> Vec<Resource> {
    let each = match digits {
        Digits::One => 1,
        Digits::Two => 2,
    };
    let joining = match adders {
        Adders::Two => [
            Resource::adder("adder", 1, bits + 3),
            Resource::adder("subtracter", 1, bits + 3),
        ]
        .to_vec(),
        Adders::Shared => vec![Resource::adder("adder/subtracter", 1, bits + 3)],
    };
    let mut list = vec![
        Resource::other("multiplexer", 2, bits),
        Resource::register("shift register", 2, bits),
        Resource::register("coefficient register", 4 * each, bits + 1),
        Resource::accumulator("scaling accumulator", 4 * each, bits + 3),
    ];
    list.extend(joining);
    list.push(Resource::accumulator(
        "serial adder for dropped bits (not in the paper)",
        2,
        each,
    ));
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::Format;

    /// Random words, and now and then the ends of the range.
    fn word(random: &mut fastrand::Rng, format: Format) -> i64 {
        match random.u8(..16) {
            0 => format.greatest(),
            1 => -format.greatest() - 1,
            _ => random.i64(-format.greatest() - 1..=format.greatest()),
        }
    }

    /// Circuit and arithmetic over a million points, with a step and its recurrence after every few.
    fn equal<const D: usize>(digits: Digits, bits: u32, fraction: u32) {
        let mut random = fastrand::Rng::with_seed(u64::from(bits));
        let format = Format::new(bits, fraction).expect("valid");
        for rounding in [Rounding::Truncate, Rounding::Nearest] {
            let mut points = 0;
            while points < 500_000 {
                let mut rotator = MultiRotator::new(format, rounding, 360.0 * random.f64());
                let adders = if random.bool() {
                    Adders::Two
                } else {
                    Adders::Shared
                };
                let mut datapath = Datapath::<D>::new(&rotator, adders);
                for step in 0..500 {
                    let point = [word(&mut random, format), word(&mut random, format)];
                    let expected = rotator.rotate(point);
                    let before = datapath.cycles;
                    assert_eq!(
                        datapath.rotate(point),
                        expected,
                        "{rotator:?} {step} {point:?}"
                    );
                    let took = datapath.cycles - before;
                    assert_eq!(took, u64::from(cycles(bits, digits, adders)));
                    rotator.advance();
                    datapath.advance();
                    assert_eq!(datapath.turned(), rotator.turned(), "{rotator:?} {step}");
                    points += 1;
                }
            }
        }
    }

    #[test]
    fn a_million_points_leave_the_serial_circuit_as_the_arithmetic_has_them() {
        for (bits, fraction) in [(16, 15), (21, 19), (32, 31)] {
            equal::<1>(Digits::One, bits, fraction);
        }
    }

    #[test]
    fn a_million_points_leave_the_parallel_circuit_as_the_arithmetic_has_them() {
        for (bits, fraction) in [(16, 15), (21, 20), (32, 24)] {
            equal::<2>(Digits::Two, bits, fraction);
        }
    }

    #[test]
    fn cycles_are_the_papers() {
        assert_eq!(cycles(32, Digits::One, Adders::Two), 33);
        assert_eq!(cycles(32, Digits::One, Adders::Shared), 34);
        assert_eq!(cycles(32, Digits::Two, Adders::Two), 17);
        assert_eq!(cycles(21, Digits::Two, Adders::Shared), 13);
    }
}
