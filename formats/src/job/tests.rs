use horma_core::{
    AxisLimits, Contact, Coordinates, Cutter, Discretization, Method, Motion, MotionKind,
};

use super::*;
use crate::post::{Angles, Control, FeedMode, Programmed, Split, Units};

const JOB: &str = r#"[part]
files = ["last.step", "/abs/holder.stl"]
axis = { point = [0, 0, 14], direction = [1, 0, 0] }
[discretization]
tolerance = 0.02
[cutter]
kind = "torus"
major_radius = 40
minor_radius = 8.0
[motion]
kind = "rings"
step = 2
points_per_revolution = 360
from = -3
lead_in = 4
[digitizing]
contact = "point"
method = "brute"
[cluster]
workers = 3
distribution = "overlap"
extents_per_worker = 4
[program]
feed = 1500
clearance = 5
"#;

const SHORT: &str = "[part]\nfiles = ['a.stl']\n[cutter]\nkind = 'ball'\nradius = 5\n\
    [motion]\nstep = 1\npoints_per_revolution = 90\n";

fn job(text: &str, overrides: &Overrides) -> Result<JobFile> {
    parse(text, Path::new("jobs/job.toml"), overrides)
}

fn valid(text: &str) -> JobFile {
    job(text, &Overrides::default()).expect("valid")
}

/// `JOB` with `old` replaced by `new` is refused with `expected`.
#[track_caller]
fn refused(old: &str, new: &str, expected: &str) {
    assert!(JOB.contains(old), "{old}");
    let text = JOB.replacen(old, new, 1);
    let error = job(&text, &Overrides::default())
        .expect_err(new)
        .to_string();
    assert!(error.contains(expected), "{error}");
}

#[test]
fn a_full_job_means_what_it_says() {
    let j = valid(JOB);
    let files = ["jobs/last.step", "/abs/holder.stl"].map(PathBuf::from);
    assert_eq!(j.files, files);
    let axis = Axis::Through {
        point: [0.0, 0.0, 14.0],
        direction: [1.0, 0.0, 0.0],
    };
    assert_eq!(j.axis, axis);
    assert_eq!(j.job.discretization, Discretization::Tolerance(0.02));
    assert_eq!(Ok(j.job.cutter), Cutter::torus(40.0, 8.0));
    assert_eq!(
        (j.job.motion.kind, j.job.motion.step),
        (MotionKind::Rings, 2.0)
    );
    assert_eq!((j.job.motion.from, j.job.motion.to), (Some(-3.0), None));
    assert_eq!(j.job.motion.lead, [4.0, 0.0]);
    assert_eq!(
        (j.job.contact, j.job.method),
        (Contact::Point, Method::Brute)
    );
    let sharing = j.cluster.sharing;
    assert_eq!((j.cluster.workers, sharing.extents_per_worker), (3, 4));
    assert_eq!(j.echo()["cluster"]["extents_per_worker"], 4);
    assert_eq!((j.program.feed, j.program.clearance), (1500.0, 5.0));
}

#[test]
fn what_is_left_out_has_defaults() {
    let j = valid(SHORT);
    assert_eq!(j.axis, Axis::default());
    assert_eq!(
        j.job.discretization,
        Discretization::Tolerance(DEFAULT_TOLERANCE)
    );
    assert_eq!(Ok(j.job.cutter), Cutter::ball(5.0));
    assert_eq!(j.job.motion.kind, MotionKind::Helix);
    assert_eq!(
        (j.job.contact, j.job.method),
        (Contact::Facet, Method::Exact)
    );
    let extents = j.cluster.sharing.extents_per_worker;
    assert_eq!(
        (j.cluster.workers, extents),
        (0, DEFAULT_EXTENTS_PER_WORKER)
    );
    assert_eq!(
        (j.program.feed, j.program.clearance),
        (DEFAULT_FEED, DEFAULT_CLEARANCE)
    );
    let auto = SHORT.replace("[cutter]", "axis = \"auto\"\n[cutter]");
    assert_eq!(valid(&auto).axis, Axis::Principal);
}

#[test]
fn what_is_also_written_is_known_by_name_and_written_once() {
    let with = |also: &str| format!("{SHORT}[output]\nalso = {also}\n");
    let j = valid(&with("['scene.glb', 'path.npy', 'scene.glb']"));
    assert_eq!(j.also, [Also::Scene, Also::PathNpy]);
    assert!(valid(SHORT).also.is_empty());
    let error = job(&with("['path.npz']"), &Overrides::default());
    let error = error.expect_err("no such file").to_string();
    assert!(
        error.contains("\"path.npz\"") && error.contains("path.parquet, path.npy"),
        "{error}"
    );
}

#[test]
fn the_place_is_shown_under_the_line() {
    let text = JOB.replacen("minor_radius = 8.0", "minor_radius = -8.0", 1);
    let error = job(&text, &Overrides::default())
        .expect_err("negative")
        .to_string();
    let expected = "minor_radius is -8, but must be greater than 0 and at most 10000 mm
 --> jobs/job.toml:9:16
  |
9 | minor_radius = -8.0
  |                ^^^^";
    assert_eq!(error, expected);
    refused(
        "step = 2",
        "step = 0",
        "\n  --> jobs/job.toml:12:8\n   |\n12 | step = 0\n   |        ^",
    );
}

#[test]
fn numbers_out_of_bounds_are_refused_at_their_key() {
    refused("= 40", "= -40", "major_radius is -40");
    refused("= 40", "= nan", "major_radius is NaN");
    refused("0.02", "0", "tolerance is 0, but must be at least");
    refused(
        "tolerance = 0.02",
        "grid = { rows = 1, columns = 9 }",
        "rows is 1, but must be",
    );
    refused(
        "tolerance = 0.02",
        "grid = { rows = 9, columns = -1 }",
        "columns is -1, but",
    );
    refused(
        "step = 2",
        "step = 0",
        "step is 0, but must be at least 0.000001 mm",
    );
    refused(
        "= 360",
        "= 0",
        "points_per_revolution is 0, but must be from 1 to 1000000",
    );
    refused(
        "= 360",
        "= -360",
        "points_per_revolution is -360, but must be",
    );
    refused("from = -3", "from = inf", "from is inf");
    refused(
        "from = -3",
        "from = 3\nto = 2",
        "the travel goes from 3 to 2",
    );
    refused("workers = 3", "workers = -1", "workers is -1");
    refused("workers = 3", "workers = 10001", "at most 10000");
    let each = "extents_per_worker = 4";
    refused(each, "extents_per_worker = 0", "must be 1 to 1000");
    refused(each, "extents_per_worker = 1001", "must be 1 to 1000");
    refused(
        "feed = 1500",
        "feed = 0",
        "feed is 0, but must be greater than 0",
    );
    refused("clearance = 5", "clearance = -1", "clearance is -1");
    let split = "clearance = 5\nsplit = { moves = 0 }";
    refused("clearance = 5", split, "a file must hold at least 1");
    let split = "clearance = 5\nsplit = { bytes = 9999 }";
    refused("clearance = 5", split, "a file must hold at least 10000");
    let step = "clearance = 5\nblock_numbers = 2000";
    refused("clearance = 5", step, "must go by 1000 at most");
    for decimals in ["travel = 0", "attack = 7", "rotation = -1"] {
        let decimals = format!("clearance = 5\ndecimals = {{ {decimals} }}");
        refused("clearance = 5", &decimals, "but must be from 1 to 6");
    }
    refused("[1, 0, 0]", "[0, 0, 0]", "which has no length");
    refused("[0, 0, 14]", "[0, nan, 14]", "must be finite");
    let cone = "kind = \"cone\"\nradius = 10\nwidth = 30\nhalf_angle = 45\n";
    let torus = "kind = \"torus\"\nmajor_radius = 40\nminor_radius = 8.0\n";
    refused(torus, cone, "allows at most 33.");
    refused(torus, cone, "10 | half_angle = 45");
}

#[test]
fn keys_and_choices_that_are_unknown_are_refused_with_the_known_ones() {
    refused(
        "[motion]",
        "[motions]",
        "unknown key `motions`, expected one of `part`",
    );
    refused(
        "step = 2",
        "stepp = 2",
        "unknown key `stepp`, expected one of `kind`, `step`",
    );
    refused(
        "\"torus\"",
        "\"flat-end\"",
        "unknown cutter 'flat-end'; known: torus, ball, cyl",
    );
    refused(
        "\"torus\"",
        "\"ball\"",
        "major_radius does not belong to a ball, which has radius",
    );
    refused(
        "\"rings\"",
        "\"lines\"",
        "unknown motion 'lines'; known: helix, rings",
    );
    refused(
        "\"point\"",
        "\"line\"",
        "unknown contact 'line'; known: facet, point",
    );
    refused(
        "\"brute\"",
        "\"fast\"",
        "unknown method 'fast'; known: exact, brute, local",
    );
    refused(
        "\"overlap\"",
        "\"gossip\"",
        "unknown distribution 'gossip'; known: overlap, halo, surface",
    );
    refused("direction", "dir", "unknown key `dir`");
}

#[test]
fn wrong_types_are_refused() {
    refused(
        "step = 2",
        "step = \"2\"",
        "invalid type: string \"2\", expected a number",
    );
    refused("= 360", "= 36.5", "expected a whole number");
    refused(
        "[\"last.step\", \"/abs/holder.stl\"]",
        "\"last.step\"",
        "expected a list",
    );
    refused(
        "{ point = [0, 0, 14], direction = [1, 0, 0] }",
        "\"x\"",
        "axis must be \"auto\" or",
    );
    refused("[0, 0, 14]", "[0, 0]", "axis must be \"auto\" or");
    refused("step = 2", "step = ", "jobs/job.toml:12:");
    refused("step = 2", "step = 2\nstep = 3", "jobs/job.toml:13:");
}

#[test]
fn what_is_missing_is_asked_for() {
    refused(JOB, "", "there is no [part]; say what to machine");
    refused(
        "files = [\"last.step\", \"/abs/holder.stl\"]\n",
        "",
        "[part] has no files",
    );
    refused(
        "\"last.step\", \"/abs/holder.stl\"",
        "",
        "at least one file",
    );
    refused("kind = \"torus\"\n", "", "[cutter] has no kind");
    refused(
        "minor_radius = 8.0\n",
        "",
        "a torus needs minor_radius, in mm",
    );
    refused(
        "step = 2\n",
        "",
        "[motion] has no step; give one, as in step = 2.0",
    );
    refused("step = 2\n", "", "10 | [motion]");
    refused(
        "points_per_revolution = 360\n",
        "",
        "[motion] has no points_per_revolution",
    );
    let both = "tolerance = 0.1\ngrid = { rows = 9, columns = 9 }";
    refused("tolerance = 0.02", both, "both given");
    refused(
        "tolerance = 0.02",
        "grid = { rows = 9 }",
        "missing key `columns`",
    );
    let (part, rest) = SHORT.split_at(SHORT.find("[cutter]").expect("there"));
    let no_motion = &SHORT[..SHORT.find("[motion]").expect("there")];
    for (text, expected) in [
        (part, "no [cutter]"),
        (rest, "no [part]"),
        (no_motion, "no [motion]"),
    ] {
        let error = job(text, &Overrides::default())
            .expect_err(expected)
            .to_string();
        assert!(
            error.contains(expected) && error.ends_with("--> jobs/job.toml"),
            "{error}"
        );
    }
}

#[test]
fn flags_take_the_place_of_the_file() {
    let overrides = Overrides {
        workers: Some(5),
        extents_per_worker: Some(7),
        tolerance: Some(0.5),
        step: Some(3.0),
        contact: Some("facet".to_owned()),
        to: Some(9.0),
        path_tolerance: Some(0.25),
        ..Overrides::default()
    };
    let text = JOB.replacen("tolerance = 0.02", "grid = { rows = 9, columns = 9 }", 1);
    let j = job(&text, &overrides).expect("valid");
    assert_eq!((j.cluster.workers, j.job.contact), (5, Contact::Facet));
    assert_eq!(j.cluster.sharing.extents_per_worker, 7);
    assert_eq!(j.job.discretization, Discretization::Tolerance(0.5));
    assert_eq!((j.job.motion.step, j.job.motion.to), (3.0, Some(9.0)));
    assert_eq!(j.job.motion.path_tolerance, Some(0.25));
    let zero = Overrides {
        points_per_revolution: Some(0),
        ..Overrides::default()
    };
    let error = job(JOB, &zero).expect_err("zero").to_string();
    let given =
        "from 1 to 1000000 (given as --points-per-revolution or HORMA_POINTS_PER_REVOLUTION)";
    assert!(error.ends_with(given), "{error}");
}

#[test]
fn coordinates_are_doubles_or_packed_and_the_tolerance_has_room_for_them() {
    let said = |c: &str| format!("tolerance = 0.02\ncoordinates = \"{c}\"");
    let packed = valid(&JOB.replacen("tolerance = 0.02", &said("packed21"), 1));
    assert_eq!(packed.job.coordinates, Coordinates::Packed21);
    assert_eq!(packed.echo()["discretization"]["coordinates"], "packed21");
    assert_eq!(valid(JOB).job.coordinates, Coordinates::Double);
    assert_eq!(valid(JOB).echo()["discretization"]["coordinates"], "double");
    let unknown = "unknown coordinates 'single'; known: double, packed21";
    refused("tolerance = 0.02", &said("single"), unknown);
    let fine = said("packed21").replacen("0.02", "0.0004", 1);
    let refusal = "tolerance is 0.0004 mm, of which rounding to packed21 takes 0.000423";
    refused("tolerance = 0.02", &fine, refusal);
    refused("tolerance = 0.02", &fine, "5 | tolerance");
}

#[test]
fn a_path_tolerance_is_positive_and_has_heights_between_positions() {
    let tolerance = |t: &str| format!("step = 2\npath_tolerance = {t}");
    let j = valid(&JOB.replacen("step = 2", &tolerance("0.005"), 1));
    assert_eq!(j.job.motion.path_tolerance, Some(0.005));
    assert_eq!(j.echo()["motion"]["path_tolerance"], 0.005);
    assert_eq!(valid(JOB).job.motion.path_tolerance, None);
    for bad in ["0", "-0.1", "nan", "inf", "1e-9"] {
        let expected = "must be at least 0.000001 mm and at most a kilometre";
        refused("step = 2", &tolerance(bad), expected);
        refused("step = 2", &tolerance(bad), "13 | path_tolerance");
    }
    let alone = JOB
        .replacen("step = 2", &tolerance("0.005"), 1)
        .replacen("workers = 3", "workers = 0", 1)
        .replacen("\"brute\"", "\"local\"\nfallback = false", 1);
    let error = job(&alone, &Overrides::default())
        .expect_err("no heights")
        .to_string();
    assert!(error.contains("without its fallback"), "{error}");
    assert!(error.contains("13 | path_tolerance"), "{error}");
}

/// `JOB` with `more` in its last section, which is the program's, and after it.
fn with(more: &str) -> String {
    format!("{JOB}{more}\n")
}

#[test]
fn a_program_is_linuxcncs_unless_the_job_says_otherwise() {
    let p = valid(JOB).program;
    assert_eq!(p.control, Control::LinuxCnc);
    assert_eq!(
        p.words.map(|w| (w.letter, w.negative)),
        [('X', false), ('Y', false), ('A', false)]
    );
    assert_eq!(
        (p.decimals, p.units, p.point),
        ([4, 4, 4], Units::Mm, Programmed::Centre)
    );
    assert_eq!(
        (p.angles, p.feed_mode),
        (Angles::Unwound, FeedMode::Inverse)
    );
    assert_eq!((p.split, p.block_numbers), (None, 0));
    let p = valid(&with(
        "dialect = 'siemens'\ntravel = '-Z'\nattack = 'X'\nrotation = '-C'\nunits = 'inch'\npoint = 'tip'
decimals = { rotation = 2 }\nangles = 'modulo'\nfeed_mode = 'degrees'\nsplit = { bytes = 20000 }",
    ))
    .program;
    assert_eq!(p.control, Control::Siemens);
    assert_eq!(
        p.words.map(|w| (w.letter, w.negative)),
        [('Z', true), ('X', false), ('C', true)]
    );
    assert_eq!(
        (p.decimals, p.units, p.point),
        ([5, 5, 2], Units::Inch, Programmed::Tip)
    );
    assert_eq!((p.angles, p.feed_mode), (Angles::Modulo, FeedMode::Degrees));
    assert_eq!((p.split, p.block_numbers), (Some(Split::Bytes(20_000)), 10));
    let flags = Overrides {
        dialect: Some("fanuc".to_owned()),
        split: Some(1000),
        ..Overrides::default()
    };
    let p = job(&with("split = { bytes = 20000 }"), &flags)
        .expect("valid")
        .program;
    assert_eq!(
        (p.control, p.split),
        (Control::Fanuc, Some(Split::Moves(1000)))
    );
    assert_eq!((p.decimals, p.shortest()), ([3; 3], 60.0 / 9999.999));
}

#[test]
fn what_a_control_is_not_known_to_do_is_refused() {
    for (more, expected) in [
        (
            "dialect = 'heidenhain'",
            "unknown dialect 'heidenhain'; known: linuxcnc, fanuc, siemens, mach",
        ),
        (
            "travel = 'A'",
            "travel is \"A\", but must be one of X, Y, Z, with a minus",
        ),
        ("rotation = '--C'", "but must be one of A, B, C"),
        ("attack = ''", "but must be one of X, Y, Z"),
        ("attack = '-X'", "travel and attack are both X"),
        ("travel = 'Y'", "travel and attack are both Y"),
        ("units = 'cm'", "unknown units 'cm'; known: mm, inch"),
        ("point = 'rim'", "unknown point 'rim'; known: centre, tip"),
        ("angles = 'wound'", "known: unwound, modulo, rezero"),
        (
            "dialect = 'mach'\nangles = 'modulo'",
            "Mach3 and Mach4 is not known to count turns as modulo; known: unwound, rezero",
        ),
        (
            "dialect = 'beckhoff'\nangles = 'rezero'",
            "TwinCAT CNC is not known to count turns as rezero",
        ),
        (
            "feed_mode = 'degrees'",
            "F cannot count degrees alone on LinuxCNC",
        ),
        (
            "dialect = 'grblhal'\nfeed_mode = 'minute'",
            "is not known; choose feed_mode = \"inverse\"",
        ),
        (
            "dialect = 'fanuc'\nfeed_mode = 'minute'\nunits = 'inch'",
            "what F makes of degrees on Fanuc 16 to 31, machining centre in inches is not known",
        ),
        ("split = {}", "split is { bytes = N } or { moves = N }"),
        (
            "split = { bytes = 20000, moves = 5 }",
            "split is { bytes = N } or { moves = N }",
        ),
    ] {
        let error = job(&with(more), &Overrides::default()).expect_err(more);
        let error = error.to_string();
        assert!(
            error.contains(expected) && error.contains("jobs/job.toml:"),
            "{error}"
        );
    }
    let few = with("angles = 'modulo'").replacen("= 360", "= 2", 1);
    let error = job(&few, &Overrides::default())
        .expect_err("either way")
        .to_string();
    assert!(
        error.contains("at least 3 points_per_revolution"),
        "{error}"
    );
}

const MACHINE: &str = "[machine]
travel = { range = [-20, 300], velocity = 500, acceleration = 2000 }
attack = { velocity = 700.0, acceleration = 20000, jerk = 1e6 }
rotation = { velocity = 600, acceleration = 3600 }
turns = 60";

#[test]
fn a_machine_has_the_limits_that_are_given() {
    let j = valid(&with(MACHINE));
    assert_eq!(j.machine.ranges, [Some(-20.0..=300.0), None]);
    let limits = j.machine.limits(&j.program, j.program.feed, None);
    assert_eq!((limits.feed, limits.shortest), (25.0, 0.0));
    let [travel, attack, rotation] = limits.axes;
    assert_eq!((travel.velocity, travel.jerk), (500.0, f64::INFINITY));
    assert_eq!((attack.acceleration, attack.jerk), (20_000.0, 1.0e6));
    assert_eq!((rotation.velocity, rotation.acceleration), (360.0, 3600.0));
    let j = valid(JOB);
    assert_eq!(
        j.machine.limits(&j.program, j.program.feed, None).axes,
        [AxisLimits::NONE; 3]
    );
}

#[test]
fn machines_that_cannot_be_are_refused() {
    for (old, new, expected) in [
        (
            "[-20, 300]",
            "[300, -20]",
            "range of travel is from 300 to -20",
        ),
        ("[-20, 300]", "[nan, 300]", "must be finite"),
        ("[-20, 300]", "[-20]", "invalid length 1"),
        (
            "velocity = 500",
            "velocity = 0",
            "velocity of travel is 0, but must be greater than 0 (mm)",
        ),
        (
            "= 3600",
            "= -1",
            "acceleration of rotation is -1, but must be greater than 0 (degrees)",
        ),
        ("turns = 60", "turns = inf", "turns is inf"),
        (
            "acceleration = 20000, ",
            "",
            "jerk of attack needs its acceleration as well",
        ),
        (
            "{ velocity = 600",
            "{ range = [0, 360], velocity = 600",
            "rotation has no range",
        ),
        ("velocity = 500", "speed = 500", "unknown key `speed`"),
    ] {
        assert!(MACHINE.contains(old), "{old}");
        let text = with(&MACHINE.replacen(old, new, 1));
        let error = job(&text, &Overrides::default())
            .expect_err(new)
            .to_string();
        assert!(
            error.contains(expected) && error.contains("jobs/job.toml:"),
            "{error}"
        );
    }
}

#[test]
fn the_echo_is_a_job_again() {
    let path = JOB.replacen("step = 2", "step = 2\npath_tolerance = 0.005", 1);
    let more = "travel = '-Z'\nangles = 'rezero'\napt = true\nsplit = { moves = 5000 }\n\
        [output]\nalso = ['path.npy']\n";
    let full = format!("{path}{more}{MACHINE}\n{LAST}{PASSES}");
    for text in [path.clone(), full] {
        let j = valid(&text);
        let mut echo = j.echo();
        // TOML has no null.
        for section in ["motion", "program", "stock", "roughing"] {
            if let Some(section) = echo[section].as_object_mut() {
                section.retain(|_, v| !v.is_null());
            }
        }
        echo.as_object_mut()
            .expect("a job")
            .retain(|_, v| !v.is_null());
        let text = toml::to_string(&echo).expect("TOML");
        let again = parse(&text, Path::new("job.toml"), &Overrides::default()).expect("valid");
        assert_eq!(again, j);
    }
}

const LAST: &str = "
[last]
bodies = ['last']
toe = '-x'
up = [0, 1, 0.2]
side = 'left'
make = { size = 38.5, side = 'right' }
[grading]
base = 37
system = 'uk'
method = 'geometric'
hold = ['toe_spring']
[measures]
instep = 0.4
heel = [1, 2, 3]
";

#[test]
fn a_last_is_graded_and_mirrored_as_it_says_or_as_flags_do() {
    let text = format!("{JOB}{LAST}");
    let last = valid(&text).last.expect("a last");
    let (grading, size) = last.graded().expect("another size");
    assert_eq!((grading.base, size, last.mirrored()), (37.0, 38.5, true));
    let flags = Overrides {
        size: Some(37.0),
        side: Some("left".to_owned()),
        ..Overrides::default()
    };
    let last = job(&text, &flags).expect("valid").last.expect("a last");
    assert!(last.graded().is_none() && !last.mirrored());
    assert!(valid(JOB).last.is_none(), "nobody spoke of one");
    let error = job(JOB, &flags).expect_err("no base").to_string();
    assert!(
        error.contains("no [grading]") && error.contains("--size or --sizes)"),
        "{error}"
    );
    for (old, new, expected) in [
        ("'-x'", "'up'", "known: +x, -x"),
        ("[0, 1, 0.2]", "[1, 0, 0]", "not along the spindle"),
        ("base = 37", "", "base = 37"),
        ("'toe_spring'", "'width'", "toe_thickness"),
        ("instep = 0.4", "ankle = 0.4", "known: heel"),
        ("instep = 0.4", "instep = 1.4", "share of the last's length"),
        ("heel = [1, 2, 3]", "heel = [1, 2]", "a point [x, y, z]"),
    ] {
        assert!(text.contains(old), "{old}");
        let error = job(&text.replacen(old, new, 1), &Overrides::default());
        let error = error.expect_err(new).to_string();
        assert!(
            error.contains(expected) && error.contains("jobs/job.toml:"),
            "{error}"
        );
    }
}

#[test]
fn no_text_makes_it_panic() {
    for cut in (0..JOB.len()).filter(|&i| JOB.is_char_boundary(i)) {
        let _ = job(&JOB[..cut], &Overrides::default());
    }
    for text in [
        "é = \u{1F45E}",
        "\u{feff}[part]",
        "[part]\nfiles = [\"\"]\r\n",
        "= \n\"é",
    ] {
        assert!(job(text, &Overrides::default()).is_err(), "{text}");
    }
}

#[test]
fn a_missing_file_is_named() {
    let error = read(Path::new("none/job.toml"), &Overrides::default()).expect_err("missing");
    assert!(error.to_string().contains("none/job.toml"), "{error}");
}

const PASSES: &str = "
[stock]
kind = 'block'
height = 120
width = 100.5
from = -5
[roughing]
allowance = 1.5
depth_of_cut = 12
step = 6
turns = 30
[[keep_out]]
from = -60
to = -12
radius = 55
[[keep_out]]
from = 270
to = 330
radius = 30
margin = 1
";

#[test]
fn passes_cut_as_the_job_does_unless_they_say_otherwise() {
    let j = valid(&format!("{JOB}{PASSES}"));
    let stock = j.stock.expect("a block");
    let section = horma_core::Section::Rectangle {
        height: 120.0,
        width: 100.5,
    };
    assert_eq!((stock.x.low, stock.x.high), (-5.0, f64::INFINITY));
    assert_eq!(stock.section, section);
    let roughing = j.roughing.expect("a roughing");
    assert_eq!((roughing.allowance, roughing.depth_of_cut), (1.5, 12.0));
    let motion = Motion {
        step: 6.0,
        ..j.job.motion
    };
    assert_eq!(roughing.motion, motion);
    assert_eq!((roughing.feed, roughing.turns), (1500.0, Some(30.0)));
    let targets = j.targets().expect("cutters");
    assert_eq!(targets.len(), 2);
    assert_eq!(Ok(targets[0].cutter), Cutter::torus(40.0, 9.5));
    assert_eq!((targets[0].motion, targets[1]), (motion, j.job));
    assert_eq!(j.keep_outs.len(), 2);
    assert_eq!((j.keep_outs[0].margin, j.keep_outs[1].margin), (0.0, 1.0));
    // The block's corner is further out than either, and the wheel has 48.
    let corner = 0.5 * 120.0_f64.hypot(100.5);
    assert_eq!(j.clear(), Some(corner + 48.0));
    assert_eq!(
        (
            valid(JOB).clear(),
            valid(JOB).targets().map(|t| t.len()).ok()
        ),
        (None, Some(1))
    );
    let limits = j.machine.limits(&j.program, roughing.feed, roughing.turns);
    assert_eq!(limits.axes[2].velocity, 180.0);
    let cylinder = valid(&format!("{JOB}[stock]\nkind = 'cylinder'\nradius = 60"));
    let section = horma_core::Section::Disc { radius: 60.0 };
    assert_eq!(cylinder.stock.map(|s| s.section), Some(section));
}

#[test]
fn passes_that_cannot_be_are_refused_at_their_place() {
    for (old, new, expected) in [
        ("kind = 'block'", "", "[stock] has no kind"),
        (
            "kind = 'block'",
            "kind = 'ball'",
            "unknown stock 'ball'; known: cylinder, block",
        ),
        ("height = 120", "", "a block needs height, in mm"),
        (
            "height = 120",
            "height = 120\nradius = 3",
            "radius does not belong to a block, which has height and width",
        ),
        (
            "width = 100.5",
            "width = -1",
            "width is -1, but must be greater than 0",
        ),
        (
            "from = -5",
            "from = 5\nto = 5",
            "must not end before it begins",
        ),
        ("allowance = 1.5", "", "[roughing] has no allowance"),
        (
            "allowance = 1.5",
            "allowance = -1",
            "allowance is -1, but must be from 0 to 1000 mm",
        ),
        (
            "depth_of_cut = 12",
            "depth_of_cut = 0",
            "depth_of_cut is 0, but must be greater than 0",
        ),
        ("step = 6", "step = 0", "step is 0, but must be"),
        (
            "step = 6",
            "step = 6\npoints_per_revolution = 0",
            "points_per_revolution is 0, but",
        ),
        (
            "step = 6",
            "step = 6\npath_tolerance = 0",
            "path_tolerance is 0, but",
        ),
        (
            "turns = 30",
            "turns = 0",
            "turns is 0, but must be greater than 0",
        ),
        (
            "turns = 30",
            "feed = 0",
            "feed is 0, but must be greater than 0",
        ),
        ("radius = 55", "", "[[keep_out]] has no radius"),
        (
            "radius = 55",
            "radius = 0",
            "radius is 0, but must be greater than 0",
        ),
        ("to = -12", "to = -80", "must not end before it begins"),
        (
            "margin = 1",
            "margin = -1",
            "margin is -1, but must be from 0",
        ),
        ("margin = 1", "inside = 1", "unknown key"),
    ] {
        assert!(PASSES.contains(old), "{old}");
        let text = format!("{JOB}{}", PASSES.replacen(old, new, 1));
        let error = job(&text, &Overrides::default())
            .expect_err(new)
            .to_string();
        assert!(
            error.contains(expected) && error.contains("jobs/job.toml:"),
            "{new}: {error}"
        );
    }
    let (_, rest) = PASSES.split_once("[roughing]").expect("there");
    let error = job(&format!("{JOB}[roughing]{rest}"), &Overrides::default());
    let error = error.expect_err("no stock").to_string();
    assert!(error.contains("[roughing] needs a [stock]"), "{error}");
}
