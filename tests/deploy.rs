//! `deploy/`: what it tells engines to start is what the real command takes, and what refers to
//! something refers to what is there. Whether an engine then does it is for `tests/compose` and
//! `tests/slurm`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{scratch, succeed, text, texts};

fn deploy() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy")
}

/// Every file under a folder.
fn files(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).expect("readable") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push(path);
        }
    }
    found
}

/// Commands of a shell script or a unit: the words after `horma`, lines that go on joined.
fn commands(text: &str) -> Vec<Vec<String>> {
    let text = text.replace("\\\n", " ");
    let lines = text.lines().map(str::trim);
    let code = lines.filter(|l| !l.starts_with('#') && !l.starts_with("Description="));
    let mut found = Vec::new();
    for line in code {
        let words: Vec<&str> = line.split_whitespace().collect();
        let command = |w: &&str| w.rsplit(['/', '=', '(']).next() == Some("horma");
        let starts = words.iter().position(command);
        // Elsewhere it is a file or an image.
        let begins = |s: &usize| *s == 0 || words[0] == "srun";
        let Some(start) = starts.filter(begins).filter(|&s| s + 1 < words.len()) else {
            continue;
        };
        let ends =
            |w: &&&str| !["&", "|", ";", "||", "&&", "#"].contains(*w) && !w.starts_with('>');
        let words = words[start + 1..].iter().take_while(ends);
        found.push(
            words
                .map(|w| w.trim_matches(['"', ')']).to_owned())
                .collect(),
        );
    }
    found
}

/// Everything known as a setting by some subcommand.
fn variables() -> BTreeSet<String> {
    let mut known = BTreeSet::new();
    for command in ["run", "submit", "master", "worker"] {
        for word in succeed(&[command, "--help"]).split_whitespace() {
            let word = word.trim_start_matches("[env:").trim_end_matches("=]");
            let name = word.split('=').next().unwrap_or_default();
            if name.starts_with("HORMA_") {
                known.insert(name.to_owned());
            }
        }
    }
    known
}

#[test]
fn every_command_of_scripts_units_and_pages_parses() {
    let known = variables();
    assert!(known.contains("HORMA_RENDEZVOUS"), "{known:?}");
    // Read by the files themselves and not by the command.
    let own = ["HORMA_IMAGE", "HORMA_USER", "HORMA_RUN"];
    let mut seen = 0;
    for file in files(&deploy()) {
        let text = fs::read_to_string(&file).expect("text");
        let names = text.split(|c: char| !c.is_ascii_uppercase() && c != '_');
        for name in names.filter(|n| n.starts_with("HORMA_") && *n != "HORMA_") {
            let there = known.contains(name) || own.contains(&name);
            assert!(there, "{}: no {name}", file.display());
        }
        if file.extension().is_some_and(|e| e == "yaml") || file.ends_with("Dockerfile") {
            continue;
        }
        // Of a page, what is to be typed.
        let typed = if file.extension().is_some_and(|e| e == "md") {
            let fenced = text.split("```").skip(1).step_by(2);
            fenced.collect::<String>()
        } else {
            text
        };
        for command in commands(&typed) {
            // With --help at its end a command is read from left to right and not carried out. What
            // the shell puts in is not known here: whatever it is, it is one word.
            let words = command.iter().filter(|w| !w.contains("[@]}"));
            let known = |w| if str::contains(w, '$') { "1" } else { w };
            let mut args: Vec<&str> = words.map(|w| known(w)).collect();
            args.push("--help");
            let output = crate::common::run(&args);
            assert!(
                output.status.success(),
                "{}: {command:?}\n{}",
                file.display(),
                texts(&output).1
            );
            seen += 1;
        }
    }
    assert!(seen > 10, "only {seen} commands found");
}

#[test]
fn scripts_are_whole_and_units_hold() {
    let shell = |args: &[&str]| Command::new(args[0]).args(&args[1..]).output();
    let mut scripts = 0;
    for file in files(&deploy().join("slurm")) {
        if file.extension().is_some_and(|e| e == "sbatch") {
            let checked = shell(&["bash", "-n", text(&file)]).expect("bash");
            assert!(checked.status.success(), "{}", texts(&checked).1);
            scripts += 1;
        }
    }
    assert_eq!(scripts, 3);
    // Copies, with a program that is there.
    let dir = scratch();
    let mut units = Vec::new();
    for (name, copy) in [
        ("horma-master.service", "horma-master.service"),
        ("horma-worker@.service", "horma-worker@1.service"),
    ] {
        let unit = fs::read_to_string(deploy().join("systemd").join(name)).expect("a unit");
        assert!(unit.contains("RestartPreventExitStatus=2\n"), "{name}");
        let unit = unit.replace("/usr/local/bin/horma", "/bin/true");
        let copy = dir.path().join(copy);
        fs::write(&copy, unit).expect("writable");
        units.push(copy);
    }
    let verify = Command::new("systemd-analyze")
        .arg("verify")
        .args(&units)
        .output();
    match verify {
        Ok(output) => {
            let said = texts(&output).1;
            assert!(output.status.success() && said.is_empty(), "{said}");
        }
        Err(_) => eprintln!("skipped: systemd units: systemd-analyze is missing"),
    }
}

#[test]
fn manifests_pass_their_schemas_and_refer_to_what_is_there() {
    let Some(python) = std::env::var_os("HORMA_ORACLE_PYTHON") else {
        eprintln!("skipped: manifests: HORMA_ORACLE_PYTHON is not set; tests/run sets it");
        return;
    };
    let dir = scratch();
    let mut rendered = Vec::new();
    for overlay in ["batch", "serving"] {
        let from = deploy().join("kubernetes").join(overlay);
        let Ok(output) = Command::new("kubectl").arg("kustomize").arg(from).output() else {
            eprintln!("skipped: Kubernetes overlays: kubectl is missing");
            break;
        };
        assert!(output.status.success(), "{}", texts(&output).1);
        let file = dir.path().join(format!("{overlay}.yaml"));
        fs::write(&file, output.stdout).expect("writable");
        rendered.push(file);
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracles/deployed.py");
    let mut ask = Command::new(python);
    ask.arg(script)
        .arg(env!("CARGO_BIN_EXE_horma"))
        .arg(deploy())
        .args(rendered);
    let output = ask.output().expect("the oracles' Python starts");
    let (out, err) = texts(&output);
    assert!(output.status.success(), "{out}{err}");
    eprint!("{out}");
}
