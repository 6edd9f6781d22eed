//! Paths against oracles that share no code with the product: other libraries, closed forms, and the
//! interpreter that will run the program. `tests/run` sets them up; what is missing is skipped by name.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{data, job, path_of, sample, scratch, text};
use horma_core::{Direction, Point, Surface};

/// Asks an oracle; false if there is none here.
fn ask(script: &str, args: &[&str]) -> bool {
    let Some(python) = std::env::var_os("HORMA_ORACLE_PYTHON") else {
        eprintln!("skipped: {script}: HORMA_ORACLE_PYTHON is not set; tests/run sets it");
        return false;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/oracles")
        .join(script);
    let output = Command::new(python).arg(&script).args(args).output();
    let output = output.expect("the oracles' Python starts");
    let (out, err) = crate::common::texts(&output);
    assert!(
        output.status.success(),
        "{} {args:?}\n{out}{err}",
        script.display()
    );
    // Shown with --nocapture.
    eprint!("{out}");
    true
}

/// Digitizes `files` and asks an oracle about the path.
fn check(script: &str, files: &[&Path], more: &str, args: impl Fn(&str) -> Vec<String>) {
    let dir = scratch();
    path_of(
        &job(dir.path(), "job.toml", files, more),
        dir.path(),
        "out",
        &[],
    );
    let csv = dir.path().join("out/path.csv");
    let args = args(text(&csv));
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    ask(script, &args);
}

fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

const WHEEL: &str = "[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 2.0\npoints_per_revolution = 120\n";

const AXIS: &str = "axis = { point = [0, 0, 14], direction = [1, 0, 0] }\n";

#[test]
fn point_contact_equals_brute_force_on_another_librarys_grid() {
    let Some(part) = data("last_3surfaces.step") else {
        return;
    };
    let more = format!(
        "{AXIS}[discretization]\ngrid = {{ rows = 159, columns = 120 }}\n{WHEEL}[digitizing]\ncontact = \"point\"\n"
    );
    check("point_contact.py", &[&part], &more, |csv| {
        words(&format!(
            "{} {csv} --axis-z 14 --rows 159 --columns 120 --major 40 --minor 8",
            text(&part)
        ))
    });
}

#[test]
fn point_contact_on_the_sample_equals_brute_force_on_another_librarys_grid() {
    let part = sample().with_file_name("last.step");
    let more = "[discretization]\ngrid = { rows = 80, columns = 60 }
[cutter]\nkind = \"ball\"\nradius = 9.0
[motion]\nkind = \"rings\"\nstep = 5.0\npoints_per_revolution = 90\n[digitizing]\ncontact = \"point\"\n";
    check("point_contact.py", &[&part], more, |csv| {
        words(&format!(
            "{} {csv} --rows 80 --columns 60 --minor 9",
            text(&part)
        ))
    });
}

#[test]
fn facet_contact_equals_dense_sampling() {
    let Some(part) = data("last_scan.stl") else {
        return;
    };
    check(
        "facet_sampling.py",
        &[&part],
        &format!("{AXIS}{WHEEL}"),
        |csv| {
            words(&format!(
                "{} {csv} --axis-z 14 --major 40 --minor 8 --positions 300",
                text(&part)
            ))
        },
    );
}

#[test]
fn facet_contact_of_a_cylinder_wheel_on_steep_flanks_equals_dense_sampling() {
    let Some(part) = data("gearwheel.stl") else {
        return;
    };
    let more = "axis = { point = [0, 0, 0], direction = [1, 0, 0] }
[cutter]\nkind = \"cylinder\"\nradius = 10.0\nwidth = 3.0\n[motion]\nstep = 1.0\npoints_per_revolution = 120\n";
    check("facet_sampling.py", &[&part], more, |csv| {
        words(&format!(
            "{} {csv} --cutter cylinder --radius 10 --width 3 --positions 200 --gap 1e-4 --spacing 1e-3",
            text(&part)
        ))
    });
}

#[test]
fn a_ball_drops_as_an_independent_drop_cutter_says() {
    let Some(part) = data("last_scan.stl") else {
        return;
    };
    let more = format!(
        "{AXIS}[cutter]\nkind = \"ball\"\nradius = 8.0\n[motion]\nstep = 2.0\npoints_per_revolution = 360\n"
    );
    check("drop_cutter.py", &[&part], &more, |csv| {
        words(&format!(
            "{} {csv} --axis-z 14 --radius 8 --positions 1000",
            text(&part)
        ))
    });
}

/// The surface of revolution about x of a polygon of quarter arcs and lines: `(x, radius, weight)`
/// of each pole, three to an arc.
fn revolved(profile: &[(f64, f64, f64)], degree: usize) -> Surface {
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let turn = [
        (1, 0),
        (1, 1),
        (0, 1),
        (-1, 1),
        (-1, 0),
        (-1, -1),
        (0, -1),
        (1, -1),
        (1, 0),
    ];
    let mut poles: Vec<Point> = Vec::new();
    let mut weights = Vec::new();
    for &(x, radius, weight) in profile {
        for (i, (y, z)) in turn.into_iter().enumerate() {
            poles.push([x, radius * f64::from(y), radius * f64::from(z)]);
            weights.push(weight * if i % 2 == 0 { 1.0 } else { h });
        }
    }
    let arcs = |degree: usize, poles: usize| {
        let pieces = (poles - 1) / degree;
        let ends = std::iter::repeat_n(pieces as f64, degree + 1);
        let inner = (1..pieces).flat_map(|k| std::iter::repeat_n(k as f64, degree));
        let knots = std::iter::repeat_n(0.0, degree + 1)
            .chain(inner)
            .chain(ends)
            .collect();
        Direction { degree, knots }
    };
    let (u, v) = (arcs(degree, profile.len()), arcs(2, turn.len()));
    Surface::new("revolved", u, v, poles, Some(weights)).expect("valid")
}

fn step_file(dir: &Path, surface: &Surface) -> PathBuf {
    let file = dir.join("part.step");
    let step = horma_formats::step_out::write("part", &[("revolved", surface)]);
    std::fs::write(&file, step).expect("writable");
    file
}

const H: f64 = std::f64::consts::FRAC_1_SQRT_2;

const CUTTERS: [(&str, &str); 5] = [
    ("kind = \"ball\"\nradius = 7.0", "--major 0 --minor 7"),
    (
        "kind = \"cone\"\nradius = 10.0\nwidth = 20.0\nhalf_angle = 45.0",
        "--cutter cone --radius 10 --width 20 --half-angle 45",
    ),
    (
        "kind = \"torus\"\nmajor_radius = 20.0\nminor_radius = 4.0",
        "--major 20 --minor 4",
    ),
    (
        "kind = \"cylinder\"\nradius = 15.0\nwidth = 6.0",
        "--cutter cylinder --radius 15 --width 6",
    ),
    (
        "kind = \"cone\"\nradius = 15.0\nwidth = 6.0\nhalf_angle = 20.0",
        "--cutter cone --radius 15 --width 6 --half-angle 20",
    ),
];

/// A shape of revolution against its closed form, with every kind of wheel.
fn check_shape(surface: &Surface, shape: &str) {
    let dir = scratch();
    let part = step_file(dir.path(), surface);
    for (cutter, args) in CUTTERS {
        let more = format!(
            "[discretization]\ntolerance = 0.005\n[cutter]\n{cutter}\n[motion]\nstep = 1.3\npoints_per_revolution = 50\n"
        );
        check("closed_form.py", &[&part], &more, |csv| {
            words(&format!("{csv} {shape} {args} --tolerance 0.005"))
        });
    }
}

#[test]
fn a_cylinder_is_cut_as_its_closed_form_says() {
    let cylinder = revolved(&[(-10.0, 12.0, 1.0), (30.0, 12.0, 1.0)], 1);
    check_shape(&cylinder, "--shape cylinder --size 12 --ends -10 30");
}

#[test]
fn a_sphere_is_cut_as_its_closed_form_says() {
    let r = 15.0;
    let sphere = [
        (-r, 0.0, 1.0),
        (-r, r, H),
        (0.0, r, 1.0),
        (r, r, H),
        (r, 0.0, 1.0),
    ];
    check_shape(&revolved(&sphere, 2), "--shape sphere --size 15");
}

#[test]
fn a_torus_is_cut_as_its_closed_form_says() {
    let (p, s) = (25.0, 6.0);
    let torus: Vec<(f64, f64, f64)> = [
        (1.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (-1.0, 1.0),
        (-1.0, 0.0),
        (-1.0, -1.0),
        (0.0, -1.0),
        (1.0, -1.0),
        (1.0, 0.0),
    ]
    .into_iter()
    .enumerate()
    .map(|(i, (x, up))| (s * x, p + s * up, if i % 2 == 0 { 1.0 } else { H }))
    .collect();
    check_shape(
        &revolved(&torus, 2),
        "--shape torus --size 6 --major-of-part 25",
    );
}

#[test]
fn foreign_rational_and_polynomial_surfaces_are_cut_as_their_closed_forms_say() {
    if let Some(sphere) = data("rational_sphere.step") {
        let more = "[discretization]\ntolerance = 0.001\n[cutter]\nkind = \"torus\"\nmajor_radius = 3.0\nminor_radius = 0.5\n[motion]\nstep = 0.05\npoints_per_revolution = 60\n";
        check("closed_form.py", &[&sphere], more, |csv| {
            words(&format!(
                "{csv} --shape sphere --size 1 --major 3 --minor 0.5 --tolerance 0.001"
            ))
        });
    }
    if let Some(torus) = data("bspline_torus.step") {
        // Its patches are polynomials that follow a torus to within 0.0032.
        let more = "axis = { point = [0, 0, 0], direction = [0, 0, 1] }
[discretization]\ntolerance = 0.001\n[cutter]\nkind = \"torus\"\nmajor_radius = 3.0\nminor_radius = 0.5\n[motion]\nstep = 0.05\npoints_per_revolution = 60\n";
        check("closed_form.py", &[&torus], more, |csv| {
            words(&format!(
                "{csv} --shape torus --size 0.497772736 --major-of-part 1.99828357 --centre 0.98631477 0 0 --deviation 0.0032 --major 3 --minor 0.5 --tolerance 0.001"
            ))
        });
    }
}

/// False if LinuxCNC's interpreter is missing.
fn rs274_is_there() -> bool {
    let there = Command::new("rs274").arg("-h").output().is_ok();
    if !there {
        eprintln!("skipped: rs274 is not installed; tests/run installs it where it can");
    }
    there
}

#[test]
fn linuxcnc_reads_the_program_back_as_the_path() {
    if !rs274_is_there() {
        return;
    }
    let dir = scratch();
    let mut jobs = vec![sample()];
    if let Some(part) = data("last_scan.stl") {
        jobs.push(job(
            dir.path(),
            "scan.toml",
            &[&part],
            &format!("{AXIS}{WHEEL}[program]\nfeed = 1500\n"),
        ));
    }
    for (job, feed) in jobs.iter().zip(["2000", "1500"]) {
        path_of(job, dir.path(), "out", &[]);
        let out = dir.path().join("out");
        let (program, csv) = (out.join("path.ngc"), out.join("path.csv"));
        ask(
            "ngc_moves.py",
            &[text(&program), text(&csv), "--feed", feed],
        );
    }
}

const MACHINE: &str = "[machine]
travel = { velocity = 200, acceleration = 1000 }
attack = { velocity = 500, acceleration = 10000 }
rotation = { acceleration = 3600 }
turns = 60\n";

#[test]
fn linuxcnc_turns_an_axis_that_counts_to_360_the_right_way() {
    let Some(part) = data("last_scan.stl").filter(|_| rs274_is_there()) else {
        return;
    };
    let dir = scratch();
    let program = "[program]\nfeed = 20000\nangles = \"modulo\"\nrotation = \"-A\"\n";
    let more = format!("{AXIS}{WHEEL}{program}{MACHINE}");
    let job = job(dir.path(), "wrapped.toml", &[&part], &more);
    path_of(&job, dir.path(), "out", &[]);
    let out = dir.path().join("out");
    let (program, csv) = (out.join("path.ngc"), out.join("path.csv"));
    ask("ngc_moves.py", &[text(&program), text(&csv), "--wrapped"]);
}

/// Each dialect, its options, its decimals, and what its reader is told.
const DIALECTS: [(&str, &str, &str, &str); 6] = [
    (
        "linuxcnc",
        "angles = \"rezero\"\nsplit = { bytes = 60000 }",
        "4 4 4",
        "",
    ),
    ("fanuc", "angles = \"modulo\"", "3 3 3", "--modulo"),
    (
        "siemens",
        "angles = \"modulo\"\nattack = \"Z\"",
        "4 4 4",
        "--modulo --letters XZA",
    ),
    (
        "mach",
        "angles = \"rezero\"\nrotation = \"C\"",
        "4 4 4",
        "--letters XYC",
    ),
    (
        "grblhal",
        "angles = \"rezero\"\nsplit = { moves = 2000 }",
        "3 3 2",
        "",
    ),
    ("beckhoff", "decimals = { attack = 3 }", "4 3 4", ""),
];

#[test]
fn a_public_parser_reads_every_dialect_of_the_sample_back_as_the_path() {
    check_dialects(&sample().with_file_name("last.step"), "");
}

#[test]
fn a_public_parser_reads_every_dialect_of_a_scan_back_as_the_path() {
    if let Some(part) = data("last_scan.stl") {
        check_dialects(&part, AXIS);
    }
}

fn check_dialects(part: &Path, axis: &str) {
    let dir = scratch();
    for (dialect, options, decimals, reader) in DIALECTS {
        let program = format!("[program]\ndialect = \"{dialect}\"\nfeed = 20000\n{options}\n");
        let more = format!("{axis}{WHEEL}{program}{MACHINE}");
        let job = job(dir.path(), "job.toml", &[part], &more);
        // A third of the positions: the parser takes a millisecond for each.
        path_of(&job, dir.path(), dialect, &["--step", "6"]);
        let out = dir.path().join(dialect);
        let report = crate::common::report(&out);
        let files = report["program"]["files"].as_array().expect("files");
        let files = files.iter().map(|f| out.join(f.as_str().expect("a name")));
        let files: Vec<PathBuf> = files.collect();
        assert_eq!(files.len() > 1, options.contains("split"), "{files:?}");
        let csv = out.join("path.csv");
        let mut args = vec![text(&csv)];
        args.extend(files.iter().map(|f| text(f)));
        args.push("--decimals");
        args.extend(decimals.split(' ').chain(reader.split_whitespace()));
        if !ask("dialects.py", &args) {
            return;
        }
    }
}

#[test]
fn opencascade_opens_the_sample() {
    let part = sample().with_file_name("last.step");
    ask("step_opens.py", &[text(&part), "3"]);
}

#[test]
fn what_is_also_written_is_what_other_libraries_read() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    // Beyond the part, so that there are positions without contact.
    let more = "[discretization]\ntolerance = 0.05
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 8.0\npoints_per_revolution = 120\nfrom = -80.0
[output]\nalso = [\"path.npy\", \"path.parquet\", \"machined.ply\", \"machined.stl\", \"designed.ply\",
    \"designed.stl\", \"scene.glb\"]\n";
    let job = job(dir.path(), "job.toml", &[&part], more);
    let out = dir.path().join("out");
    crate::common::succeed(&[
        "run",
        text(&job),
        "-o",
        text(&out),
        "-q",
        "--path-tolerance",
        "0.05",
    ]);
    ask("outputs.py", &[text(&out)]);
    let also = |name: &str, args: &[&str]| {
        let again = dir.path().join(name);
        let all = [&["run", text(&job), "-o", text(&again), "-q"], args].concat();
        crate::common::succeed(&all);
        again
    };
    // Files are the same bytes however many workers there are, and nothing is written that was not asked for.
    let again = also("again", &["--path-tolerance", "0.05", "-w", "2"]);
    for name in [
        "path.npy",
        "path.parquet",
        "machined.ply",
        "designed.stl",
        "scene.glb",
    ] {
        let [one, other] =
            [&out, &again].map(|dir| std::fs::read(dir.join(name)).expect("written"));
        assert!(one == other, "{name}");
    }
    let few = also("few", &["--no-verify", "--also", "machined.stl"]);
    assert!(few.join("machined.stl").exists() && !few.join("scene.glb").exists());
}
