//! The machined surface: what a path does to a part is seen where it does it, and a good path shows nothing.

mod common;

use std::path::Path;

use common::{job, sample, scratch, succeed, text};

/// Deepest gouge, mm, and where it is: travel and angle; and the share of rays within the tolerance.
fn machined(path: &Path, job: &Path, out: &Path) -> (f64, [f64; 2], f64) {
    let told = succeed(&[
        "machined",
        text(path),
        text(job),
        "-o",
        text(out),
        "--json",
        "--columns",
        "360",
    ]);
    let told: serde_json::Value = serde_json::from_str(&told).expect("JSON");
    let number = |pointer: &str| told.pointer(pointer).and_then(serde_json::Value::as_f64);
    let gouge = |key: &str| number(&format!("/deepest_gouge/{key}")).unwrap_or(0.0);
    let within = number("/within_tolerance").expect("a tolerance");
    (-gouge("deviation"), [gouge("x"), gouge("angle")], within)
}

#[test]
fn a_position_too_low_is_seen_where_it_is_and_a_good_path_shows_no_gouge() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    let more = "axis = \"auto\"
[discretization]\ntolerance = 0.02
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 1.0\npoints_per_revolution = 360\npath_tolerance = 0.02\n";
    let job = job(dir.path(), "job.toml", &[&part], more);
    let run = dir.path().join("run");
    succeed(&["run", text(&job), "-o", text(&run), "-q"]);
    let path = run.join("path.csv");
    let (gouge, _, within) = machined(&path, &job, &dir.path().join("good"));
    // Facets may be 0.02 mm inside of the surface, and straight moves 0.02 mm inside of those.
    assert!(gouge <= 0.04, "{gouge} mm");
    assert!(within > 0.5, "{within} of the rays");

    // Half a millimetre lower in the middle, where the cutter touches what faces it.
    let lines: Vec<String> = std::fs::read_to_string(&path)
        .expect("a path")
        .lines()
        .map(str::to_owned)
        .collect();
    let numbers =
        |line: &str| -> Vec<f64> { line.split(',').filter_map(|n| n.parse().ok()).collect() };
    let facing = |line: &String| {
        let [_, x, angle, y, contact_x, contact_y, contact_z] = numbers(line)[..] else {
            return false;
        };
        let reach = contact_y.hypot(contact_z);
        (contact_x - x).abs() < 0.05 && (y - 48.0 - reach).abs() < 0.001 && angle > 20000.0
    };
    let low = (1..lines.len())
        .find(|&k| facing(&lines[k]))
        .expect("one that is faced");
    let [index, x, angle, y, ..] = numbers(&lines[low])[..] else {
        panic!("a touch: {}", lines[low]);
    };
    let mut lowered = lines.clone();
    lowered[low] = format!("{index},{x},{angle},{},,,", y - 0.5);
    let bad = dir.path().join("bad.csv");
    std::fs::write(&bad, lowered.join("\n") + "\n").expect("writable");
    let out = dir.path().join("bad");
    let (gouge, [at_x, at_angle], _) = machined(&bad, &job, &out);
    assert!((gouge - 0.5).abs() < 0.02, "{gouge} mm deep");
    assert!((at_x - x).abs() <= 0.5, "at x {at_x} instead of {x}");
    let apart = (at_angle - angle).rem_euclid(360.0);
    assert!(
        apart.min(360.0 - apart) <= 1.5,
        "at {at_angle}° instead of {angle}°"
    );
    for file in ["machined.ply", "machined.svg"] {
        assert!(out.join(file).metadata().expect("written").len() > 10_000);
    }
}
