//! `horma doctor`: a fit host, and every way in which one is not.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};

use crate::common::{master, run, scratch, succeed, text, texts};

/// What was said about something, and the exit code.
fn examined(args: &[&str]) -> (Option<i32>, String) {
    let output = run(&[&["doctor"], args].concat());
    (output.status.code(), texts(&output).0)
}

/// The doctor ends with this code, and says this about that, with these words.
fn check(args: &[&str], code: i32, lines: &[(&str, &str, &[&str])]) {
    let (found, said) = examined(args);
    for (verdict, what, words) in lines {
        let line = said.lines().find(|l| {
            l.split_whitespace().next() == Some(*verdict) && l.contains(&format!("  {what}: "))
        });
        let line = line.unwrap_or_else(|| panic!("no {verdict} {what} in:\n{said}"));
        for word in *words {
            assert!(line.contains(word), "{word:?} is not in: {line}");
        }
    }
    assert_eq!(found, Some(code), "{said}");
}

#[test]
fn a_fit_host_passes_and_one_that_is_alone_is_told_so() {
    check(
        &[],
        0,
        &[
            ("ok", "horma", &["0.1.0"]),
            ("ok", "addresses", &[]),
            ("ok", "open files", &[]),
            ("warning", "certificate", &["none"]),
            ("warning", "master", &["--master"]),
        ],
    );
    let dir = scratch();
    let file = dir.path().join("master");
    let (_master, address) = master(&["--rendezvous", text(&file)]);
    for way in [["--master", &address], ["--rendezvous", text(&file)]] {
        check(
            &way,
            0,
            &[
                ("ok", "master", &[&address]),
                ("ok", "clock", &["ms"]),
                ("ok", "dial-back", &["127.0.0.1:"]),
            ],
        );
    }
}

#[test]
fn an_address_that_the_master_does_not_reach_is_told() {
    let (_master, address) = master(&[]);
    // Bound and let go: nobody is there.
    let free = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr());
    let nobody = free.expect("a port").to_string();
    let lines: [(&str, &str, &[&str]); 2] = [
        ("ok", "master", &[]),
        ("failed", "dial-back", &[&nobody, "refused", "--advertise"]),
    ];
    check(&["--master", &address, "--advertise", &nobody], 4, &lines);
    // Somebody is there, but somebody else: the master itself, which says something of its own.
    let lines: [(&str, &str, &[&str]); 1] = [("failed", "dial-back", &["somebody else"])];
    check(&["--master", &address, "--advertise", &address], 4, &lines);
    let lines: [(&str, &str, &[&str]); 1] = [("failed", "master", &[&nobody, "running"])];
    check(&["--master", &nobody], 4, &lines);
    let lines: [(&str, &str, &[&str]); 1] = [("failed", "master", &["nowhere"])];
    check(&["--rendezvous", "/nowhere/master"], 4, &lines);
    let lines: [(&str, &str, &[&str]); 1] = [("failed", "bind", &["--insecure"])];
    check(&["--bind", "0.0.0.0:0"], 2, &lines);
}

/// The files of one role, as arguments.
fn files(dir: &Path, role: &str) -> Vec<String> {
    let file = |name: String| text(&dir.join(name)).to_owned();
    let given = [
        ("--tls-ca", file("ca.pem".to_owned())),
        ("--tls-cert", file(format!("{role}.pem"))),
        ("--tls-key", file(format!("{role}.key"))),
    ];
    given
        .into_iter()
        .flat_map(|(flag, file)| [flag.to_owned(), file])
        .collect()
}

fn strings(args: &[String]) -> Vec<&str> {
    args.iter().map(String::as_str).collect()
}

fn authority(dir: &Path, name: &str, days: &str) -> PathBuf {
    let certs = dir.join(name);
    succeed(&["certs", text(&certs), "--days", days]);
    certs
}

/// A worker's certificate that has expired, of an authority of its own, as arguments.
fn expired(dir: &Path) -> Vec<String> {
    let ca_key = KeyPair::generate().expect("a key");
    let mut ca = CertificateParams::default();
    ca.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let ca_pem = ca.self_signed(&ca_key).expect("signed").pem();
    let issuer = Issuer::new(ca, ca_key);
    let mut params = CertificateParams::new(["worker.horma.internal".to_owned()]).expect("a name");
    let day = Duration::from_secs(86_400);
    params.not_before = (SystemTime::now() - 3 * day).into();
    params.not_after = (SystemTime::now() - day).into();
    let key = KeyPair::generate().expect("a key");
    let certificate = params.signed_by(&key, &issuer).expect("signed");
    for (name, pem) in [
        ("ca.pem", ca_pem),
        ("worker.pem", certificate.pem()),
        ("worker.key", key.serialize_pem()),
    ] {
        std::fs::write(dir.join(name), pem).expect("writable");
    }
    files(dir, "worker")
}

#[test]
fn certificates_are_looked_at_and_held_against_the_masters() {
    let dir = scratch();
    let dir = dir.path();
    let [ours, theirs] = ["ours", "theirs"].map(|name| authority(dir, name, "10"));
    let serving = files(&ours, "master");
    let (_master, address) = master(&strings(&serving));
    let with = |given: &[String], code: i32, lines: &[(&str, &str, &[&str])]| {
        check(
            &[&["--master", &address], &strings(given)[..]].concat(),
            code,
            lines,
        );
    };
    with(
        &files(&ours, "worker"),
        0,
        &[
            ("warning", "certificate", &["days left", "horma certs"]),
            ("ok", "master", &[]),
            ("ok", "dial-back", &[]),
        ],
    );
    let role: &[(&str, &str, &[&str])] = &[("failed", "certificate", &["client", "role worker"])];
    with(&files(&ours, "client"), 2, role);
    let other: &[(&str, &str, &[&str])] = &[
        ("warning", "certificate", &[]),
        (
            "failed",
            "master",
            &["do not trust each other", "authority"],
        ),
    ];
    with(&files(&theirs, "worker"), 2, other);
    let mut mixed = files(&theirs, "worker");
    mixed[1] = text(&ours.join("ca.pem")).to_owned();
    with(
        &mixed,
        2,
        &[("failed", "certificate", &["not signed by the authority"])],
    );
    let old = dir.join("old");
    std::fs::create_dir(&old).expect("writable");
    with(
        &expired(&old),
        2,
        &[("failed", "certificate", &["expired"])],
    );
    with(&[], 4, &[("failed", "master", &["--tls-ca"])]);
}
