//! The program as its user meets it: its files, what the machine allows, and what the report tells of it.

use std::path::Path;

use crate::common::{report, run, sample, scratch, succeed, text, texts};

/// The sample, coarse, with these sections after its own.
fn job(dir: &Path, more: &str) -> std::path::PathBuf {
    let motion = "[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 10.0\npoints_per_revolution = 72\n";
    let part = sample().with_file_name("last.step");
    crate::common::job(dir, "job.toml", &[&part], &format!("{motion}{more}"))
}

fn names(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).map(|d| d.flatten().collect::<Vec<_>>());
    let entries = entries.unwrap_or_default();
    let names = entries
        .iter()
        .map(|e| e.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn what_an_earlier_program_left_goes() {
    let dir = scratch();
    let (job, out) = (job(dir.path(), ""), dir.path().join("out"));
    let common = ["path.csv", "preview.png", "report.html", "report.json"];
    let run = |args: &[&str], programs: &[&str]| {
        let mut all = vec!["run", text(&job), "-o", text(&out), "--no-verify"];
        all.extend(args);
        let said = succeed(&all);
        let mut expected: Vec<String> = common
            .iter()
            .chain(programs)
            .map(ToString::to_string)
            .collect();
        expected.sort();
        assert_eq!(names(&out), expected);
        assert!(
            said.contains("cutting takes") && said.contains(programs[0]),
            "{said}"
        );
        let files = report(&out)["program"]["files"].clone();
        assert_eq!(files, serde_json::json!(programs));
    };
    let parts = ["path_0001.mpf", "path_0002.mpf"];
    run(&["--dialect", "siemens", "--split", "1500"], &parts);
    run(&["--dialect", "mach"], &["path.tap"]);
    run(&[], &["path.ngc"]);
}

#[test]
fn a_path_beyond_the_machine_is_refused_with_its_place() {
    let dir = scratch();
    let out = dir.path().join("out");
    for (more, words) in [
        (
            "[machine]\ntravel = { range = [0, 500] }\n",
            &[
                "travel goes to -",
                "travel -",
                "angle 0.00°",
                "range in [machine] is from 0 to 500",
            ][..],
        ),
        (
            "[machine]\nattack = { range = [0, 60] }\n",
            &["attack goes to ", "range in [machine] is from 0 to 60"],
        ),
        (
            "[program]\nclearance = 1000\n[machine]\nattack = { range = [0, 500] }\n",
            &["attack retracts to 1", "ask for less clearance"],
        ),
        (
            "[program]\ndialect = \"grblhal\"\ndecimals = { rotation = 4 }\n",
            &[
                "rotation at travel ",
                "is beyond the 1677.7216 that grblHAL can be told",
            ],
        ),
    ] {
        let job = job(dir.path(), more);
        let output = run(&["run", text(&job), "-o", text(&out), "-q", "--no-verify"]);
        let (said, err) = texts(&output);
        assert_eq!(
            (output.status.code(), said.as_str()),
            (Some(3), ""),
            "{err}"
        );
        for word in words {
            assert!(err.contains(word), "{word:?} is not in: {err}");
        }
        assert_eq!(names(&out), Vec::<String>::new());
    }
}

#[test]
fn the_report_tells_what_holds_the_machine_back() {
    let dir = scratch();
    let out = dir.path().join("out");
    let more = "[program]\nfeed = 100000\napt = true
[machine]
travel = { velocity = 200, acceleration = 1000 }
attack = { range = [0, 500], velocity = 300, acceleration = 3000, jerk = 50000 }
rotation = { acceleration = 1800 }
turns = 45\n";
    let job = job(dir.path(), more);
    succeed(&["run", text(&job), "-o", text(&out), "-q", "--no-verify"]);
    let apt = std::fs::read_to_string(out.join("path.apt")).expect("locations");
    let report = report(&out);
    let positions = report["path"]["positions"].as_u64().expect("positions");
    // All of them, and retracted before and after.
    assert_eq!(apt.matches("\nGOTO/").count() as u64, positions + 2);
    let program = report["program"].clone();
    let bounds = program["bounds"].as_array().expect("bounds");
    let share: f64 = bounds.iter().filter_map(|b| b[1].as_f64()).sum();
    assert!((share - 1.0).abs() < 1e-9, "{bounds:?}");
    let named = |name: &str| bounds.iter().any(|b| b[0].as_str() == Some(name));
    assert!(
        named("rotation velocity") && named("attack jerk"),
        "{bounds:?}"
    );
    let seconds = program["seconds"].as_f64().expect("seconds");
    let steady = program["steady"]["seconds"].as_f64().expect("seconds");
    assert!(seconds < steady, "{program}");
    let most = [
        [200.0, 1000.0, f64::INFINITY],
        [300.0, 3000.0, 5.0e4],
        [270.0, 1800.0, f64::INFINITY],
    ];
    for (peak, most) in program["peaks"].as_array().expect("peaks").iter().zip(most) {
        for (key, most) in ["velocity", "acceleration", "jerk"].into_iter().zip(most) {
            let found = peak[key].as_f64().expect("a number");
            assert!(found <= most * (1.0 + 1e-9), "{key}: {peak}");
        }
    }
}
