//! Roughing and keep-outs as their user meets them: files, the program, the report, and the same bytes
//! whoever computes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::common::{
    Process, events, master, report, run, sample, scratch, succeed, text, texts, worker,
};

const PASSES: &str = "
[stock]
kind = \"block\"
height = 150
width = 144
from = -6
to = 266
[roughing]
allowance = 2
depth_of_cut = 20
step = 12
path_tolerance = 0.5
feed = 3000
[[keep_out]]
from = -100
to = -14
radius = 70
margin = 1
";

/// The sample, coarse, with these sections after its own.
fn job(dir: &Path, name: &str, more: &str) -> PathBuf {
    let motion = "[discretization]\ntolerance = 0.1
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 10.0\npoints_per_revolution = 72\n";
    let part = sample().with_file_name("last.step");
    crate::common::job(dir, name, &[&part], &format!("{motion}{more}"))
}

/// Paths and programs of a directory.
fn results(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(dir).expect("results");
    let files = entries.map(|e| e.expect("an entry").path());
    let files = files.filter(|f| {
        ["csv", "ngc", "apt"]
            .map(Some)
            .contains(&f.extension().and_then(|e| e.to_str()))
    });
    files
        .map(|f| {
            let name = f
                .file_name()
                .expect("a name")
                .to_string_lossy()
                .into_owned();
            (name, std::fs::read(f).expect("readable"))
        })
        .collect()
}

/// Travel, angle and height of each line of a path.
fn positions(path: &[u8]) -> Vec<(f64, f64, Option<f64>)> {
    let text = String::from_utf8_lossy(path).into_owned();
    let lines = text.lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>();
        (
            number(1).expect("travel"),
            number(2).expect("angle"),
            number(3).ok(),
        )
    });
    lines.collect()
}

#[test]
fn all_passes_are_the_same_bytes_whoever_computes() {
    let dir = scratch();
    let job = job(
        dir.path(),
        "job.toml",
        &format!("{PASSES}[program]\napt = true\n"),
    );
    let made = |name: &str, args: &[&str]| {
        let out = dir.path().join(name);
        let mut all = vec!["run", text(&job), "-o", text(&out), "-q", "--no-verify"];
        all.extend(args);
        succeed(&all);
        results(&out)
    };
    let here = made("here", &["--threads", "1"]);
    assert!(here.contains_key("rough-1.csv") && here.contains_key("path.apt"));
    assert_eq!(here, made("threads", &["--threads", "3"]));
    assert_eq!(here, made("one", &["--workers", "1"]));
    for distribution in ["overlap", "halo", "surface"] {
        let args = ["--workers", "4", "--distribution", distribution];
        assert_eq!(here, made(distribution, &args), "{distribution}");
    }

    // A master elsewhere has two jobs of it, and keeps neither.
    let (mut master, address) = master(&[]);
    let _worker = worker(&address, "w1");
    let out = dir.path().join("elsewhere");
    let submit = |more: &[&str]| {
        let mut all = vec![
            "submit",
            text(&job),
            "--master",
            &address,
            "-q",
            "--no-verify",
        ];
        all.extend(more);
        run(&all)
    };
    let output = submit(&["-o", text(&out)]);
    assert!(output.status.success(), "{:?}", texts(&output));
    assert_eq!(here, results(&out));
    for args in [
        &["submit", text(&job), "--master", &address, "--detach"][..],
        &[
            "fetch",
            "1",
            text(&job),
            "--master",
            &address,
            "-o",
            text(&dir.path().join("fetched")),
        ],
    ] {
        let output = run(args);
        let (_, said) = texts(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("a job with [roughing] is two jobs"), "{said}");
    }
    assert!(!dir.path().join("fetched").exists());
    assert!(!Process::has_ended(&mut master));
}

#[test]
fn layers_lead_to_the_path_and_the_program_runs_them_in_order() {
    let dir = scratch();
    let (passes, plain) = (
        job(dir.path(), "passes.toml", PASSES),
        job(dir.path(), "plain.toml", ""),
    );
    let out = dir.path().join("out");
    let said = succeed(&["run", text(&passes), "-o", text(&out)]);
    let results = results(&out);
    let layers: Vec<String> = (1..=20).map(|k| format!("rough-{k}.csv")).collect();
    let layers: Vec<&String> = layers.iter().filter(|l| results.contains_key(*l)).collect();
    assert!((3..=7).contains(&layers.len()), "{layers:?}");
    assert!(
        said.contains(&format!(
            "roughing in {} layers, which leave ",
            layers.len()
        )),
        "{said}"
    );

    // Layer by layer no higher, and down by no more than the depth of cut where there is stock.
    let paths: Vec<_> = layers.iter().map(|l| positions(&results[*l])).collect();
    for pair in paths.windows(2) {
        assert_eq!(pair[0].len(), pair[1].len());
        for (before, after) in pair[0].iter().zip(&pair[1]) {
            assert_eq!((before.0, before.1), (after.0, after.1));
            let taken = before.2.expect("stock") - after.2.expect("stock");
            assert!((0.0..=20.0 + 1e-9).contains(&taken), "{before:?} {after:?}");
        }
    }

    // One program, with a comment before each pass and one retract after it.
    let program = String::from_utf8_lossy(&results["path.ngc"]).into_owned();
    let comments: Vec<&str> = program.lines().filter(|l| l.contains("pass: ")).collect();
    let mut expected: Vec<String> = (1..=layers.len())
        .map(|k| format!("(pass: rough {k})"))
        .collect();
    expected.push("(pass: finish)".to_owned());
    assert_eq!(comments, expected);
    let retracts = program.lines().filter(|l| l.starts_with("G0 Y")).count();
    assert_eq!(retracts, expected.len() + 1);

    // Over the block's corner, which is higher than any position, and the keep-out is not.
    let retract = program.lines().find_map(|l| l.strip_prefix("G0 Y"));
    let retract: f64 = retract.and_then(|y| y.parse().ok()).expect("a height");
    let corner = 0.5 * 150.0_f64.hypot(144.0) + 48.0;
    assert!((retract - corner - 20.0).abs() < 1e-3, "{retract}");

    let told = report(&out);
    let forecast = succeed(&["run", text(&passes), "--dry-run", "--json"]);
    let forecast = events(&forecast);
    let forecast = &forecast.last().expect("a plan")["plan"]["passes"];
    let positions_of = |pass: usize| forecast[pass]["positions"].as_u64();
    assert_eq!(
        (&forecast[0]["name"], &forecast[1]["name"]),
        (&"rough".into(), &"finish".into())
    );
    assert_eq!(positions_of(1), told["path"]["positions"].as_u64());
    // The allowance makes the cutter wider, and the roughing's steps are longer.
    assert!(positions_of(0) < positions_of(1), "{forecast}");

    let figures = told["program"]["passes"]
        .as_array()
        .expect("passes")
        .clone();
    let names: Vec<&str> = figures.iter().filter_map(|p| p["name"].as_str()).collect();
    assert_eq!(names.len(), expected.len());
    let total: f64 = figures.iter().filter_map(|p| p["seconds"].as_f64()).sum();
    let seconds = told["program"]["seconds"].as_f64().expect("seconds");
    assert!((total - seconds).abs() < 1e-9 * total);
    for (figure, path) in figures.iter().zip(&paths) {
        assert_eq!(figure["positions"], path.len());
        let deepest = figure["deepest_cut"].as_f64().expect("a depth");
        assert!(deepest > 0.0 && deepest <= 20.0 + 1e-9, "{figure}");
        assert!(figure["length"].as_f64() > Some(1000.0));
    }
    // What is left is the allowance at least. The finishing pass takes that and the scallops, at faces square to
    // the spindle up to the step.
    let left = &told["roughing"]["left"];
    let least = left["least"].as_f64().expect("a least");
    assert!((least - 2.0).abs() < 0.1, "{left}");
    let deepest = figures[layers.len()]["deepest_cut"]
        .as_f64()
        .expect("a depth");
    assert!((2.0..14.0).contains(&deepest), "{deepest}");

    // The finishing pass is what it would be alone, but for what it keeps out of; no layer is left over.
    let raised = positions(&results["path.csv"]);
    succeed(&["run", text(&plain), "-o", text(&out), "-q"]);
    let alone = self::results(&out);
    assert_eq!(alone.keys().collect::<Vec<_>>(), ["path.csv", "path.ngc"]);
    let alone = positions(&alone["path.csv"]);
    let (mut kept, mut most) = (0, 0.0_f64);
    let travels: Vec<f64> = alone.iter().map(|p| p.0).collect();
    for (i, (with, without)) in raised.iter().zip(&alone).enumerate() {
        assert_eq!((with.0, with.1), (without.0, without.1));
        // The wheel's rim, from the position before, and the end with its margin.
        let away = (travels[i.saturating_sub(1)] - 8.0) - -13.0;
        let least = (away <= 0.0).then(|| {
            let d = (away + 8.0).max(0.0);
            71.0 + (40.0 + (64.0 - d * d).sqrt())
        });
        let expected = match (without.2, least) {
            (Some(part), Some(least)) => Some(part.max(least)),
            (part, least) => part.or(least),
        };
        assert_eq!(with.2, expected, "position {i}");
        if with.2 != without.2 {
            kept += 1;
            most = most.max(with.2.unwrap_or_default() - without.2.expect("the holder"));
        }
    }
    assert!(kept > 100);
    let kept_out = &told["keep_outs"][0];
    assert_eq!(
        (&kept_out["positions"], &kept_out["uncut"]),
        (&kept.into(), &kept.into())
    );
    assert_eq!(kept_out["most"].as_f64(), Some(most));
    let warnings = told["warnings"].to_string();
    assert!(
        warnings.contains("keep-out 1 (-100 to -14) leaves the part uncut at"),
        "{warnings}"
    );
    assert!(!warnings.contains("out of the stock"), "{warnings}");
    // Not cut is no gouge.
    assert!(
        told["verification"]["normal"]["gouge"]["depth"]
            .as_f64()
            .unwrap_or(0.0)
            < 0.1
    );
}

#[test]
fn what_a_roughing_would_spoil_is_refused_or_warned_of() {
    let dir = scratch();
    let out = dir.path().join("out");
    let run_with = |old: &str, new: &str| {
        assert!(PASSES.contains(old), "{old}");
        let job = job(dir.path(), "job.toml", &PASSES.replacen(old, new, 1));
        let output = run(&["run", text(&job), "-o", text(&out)]);
        let (_, said) = texts(&output);
        (output.status.code(), said)
    };
    let (code, said) = run_with("path_tolerance = 0.5", "points_per_revolution = 7");
    assert_eq!(code, Some(3), "{said}");
    assert!(
        said.contains("a straight move of the roughing gouges the part by"),
        "{said}"
    );
    let (code, said) = run_with("depth_of_cut = 20", "depth_of_cut = 0.01");
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("more than the 200 that are made"), "{said}");
    let (code, said) = run_with("width = 144", "width = 60");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("warning: the part comes out of the stock by"),
        "{said}"
    );
}

#[test]
fn leads_come_in_beside_the_part() {
    let dir = scratch();
    let motion = "[cutter]\nkind = \"ball\"\nradius = 8.0
[motion]\nstep = 10.0\npoints_per_revolution = 36\n";
    let part = sample().with_file_name("last.step");
    let made = |name: &str, more: &str| {
        let job = crate::common::job(dir.path(), "job.toml", &[&part], &format!("{motion}{more}"));
        let out = dir.path().join(name);
        succeed(&["run", text(&job), "-o", text(&out), "-q", "--no-verify"]);
        results(&out)
    };
    let plain = made("plain", "");
    let led = made(
        "led",
        "lead_in = 20\nlead_out = 15\n[cluster]\nworkers = 2\n",
    );
    let (plain, all) = (positions(&plain["path.csv"]), positions(&led["path.csv"]));
    // Two turns before, with nothing in reach, and then the same path.
    assert!((all[0].0 - (plain[0].0 - 20.0)).abs() < 1e-9);
    assert!(all[..72].iter().all(|p| p.2.is_none()));
    for (led, plain) in all[72..].iter().zip(&plain) {
        assert!((led.0 - plain.0).abs() < 1e-9 && (led.1 - 720.0 - plain.1).abs() < 1e-9);
        let off = led.2.expect("the part") - plain.2.expect("the part");
        assert!(off.abs() < 1e-6, "{led:?} {plain:?}");
    }
    let end = plain.last().expect("positions").0 + 15.0;
    let last = all.last().expect("positions");
    assert!(last.2.is_none() && (last.0 - end).abs() < 0.6);
    // The program plunges there, as deep as the first contact.
    let program = String::from_utf8_lossy(&led["path.ngc"]).into_owned();
    let travel = program
        .lines()
        .find(|l| l.starts_with("G0 X"))
        .expect("travel");
    let x: f64 = travel[4..]
        .split(' ')
        .next()
        .and_then(|x| x.parse().ok())
        .expect("a number");
    assert!((x - all[0].0).abs() < 1e-3, "{travel}");
    let plunge = program
        .lines()
        .find_map(|l| l.strip_prefix("G1 Y"))
        .expect("a plunge");
    let y: f64 = plunge
        .split(' ')
        .next()
        .and_then(|y| y.parse().ok())
        .expect("a number");
    assert!((y - all[72].2.expect("contact")).abs() < 1e-3, "{plunge}");
}
