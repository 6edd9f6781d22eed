//! Workers that are not lost, only slow: an idle one helps them, and what both bring together is the path.

use std::collections::BTreeMap;

use super::*;

/// A master that never takes a silent worker for lost, and tells when positions come.
fn patient_master() -> (Process, String) {
    crate::common::master_saying("info,horma_master=debug", &["--lease", "600"])
}

/// How many positions each worker brought of each extent.
fn shares(report: &serde_json::Value) -> Vec<BTreeMap<String, u64>> {
    let share = |s: &serde_json::Value| {
        let worker = s["worker"].as_str().expect("a name").to_owned();
        (worker, s["positions"].as_u64().expect("a number"))
    };
    let of = |e: &serde_json::Value| {
        e["shares"]
            .as_array()
            .expect("shares")
            .iter()
            .map(share)
            .collect()
    };
    report["extents"]
        .as_array()
        .expect("extents")
        .iter()
        .map(of)
        .collect()
}

/// A worker that stops when its first positions have come, and whether it goes on when it is helped.
fn check_stopped(distribution: &str, goes_on: bool) {
    let dir = scratch();
    let job = long_job(dir.path());
    let exact = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let (mut master, address) = patient_master();
    let victim = worker(&address, "a victim");
    let mut other = worker(&address, "other");
    let out = dir.path().join("out");
    let args = ["--master", &address, "--distribution", distribution, "-o"];
    let submit = |out: &Path| {
        let args = [&["submit", text(&job)], &args[..], &[text(out)]].concat();
        Process::start("submit", &args, "error")
    };
    let client = submit(&out);
    master.wait_for(&["positions", "worker=\"a victim\""]);
    if distribution == "halo" {
        // It has what it needs of the victim, so that nothing but the victim's extent is late.
        other.wait_for(&["rows fetched"]);
    }
    victim.signal("-STOP");
    master.wait_for(&["started", "other", "helps=\"worker a victim is late\""]);
    if goes_on {
        victim.signal("-CONT");
    }
    let (code, log) = client.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == exact);

    let report = report(&out);
    assert_eq!(
        report["lost"].as_array().map(Vec::len),
        Some(0),
        "it was never lost"
    );
    let second = &report["second"].as_array().expect("second attempts")[0];
    assert_eq!(
        (&second["worker"], &second["extent"]),
        (&"other".into(), &0.into())
    );
    let shares = shares(&report);
    assert!(
        shares[0]["a victim"] > 0 && shares[0]["other"] > 0,
        "{shares:?}"
    );
    let brought = |worker: &str| -> u64 { shares.iter().filter_map(|s| s.get(worker)).sum() };
    assert!(brought("other") > brought("a victim"), "{shares:?}");
    let all = report["path"]["positions"].as_u64();
    assert_eq!(Some(brought("other") + brought("a victim")), all);

    // It is as good as ever.
    victim.signal("-CONT");
    let again = dir.path().join("again");
    let (code, log) = submit(&again).end();
    assert_eq!(code, Some(0), "{log}");
    assert!(std::fs::read(again.join("path.csv")).expect("a path") == exact);
}

#[test]
fn nobody_waits_for_a_worker_that_has_stopped() {
    for distribution in ["overlap", "halo", "surface"] {
        check_stopped(distribution, false);
    }
}

#[test]
fn a_slow_worker_does_what_it_can() {
    for distribution in ["overlap", "halo"] {
        check_stopped(distribution, true);
    }
}
