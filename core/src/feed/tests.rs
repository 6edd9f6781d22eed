use super::*;

const ROUGH: AxisLimits = AxisLimits {
    velocity: 300.0,
    acceleration: 3000.0,
    jerk: f64::INFINITY,
};

fn limits(axes: [AxisLimits; 3]) -> Limits {
    Limits {
        feed: 1.0e9,
        shortest: 0.0,
        axes,
    }
}

/// A helix whose height follows `height` of the angle in radians.
fn helix(turns: usize, ppr: usize, height: impl Fn(f64) -> f64) -> Vec<Station> {
    let station = |i: usize| {
        let turn = i as f64 / ppr as f64;
        Station {
            axes: [
                2.0 * turn,
                height(2.0 * std::f64::consts::PI * turn),
                360.0 * turn,
            ],
            reach: 50.0,
        }
    };
    (0..=turns * ppr).map(station).collect()
}

/// That nothing is beyond its limit, and how much of each axis's acceleration is used.
#[track_caller]
fn held(stations: &[Station], limits: &Limits) -> (Timing, [Peak; 3]) {
    let timing = timing(stations, limits);
    assert!(timing.durations.iter().all(|t| t.is_finite() && *t > 0.0));
    let peaks = peaks(stations, &timing.durations);
    for (peak, limit) in peaks.iter().zip(limits.axes) {
        let slack = 1.0 + 1.0e-9;
        assert!(peak.velocity <= slack * limit.velocity, "{peak:?}");
        assert!(peak.acceleration <= slack * limit.acceleration, "{peak:?}");
        assert!(peak.jerk <= slack * limit.jerk, "{peak:?}");
    }
    for (w, t) in stations.windows(2).zip(&timing.durations) {
        let feed = w[0].cut(&w[1]) / t;
        assert!(feed <= (1.0 + 1.0e-9) * limits.feed && *t >= 0.999_999 * limits.shortest);
    }
    (timing, peaks)
}

#[test]
fn without_a_machine_the_feed_alone_decides() {
    let stations = helix(3, 36, |a| 60.0 + 10.0 * a.sin());
    let limits = Limits {
        feed: 30.0,
        ..limits([AxisLimits::NONE; 3])
    };
    let timing = timing(&stations, &limits);
    for (w, t) in stations.windows(2).zip(&timing.durations) {
        assert!((w[0].cut(&w[1]) / t - 30.0).abs() < 1e-9);
    }
    assert!(timing.bounds.iter().all(|b| *b == Bound::Feed));
}

#[test]
fn a_straight_way_is_a_trapezoid() {
    let station = |i: usize| Station {
        axes: [0.01 * i as f64, 0.0, 0.0],
        reach: 0.0,
    };
    let stations: Vec<Station> = (0..=20_000).map(station).collect();
    let limits = limits([ROUGH, AxisLimits::NONE, AxisLimits::NONE]);
    let (timing, _) = held(&stations, &limits);
    let expected = 200.0 / 300.0 + 300.0 / 3000.0;
    let found: f64 = timing.durations.iter().sum();
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    assert_eq!(
        timing.bounds[0],
        Bound::Acceleration(MachineAxis::Travel),
        "it starts at rest"
    );
    assert_eq!(timing.bounds[10_000], Bound::Velocity(MachineAxis::Travel));
    assert_eq!(timing.bounds[19_999], timing.bounds[0], "it looks ahead");
}

#[test]
fn a_plan_uses_what_there_is_and_beats_a_steady_spindle() {
    // Steep on one side, as a last between its heel and its ball.
    let stations = helix(20, 360, |a| 80.0 + 25.0 * (a.sin() + 0.5 * a.cos()).exp());
    let rotation = AxisLimits {
        velocity: 720.0,
        acceleration: 5000.0,
        ..AxisLimits::NONE
    };
    let limits = limits([AxisLimits::NONE, ROUGH, rotation]);
    let (timing, peaks) = held(&stations, &limits);
    assert!(peaks[1].acceleration > 0.9 * ROUGH.acceleration || peaks[1].velocity > 299.0);
    let steady = steady(&stations, &limits).expect("it turns");
    let seconds: f64 = timing.durations.iter().sum();
    assert!(seconds < 0.8 * steady.seconds, "{seconds} {steady:?}");
    // Any faster, and the steady spindle breaks a limit.
    let at = |velocity: f64| -> Vec<f64> {
        let moves = stations.windows(2);
        moves.map(|w| w[0].to(&w[1])[2] / velocity).collect()
    };
    let found = super::peaks(&stations[..], &at(1.01 * steady.velocity));
    assert!(
        found[1].velocity > 300.0
            || found[1].acceleration > 3000.0
            || 1.01 * steady.velocity > 720.0,
        "{found:?}"
    );
}

#[test]
fn a_control_that_takes_no_shorter_move_is_not_told_any() {
    let stations = helix(2, 360, |_| 60.0);
    let mut limits = limits([AxisLimits::NONE; 3]);
    limits.shortest = 0.006;
    let (timing, _) = held(&stations, &limits);
    assert!(timing.bounds.iter().all(|b| *b == Bound::Shortest));
    let steady = steady(&stations, &limits).expect("it turns");
    assert!((steady.seconds / (720.0 * 0.006) - 1.0).abs() < 1e-9);
}

#[test]
fn jerk_is_kept_where_it_is_given() {
    let stations = helix(5, 360, |a| 80.0 + 15.0 * (a.sin() + 0.5 * a.cos()).exp());
    let rotation = AxisLimits {
        velocity: 720.0,
        acceleration: 5000.0,
        ..AxisLimits::NONE
    };
    let without = limits([AxisLimits::NONE, ROUGH, rotation]);
    let (quick, hard) = held(&stations, &without);
    let gentle = AxisLimits {
        jerk: 200_000.0,
        ..ROUGH
    };
    assert!(hard[1].jerk > 2.0 * gentle.jerk, "{hard:?}");
    let with = limits([AxisLimits::NONE, gentle, rotation]);
    let (slow, _) = held(&stations, &with);
    let seconds = |t: &Timing| t.durations.iter().sum::<f64>();
    let ratio = seconds(&slow) / seconds(&quick);
    assert!(ratio > 1.0 && ratio < 2.0, "{ratio}");
    let jerk = |b: &&Bound| matches!(b, Bound::Jerk(_));
    let mut jerks = slow.bounds.iter().filter(jerk).peekable();
    assert!(jerks.peek().is_some());
    assert!(jerks.all(|b| *b == Bound::Jerk(MachineAxis::Attack)));
}

#[test]
fn short_paths_are_planned_too() {
    let stations = helix(1, 3, |_| 60.0);
    let limits = limits([ROUGH; 3]);
    for n in 0..=3 {
        let (timing, _) = held(&stations[..n], &limits);
        assert_eq!(timing.durations.len(), n.saturating_sub(1));
        assert_eq!(steady(&stations[..n], &limits).is_some(), n > 1);
    }
}
