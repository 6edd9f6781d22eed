//! A machined surface in figures.

use horma_core::{Machined, Spot};
use serde::{Deserialize, Serialize};

/// How far a machined surface lies outside of the designed one, on rays from the spindle; lengths in mm,
/// negative where it was gouged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MachinedStatistics {
    /// Rays from the spindle.
    pub rays: usize,
    /// Of these, those that meet both surfaces.
    pub compared: usize,
    /// From ray to ray along the spindle, mm.
    pub spacing: f64,
    /// Rays around the spindle.
    pub columns: u32,
    /// Where the cutter went deepest into the designed surface, if it did.
    pub deepest_gouge: Option<Spot>,
    /// Where most is left.
    pub largest_excess: Option<Spot>,
    /// What so many of the compared rays do not exceed; nothing if there are none.
    pub percentiles: Option<Percentiles>,
    /// What the job allows between the two, mm, if it says so.
    pub tolerance: Option<f64>,
    /// Share of the compared rays that keep to it.
    pub within_tolerance: Option<f64>,
}

/// Deviations that a percentage of the compared rays do not exceed, by nearest rank, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// 1 %.
    pub p1: f64,
    /// 10 %.
    pub p10: f64,
    /// Half of them.
    pub median: f64,
    /// 90 %.
    pub p90: f64,
    /// 99 %.
    pub p99: f64,
}

impl MachinedStatistics {
    /// Of a machined surface that is to stay within `tolerance`, mm, of the designed one.
    pub fn of(surface: &Machined, tolerance: Option<f64>) -> Self {
        let mut deviations: Vec<f64> = surface.deviation.iter().flatten().copied().collect();
        deviations.sort_unstable_by(f64::total_cmp);
        let compared = deviations.len();
        let rank = |percent: usize| deviations[(percent * compared).div_ceil(100).max(1) - 1];
        let within = |tolerance: f64| {
            let within = deviations.iter().filter(|d| d.abs() <= tolerance);
            within.count() as f64 / compared as f64
        };
        Self {
            rays: surface.rays.len(),
            compared,
            spacing: surface.rays.step,
            columns: surface.rays.columns,
            deepest_gouge: surface.deepest().filter(|spot| spot.deviation < 0.0),
            largest_excess: surface.highest().filter(|spot| spot.deviation > 0.0),
            percentiles: (compared > 0).then(|| Percentiles {
                p1: rank(1),
                p10: rank(10),
                median: rank(50),
                p90: rank(90),
                p99: rank(99),
            }),
            tolerance,
            within_tolerance: tolerance.filter(|_| compared > 0).map(within),
        }
    }

    /// In words.
    pub fn describe(&self) -> String {
        let spot = |name: &str, spot: &Option<Spot>| match spot {
            None => format!("{name}: none"),
            Some(s) => format!(
                "{name}: {:.4} mm at x {:.3}, {:.1}°",
                s.deviation.abs(),
                s.x,
                s.angle
            ),
        };
        let within = self.within_tolerance.zip(self.tolerance);
        let within = within.map_or(String::new(), |(share, tolerance)| {
            let percent = 100.0 * share;
            format!("\nwithin {tolerance} mm of the designed surface: {percent:.1} %")
        });
        format!(
            "{} rays from the spindle, {} of them meet both surfaces\n{}\n{}{within}",
            self.rays,
            self.compared,
            spot("deepest gouge", &self.deepest_gouge),
            spot("largest excess", &self.largest_excess),
        )
    }
}

#[cfg(test)]
mod tests {
    use horma_core::Rays;

    use super::*;

    /// Rays 10 mm from the spindle to these deviations.
    fn surface(deviation: Vec<Option<f64>>) -> Machined {
        let rays = Rays {
            from: 0.0,
            step: 1.0,
            rows: 1,
            columns: deviation.len() as u32,
        };
        Machined {
            rays,
            designed: vec![Some(10.0); rays.len()],
            machined: deviation.iter().map(|d| d.map(|d| 10.0 + d)).collect(),
            deviation,
        }
    }

    #[test]
    fn percentiles_are_ranks_and_places_are_those_of_the_extremes() {
        let mut deviation: Vec<_> = (1..=100).map(|k| Some(f64::from(k) / 100.0)).collect();
        deviation[6] = Some(-0.5);
        deviation.push(None);
        let found = MachinedStatistics::of(&surface(deviation), Some(0.5));
        assert_eq!((found.rays, found.compared), (101, 100));
        let gouge = found.deepest_gouge.expect("one");
        assert_eq!(gouge.deviation, -0.5);
        assert_eq!(gouge.angle, 360.0 * 6.0 / 101.0);
        assert_eq!(found.largest_excess.map(|s| s.deviation), Some(1.0));
        let percentiles = found.percentiles.expect("some");
        assert_eq!((percentiles.p1, percentiles.p99), (-0.5, 0.99));
        assert_eq!(percentiles.median, 0.5);
        assert_eq!(found.within_tolerance, Some(0.5));
        assert!(found.describe().contains("deepest gouge: 0.5000 mm"));
    }

    #[test]
    fn of_nothing_there_are_no_figures() {
        let found = MachinedStatistics::of(&surface(vec![None; 3]), Some(0.01));
        assert_eq!((found.rays, found.compared), (3, 0));
        assert_eq!(found.percentiles, None);
        assert_eq!(found.within_tolerance, None);
        assert!(found.describe().contains("largest excess: none"));
    }
}
