//! Points in 21 bits, the unit, table 1, and figures 4 and 10 of the FPGA paper.

use horma_core::{Coordinates, Packing, Point};
use horma_formats::plot::{Curve, Plot, Scale};

use crate::error::Result;
use crate::fixed::Rounding;
use crate::multirotator::{Adders, Digits, cycles};
use crate::report::{Block, Chapter, Claim, Verdict, three};

use super::path::{Compared, Sample};
use super::schedule::{ALONE, Elapsed, FASTEST, Fit, PRINTED, Rotations, Work, simulate};
use super::shares::{self, Shares};
use super::transform::{STAGES, coordinates};

/// Figure 4: what distances take of the inner loop, "almost 60 %".
const DISTANCES: f64 = 0.6;
/// The error of a path that a last allows, mm.
const ALLOWED: f64 = 0.1;

/// What there is to tell.
///
/// # Errors
/// None, for the sample last.
pub fn chapter() -> Result<Chapter> {
    let sample = Sample::new()?;
    let compared = sample.compare();
    let shares = shares::measure(&sample.points, [40.0, 8.0]);
    let blocks = vec![
        Block::text(
            "A point is packed into a word of 64 bits, three coordinates of 21 bits with 11 after the point, so \
             that the unit fetches one each cycle. It turns and moves the points in the tool's influence area, \
             those within the cutter's width along the spindle, with matrix entries of 19 bits after the point, \
             in five stages. The host takes their distances in doubles. Both work at once, on two buffers: the \
             unit at position i, the host at i − 1.",
        ),
        Block::text(format!(
            "On the sample last and its holders, {} points on grids of 130 × 120 as in print, torus R 40 r 8, 100 \
             positions to a millimetre as in print, {} positions; paths in doubles by horma's exact search over \
             the same points.",
            sample.points.len(),
            sample.trajectory().positions
        )),
        Block::Claims(precision(&sample, &compared)?),
        Block::text(
            "Table 1 has two times with the unit, so that a model of two numbers goes through both: cycles of the \
             unit over its clock, and a rest that does not become shorter, for transfers and their messages. What \
             follows from it is not fitted.",
        ),
        Block::Figure("speedup", speedup_plot()),
        Block::table(
            "Table 1 by the model, and by simulating unit and host position by position, with distances that take \
             60 % of the time without the unit, over the influence area alone",
            &[
                "clock, MHz",
                "in print, s",
                "model, s",
                "speed-up",
                "simulated, s",
                "host waits",
            ],
            table1(&sample, &compared),
        ),
        Block::Claims(speedups(&sample, &compared)),
        Block::text(
            "Figure 10 of the FPGA paper: of the time without hardware a share s is rotations, and hardware is as \
             fast at 22 MHz, so `time = 1 − s + s·22/f`. The 30 % at 50 MHz give s = 54 %, which cannot be: figure \
             4 has distances at almost 60 %, which leaves 40 % for rotations at most. Both curves are drawn.",
        ),
        Block::Figure("figure10", figure10()),
        Block::Claims(rotations()),
        Block::Timed(timed(&shares)),
    ];
    Ok(Chapter {
        name: "coprocessor",
        title: "The coprocessor",
        source: "the coprocessor paper, section 4 and table 1; figures 4 and 10 of the FPGA paper",
        blocks,
    })
}

/// How far coordinates are from their words at most, mm: truncated and rounded.
fn representation(points: &[Point]) -> Result<[f64; 2]> {
    let packing = Packing::new(coordinates().fraction())?;
    let ulp = coordinates().ulp();
    let mut most = [0.0_f64; 2];
    for &point in points {
        let back = packing.unpack(packing.pack(point)?);
        for (coordinate, rounded) in point.into_iter().zip(back) {
            let truncated = libm::floor(coordinate / ulp) * ulp;
            most[0] = most[0].max((coordinate - truncated).abs());
            most[1] = most[1].max((coordinate - rounded).abs());
        }
    }
    Ok(most)
}

fn precision(sample: &Sample, compared: &Compared) -> Result<Vec<Claim>> {
    let [truncated, rounded] = representation(&sample.points)?;
    let ulp = coordinates().ulp();
    let (cycles, _) = sample.clocked(sample.trajectory().positions / 2);
    let points = sample.points.len() as u64;
    Ok(vec![
        Claim::new(
            "worst error of a coordinate in 21 bits",
            "2⁻¹¹ = 4.88·10⁻⁴ mm",
            format!(
                "{} mm {}, {} {}",
                three(truncated),
                Rounding::Truncate.name(),
                three(rounded),
                Rounding::Nearest.name()
            ),
            Verdict::of(truncated <= ulp && truncated > 0.99 * ulp && rounded <= ulp / 2.0),
        ),
        Claim::new(
            "range of a coordinate with 11 bits after the point",
            "",
            "±512 mm",
            Verdict::Unsaid,
        ),
        Claim::new(
            "error of the path's points",
            "always below 0.1 mm",
            format!(
                "{} mm at most, {} on average",
                three(compared.largest),
                three(compared.mean)
            ),
            Verdict::of(compared.largest < ALLOWED),
        ),
        Claim::new(
            "positions at which only one of the two touches, where a point is at the end of the reach",
            "",
            format!("{} of {}", compared.one, compared.both + compared.one),
            Verdict::Unsaid,
        ),
        Claim::new(
            "a point on its way to a worker, with `coordinates = \"packed21\"`",
            "64 bits",
            format!(
                "8 bytes instead of 24; the surface is {} mm off at most, and heights over these points, \
                 searched in doubles, {}",
                three(Coordinates::Packed21.error()),
                three(compared.sent)
            ),
            Verdict::Agrees,
        ),
        Claim::new(
            "stages of the pipeline, and points a cycle",
            "5, and 1",
            format!("{points} points in {cycles} cycles"),
            Verdict::of(cycles == points + STAGES - 1),
        ),
        Claim::new(
            "points in the tool's influence area, of all",
            "",
            format!("{:.1} % on average", 100.0 * mean_area(sample, compared)),
            Verdict::Unsaid,
        ),
    ])
}

fn mean_area(sample: &Sample, compared: &Compared) -> f64 {
    let sum: usize = compared.areas.iter().sum();
    sum as f64 / (compared.areas.len() * sample.points.len()) as f64
}

/// Unit and host at a clock, over the sample's positions.
fn simulated(sample: &Sample, compared: &Compared, clock: f64) -> Elapsed {
    let fit = Fit::printed();
    let positions = compared.areas.len() as f64;
    let all = sample.points.len() as f64;
    let work = |&area: &usize| Work {
        transform: fit.megacycles / clock / positions,
        transfer: fit.rest / positions,
        distance: DISTANCES * ALONE / positions * area as f64 / all,
    };
    simulate(compared.areas.iter().map(work))
}

fn table1(sample: &Sample, compared: &Compared) -> Vec<Vec<String>> {
    let clocks = PRINTED
        .into_iter()
        .map(|(clock, time)| (clock, time.to_string()));
    let clocks = clocks.chain([(FASTEST, String::new())]);
    clocks
        .map(|(clock, printed)| {
            let time = Fit::printed().time(clock);
            let elapsed = simulated(sample, compared, clock);
            vec![
                clock.to_string(),
                printed,
                three(time),
                three(ALONE / time),
                three(elapsed.total),
                format!("{:.0} %", 100.0 * elapsed.host_waited / elapsed.total),
            ]
        })
        .collect()
}

fn speedups(sample: &Sample, compared: &Compared) -> Vec<Claim> {
    let fit = Fit::printed();
    let speedup = |clock: f64| ALONE / fit.time(clock);
    let [slow, fast] = PRINTED.map(|(clock, _)| speedup(clock));
    // Behind the unit's cycles at the faster clock there is room for this much, of the time without the unit.
    let hidden = fit.megacycles / PRINTED[1].0;
    let room = hidden / (DISTANCES * ALONE);
    let area = mean_area(sample, compared);
    let cycles = (sample.points.len() as u64 + STAGES - 1) * sample.trajectory().positions;
    vec![
        Claim::new("speed-up at 16 MHz", "2.6", three(slow), Verdict::Fitted),
        Claim::new("speed-up at 33 MHz", "4.1", three(fast), Verdict::Fitted),
        Claim::new(
            "speed-up at 53 MHz, the fastest clock",
            "",
            three(speedup(FASTEST)),
            Verdict::Unsaid,
        ),
        Claim::new(
            "speed-up at any clock",
            "",
            format!("below {}", three(ALONE / fit.rest)),
            Verdict::Unsaid,
        ),
        Claim::new(
            "cycles of the unit, millions",
            "",
            format!(
                "{:.0} by table 1; {:.0} on the sample last, every point at every position",
                fit.megacycles,
                cycles as f64 / 1.0e6
            ),
            Verdict::Unsaid,
        ),
        Claim::new(
            "distances take almost 60 % of the time (FPGA paper), and hide behind the unit at 33 MHz",
            "both",
            format!(
                "there is room for {:.0} % of all points; {:.1} % are in the influence area",
                100.0 * room,
                100.0 * area
            ),
            Verdict::of(area < room),
        ),
    ]
}

fn speedup_plot() -> Plot {
    let fit = Fit::printed();
    let clocks = (8..=120).map(f64::from);
    let curve = |name: &str, color, dashed, points: Vec<[f64; 2]>| Curve {
        name: name.to_owned(),
        color,
        dashed,
        points,
    };
    let limit = ALONE / fit.rest;
    Plot {
        title: "Speed-up by the coprocessor against its clock".to_owned(),
        subtitle: format!(
            "{:.0} million cycles, and {:.1} s at any clock",
            fit.megacycles, fit.rest
        ),
        x: "clock, MHz".to_owned(),
        y: "times as fast as without".to_owned(),
        scales: [Scale::Even; 2],
        curves: vec![
            curve(
                "model",
                0,
                false,
                clocks.map(|c| [c, ALONE / fit.time(c)]).collect(),
            ),
            curve(
                "in print",
                1,
                true,
                PRINTED.map(|(c, t)| [c, ALONE / t]).to_vec(),
            ),
            curve(
                "no cycles at all",
                3,
                true,
                vec![[8.0, limit], [120.0, limit]],
            ),
        ],
    }
}

fn figure10() -> Plot {
    let clocks = || (10..=120).map(f64::from);
    let curve = |name: String, color, dashed, points: Vec<[f64; 2]>| Curve {
        name,
        color,
        dashed,
        points,
    };
    let flat = |y: f64| vec![[10.0, y], [120.0, y]];
    let models = [Rotations::printed(), Rotations::of_share(1.0 - DISTANCES)];
    let mut curves: Vec<Curve> = Vec::new();
    for (color, model) in models.into_iter().enumerate() {
        let name = format!("{:.0} % rotations", 100.0 * model.share);
        let points = clocks().map(|c| [c, 100.0 * model.time(c)]).collect();
        curves.push(curve(name, color, false, points));
        let name = format!("{:.0} % in no time", 100.0 * model.share);
        curves.push(curve(name, color, true, flat(100.0 * (1.0 - model.share))));
    }
    curves.push(curve("without hardware".to_owned(), 3, false, flat(100.0)));
    Plot {
        title: "Figure 10: time against the clock of a 32-bit MultiRotator".to_owned(),
        subtitle: "models through the break-even in print, 22 MHz".to_owned(),
        x: "clock, MHz".to_owned(),
        y: "time, % of that without hardware".to_owned(),
        scales: [Scale::Even; 2],
        curves,
    }
}

fn rotations() -> Vec<Claim> {
    let [model, by_shares] = [Rotations::printed(), Rotations::of_share(1.0 - DISTANCES)];
    let less = |model: Rotations, clock: f64| 100.0 * (1.0 - model.time(clock));
    let gained = less(model, 80.0) / (100.0 * model.share);
    let serial = f64::from(cycles(32, Digits::One, Adders::Two));
    vec![
        Claim::new("figure 10 itself", "", "drawn above", Verdict::Lost),
        Claim::new(
            "as fast as without hardware",
            "at 22 MHz",
            "at 22 MHz",
            Verdict::Fitted,
        ),
        Claim::new(
            "less time at 50 MHz, with 54 % rotations",
            "30 %",
            format!("{:.0} %", less(model, 50.0)),
            Verdict::Fitted,
        ),
        Claim::new(
            "less time at 50 MHz, with the 40 % rotations that figure 4 leaves",
            "30 %",
            format!("{:.0} %", less(by_shares, 50.0)),
            Verdict::of((less(by_shares, 50.0) - 30.0).abs() < 1.0),
        ),
        Claim::new(
            "flat past 80 MHz",
            "yes",
            format!(
                "{:.0} % of all that can be gained is gained there; {:.1} points more from 80 to 120",
                100.0 * gained,
                less(model, 120.0) - less(model, 80.0)
            ),
            Verdict::of(less(model, 120.0) - less(model, 80.0) < 5.0),
        ),
        Claim::new(
            "time of a rotation in software by the break-even, one SDA circuit, on a Pentium IV of 3.4 GHz",
            "",
            format!(
                "{:.2} µs, {:.0} of its cycles",
                serial / 22.0,
                3400.0 * serial / 22.0
            ),
            Verdict::Unsaid,
        ),
    ]
}

/// What differs from run to run.
fn timed(shares: &Shares) -> Vec<Claim> {
    let all = shares.transform + shares.distance + shares.compare;
    let share = |time: f64| format!("{:.0} %", 100.0 * time / all);
    let distance = shares.distance / all;
    vec![
        Claim::new(
            "figure 4: the share of distances in the inner loop, matrix given",
            "almost 60 %",
            share(shares.distance),
            Verdict::of((0.5..0.7).contains(&distance)),
        ),
        Claim::new("of transforms", "", share(shares.transform), Verdict::Lost),
        Claim::new(
            "of comparing and assigning",
            "",
            share(shares.compare),
            Verdict::Lost,
        ),
        Claim::new(
            "a rotation with sine and cosine anew, times one by a given matrix",
            "",
            three(shares.sines / shares.transform),
            Verdict::Unsaid,
        ),
        Claim::new(
            "share of distances if sine and cosine are computed anew for each point",
            "almost 60 %",
            format!(
                "{:.0} %",
                100.0 * shares.distance / (shares.sines + shares.distance + shares.compare)
            ),
            Verdict::of(
                (0.5..0.7).contains(
                    &(shares.distance / (shares.sines + shares.distance + shares.compare)),
                ),
            ),
        ),
    ]
}
