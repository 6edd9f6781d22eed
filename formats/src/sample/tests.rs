use std::fs;
use std::path::PathBuf;

use horma_core::{Interval, cross, dot, length, sub};

use super::*;
use crate::{job, part};

fn example(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../examples/last")
        .join(name)
}

fn surfaces(style: &LastStyle) -> Vec<Surface> {
    let bodies = last(style).expect("valid").bodies;
    let surface = |b: Body| match b.shape {
        Shape::Surface(s) => s,
        Shape::Mesh(_) => panic!("a mesh"),
    };
    bodies.into_iter().map(surface).collect()
}

fn dense(surface: &Surface, rows: usize, columns: usize) -> Vec<Vec<Point>> {
    let over = |(low, high): (f64, f64), n: usize| -> Vec<f64> {
        let step = (high - low) / (n - 1) as f64;
        (0..n).map(|i| (low + step * i as f64).min(high)).collect()
    };
    let us = over(surface.u().domain(), rows);
    let vs = over(surface.v().domain(), columns);
    let points = surface.grid(&us, &vs);
    points
        .chunks_exact(columns)
        .map(<[Point]>::to_vec)
        .collect()
}

/// What a last maker would measure, mm.
fn measures(style: &LastStyle) -> [f64; 4] {
    let rows = dense(&surfaces(style)[0], 400, 200);
    let extent = |row: &[Point], k: usize| {
        let i = Interval::of(row.iter().map(|p| p[k]));
        i.high - i.low
    };
    let all: Vec<Point> = rows.concat();
    let width = |row: &Vec<Point>| extent(row, 1);
    let ball = rows.iter().map(width).fold(0.0, f64::max);
    let waist = rows
        .iter()
        .filter(|r| (0.25..0.55).contains(&(r[0][0] / style.length)));
    let waist = waist.map(width).fold(f64::INFINITY, f64::min);
    let cone = rows.iter().map(|row| extent(row, 2)).fold(0.0, f64::max);
    [extent(&all, 0), ball, waist, cone]
}

#[test]
fn the_styles_measure_what_they_state() {
    for style in [LastStyle::WOMEN, LastStyle::MEN] {
        let [length, ball, waist, cone] = measures(&style);
        assert!((length - style.length).abs() < 0.2, "length {length}");
        assert!((ball / style.ball_width - 1.0).abs() < 0.01, "ball {ball}");
        assert!((cone / style.cone_height - 1.0).abs() < 0.02, "cone {cone}");
        assert!(waist < 0.72 * ball, "waist {waist}, ball {ball}");
    }
}

#[test]
fn it_is_smooth_and_turned_outwards() {
    let styles = [LastStyle::WOMEN, LastStyle::MEN];
    for surface in styles.iter().flat_map(surfaces) {
        let rows = dense(&surface, 200, 200);
        let normal = |i: usize, j: usize| {
            let along = sub(rows[i + 1][j], rows[i][j]);
            let around = sub(rows[i][j + 1], rows[i][j]);
            let n = cross(along, around);
            n.map(|c| c / length(n))
        };
        assert!(rows.iter().all(|row| row[0] == row[199]), "v is closed");
        for (i, row) in rows.iter().enumerate().take(199).skip(1) {
            for (j, &p) in row.iter().enumerate().take(199).skip(1) {
                // A section may be hollow, but nowhere does the surface turn its back on the spindle.
                let n = normal(i, j);
                let outwards = n[1] * p[1] + n[2] * p[2];
                assert!(outwards > 0.0, "{p:?} {n:?}");
                let turn = dot(n, normal(i - 1, j)).min(dot(n, normal(i, j - 1)));
                assert!(turn > 0.5, "a fold at {p:?}");
            }
        }
    }
}

#[test]
fn the_holders_enter_the_last() {
    let [last, toe, heel] = surfaces(&LastStyle::WOMEN).try_into().expect("three");
    let x = |s: &Surface| Interval::of(s.poles().iter().map(|p| p[0]));
    assert!(x(&heel).low < x(&last).low && x(&last).low < x(&heel).high);
    assert!(x(&toe).low < x(&last).high && x(&last).high < x(&toe).high);
    // The slits that the last leaves at its ends are inside them.
    let ends = dense(&last, 2, 200);
    for (end, (_, width, height)) in ends.iter().zip([HEEL_HOLDER[1], TOE_HOLDER[1]]) {
        let inside = |p: &Point| (p[1] / width).hypot(p[2] / height) < 1.0;
        assert!(end.iter().all(inside));
    }
}

#[test]
fn the_committed_example_is_what_this_code_writes() {
    let file = example(PART);
    let text = last_step(&LastStyle::WOMEN).expect("valid");
    if std::env::var_os("UPDATE_EXAMPLES").is_some() {
        fs::write(&file, &text).expect("written");
    }
    let committed = fs::read_to_string(&file).expect("there");
    // No assert_eq: it would print both files.
    assert!(
        committed == text,
        "{} is stale; run the tests with UPDATE_EXAMPLES=1",
        file.display()
    );
    assert!(text.len() < 400_000, "{} bytes", text.len());
}

#[test]
fn the_example_reads_back_pole_for_pole() {
    let loaded = part::read(&example(PART), &part::Reading::default()).expect("readable");
    assert_eq!(loaded.warnings, []);
    let expected = last(&LastStyle::WOMEN).expect("valid").bodies;
    assert_eq!(loaded.bodies.len(), expected.len());
    for (body, original) in loaded.bodies.iter().zip(expected) {
        assert!(body.shape == original.shape, "{}", body.name);
        assert!(
            body.name.contains(&format!("'{}'", original.name)),
            "{}",
            body.name
        );
    }
}

#[test]
fn the_job_is_valid_and_says_what_the_defaults_say() {
    let overrides = job::Overrides::default();
    let job = job::parse(job_toml(), &example(JOB), &overrides).expect("valid");
    assert_eq!(job.files, [example(PART)]);
}

#[test]
fn nothing_is_overwritten() {
    let dir = tempfile::tempdir().expect("a scratch directory");
    let inside = dir.path().join("new/sample");
    write_sample(&inside).expect("written");
    assert_eq!(
        fs::read_to_string(inside.join(JOB)).expect("there"),
        job_toml()
    );
    fs::remove_file(inside.join(PART)).expect("removed");
    fs::write(inside.join(JOB), "mine").expect("written");
    let error = write_sample(&inside).expect_err("the job is there");
    assert!(error.to_string().contains(JOB), "{error}");
    assert!(!inside.join(PART).exists());
    assert_eq!(fs::read_to_string(inside.join(JOB)).expect("there"), "mine");
}
