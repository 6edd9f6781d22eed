//! The MultiRotator's cycles and resources, and how its circuits compare with its arithmetic.

use crate::error::Result;
use crate::fixed::{Format, Rounding};
use crate::report::{Block, Chapter, Claim, Verdict, three};
use crate::resources::{flip_flops, full_adders, in_words};

use super::{Adders, Datapath, Digits, MultiRotator, Recurrence, cycles, resources};

/// Word lengths that are told of, and bits of them after the point.
const WORDS: [(u32, u32); 3] = [(16, 15), (21, 20), (32, 31)];

/// Every circuit: its name and what it is.
pub(crate) const CIRCUITS: [(&str, Digits, Adders); 4] = [
    ("SDA, adder and subtracter", Digits::One, Adders::Two),
    ("SDA, one adder/subtracter", Digits::One, Adders::Shared),
    ("2-bit PDA, adder and subtracter", Digits::Two, Adders::Two),
    (
        "2-bit PDA, one adder/subtracter",
        Digits::Two,
        Adders::Shared,
    ),
];

/// Steps over which circuits are held to the arithmetic here; the tests do it with a million points each.
const STEPS: u32 = 720;

/// What there is to tell.
///
/// # Errors
/// None, for the words above.
pub fn chapter() -> Result<Chapter> {
    let mut blocks = vec![
        Block::text(
            "A point is turned again and again by one step. Its sine and cosine come from those before by the \
             angle sum, eq. (7), with the same four products as the turned point, eq. (4). The model of the \
             arithmetic keeps each sum of two products exact and rounds it once, to words of any length with any \
             number of bits after the point, by truncation or to the nearest.",
        ),
        Block::text(
            "The circuit is clocked register by register: two shift registers, four one-coefficient MACs whose \
             scaling accumulators halve what they hold before they add, and what joins the products; registers \
             wrap at the widths in print. One thing is ours: the bits that halving drops are added as they come \
             by a serial adder as wide as a digit, whose carry goes into the last addition, so that results are \
             those of the arithmetic to the last bit.",
        ),
        Block::table(
            "Cycles from a point to the turned one, counted while the circuit runs",
            &[
                "circuit",
                "16 bits",
                "21 bits",
                "32 bits",
                "in print, for n bits",
            ],
            cycle_rows()?,
        ),
    ];
    for (bits, _) in WORDS {
        let rows =
            [(Digits::One, Adders::Two), (Digits::Two, Adders::Two)].map(|(digits, adders)| {
                let list = resources(bits, digits, adders);
                let name = match digits {
                    Digits::One => "SDA",
                    Digits::Two => "2-bit PDA",
                };
                vec![
                    name.to_owned(),
                    in_words(&list),
                    flip_flops(&list).to_string(),
                    full_adders(&list).to_string(),
                ]
            });
        let heads = [
            "circuit",
            "count × part of so many bits",
            "flip-flops",
            "full adders",
        ];
        blocks.push(Block::table(
            format!("Resources at {bits} bits"),
            &heads,
            rows.to_vec(),
        ));
    }
    blocks.push(Block::Claims(claims()?));
    Ok(Chapter {
        name: "multirotator",
        title: "The MultiRotator",
        source: "the FPGA paper, section MultiRotators, eqs. (3) to (7), figures 5 and 6",
        blocks,
    })
}

fn cycle_rows() -> Result<Vec<Vec<String>>> {
    const PRINTED: [&str; 4] = ["n + 1", "n + 2", "a half of that", "a half of that"];
    let each = CIRCUITS.into_iter().zip(PRINTED);
    each.map(|((name, digits, adders), printed)| {
        let mut row = vec![name.to_owned()];
        for (bits, fraction) in WORDS {
            let format = Format::new(bits, fraction)?;
            row.push(run(format, Rounding::Nearest, digits, adders).0.to_string());
        }
        row.push(printed.to_owned());
        Ok(row)
    })
    .collect()
}

/// Cycles of a rotation, and at how many steps circuit and arithmetic differ.
fn run(format: Format, rounding: Rounding, digits: Digits, adders: Adders) -> (u64, u32) {
    match digits {
        Digits::One => run_digits::<1>(format, rounding, adders),
        Digits::Two => run_digits::<2>(format, rounding, adders),
    }
}

fn run_digits<const D: usize>(format: Format, rounding: Rounding, adders: Adders) -> (u64, u32) {
    let mut rotator = MultiRotator::new(format, rounding, 0.5);
    let mut datapath = Datapath::<D>::new(&rotator, adders);
    let point = [format.greatest(), -format.greatest() / 3];
    let mut different = 0;
    for _ in 0..STEPS {
        different += u32::from(datapath.rotate(point) != rotator.rotate(point));
        rotator.advance();
        datapath.advance();
    }
    // Each step is two passes.
    (datapath.cycles / u64::from(2 * STEPS), different)
}

fn claims() -> Result<Vec<Claim>> {
    let mut different = 0;
    for (bits, fraction) in WORDS {
        for rounding in [Rounding::Truncate, Rounding::Nearest] {
            for (_, digits, adders) in CIRCUITS {
                different += run(Format::new(bits, fraction)?, rounding, digits, adders).1;
            }
        }
    }
    let mut doubles = Recurrence::new(0.5);
    for _ in 1..STEPS {
        doubles.advance();
    }
    let whole = libm::hypot(doubles.turned[0] - 1.0, doubles.turned[1]);
    let printed = |digits, adders| cycles(32, digits, adders);
    let serial = printed(Digits::One, Adders::Two);
    let shared = printed(Digits::One, Adders::Shared);
    let parallel = printed(Digits::Two, Adders::Two);
    Ok(vec![
        Claim::new(
            "cycles at 32 bits, adder and subtracter",
            "n + 1 = 33",
            serial.to_string(),
            Verdict::of(serial == 33),
        ),
        Claim::new(
            "cycles at 32 bits, one adder/subtracter",
            "n + 2 = 34",
            shared.to_string(),
            Verdict::of(shared == 34),
        ),
        Claim::new(
            "cycles at 32 bits by 2-bit PDA",
            "a half",
            format!("{parallel}: a half of the bits, and one to add"),
            Verdict::of(parallel == 33_u32.div_ceil(2)),
        ),
        Claim::new(
            "steps at which circuit and arithmetic differ, all circuits and words above, both roundings",
            "",
            format!("{different} of {}", STEPS * 2 * 4 * WORDS.len() as u32),
            Verdict::Unsaid,
        ),
        Claim::new(
            "the recurrence in doubles, off after 720 steps of 0.5°",
            "",
            three(whole),
            Verdict::Unsaid,
        ),
        Claim::new(
            "no error accumulates, for every rotation is made from the original location",
            "yes",
            "not in the point, but in sine and cosine: see the bound and figure 7 below",
            Verdict::Differs,
        ),
    ])
}
