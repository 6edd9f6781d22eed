//! A master that serves: jobs are sent, looked at, cancelled and fetched; and a master that is killed
//! at any instant and started again has forgotten nothing.

use std::path::{Path, PathBuf};

use crate::common::{
    Process, master, path_of, report, run, sample, scratch, submission, submit, succeed, text,
    texts, worker,
};
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::submit_request::Kind;
use horma_proto::wire::{self, Job, PathRequest, SubmitHeader, SubmitRequest};
use serde_json::Value;
use tonic::{Code, Status};

/// A job of seconds on one worker, in as many extents as there are workers.
fn long_job(dir: &Path) -> PathBuf {
    let part = sample().with_file_name("last.step");
    crate::common::brute_job(dir, "long.toml", &part, "point", [159, 120])
}

/// A job of a moment.
fn short_job(dir: &Path) -> PathBuf {
    let part = sample().with_file_name("last.step");
    let more = "axis = \"auto\"
[discretization]\ngrid = { rows = 40, columns = 30 }
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 10.0\npoints_per_revolution = 30\n";
    crate::common::job(dir, "short.toml", &[&part], more)
}

/// Sends a job and does not wait; returns its number.
fn detach(job: &Path, master: &str, more: &[&str]) -> String {
    let args = ["submit", text(job), "--master", master, "--detach"];
    succeed(&[&args, more].concat()).trim().to_owned()
}

/// What `horma status --json` says of a job.
fn status(master: &str, id: &str) -> Value {
    let jobs = succeed(&["status", id, "--json", "--master", master]);
    let jobs: Value = serde_json::from_str(&jobs).expect("JSON");
    jobs[0].clone()
}

/// The path of a job that was sent before, when it is done.
fn fetched(master: &str, id: &str, out: &Path) -> Vec<u8> {
    succeed(&[
        "fetch",
        id,
        "--wait",
        "-q",
        "--master",
        master,
        "-o",
        text(out),
    ]);
    std::fs::read(out.join("path.csv")).expect("a path")
}

/// Tells a process to stop; returns its exit code and what it said.
fn terminated(process: Process) -> (Option<i32>, String) {
    process.signal("-TERM");
    process.end()
}

/// A master on the store of one that was killed, at the same address.
fn again(address: &str, store: &Path, more: &[&str]) -> Process {
    let args = ["master", "--bind", address, "--store", text(store)];
    let mut process = Process::start("master again", &[&args, more].concat(), "info");
    process.wait_for(&["listening on"]);
    process
}

#[test]
fn a_master_killed_in_the_middle_goes_on_where_it_was() {
    for distribution in ["overlap", "halo", "surface"] {
        check_killed(distribution);
    }
}

fn check_killed(distribution: &str) {
    let dir = scratch();
    let job = long_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let store = dir.path().join("store");
    let (mut first, address) = master(&["--store", text(&store)]);
    let mut a = worker(&address, "a");
    let mut b = worker(&address, "b");
    let id = detach(&job, &address, &["--distribution", distribution]);
    // One worker is stopped, so that the other is done with its extent, or all it could do, first.
    b.wait_for(&["positions", "first="]);
    b.signal("-STOP");
    first.wait_for(&["journalled"]);
    // Nor may it help the other to an end meanwhile.
    a.signal("-STOP");
    assert_eq!(status(&address, &id)["stage"], "running", "not all is done");
    first.signal("-KILL");
    let (code, before) = first.end();
    assert_eq!(code, None, "killed: {before}");
    let journalled = before.matches("journalled job=").count() as u64;

    let mut second = again(&address, &store, &[]);
    a.signal("-CONT");
    b.signal("-CONT");
    second.wait_for(&["resumed from the journal"]);
    let out = dir.path().join("out");
    let path = fetched(&address, &id, &out);
    assert!(path == alone, "{distribution}");
    let report = report(&out);
    let extents = report["extents"].as_array().expect("extents").len() as u64;
    let taken = report["extents_from_journal"].as_u64().expect("a number");
    assert!(0 < taken && taken < extents, "{taken} of {extents}");
    assert!(taken >= journalled, "what was journalled is not repeated");
    second.signal("-TERM");
    let (_, after) = second.end();
    let journalled = after.matches("journalled job=").count() as u64;
    assert!(journalled <= extents - taken, "{after}");
    // The workers outlived the master, and are none the worse for it.
    for worker in [&mut a, &mut b] {
        worker.wait_for(&["no answer"]);
        assert_eq!(worker.child.try_wait().expect("known"), None);
    }
}

#[test]
fn a_worker_that_is_told_to_stop_gives_back_what_it_is_at() {
    let dir = scratch();
    let job = long_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    for distribution in ["overlap", "halo"] {
        let (mut master, address) = master(&[]);
        let mut leaves = worker(&address, "leaves");
        let _stays = worker(&address, "stays");
        let id = detach(&job, &address, &["--distribution", distribution]);
        leaves.wait_for(&["positions", "first="]);
        let (code, log) = terminated(leaves);
        assert_eq!(code, Some(0), "{log}");
        master.wait_for(&["left worker=\"leaves\""]);
        let out = dir.path().join(distribution);
        assert!(fetched(&address, &id, &out) == alone);
        let lost = &report(&out)["lost"][0];
        assert!(
            lost["reason"]
                .as_str()
                .expect("a reason")
                .contains("worker leaves left"),
            "{lost}"
        );
    }
}

#[test]
fn a_master_that_is_told_to_stop_lets_workers_end_what_they_are_at() {
    let dir = scratch();
    let job = long_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let store = dir.path().join("store");
    let drain = ["--store", text(&store), "--drain", "100"];
    let (mut first, address) = master(&drain);
    let mut killed = worker(&address, "killed");
    let mut ends = worker(&address, "ends");
    let [one, other] = ["1", "2"].map(|_| detach(&job, &address, &[]));
    for worker in [&mut killed, &mut ends] {
        worker.wait_for(&["positions", "first="]);
    }
    // Its extent waits, and nobody is to begin it.
    drop(killed);
    first.signal("-TERM");
    first.wait_for(&["draining"]);
    let refused = run(&[
        "submit",
        text(&job),
        "--detach",
        "--patience",
        "0",
        "--master",
        &address,
    ]);
    let (_, err) = texts(&refused);
    assert_eq!(refused.status.code(), Some(4), "{err}");
    assert!(err.contains("shutting down"), "{err}");
    let (code, log) = first.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(log.contains("journalled job=1"), "{log}");
    let _second = again(&address, &store, &[]);
    for id in [one, other] {
        assert!(fetched(&address, &id, &dir.path().join(&id)) == alone);
    }
    let resumed = &report(&dir.path().join("1"))["extents_from_journal"];
    assert_eq!(resumed.as_u64(), Some(1), "the other one was not begun");
}

#[test]
fn what_takes_too_long_is_left_to_the_store_and_a_second_signal_waits_for_nothing() {
    let dir = scratch();
    let job = long_job(dir.path());
    let store = dir.path().join("store");
    let (mut first, address) = master(&["--store", text(&store), "--drain", "1000"]);
    let mut worker = worker(&address, "w");
    let id = detach(&job, &address, &[]);
    worker.wait_for(&["positions", "first="]);
    worker.signal("-STOP");
    first.signal("-TERM");
    first.wait_for(&["draining"]);
    let (code, log) = terminated(first);
    assert_eq!(code, Some(130), "{log}");
    let second = again(&address, &store, &["--drain", "0"]);
    assert_eq!(status(&address, &id)["stage"], "running");
    let (code, log) = terminated(second);
    assert_eq!(code, Some(0), "{log}");
}

#[test]
fn a_worker_whose_master_goes_for_good_in_the_middle_of_a_job_says_so() {
    let dir = scratch();
    let (first, address) = master(&["--lease", "1"]);
    let mut worker = crate::common::worker_with(&address, "w", &["--patience", "1"]);
    detach(&long_job(dir.path()), &address, &[]);
    worker.wait_for(&["going on", "jobs=[1]"]);
    drop(first);
    let (code, log) = worker.end();
    assert_eq!(code, Some(4), "{log}");
    assert!(log.contains("1 of its jobs were under way"), "{log}");
}

#[test]
fn a_small_job_is_done_in_the_middle_of_a_big_one() {
    let dir = scratch();
    let (long, short) = (long_job(dir.path()), short_job(dir.path()));
    let alone = path_of(&short, dir.path(), "alone", &[]);
    let (_master, address) = master(&[]);
    let mut worker = worker(&address, "w");
    // These make it several extents, and do none of them.
    let others = ["a", "b", "c", "d", "e"].map(|id| crate::common::worker(&address, id));
    others.iter().for_each(|other| other.signal("-STOP"));
    let big = detach(&long, &address, &["--points-per-revolution", "900"]);
    worker.wait_for(&["positions", "first="]);
    drop(others);
    let small = detach(&short, &address, &[]);
    assert!(fetched(&address, &small, &dir.path().join("out")) == alone);
    assert_eq!(status(&address, &big)["stage"], "running", "far from done");
    succeed(&["cancel", &big, "--master", &address]);
}

#[test]
fn queued_jobs_are_there_when_the_master_is_killed() {
    let dir = scratch();
    let job = short_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &[]);
    let store = dir.path().join("store");
    let (first, address) = master(&["--store", text(&store)]);
    let ids = ["1", "2", "3"].map(|id| {
        assert_eq!(detach(&job, &address, &[]), id);
        assert_eq!(
            status(&address, id)["stage"],
            "queued",
            "there is no worker"
        );
        id
    });
    drop(first);
    let mut second = again(&address, &store, &[]);
    assert_eq!(
        detach(&job, &address, &[]),
        "4",
        "numbers are not used again"
    );
    let _worker = worker(&address, "w");
    for id in ids {
        assert!(fetched(&address, id, &dir.path().join(id)) == alone);
        assert_eq!(status(&address, id)["stage"], "fetched");
    }
    // A result that nobody has fetched outlives the master too.
    second.wait_for(&["job=4", "Done"]);
    drop(second);
    let _third = again(&address, &store, &[]);
    assert_eq!(status(&address, "4")["stage"], "done");
    assert!(fetched(&address, "4", &dir.path().join("4")) == alone);
}

#[test]
fn who_waits_outlives_the_master_as_well() {
    let dir = scratch();
    let job = long_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let store = dir.path().join("store");
    let (first, address) = master(&["--store", text(&store)]);
    let mut worker = worker(&address, "w");
    let out = dir.path().join("out");
    let client = submit(&job, &address, &out);
    worker.wait_for(&["positions", "first="]);
    drop(first);
    let _second = again(&address, &store, &[]);
    let (code, log) = client.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
}

#[test]
fn a_job_is_sent_looked_at_cancelled_and_fetched() {
    let dir = scratch();
    let job = short_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &[]);
    let (_master, address) = master(&[]);
    let out = dir.path().join("out");
    let fetch = |id: &str, more: &[&str]| {
        let args = ["fetch", id, "-q", "--master", &address, "-o", text(&out)];
        run(&[&args, more].concat())
    };
    let check = |output: &std::process::Output, code: i32, words: &[&str]| {
        let (_, err) = texts(output);
        assert_eq!(output.status.code(), Some(code), "{err}");
        assert!(words.iter().all(|w| err.contains(w)), "{err}");
        assert!(!out.exists() || std::fs::read_dir(&out).expect("there").count() == 0);
    };
    assert_eq!(succeed(&["status", "--master", &address]), "no jobs\n");
    let first = detach(&job, &address, &[]);
    let table = succeed(&["status", "--master", &address]);
    assert!(
        table.contains("queued") && table.contains("short.toml"),
        "{table}"
    );
    check(&fetch(&first, &[]), 4, &["not over", "--wait"]);
    succeed(&["cancel", &first, "--master", &address]);
    assert_eq!(status(&address, &first)["stage"], "cancelled");
    check(&fetch(&first, &["--wait"]), 4, &["was cancelled"]);
    check(&fetch("99", &[]), 2, &["no job 99", "horma status"]);
    check(
        &run(&["cancel", "99", "--master", &address]),
        2,
        &["no job 99"],
    );

    let _worker = worker(&address, "w");
    let second = detach(&job, &address, &[]);
    assert!(fetch(&second, &["--wait", "--keep"]).status.success());
    assert_eq!(
        status(&address, &second)["stage"],
        "done",
        "it was to be kept"
    );
    let with_job = fetch(&second, &[text(&job)]);
    assert!(with_job.status.success(), "{:?}", texts(&with_job));
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    for file in ["path.ngc", "preview.png", "report.json", "report.html"] {
        assert!(out.join(file).exists(), "{file}");
    }
    assert!(report(&out)["verification"].is_object());
    std::fs::remove_dir_all(&out).expect("there");
    check(&fetch(&second, &[]), 2, &["has been fetched"]);
    succeed(&["cancel", &second, "--master", &address]);
    assert_eq!(status(&address, &second)["stage"], "fetched", "it was over");
}

#[test]
fn a_cancelled_job_leaves_its_worker_to_others() {
    let dir = scratch();
    let (long, short) = (long_job(dir.path()), short_job(dir.path()));
    let alone = path_of(&short, dir.path(), "alone", &[]);
    let (_master, address) = master(&[]);
    let mut worker = worker(&address, "w");
    let first = detach(&long, &address, &[]);
    worker.wait_for(&["positions", "first="]);
    let second = detach(&short, &address, &[]);
    succeed(&["cancel", &first, "--master", &address]);
    worker.wait_for(&["abandoned by the master"]);
    assert!(fetched(&address, &second, &dir.path().join("out")) == alone);
}

#[test]
fn an_interrupted_client_takes_its_job_with_it() {
    let dir = scratch();
    let (_master, address) = master(&[]);
    let mut worker = worker(&address, "w");
    let (job, out) = (long_job(dir.path()), dir.path().join("out"));
    let client = submit(&job, &address, &out);
    worker.wait_for(&["positions", "first="]);
    client.signal("-INT");
    let (code, log) = client.end();
    assert_eq!(code, Some(130), "{log}");
    assert_eq!(status(&address, "1")["stage"], "cancelled");
    worker.wait_for(&["abandoned by the master"]);
}

#[test]
fn a_failed_job_says_why_to_whoever_asks_later() {
    let dir = scratch();
    let store = dir.path().join("store");
    let (mut first, address) = master(&["--patience", "0", "--store", text(&store)]);
    let id = detach(&short_job(dir.path()), &address, &[]);
    first.wait_for(&["job=1", "Failed"]);
    drop(first);
    let _second = again(&address, &store, &[]);
    let said = status(&address, &id);
    assert_eq!(said["stage"], "failed");
    let reason = said["reason"].as_str().expect("a reason");
    assert!(reason.contains("no worker registered"), "{reason}");
    let out = dir.path().join("out");
    let output = run(&["fetch", &id, "--master", &address, "-o", text(&out)]);
    let (_, err) = texts(&output);
    assert_eq!(output.status.code(), Some(4), "{err}");
    assert!(err.contains(reason), "{err}");
}

/// What a client sends whose first answer was lost.
#[tokio::test]
async fn a_submission_that_comes_twice_is_one_job() {
    let dir = scratch();
    let store = dir.path().join("store");
    let (first, address) = master(&["--store", text(&store)]);
    let [one, same] = [submit_raw(&address, 7).await, submit_raw(&address, 7).await];
    assert_eq!(one.expect("taken"), same.expect("known"));
    assert_eq!(submit_raw(&address, 8).await.expect("taken"), 2);
    drop(first);
    let _second = again(&address, &store, &[]);
    assert_eq!(submit_raw(&address, 7).await.expect("known"), 1);
    assert_eq!(submit_raw(&address, 9).await.expect("taken"), 3);
}

/// Sends a job of one small mesh with a key.
async fn submit_raw(address: &str, key: u8) -> Result<u64, Status> {
    let mesh = horma_core::Mesh::new(
        "mesh",
        vec![[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 5.0, 0.0]],
        vec![[0, 1, 2]],
    );
    let body = horma_core::Body {
        name: "mesh".to_owned(),
        shape: horma_core::Shape::Mesh(mesh.expect("a mesh")),
    };
    let job = Job {
        cutter: Some(wire::job::Cutter::Torus(wire::Torus {
            major_radius: 40.0,
            minor_radius: 8.0,
        })),
        discretization: Some(wire::job::Discretization::Tolerance(0.01)),
        motion: Some(wire::Motion {
            kind: wire::MotionKind::Helix.into(),
            step: 2.0,
            points_per_revolution: 36,
            ..wire::Motion::default()
        }),
        contact: wire::Contact::Facet.into(),
        method: wire::Method::Exact.into(),
        ..Job::default()
    };
    let header = SubmitHeader {
        version: horma_proto::VERSION.to_owned(),
        job: Some(job),
        sharing: Some(wire::Sharing {
            distribution: wire::Distribution::Overlap.into(),
            extents_per_worker: 1,
        }),
        key: vec![key; 16].into(),
        name: "raw".to_owned(),
    };
    let bodies = std::iter::once(horma_proto::body_to_wire(&body));
    let bodies = horma_proto::Chunks::of(bodies).map(Kind::Bodies);
    let kinds = std::iter::once(Kind::Header(horma_proto::seal(&header))).chain(bodies);
    let requests: Vec<_> = kinds
        .map(|kind| SubmitRequest { kind: Some(kind) })
        .collect();
    let client = MasterClient::connect(format!("http://{address}")).await;
    let reply = client
        .expect("serves")
        .submit(tokio_stream::iter(requests))
        .await?;
    Ok(reply.into_inner().job)
}

#[tokio::test]
async fn what_is_beyond_a_limit_is_refused_with_what_to_do() {
    let (_master, address) = master(&["--max-jobs", "1"]);
    let check = |refused: Result<u64, Status>, word: &str| {
        let status = refused.expect_err("beyond the limit");
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert!(status.message().contains(word), "{status}");
    };
    submit_raw(&address, 1).await.expect("there is a place");
    check(submit_raw(&address, 2).await, "--max-jobs");
    assert_eq!(submit_raw(&address, 1).await.expect("known"), 1);
    succeed(&["cancel", "1", "--master", &address]);
    submit_raw(&address, 2).await.expect("there is a place");
    let (_master, address) = master(&["--max-calls", "1"]);
    let id = submit_raw(&address, 1).await.expect("the only call");
    let mut client = MasterClient::connect(format!("http://{address}"))
        .await
        .expect("serves");
    let request = PathRequest {
        job: id,
        wait: true,
    };
    let waiting = client.fetch(request).await.expect("the only call");
    check(submit_raw(&address, 2).await, "--max-calls");
    drop(waiting);
    let (_master, address) = master(&["--max-part", "0"]);
    check(submit_raw(&address, 1).await, "--max-part");
    let dir = scratch();
    let (job, out) = (short_job(dir.path()), dir.path().join("out"));
    let refused = run(&submission(&job, &address, &out));
    let (_, err) = texts(&refused);
    assert_eq!(refused.status.code(), Some(3), "{err}");
    assert!(err.contains("--max-part"), "{err}");
}

#[test]
fn a_result_for_which_there_is_no_room_is_dropped_unless_somebody_waits_for_it() {
    let dir = scratch();
    let job = long_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let (mut master, address) = master(&["--keep-mb", "0"]);
    let _worker = worker(&address, "w");
    let out = dir.path().join("out");
    succeed(&submission(&job, &address, &out));
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    let id = detach(&job, &address, &[]);
    master.wait_for(&[&format!("job={id}"), "Dropped"]);
    let late = run(&["fetch", &id, "--master", &address, "-o", text(&out)]);
    let (_, err) = texts(&late);
    assert_eq!(late.status.code(), Some(2), "{err}");
    assert!(err.contains("was dropped"), "{err}");
}
