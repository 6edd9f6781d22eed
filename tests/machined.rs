//! The machined surface: what a path does to a part is seen where it does it, and a good path shows nothing.

use std::path::Path;

use crate::common::{job, lower, report, sample, scratch, succeed, text};
use serde_json::Value;

fn number(value: &Value, pointer: &str) -> f64 {
    let number = value.pointer(pointer).and_then(Value::as_f64);
    number.unwrap_or_else(|| panic!("no {pointer} in {value}"))
}

/// Deepest gouge of a report, mm, and where it is: travel and angle.
fn deepest(report: &Value) -> (f64, [f64; 2]) {
    let gouge = &report["machined"]["deepest_gouge"];
    if gouge.is_null() {
        return (0.0, [f64::NAN; 2]);
    }
    let at = ["/x", "/angle"].map(|key| number(gouge, key));
    (-number(gouge, "/deviation"), at)
}

/// Whether a deepest gouge is where the cutter was, at such an angle, as near as rays half a millimetre and a
/// degree apart can tell.
fn check_at([x, angle]: [f64; 2], [at_x, at_angle]: [f64; 2]) {
    assert!((at_x - x).abs() <= 0.5, "at x {at_x} instead of {x}");
    let apart = (at_angle - angle).rem_euclid(360.0);
    assert!(
        apart.min(360.0 - apart) <= 1.5,
        "at {at_angle}° instead of {angle}°"
    );
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
    // The run's own report tells of the surface that it leaves. Facets may be 0.02 mm inside of the designed
    // surface, and straight moves 0.02 mm inside of those.
    let of_run = report(&run);
    let (gouge, _) = deepest(&of_run);
    assert!(gouge <= 0.04, "{gouge} mm");
    let within = number(&of_run, "/machined/within_tolerance");
    assert!(within > 0.5, "{within} of the rays");
    // Between turns 1 mm apart, 1/64 mm is left by the rim's 8 mm; somewhat more where it runs aslant.
    let median = number(&of_run, "/machined/percentiles/median");
    assert!((0.0..0.02).contains(&median), "{median} mm");
    assert!(run.join("machined.svg").exists());

    let path = run.join("path.csv");
    let machined = |path: &Path, name: &str| {
        let out = dir.path().join(name);
        let args = ["--columns", "360", "--json"];
        let told = succeed(
            &[
                &["machined", text(path), text(&job), "-o", text(&out)],
                &args[..],
            ]
            .concat(),
        );
        let told: Value = serde_json::from_str(&told).expect("JSON");
        let report = report(&out);
        assert_eq!(told, report["machined"]);
        for file in ["machined.ply", "machined.svg", "report.html"] {
            assert!(out.join(file).metadata().expect("written").len() > 10_000);
        }
        report
    };
    let good = machined(&path, "good");
    // The same rays over the same path.
    assert_eq!(good["machined"], of_run["machined"]);
    assert_eq!(good["verification"], of_run["verification"]);
    assert_eq!(good["path"]["positions"], of_run["path"]["positions"]);

    let lowered = dir.path().join("low.csv");
    let place = lower(&path, &lowered);
    let bad = machined(&lowered, "bad");
    let (gouge, at) = deepest(&bad);
    assert!((gouge - 0.5).abs() < 0.02, "{gouge} mm deep");
    check_at(place, at);
    let verified = number(&bad, "/verification/normal/gouge/depth");
    assert!((verified - 0.5).abs() < 0.02, "{verified} mm deep");

    let quick = dir.path().join("quick");
    succeed(&["run", text(&job), "-o", text(&quick), "-q", "--no-verify"]);
    assert!(report(&quick)["machined"].is_null());
    assert!(!quick.join("machined.svg").exists());
}
