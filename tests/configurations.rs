//! The three configurations that the 2001 paper measured, in full: every position by the exact search, by
//! brute force and by the papers' windows.

use std::path::Path;

use crate::common::{data, job, path_of, report, sample, scratch};

/// Rows, columns, points per revolution and step.
const CONFIGURATIONS: [(u32, u32, u32, f64); 3] = [
    (159, 120, 360, 2.0),
    (137, 90, 120, 1.0),
    (140, 100, 90, 5.0),
];

/// Candidates evaluated over positions.
fn evaluations(dir: &Path, name: &str) -> f64 {
    let report = report(&dir.join(name));
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    number(&report["counters"]["evaluations"]) / number(&report["path"]["positions"])
}

fn check_configurations(part: &Path, axis: &str) {
    let dir = scratch();
    for (rows, columns, points, step) in CONFIGURATIONS {
        let more = format!(
            "{axis}\n[discretization]\ngrid = {{ rows = {rows}, columns = {columns} }}\n[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0\n[motion]\nstep = {step:?}\npoints_per_revolution = {points}\n[digitizing]\ncontact = \"point\"\n"
        );
        let job = job(dir.path(), "job.toml", &[part], &more);
        let exact = path_of(&job, dir.path(), "exact", &[]);
        let brute = path_of(&job, dir.path(), "brute", &["--method", "brute"]);
        assert!(exact == brute, "{rows} × {columns}: brute force");
        let windows = ["--method", "local", "--delta-u", "8", "--delta-v", "20"];
        let alone = [&windows[..], &["--no-fallback"]].concat();
        let local = path_of(&job, dir.path(), "local", &alone);
        assert!(
            local == exact,
            "{rows} × {columns}: windows without a fallback"
        );
        let [all, few] = ["brute", "local"].map(|name| evaluations(dir.path(), name));
        assert!(
            few <= 0.1 * all,
            "{few} evaluations by windows, {all} by brute force"
        );
    }
}

#[test]
fn every_position_of_the_sample_is_that_of_brute_force() {
    check_configurations(&sample().with_file_name("last.step"), "");
}

#[test]
fn every_position_of_a_scanned_last_is_that_of_brute_force() {
    if let Some(part) = data("last_3surfaces.step") {
        let axis = "axis = { point = [0, 0, 14], direction = [1, 0, 0] }";
        check_configurations(&part, axis);
    }
}
