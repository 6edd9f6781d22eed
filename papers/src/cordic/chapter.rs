//! Table 3: CORDIC and the MultiRotator compared.

use crate::error::Result;
use crate::fixed::{Format, Rounding};
use crate::multirotator::{self, MultiRotator};
use crate::report::{Block, Chapter, Claim, Verdict, three};
use crate::resources::{Resource, flip_flops, full_adders, in_words};

use super::{Cordic, Parallel, Serial, resources};

/// A clock period against that of the bit-serial CORDIC: "about five times" for the bit-parallel one, and
/// "similar" for the MultiRotator.
const PARALLEL_PERIOD: f64 = 5.0;

/// Word lengths compared.
const WORDS: [u32; 3] = [16, 21, 32];

/// Steps of the MultiRotator after which bounds are compared.
const STEPS: [u32; 3] = [1, 90, 720];

/// A line of the comparison.
struct Architecture {
    name: &'static str,
    cycles: u32,
    period: f64,
    list: Vec<Resource>,
    /// Bounds of a relative error at the greatest radius.
    errors: [f64; 3],
}

/// What there is to tell.
///
/// # Errors
/// None, for the words above.
pub fn chapter() -> Result<Chapter> {
    let mut blocks = vec![Block::text(
        "CORDIC turns a point by shifts and additions: for coordinates of M bits M + 1 iterations, words of \
         M + 2 + ⌈log₂ M⌉ bits, angles of M + 1, a quarter turn first and the gain taken back at the end by a \
         constant multiplier, which takes one more cycle, or one more word's time. The bit-serial circuit is \
         clocked bit by bit with three one-bit adders, the bit-parallel one word by word with barrel shifters; \
         both equal the arithmetic to the last bit.",
    )];
    let mut last = Vec::new();
    for bits in WORDS {
        let compared = compare(bits)?;
        let serial_time = f64::from(compared[0].cycles);
        let rows = compared.iter().map(|a| {
            let time = f64::from(a.cycles) * a.period;
            let mut row = vec![
                a.name.to_owned(),
                a.cycles.to_string(),
                a.period.to_string(),
                three(time / serial_time),
                flip_flops(&a.list).to_string(),
                full_adders(&a.list).to_string(),
            ];
            row.extend(a.errors.map(three));
            row
        });
        let heads = [
            "architecture",
            "cycles",
            "period",
            "time",
            "flip-flops",
            "full adders",
            "error: first step",
            "90th",
            "720th",
        ];
        let title = format!(
            "Table 3 for coordinates of {bits} bits. Period as the text has it, and time, against the bit-serial \
             CORDIC; error: the derived bound of the relative one, at steps of 0.5°"
        );
        blocks.push(Block::table(title, &heads, rows.collect()));
        last = compared;
    }
    let parts = last
        .iter()
        .map(|a| vec![a.name.to_owned(), in_words(&a.list)]);
    let heads = ["architecture", "count × part of so many bits"];
    blocks.push(Block::table(
        "What they are made of, at 32 bits",
        &heads,
        parts.collect(),
    ));
    blocks.push(Block::Claims(claims(&last)?));
    Ok(Chapter {
        name: "cordic",
        title: "CORDIC, and table 3",
        source: "the FPGA paper, section MultiRotators, table 3",
        blocks,
    })
}

fn compare(bits: u32) -> Result<Vec<Architecture>> {
    let cordic = Cordic::new(bits)?;
    let coordinates = Format::new(bits, bits - 1)?;
    let bound = cordic.point_bound(1.0, coordinates.ulp());
    let point = [coordinates.greatest(), 0];
    let (mut serial, mut parallel) = (Serial::new(&cordic), Parallel::new(&cordic));
    serial.rotate(point, cordic.angle(30.0));
    parallel.rotate(point, cordic.angle(30.0));
    let mut compared = vec![
        Architecture {
            name: "CORDIC, bit-serial",
            cycles: serial.cycles as u32,
            period: 1.0,
            list: resources(bits, true),
            errors: [bound; 3],
        },
        Architecture {
            name: "CORDIC, bit-parallel",
            cycles: parallel.cycles as u32,
            period: PARALLEL_PERIOD,
            list: resources(bits, false),
            errors: [bound; 3],
        },
    ];
    let rotator = MultiRotator::new(coordinates, Rounding::Nearest, 0.5);
    let errors = STEPS.map(|steps| rotator.point_bound(1.0, coordinates.ulp(), steps));
    compared.extend(
        multirotator::CIRCUITS.map(|(name, digits, adders)| Architecture {
            name,
            cycles: multirotator::cycles(bits, digits, adders),
            period: PARALLEL_PERIOD,
            list: multirotator::resources(bits, digits, adders),
            errors,
        }),
    );
    Ok(compared)
}

fn claims(at_32: &[Architecture]) -> Result<Vec<Claim>> {
    let [serial, parallel, sda, _, pda, _] = at_32 else {
        unreachable!("six architectures are compared")
    };
    let time = |a: &Architecture| f64::from(a.cycles) * a.period;
    let slowest = at_32.iter().all(|a| time(a) <= time(serial));
    let format = Format::new(32, 31)?;
    let rotator = MultiRotator::new(format, Rounding::Nearest, 0.5);
    let better =
        (1..=720).take_while(|&i| rotator.point_bound(1.0, format.ulp(), i) < parallel.errors[0]);
    let better = better.count();
    let narrow = Cordic::new(25)?;
    let narrow = (
        narrow.width(),
        narrow.point_bound(1.0, libm::ldexp(1.0, -24)),
    );
    let better_than_narrow = (1..=720)
        .take_while(|&i| rotator.point_bound(1.0, format.ulp(), i) < narrow.1)
        .count();
    Ok(vec![
        Claim::new("table 3 itself", "", "recomputed above", Verdict::Lost),
        Claim::new(
            "the bit-serial CORDIC is the slowest",
            "yes",
            format!(
                "{} cycles; at 32 bits {} times the time of SDA",
                serial.cycles,
                three(time(serial) / time(sda))
            ),
            Verdict::of(slowest),
        ),
        Claim::new(
            "the MultiRotator takes no more cycles than the fastest CORDIC",
            "yes",
            format!(
                "{} by SDA and {} by PDA, against {}",
                sda.cycles, pda.cycles, parallel.cycles
            ),
            Verdict::of(sda.cycles <= parallel.cycles && pda.cycles <= parallel.cycles),
        ),
        Claim::new(
            "for similar resources",
            "yes",
            format!(
                "SDA has {} flip-flops, the bit-parallel CORDIC {} and two barrel shifters",
                flip_flops(&sda.list),
                flip_flops(&parallel.list)
            ),
            Verdict::of(flip_flops(&sda.list) <= 2 * flip_flops(&parallel.list)),
        ),
        Claim::new(
            "CORDIC is always less precise than numbers of n bits, and the MultiRotator is not, at 32 bits and \
             steps of 0.5°",
            "yes",
            format!("by their bounds for {better} steps and no more"),
            Verdict::of(better == 720),
        ),
        Claim::new(
            format!(
                "the same if CORDIC's words have the 32 bits ({}, for coordinates of 25)",
                narrow.0
            ),
            "yes",
            format!("by their bounds for {better_than_narrow} of 720 steps"),
            Verdict::of(better_than_narrow == 720),
        ),
    ])
}
