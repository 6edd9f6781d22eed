//! The table of the distributions: each of them, on 1 to 16 workers, over points and over facets, of
//! surfaces and of a scan, against the path of one process, byte for byte.
//!
//! `cargo test table:: -- --nocapture` prints it. The cutter is wider than the extents of many
//! workers, so that halos reach beyond neighbours.

use std::path::{Path, PathBuf};

use crate::common::{data, job, path_of, report, run, sample, scratch, text, texts};
use horma_core::{Axis, Discretization, discretize, place};
use horma_formats::part;
use serde_json::Value;

const WORKERS: [usize; 6] = [1, 2, 3, 5, 8, 16];

/// Width of the cutter below, mm.
const WIDTH: f64 = 96.0;

const STEP: f64 = 5.0;
const POINTS_PER_REVOLUTION: u32 = 36;

fn job_of(dir: &Path, part: &Path, axis: &str) -> PathBuf {
    let more = format!(
        "{axis}[discretization]\ngrid = {{ rows = 60, columns = 40 }}
[cutter]\nkind = \"torus\"\nmajor_radius = 10.0\nminor_radius = {:?}
[motion]\nstep = {STEP:?}\npoints_per_revolution = {POINTS_PER_REVOLUTION}\n",
        WIDTH / 2.0
    );
    job(dir, "job.toml", &[part], &more)
}

/// Every row of the table over one part.
fn check_table(name: &str, part: &Path, axis: &str, distributions: &[&str]) {
    let dir = scratch();
    let job = job_of(dir.path(), part, axis);
    let mut table = format!(
        "\n{name}\n| contact | distribution | workers | widest extent, mm | rows needed | rows sent | again | kB to workers | kB between | kB of results | equal |\n|---|---|---|---|---|---|---|---|---|---|---|\n"
    );
    let mut different = Vec::new();
    for contact in ["point", "facet"] {
        let given = ["--contact", contact];
        let alone = path_of(&job, dir.path(), "alone", &given);
        for distribution in distributions {
            for workers in WORKERS {
                let count = workers.to_string();
                let how = ["--workers", &count, "--distribution", distribution];
                let path = path_of(&job, dir.path(), "cluster", &[&given[..], &how].concat());
                let equal = path == alone;
                let report = report(&dir.path().join("cluster"));
                let extents = report["extents"].as_array().expect("extents").len();
                assert_eq!(extents, workers, "one extent for each");
                let widest = widest(&report);
                assert!(
                    workers < 8 || widest < WIDTH,
                    "extents of {workers} are narrower than the cutter: {widest} mm"
                );
                let traffic = &report["traffic"];
                let number = |key: &str| traffic[key].as_u64().expect("a number");
                let kilobytes = |key| number(key).div_ceil(1000);
                let second = report["second"].as_array().expect("a list");
                let again: u64 = second.iter().filter_map(|s| s["rows_sent"].as_u64()).sum();
                let row = format!(
                    "| {contact} | {distribution} | {workers} | {widest:.1} | {} | {} | {again} | {} | {} | {} | {} |\n",
                    number("rows_needed"),
                    number("rows_sent"),
                    kilobytes("bytes_to_workers"),
                    kilobytes("bytes_between_workers"),
                    kilobytes("bytes_of_results"),
                    if equal { "yes" } else { "NO" },
                );
                if !equal {
                    different.push(row.clone());
                }
                table += &row;
            }
        }
    }
    eprintln!("{table}");
    assert!(different.is_empty(), "{name}: {different:#?}");
}

/// Travel of the widest extent, mm.
fn widest(report: &Value) -> f64 {
    let extents = report["extents"].as_array().expect("extents").iter();
    let positions = extents.filter_map(|e| e["positions"].as_u64());
    positions.max().expect("an extent") as f64 * STEP / f64::from(POINTS_PER_REVOLUTION)
}

/// A scan of the sample: its facets, in no order and without their surfaces, in a binary STL.
fn scan_of_the_sample(dir: &Path) -> PathBuf {
    let files = [sample().with_file_name("last.step")];
    let read = part::read_all(&files, &part::Reading::default()).expect("the sample");
    let part = place(read.part, Axis::default()).expect("placed");
    let grid = Discretization::Grid {
        rows: 60,
        columns: 40,
    };
    let triangles = discretize(&part, grid).expect("discretized").triangles();
    let mut stl = vec![0; 80];
    stl.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        let numbers = [[0.0; 3]].into_iter().chain(triangle).flatten();
        stl.extend(numbers.flat_map(|number: f64| (number as f32).to_le_bytes()));
        stl.extend([0, 0]);
    }
    let file = dir.join("scan.stl");
    std::fs::write(&file, stl).expect("writable");
    file
}

const ALL: [&str; 3] = ["overlap", "halo", "surface"];
const AXIS: &str = "axis = { point = [0, 0, 14], direction = [1, 0, 0] }\n";

#[test]
fn surfaces_of_the_sample() {
    check_table(
        "the sample",
        &sample().with_file_name("last.step"),
        "",
        &ALL,
    );
}

#[test]
fn a_scan_of_the_sample() {
    let dir = scratch();
    let scan = scan_of_the_sample(dir.path());
    check_table("a scan of the sample", &scan, "", &ALL[..2]);
    // There is no surface to send.
    let (job, out) = (job_of(dir.path(), &scan, ""), dir.path().join("out"));
    let how = ["--workers", "2", "--distribution", "surface"];
    let refused = run(&[&["run", text(&job), "-o", text(&out)], &how[..]].concat());
    let (_, err) = texts(&refused);
    assert_eq!(refused.status.code(), Some(2), "{err}");
    assert!(err.contains("is a mesh"), "{err}");
}

#[test]
fn surfaces_of_a_scanned_last() {
    if let Some(part) = data("last_3surfaces.step") {
        check_table("last_3surfaces.step", &part, AXIS, &ALL);
    }
}

#[test]
fn a_scanned_last() {
    if let Some(part) = data("last_scan.stl") {
        check_table("last_scan.stl", &part, AXIS, &ALL[..2]);
    }
}
