//! Unit and host at work at once (coprocessor paper, figures 5 and 6, table 1), and figure 10 of the FPGA paper.
//!
//! The unit transforms position i into the board's banks; once it is through, the host copies the banks into its
//! own memory and acknowledges, and then takes the distances of i while the unit transforms i + 1. So there are
//! two buffers, and neither side waits longer than for the other.

/// What one position takes, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Work {
    /// The unit's cycles, by its clock.
    pub transform: f64,
    /// Copying, and the messages about it.
    pub transfer: f64,
    /// The host's distances.
    pub distance: f64,
}

/// How long it takes, and who waited, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Elapsed {
    /// From the first cycle of the unit to the host's last distance.
    pub total: f64,
    /// How long the unit waited for the host to acknowledge.
    pub unit_waited: f64,
    /// How long the host waited for the unit.
    pub host_waited: f64,
}

/// Positions one after the other, event by event.
pub fn simulate(positions: impl IntoIterator<Item = Work>) -> Elapsed {
    let mut elapsed = Elapsed::default();
    // When the unit may begin, and when the host has no distances left to take.
    let (mut acknowledged, mut idle) = (0.0_f64, 0.0_f64);
    for work in positions {
        let transformed = acknowledged + work.transform;
        let copying = transformed.max(idle);
        elapsed.unit_waited += copying - transformed + work.transfer;
        elapsed.host_waited += copying - idle;
        acknowledged = copying + work.transfer;
        idle = acknowledged + work.distance;
    }
    elapsed.total = idle;
    elapsed
}

/// Table 1: seconds without the unit, and with it by its clock in MHz.
pub const ALONE: f64 = 236.2;
/// With it, by its clock in MHz.
pub const PRINTED: [(f64, f64); 2] = [(16.0, 92.3), (33.0, 57.6)];
/// The fastest clock that the board took, MHz.
pub const FASTEST: f64 = 53.073;

/// Table 1 as `time = cycles / clock + rest`: what does not become shorter with the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Cycles of the unit in all, millions.
    pub megacycles: f64,
    /// Transfers and what else the unit waits for, s.
    pub rest: f64,
}

impl Fit {
    /// The one through both printed times.
    pub fn printed() -> Self {
        let [(slow, long), (fast, short)] = PRINTED;
        let megacycles = (long - short) / (1.0 / slow - 1.0 / fast);
        Self {
            megacycles,
            rest: long - megacycles / slow,
        }
    }

    /// Seconds at a clock in MHz.
    pub fn time(&self, clock: f64) -> f64 {
        self.megacycles / clock + self.rest
    }
}

/// Figure 10 as `time = 1 − s + s·f₀/f`: of the time without hardware the share s is rotations, and at the clock
/// f₀ hardware is as fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotations {
    /// s.
    pub share: f64,
    /// f₀, MHz.
    pub even: f64,
}

impl Rotations {
    /// Break-even at 22 MHz, and 30 % less at 50.
    pub fn printed() -> Self {
        let even = 22.0;
        Self {
            share: 0.3 / (1.0 - even / 50.0),
            even,
        }
    }

    /// The share given, and the same break-even.
    pub fn of_share(share: f64) -> Self {
        Self {
            share,
            ..Self::printed()
        }
    }

    /// Time at a clock in MHz, of that without hardware.
    pub fn time(&self, clock: f64) -> f64 {
        1.0 - self.share + self.share * self.even / clock
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORK: Work = Work {
        transform: 3.0,
        transfer: 1.0,
        distance: 2.0,
    };

    #[test]
    fn the_slower_of_the_two_sets_the_pace() {
        // A position every 3 + 1, and the last one's distances.
        let elapsed = simulate([WORK; 10]);
        assert_eq!(elapsed.total, 42.0);
        assert_eq!(
            (elapsed.unit_waited, elapsed.host_waited),
            (10.0, 3.0 + 9.0)
        );
        let slow_host = Work {
            distance: 7.0,
            ..WORK
        };
        // The first is ready at 3; then one every 1 + 7.
        assert_eq!(simulate([slow_host; 10]).total, 83.0);
        assert_eq!(simulate([]), Elapsed::default());
    }

    #[test]
    fn the_models_go_through_what_is_printed() {
        let fit = Fit::printed();
        for (clock, time) in PRINTED {
            assert!((fit.time(clock) - time).abs() < 1.0e-9);
        }
        assert!(
            (fit.megacycles - 1077.7).abs() < 0.1 && (fit.rest - 24.94).abs() < 0.01,
            "{fit:?}"
        );
        let rotations = Rotations::printed();
        assert!((rotations.time(22.0) - 1.0).abs() < 1.0e-12);
        assert!((rotations.time(50.0) - 0.7).abs() < 1.0e-12);
    }
}
