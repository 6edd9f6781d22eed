//! The Python wheel: built, installed into a clean virtual environment, and tested there beside this binary.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use crate::common::{forget_settings, scratch, texts};

/// Runs a program to a good end.
fn succeed(program: &OsStr, args: &[&OsStr], set: &[(&str, &OsStr)]) -> String {
    let mut command = Command::new(program);
    forget_settings(&mut command);
    command.args(args).envs(set.iter().copied());
    let output = command.output().expect("the program starts");
    let (out, err) = texts(&output);
    assert!(output.status.success(), "{command:?}\n{out}{err}");
    out + &err
}

#[test]
fn the_wheel_installs_and_gives_the_same_path() {
    let Some(python) = std::env::var_os("HORMA_ORACLE_PYTHON") else {
        eprintln!("skipped: the wheel: HORMA_ORACLE_PYTHON is not set; tests/run sets it");
        return;
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dir = scratch();
    let (wheels, clean) = (dir.path().join("wheels"), dir.path().join("clean"));
    let manifest = root.join("python/Cargo.toml");
    // Most of what it depends on is compiled there already.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("..");
    let words = |words: &'static str| words.split_whitespace().map(OsStr::new);
    let build: Vec<&OsStr> =
        words("-m maturin build --locked --quiet --profile dev --manifest-path")
            .chain([
                manifest.as_os_str(),
                OsStr::new("--out"),
                wheels.as_os_str(),
                OsStr::new("--target-dir"),
                target.as_os_str(),
            ])
            .collect();
    // What is built once needs no notes for the next time, and they take most of it.
    succeed(&python, &build, &[("CARGO_INCREMENTAL", OsStr::new("0"))]);
    let wheel = std::fs::read_dir(&wheels).expect("wheels").next();
    let wheel = wheel.expect("a wheel").expect("readable").path();
    let name = wheel.to_string_lossy();
    assert!(name.contains("-cp39-abi3-"), "one wheel for all: {name}");

    let environment: Vec<&OsStr> = words("-m venv").chain([clean.as_os_str()]).collect();
    succeed(&python, &environment, &[]);
    let clean = clean.join("bin/python");
    let install: Vec<&OsStr> = words("-m pip install --disable-pip-version-check --quiet")
        .chain([wheel.as_os_str()])
        .collect();
    succeed(clean.as_os_str(), &install, &[]);
    let tests = root.join("python/tests");
    let test: Vec<&OsStr> = words("-m unittest discover -v")
        .chain([tests.as_os_str()])
        .collect();
    let horma = OsStr::new(env!("CARGO_BIN_EXE_horma"));
    // Nothing is to be written into the tree.
    let set = [
        ("HORMA", horma),
        ("PYTHONDONTWRITEBYTECODE", OsStr::new("1")),
    ];
    let said = succeed(clean.as_os_str(), &test, &set);
    assert!(said.contains("OK") && !said.contains("skipped"), "{said}");
}
