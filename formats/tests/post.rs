//! Programs read back by a reader that shares nothing with the writer: every dialect says the path's
//! positions, and durations within the machine's limits. Golden files show what each looks like.

mod post {
    pub mod course;
    pub mod reader;
}

use std::path::Path;

use horma_core::{AxisLimits, Cutter, Limits, Station, timing};
use horma_formats::post::{
    Angles, Control, FeedMode, Pass, Placed, Program, Programmed, Split, Units, Word, save,
};
use post::course::{course, cutter};
use post::reader::{Meaning, Move, check, read};
use proptest::prelude::*;

/// The defaults of a control.
fn program(control: Control) -> Program {
    let [mm, _, degrees] = control.dialect().decimals;
    Program {
        control,
        words: ['X', 'Y', 'A'].map(|letter| Word {
            letter,
            negative: false,
        }),
        decimals: [mm, mm, degrees],
        units: Units::Mm,
        point: Programmed::Centre,
        angles: Angles::Unwound,
        feed_mode: FeedMode::Inverse,
        split: None,
        apt: false,
        block_numbers: control.dialect().block_numbers,
        feed: 1500.0,
        clearance: 20.0,
    }
}

/// The texts of the files of a program of these passes, and how long their moves are meant to take. Each pass
/// is at half the feed of the one before.
fn written(
    courses: &[Vec<Station>],
    clear: Option<f64>,
    program: &Program,
    axes: [AxisLimits; 3],
) -> (Vec<String>, Vec<Vec<f64>>) {
    let dir = tempfile::tempdir().expect("scratch");
    let names = ["rough 1", "rough 2", "finish"];
    let mut feed = 2.0 * program.feed;
    let passes = courses.iter().zip(names).map(|(course, title)| {
        feed *= 0.5;
        Pass {
            title,
            course,
            feed,
        }
    });
    let passes: Vec<Pass> = passes.collect();
    let placed = Placed::new(&passes, clear, &cutter(), program).expect("it fits");
    let durations = placed.passes().map(|pass| {
        let limits = Limits {
            feed: pass.feed / 60.0,
            shortest: program.shortest(),
            axes,
        };
        timing(pass.course, &limits).durations
    });
    let durations: Vec<Vec<f64>> = durations.collect();
    let heading = [("job", "golden.toml"), ("cutter", "kind \"torus\"")];
    let names = save(dir.path(), &placed, &durations, program, &heading).expect("writable");
    let read = |name: &String| std::fs::read_to_string(dir.path().join(name)).expect("ASCII");
    (names.iter().map(read).collect(), durations)
}

/// Compares a program of one pass with a golden file.
#[track_caller]
fn golden(name: &str, program: &Program) {
    golden_passes(name, &[course(13, 8, 0x00c0_8040)], program);
}

/// Compares with a golden file; with HORMA_BLESS set it writes it instead.
#[track_caller]
fn golden_passes(name: &str, courses: &[Vec<Station>], program: &Program) {
    let (texts, _) = written(courses, None, program, [AxisLimits::NONE; 3]);
    let found = texts.concat();
    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/golden")
        .join(name);
    if std::env::var_os("HORMA_BLESS").is_some() {
        std::fs::write(&file, &found).expect("writable");
    }
    let expected = std::fs::read_to_string(&file).expect("there");
    assert_eq!(found, expected, "{name}");
}

#[test]
fn each_dialect_looks_as_it_was_looked_at() {
    for control in Control::ALL {
        let dialect = control.dialect();
        let name = format!("{}.{}", dialect.name, dialect.extension);
        golden(&name, &program(control));
    }
}

#[test]
fn what_shops_do_differently_looks_as_it_was_looked_at() {
    let lathe = ["-Z", "X", "-C"].map(|name| Word {
        letter: name.chars().last().expect("a letter"),
        negative: name.starts_with('-'),
    });
    let linuxcnc = program(Control::LinuxCnc);
    golden(
        "linuxcnc_wrapped_inch_tip.ngc",
        &Program {
            words: lathe,
            decimals: [5, 5, 3],
            units: Units::Inch,
            point: Programmed::Tip,
            angles: Angles::Modulo,
            block_numbers: 5,
            ..linuxcnc
        },
    );
    golden(
        "fanuc_modulo_minute.nc",
        &Program {
            angles: Angles::Modulo,
            feed_mode: FeedMode::Minute,
            ..program(Control::Fanuc)
        },
    );
    golden(
        "siemens_modulo_degrees.mpf",
        &Program {
            angles: Angles::Modulo,
            feed_mode: FeedMode::Degrees,
            ..program(Control::Siemens)
        },
    );
    golden(
        "grblhal_rezero_split.nc",
        &Program {
            angles: Angles::Rezero,
            split: Some(Split::Moves(9)),
            ..program(Control::GrblHal)
        },
    );
    golden(
        "beckhoff_minute.nc",
        &Program {
            feed_mode: FeedMode::Minute,
            ..program(Control::Beckhoff)
        },
    );
}

#[test]
fn several_passes_look_as_they_were_looked_at() {
    let courses = [(9, 0x00e0_8040), (9, 0x00d0_8040), (13, 0x00c0_8040)];
    let courses = courses.map(|(positions, shape)| course(positions, 8, shape));
    golden_passes("linuxcnc_passes.ngc", &courses, &program(Control::LinuxCnc));
    golden_passes(
        "fanuc_passes_rezero_split.nc",
        &courses,
        &Program {
            angles: Angles::Rezero,
            split: Some(Split::Moves(12)),
            ..program(Control::Fanuc)
        },
    );
}

/// A valid combination for each number.
fn combination(seed: u64, control: Control) -> Program {
    let dialect = control.dialect();
    let mut rest = seed;
    let mut pick = |n: u64| {
        let picked = rest % n;
        rest /= n;
        picked as usize
    };
    let mut angles = vec![Angles::Unwound];
    angles.extend(dialect.modulo.as_ref().map(|_| Angles::Modulo));
    angles.extend(dialect.rezero.then_some(Angles::Rezero));
    let mut modes = vec![FeedMode::Inverse];
    modes.extend(dialect.minute.map(|_| FeedMode::Minute));
    modes.extend(dialect.group.as_ref().map(|_| FeedMode::Degrees));
    let feed_mode = modes[pick(modes.len() as u64)];
    let units = match feed_mode {
        FeedMode::Inverse => [Units::Mm, Units::Inch][pick(2)],
        FeedMode::Minute | FeedMode::Degrees => Units::Mm,
    };
    let lengths = [['X', 'Y'], ['X', 'Z'], ['Z', 'X']][pick(3)];
    let rotation = ['A', 'B', 'C'][pick(3)];
    let [mm, inch, degrees] = dialect.decimals;
    let length = if units == Units::Mm { mm } else { inch };
    Program {
        words: [lengths[0], lengths[1], rotation].map(|letter| Word {
            letter,
            negative: pick(2) == 1,
        }),
        decimals: [length, length, degrees],
        units,
        point: [Programmed::Centre, Programmed::Tip][pick(2)],
        angles: angles[pick(angles.len() as u64)],
        feed_mode,
        split: [None, Some(Split::Moves(37)), Some(Split::Bytes(10_000))][pick(3)],
        block_numbers: [0, 10][pick(2)],
        ..program(control)
    }
}

/// What a reader has to know of a program's control and options.
fn meaning(program: &Program) -> Meaning {
    let control = program.control;
    Meaning {
        letters: program.words.map(|w| w.letter),
        reversed: program.words.map(|w| w.negative),
        unit: program.units.length(),
        tip: match program.point {
            Programmed::Centre => 0.0,
            Programmed::Tip => 48.0,
        },
        seconds: control == Control::Beckhoff,
        lengths_only: matches!(control, Control::LinuxCnc | Control::Mach),
        degrees_only: program.feed_mode == FeedMode::Degrees,
        wrapped: program.angles == Angles::Modulo,
        directed: matches!(control, Control::LinuxCnc | Control::Siemens),
    }
}

#[test]
fn the_cutter_of_these_tests_has_its_tip_48_below_its_centre() {
    assert_eq!(Ok(cutter()), Cutter::torus(40.0, 8.0));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_program_says_its_path_within_the_limits(
        seed in any::<u64>(),
        control in 0..6_usize,
        positions in prop::collection::vec(1..150_usize, 1..4),
        clear in prop::option::of(50.0..300.0_f64),
        points in 5..40_usize,
        shape in any::<u32>(),
        hard in 0.05..20.0_f64,
        jerk in prop::option::of(1.0e4..1.0e6_f64),
    ) {
        let program = combination(seed, Control::ALL[control]);
        let courses = positions.iter().zip(0..);
        let courses = courses.map(|(&n, pass)| course(n, points, shape.rotate_left(5 * pass)));
        let courses: Vec<Vec<Station>> = courses.collect();
        let limit = |velocity: f64| AxisLimits {
            velocity,
            acceleration: 200.0 * hard,
            jerk: f64::INFINITY,
        };
        let mut axes = [limit(20.0), limit(60.0), limit(90.0)];
        if let Some(jerk) = jerk {
            axes[1].jerk = jerk;
        }
        let program = Program { feed: 6000.0, ..program };
        let (texts, durations) = written(&courses, clear, &program, axes);
        let meaning = meaning(&program);
        let moves: Vec<Vec<Move>> = texts.iter().map(|t| read(t, &meaning)).collect();
        for text in &texts {
            let longest = text.lines().map(str::len).max();
            prop_assert!(longest <= Some(program.control.dialect().line), "{longest:?}");
            if let Some(Split::Bytes(most)) = program.split {
                prop_assert!(text.len() as u64 <= most, "{}", text.len());
            }
        }
        let rounding = std::array::from_fn(|axis| {
            let unit = if axis < 2 { program.units.length() } else { 1.0 };
            0.5 * unit / 10_f64.powi(i32::from(program.decimals[axis]))
        });
        let found = check(&moves, &courses, rounding, program.clearance, clear);
        let found = found.map_err(|e| TestCaseError::fail(format!("{e}\n{}", texts.concat())))?;
        prop_assert_eq!(found.len(), durations.len());
        for (found, durations) in found.iter().zip(&durations) {
            prop_assert_eq!(found.len(), durations.len());
            for (read, meant) in found.iter().zip(durations) {
                let slack = 1.0e-9 * meant + read.rounding;
                prop_assert!(read.seconds >= meant - 1.0e-9 * meant && read.seconds <= meant + slack,
                    "{} s instead of {meant} s", read.seconds);
            }
            post::reader::within(found, &axes.map(|a| [a.velocity, a.acceleration, a.jerk]))
                .map_err(|e| TestCaseError::fail(format!("{e}\n{}", texts.concat())))?;
        }
    }
}
