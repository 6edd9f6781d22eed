//! What a run is besides a run: told beforehand, told to other programs, and repeated when a file changes;
//! and the pages of its manual.

use std::path::{Path, PathBuf};

use crate::common::{
    Process, events, job, report, run, sample, scratch, succeed, text, texts, wait_until,
};
use serde_json::Value;

/// A coarse job of the sample last, with its own copy of the part.
fn coarse(dir: &Path, step: f64) -> PathBuf {
    let part = dir.join("last.step");
    std::fs::copy(sample().with_file_name("last.step"), &part).expect("writable");
    let more = format!(
        "[discretization]\ntolerance = 0.1\n[cutter]\nkind = \"ball\"\nradius = 20.0\n\
         [motion]\nstep = {step}\npoints_per_revolution = 36\n"
    );
    job(dir, "job.toml", &[&part], &more)
}

#[test]
fn a_dry_run_tells_what_a_run_does_and_writes_nothing() {
    let dir = scratch();
    let job = coarse(dir.path(), 5.0);
    let out = dir.path().join("out");
    let before = std::fs::read_dir(dir.path()).expect("readable").count();
    let said = succeed(&["run", text(&job), "--dry-run", "-w", "3"]);
    for word in [
        "3 workers",
        "3 extents",
        "MB",
        "digitize about",
        "nothing was written",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let told = succeed(&[
        "run",
        text(&job),
        "--dry-run",
        "-w",
        "3",
        "--json",
        "-o",
        text(&out),
    ]);
    assert_eq!(
        std::fs::read_dir(dir.path()).expect("readable").count(),
        before
    );
    let told = events(&told);
    let plan = &told.last().expect("a plan")["plan"];

    succeed(&["run", text(&job), "-o", text(&out), "-w", "3", "-q"]);
    let report = report(&out);
    let passes = plan["passes"].as_array().expect("passes");
    let [pass] = &passes[..] else {
        panic!("not one pass: {passes:?}");
    };
    assert_eq!(pass["positions"], report["path"]["positions"]);
    assert_eq!(plan["bodies"], report["bodies"]);
    let extents = pass["extents"].as_array().expect("extents");
    let made = report["extents"].as_array().expect("extents");
    let positions = |all: &[Value]| -> Vec<u64> {
        let of = |e: &Value| e["positions"].as_u64().expect("a number");
        all.iter().map(of).collect()
    };
    assert_eq!(positions(extents), positions(made));
    assert!(pass["seconds"]["digitize"].as_f64().expect("a time") > 0.0);
}

#[test]
fn what_cannot_be_run_cannot_be_planned() {
    let dir = scratch();
    let job = coarse(dir.path(), 5.0);
    std::fs::remove_file(dir.path().join("last.step")).expect("removed");
    let output = run(&["run", text(&job), "--dry-run"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(texts(&output).1.contains("last.step"));
    // Without a dry run there has to be a place for the results.
    let output = run(&["run", text(&job)]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(texts(&output).1.contains("--output"));
}

#[test]
fn other_programs_are_told_in_events() {
    let dir = scratch();
    let job = coarse(dir.path(), 5.0);
    let out = dir.path().join("out");
    let output = run(&["run", text(&job), "-o", text(&out), "--json"]);
    let (told, err) = texts(&output);
    assert_eq!((output.status.code(), &*err), (Some(0), ""));
    let told = events(&told);
    let of = |kind: &str| -> Vec<&Value> { told.iter().filter(|e| e["event"] == kind).collect() };
    let names = |events: &[&Value]| -> Vec<String> {
        events.iter().map(|e| e["name"].to_string()).collect()
    };
    assert_eq!(told[0]["event"], "phase");
    assert_eq!(told[0]["name"], "read");
    assert_eq!(
        names(&of("phase")),
        names(&of("phase_done")),
        "each phase ends"
    );
    let last = told.last().expect("an end");
    assert_eq!(last["event"], "done");
    assert_eq!(last["directory"], text(&out));
    assert!(out.join("path.csv").exists());

    std::fs::remove_file(dir.path().join("last.step")).expect("removed");
    let output = run(&["run", text(&job), "-o", text(&out), "--json"]);
    let (told, err) = texts(&output);
    let told = events(&told);
    let last = told.last().expect("an end");
    assert_eq!(
        (output.status.code(), &last["exit_code"]),
        (Some(2), &2.into())
    );
    let reason = last["text"].as_str().expect("a reason");
    assert!(
        reason.contains("last.step") && err.contains(reason),
        "{err}"
    );
}

#[test]
#[cfg(unix)]
fn a_watched_job_is_run_again_when_it_changes() {
    let dir = scratch();
    let job = coarse(dir.path(), 8.0);
    let out = dir.path().join("out");
    let args = ["run", text(&job), "-o", text(&out), "--watch", "--json"];
    let mut process = Process::start("watch", &args, "error");
    process.wait_for(&["\"watching\""]);
    let positions = || {
        report(&out)["path"]["positions"]
            .as_u64()
            .expect("a number")
    };
    let first = positions();

    // The job itself.
    coarse(dir.path(), 4.0);
    wait_until("it was heard", || process.has_said(&["\"changed\""]));
    // The part was written anew as well, before the job: however many runs that made, the last one has both.
    wait_until("the new step is run", || {
        process.times_said(&["\"done\""]) >= 2 && positions() > first
    });

    // A job that cannot be run is told of, and mended.
    std::fs::write(&job, "[part]\n").expect("writable");
    process.wait_for(&["\"failed\"", "job.toml"]);
    assert!(out.join("path.csv").exists(), "what there was is left");
    let done = process.times_said(&["\"done\""]);
    coarse(dir.path(), 2.0);
    wait_until("it is mended", || {
        process.times_said(&["\"done\""]) > done && positions() > 2 * first
    });

    process.signal("-INT");
    let (code, log) = process.end();
    assert_eq!(code, Some(130), "{log}");
}

#[test]
fn every_command_has_a_page() {
    let dir = scratch();
    let pages = dir.path().join("man1");
    succeed(&["man", text(&pages)]);
    let help = succeed(&["--help"]);
    let commands = help.split("Commands:").nth(1).expect("commands");
    let commands = commands.split("\n\n").next().expect("a list");
    let names: Vec<&str> = commands
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|&name| name != "help")
        .collect();
    assert!(names.len() > 15, "{names:?}");
    for name in names {
        let page = std::fs::read_to_string(pages.join(format!("horma-{name}.1"))).expect(name);
        assert!(
            page.contains(".TH") && page.contains(".SH SYNOPSIS"),
            "{name}"
        );
    }
    let page = std::fs::read_to_string(pages.join("horma.1")).expect("a page");
    assert!(page.contains("Exit codes"), "{page}");
    // A file is in the way.
    let output = run(&["man", text(&pages.join("horma.1"))]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}
