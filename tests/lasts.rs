//! Lasts in sizes and for both feet: the same bytes for any number of workers, all or nothing, and a path that is
//! mirrored with its part.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{job, report, run, sample, scratch, succeed, text, texts};

/// The sample last with a coarse path.
fn coarse(dir: &Path, more: &str) -> PathBuf {
    let part = sample().with_file_name("last.step");
    let rest = format!(
        "[discretization]\ntolerance = 0.05
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nkind = \"rings\"\nstep = 10.0\npoints_per_revolution = 36
[last]\nbodies = [\"last\"]\nup = [-45, 0, 260]
[grading]\nbase = 37\nhold = [\"heel_height\", \"toe_spring\"]\n{more}"
    );
    job(dir, "job.toml", &[&part], &rest)
}

/// Every file below a directory that does not tell of clocks or processes.
fn results(dir: &Path, below: &str, found: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(dir).expect("readable") {
        let path = entry.expect("readable").path();
        let name = path
            .file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        let name = format!("{below}{name}");
        if path.is_dir() {
            results(&path, &format!("{name}/"), found);
        } else if below.is_empty()
            || !["report.json", "report.html"]
                .iter()
                .any(|r| name.ends_with(r))
        {
            found.insert(name, fs::read(&path).expect("readable"));
        }
    }
}

#[test]
fn sizes_and_sides_are_the_same_bytes_with_any_number_of_workers() {
    let dir = scratch();
    let job = coarse(dir.path(), "");
    let all: Vec<_> = ["0", "1", "4"]
        .into_iter()
        .map(|workers| {
            let out = dir.path().join(workers);
            let args = [
                "--sizes",
                "36,37.5",
                "--sides",
                "left,right",
                "-w",
                workers,
                "-q",
            ];
            succeed(&[&["run", text(&job), "-o", text(&out)], &args[..]].concat());
            let mut found = BTreeMap::new();
            results(&out, "", &mut found);
            found
        })
        .collect();
    let names: Vec<&str> = all[0].keys().map(String::as_str).collect();
    assert_eq!(
        names.iter().filter(|n| n.ends_with("path.csv")).count(),
        4,
        "{names:?}"
    );
    assert_eq!(
        names.iter().filter(|n| n.ends_with("path.ngc")).count(),
        4,
        "{names:?}"
    );
    for other in &all[1..] {
        assert_eq!(
            other.keys().collect::<Vec<_>>(),
            all[0].keys().collect::<Vec<_>>()
        );
        for (name, bytes) in other {
            assert!(*bytes == all[0][name], "{name} differs");
        }
    }
    let told = report(&dir.path().join("4"));
    let measure = |k: usize, key: &str| {
        let designed = &told["sizes"][k]["last"]["designed"];
        designed[key].as_f64().expect("a number")
    };
    assert_eq!(told["sizes"][0]["name"], "36-left");
    assert_eq!(told["sizes"][3]["name"], "37.5-right");
    for (key, by) in [("length", 10.0), ("ball_girth", 7.5), ("heel_height", 0.0)] {
        let grown = measure(2, key) - measure(0, key);
        assert!((grown - by).abs() < 0.01, "{key} grows by {grown}");
        // Facets of a mirrored surface are others, within their tolerance.
        let mirrored = measure(1, key) - measure(0, key);
        assert!(
            mirrored.abs() < 0.01,
            "{key} of the other side is off by {mirrored}"
        );
    }
}

#[test]
fn what_fails_for_one_size_leaves_nothing_of_any() {
    let dir = scratch();
    // The machine is long enough for the smaller last alone.
    let job = coarse(dir.path(), "[machine]\ntravel = { range = [-100, 308] }\n");
    let out = dir.path().join("out");
    let ended = run(&[
        "run",
        text(&job),
        "-o",
        text(&out),
        "--sizes",
        "37,44",
        "-q",
    ]);
    let (_, told) = texts(&ended);
    assert_eq!(ended.status.code(), Some(3), "{told}");
    assert!(told.contains("44: "), "{told}");
    let left = fs::read_dir(&out).expect("made").count();
    assert_eq!(left, 0, "something is left");
}

#[test]
fn bad_sizes_are_refused_with_advice() {
    let dir = scratch();
    let job = coarse(dir.path(), "");
    let out = dir.path().join("out");
    let check = |sizes: &str, advice: &str| {
        let ended = run(&["run", text(&job), "-o", text(&out), "--sizes", sizes]);
        let (_, told) = texts(&ended);
        assert_eq!(ended.status.code(), Some(2), "{sizes}: {told}");
        assert!(told.contains(advice), "{sizes}: {told}");
    };
    check("36..42", "36-42");
    check("42-36", "write 36-42");
    check("1", "half to twice");
}

#[test]
fn a_last_is_measured_and_drawn_with_its_landmarks() {
    let dir = scratch();
    let job = coarse(dir.path(), "[measures]\ninstep = 0.4\n");
    let figure = dir.path().join("last.svg");
    let told = succeed(&["measure", text(&job), "--figure", text(&figure), "--json"]);
    let told: serde_json::Value = serde_json::from_str(&told).expect("JSON");
    let instep = told["landmarks"]["instep"][0].as_f64().expect("a place");
    let length = told["designed"]["length"].as_f64().expect("a number");
    assert!((instep - (0.05 + 0.4 * length)).abs() < 0.01, "{instep}");
    let drawn = fs::read_to_string(&figure).expect("a figure");
    assert_eq!(drawn.matches("<circle").count(), 7);
    assert_eq!(drawn.matches("<polygon").count(), 3);
    assert!(drawn.contains(">ball inner</text>") && !drawn.contains("NaN"));
}

#[test]
fn a_mirrored_mesh_has_a_mirrored_path() {
    let dir = scratch();
    let part = dir.path().join("part.stl");
    fs::write(&part, lopsided()).expect("writable");
    let rest = "[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nkind = \"rings\"\nstep = 5.0\npoints_per_revolution = 72
[last]\nup = [0, 1, 0]\n";
    let job = job(dir.path(), "job.toml", &[&part], rest);
    let out = dir.path().join("out");
    succeed(&[
        "run",
        text(&job),
        "-o",
        text(&out),
        "--sides",
        "left,right",
        "-q",
        "--no-verify",
    ]);
    let heights = |side: &str| -> Vec<f64> {
        let path = fs::read_to_string(out.join(side).join("path.csv")).expect("a path");
        let column = |line: &str| line.split(',').nth(3).and_then(|y| y.parse().ok());
        path.lines()
            .skip(1)
            .map(|line| column(line).unwrap_or(f64::NAN))
            .collect()
    };
    let (left, right) = (heights("left"), heights("right"));
    assert!(left.len() > 500 && left.len() == right.len());
    let mut lopsided = 0;
    for (i, y) in right.iter().enumerate() {
        let (ring, turn) = (i / 72, i % 72);
        let other = left[ring * 72 + (72 - turn) % 72];
        assert!((y - other).abs() < 1e-9, "position {i}: {y} and {other}");
        lopsided += usize::from((y - left[i]).abs() > 1.0);
    }
    assert!(lopsided > 100, "the part is its own mirror image");
}

/// A bar with a side to it, as ASCII STL.
fn lopsided() -> String {
    let ring = |x: f64| -> Vec<[f64; 3]> {
        let point = |k: u32| {
            let angle = f64::from(k) * std::f64::consts::TAU / 40.0;
            let radius = 30.0 + 6.0 * (angle + 0.4).sin() + 3.0 * (2.0 * angle).cos();
            [x, radius * angle.cos(), radius * angle.sin()]
        };
        (0..40).map(point).collect()
    };
    let rings: Vec<_> = (0..=10).map(|k| ring(f64::from(k) * 12.0)).collect();
    let mut stl = "solid bar\n".to_owned();
    for pair in rings.windows(2) {
        for k in 0..40 {
            let [a, b] = [pair[0][k], pair[0][(k + 1) % 40]];
            let [c, d] = [pair[1][k], pair[1][(k + 1) % 40]];
            for triangle in [[a, b, c], [b, d, c]] {
                stl += "facet normal 0 0 0\nouter loop\n";
                for [x, y, z] in triangle {
                    stl += &format!("vertex {x} {y} {z}\n");
                }
                stl += "endloop\nendfacet\n";
            }
        }
    }
    stl + "endsolid bar\n"
}
