//! What goes wrong on a cluster costs time, never a byte, or the job fails and says why. Every test
//! proves that its fault was there.

mod halo;
mod slow;

use std::path::{Path, PathBuf};

use crate::common::{
    Process, brute_job, data, master, path_of, report, sample, scratch, submit, text,
};
use crate::common::{wait_until, worker};
use horma_proto::wire::digitize_reply::Kind;
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::worker_server::{Worker, WorkerServer};
use horma_proto::wire::{self, DigitizeReply, DigitizeRequest, RegisterRequest};
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Request, Response, Status, Streaming};

/// A job that takes brute force long enough to be interrupted in the middle of each extent.
fn long_job(dir: &Path) -> PathBuf {
    long_job_of(dir, &sample().with_file_name("last.step"), "point")
}

fn long_job_of(dir: &Path, part: &Path, contact: &str) -> PathBuf {
    brute_job(dir, "long.toml", part, contact, [159, 120])
}

#[test]
fn a_worker_killed_while_it_computes_costs_no_byte() {
    let sample = sample().with_file_name("last.step");
    check_killed(&sample, "point");
    // Brute force over a few thousand points is too quick; over their facets it is not.
    for (part, contact) in [("last_3surfaces.step", "point"), ("last_scan.stl", "facet")] {
        if let Some(part) = data(part) {
            check_killed(&part, contact);
        }
    }
}

fn check_killed(part: &Path, contact: &str) {
    let dir = scratch();
    let job = long_job_of(dir.path(), part, contact);
    let exact = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let (mut master, address) = master(&[]);
    let mut victim = worker(&address, "victim");
    let _other = worker(&address, "other");
    let out = dir.path().join("out");
    let client = submit(&job, &address, &out);
    // Some of its positions are on their way, and far from all.
    victim.wait_for(&["positions", "first="]);
    victim.child.kill().expect("alive");
    master.wait_for(&["not delivered", "victim"]);
    let (code, log) = client.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == exact);

    let report = report(&out);
    let lost = &report["lost"].as_array().expect("lost attempts")[0];
    assert_eq!(lost["worker"], "victim");
    let (had, all) = (&lost["positions_received"], &lost["positions"]);
    assert!(
        had.as_u64() < all.as_u64(),
        "it was killed before it was done: {lost}"
    );
    let extents = report["extents"].as_array().expect("extents");
    assert!(extents.iter().all(|e| e["worker"] == "other"));
    assert!(extents.iter().any(|e| e["attempt"] == 2));
}

#[test]
fn a_worker_of_a_local_run_killed_while_it_computes_costs_no_byte() {
    let dir = scratch();
    let job = long_job(dir.path());
    let exact = path_of(&job, dir.path(), "alone", &["--method", "exact"]);
    let out = dir.path().join("out");
    let args = ["run", text(&job), "-o", text(&out), "-w", "3"];
    let mut run = Process::start("run", &args, "debug");
    // The run's own log and its workers' come by the same pipe.
    run.wait_for(&["extent 1, attempt 1", "first=", "positions"]);
    kill_local_worker(run.child.id(), "local-2");
    run.wait_for(&["not delivered", "local-2"]);
    let (code, log) = run.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == exact);
    let report = report(&out);
    let lost = &report["lost"].as_array().expect("lost attempts")[0];
    assert_eq!(lost["worker"], "local-2");
    assert!(lost["positions_received"].as_u64() < lost["positions"].as_u64());
}

/// Kills the child of `parent` that has `id` among its arguments.
fn kill_local_worker(parent: u32, id: &str) {
    let pids = children(parent);
    let is_it = |pid: &&u32| {
        let arguments = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        arguments.split(|b| *b == 0).any(|a| a == id.as_bytes())
    };
    let pid = pids
        .iter()
        .find(is_it)
        .expect("the worker runs")
        .to_string();
    let killed = std::process::Command::new("kill")
        .args(["-9", &pid])
        .status();
    assert!(killed.expect("kill exists").success());
}

/// Children of a process, of all its threads.
fn children(parent: u32) -> Vec<u32> {
    let tasks = std::fs::read_dir(format!("/proc/{parent}/task"))
        .into_iter()
        .flatten();
    let lists = tasks
        .flatten()
        .map(|t| std::fs::read_to_string(t.path().join("children")));
    let all: String = lists.map(Result::unwrap_or_default).collect();
    all.split_whitespace()
        .filter_map(|pid| pid.parse().ok())
        .collect()
}

#[test]
fn a_job_fails_when_nobody_is_left_and_leaves_nothing_behind() {
    let dir = scratch();
    let job = long_job(dir.path());
    let (_master, address) = master(&["--patience", "1"]);
    let mut victim = worker(&address, "victim");
    let out = dir.path().join("out");
    let client = submit(&job, &address, &out);
    victim.wait_for(&["positions", "first="]);
    victim.child.kill().expect("alive");
    let (code, log) = client.end();
    assert_eq!(code, Some(4), "{log}");
    assert!(
        log.contains("no worker is left") && log.contains("victim"),
        "{log}"
    );
    assert_eq!(std::fs::read_dir(&out).expect("there").count(), 0);
}

#[test]
fn a_job_without_workers_fails_and_says_so() {
    let (_master, address) = master(&["--patience", "0"]);
    let dir = scratch();
    let (code, log) = submit(&sample(), &address, &dir.path().join("out")).end();
    assert_eq!(code, Some(4), "{log}");
    assert!(log.contains("no worker registered"), "{log}");
}

#[test]
fn an_interrupt_stops_a_run_and_its_workers() {
    let dir = scratch();
    let job = long_job(dir.path());
    let out = dir.path().join("out");
    for workers in ["0", "2"] {
        let args = ["run", text(&job), "-o", text(&out), "-w", workers];
        let mut run = Process::start("run", &args, "debug");
        let phase = if workers == "0" { "build" } else { "positions" };
        run.wait_for(&[phase]);
        let children = children(run.child.id());
        assert_eq!(children.len().to_string(), workers);
        run.signal("-INT");
        let (code, log) = run.end();
        assert_eq!(code, Some(130), "{log}");
        // They were killed: one that is left to itself looks for its master before it ends.
        assert!(!log.contains("no answer"), "{log}");
        for child in children {
            // A killed process is gone a moment after its outputs are.
            wait_until(&format!("the end of {child}"), || {
                let state = std::fs::read_to_string(format!("/proc/{child}/stat"));
                // An orphan that nobody has reaped yet has ended as well.
                state.is_err() || state.is_ok_and(|s| s.contains(") Z "))
            });
        }
        assert_eq!(std::fs::read_dir(&out).expect("there").count(), 0);
    }
}

/// A worker that sends positions which cannot be right, in one of several ways.
struct Liar(Lie);

type Lie = fn(wire::Task) -> Vec<DigitizeReply>;

#[tonic::async_trait]
impl Worker for Liar {
    type DigitizeStream = tokio_stream::Iter<std::vec::IntoIter<Result<DigitizeReply, Status>>>;
    type FetchRowsStream = tokio_stream::Empty<Result<wire::Chunk, Status>>;

    async fn digitize(
        &self,
        request: Request<Streaming<DigitizeRequest>>,
    ) -> Result<Response<Self::DigitizeStream>, Status> {
        let mut requests = request.into_inner();
        let mut task = None;
        while let Some(request) = requests.message().await? {
            if let Some(wire::digitize_request::Kind::Task(header)) = request.kind {
                task = Some(horma_proto::open(&header)?);
            }
        }
        let replies = (self.0)(task.expect("a task comes first"));
        let replies: Vec<_> = replies.into_iter().map(Ok).collect();
        Ok(Response::new(tokio_stream::iter(replies)))
    }

    async fn place(
        &self,
        _: Request<Streaming<wire::PlaceRequest>>,
    ) -> Result<Response<wire::PlaceReply>, Status> {
        Err(Status::unimplemented("a liar holds nothing"))
    }

    async fn fetch_rows(
        &self,
        _: Request<wire::FetchRequest>,
    ) -> Result<Response<Self::FetchRowsStream>, Status> {
        Err(Status::unimplemented("a liar holds nothing"))
    }
}

/// Serves a liar and registers it.
async fn lie(master: &str, id: &str, how: Lie) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("bound").to_string();
    let server = tonic::transport::Server::builder()
        .add_service(WorkerServer::new(Liar(how)))
        .serve_with_incoming(TcpListenerStream::new(listener));
    tokio::spawn(server);
    register(master, id, horma_proto::VERSION, address)
        .await
        .expect("welcome");
}

async fn register(
    master: &str,
    id: &str,
    version: &str,
    address: String,
) -> Result<Response<wire::RegisterReply>, Status> {
    let mut client = MasterClient::connect(format!("http://{master}"))
        .await
        .expect("serves");
    let request = RegisterRequest {
        version: version.to_owned(),
        worker: id.to_owned(),
        incarnation: 1,
        address,
    };
    client.register(request).await
}

fn first(task: &wire::Task) -> u64 {
    task.runs[0].first
}

fn positions(task: &wire::Task, skip: u64, count: u64) -> DigitizeReply {
    let touches = vec![None; count as usize];
    let positions = horma_proto::pack_positions(first(task) + skip, &touches, &[]);
    DigitizeReply {
        id: task.id,
        kind: Some(Kind::Positions(positions)),
        counters: None,
    }
}

/// The first position of a task, and one inserted on the move from it or from another.
fn inserted(task: &wire::Task, from: u64) -> DigitizeReply {
    let index = horma_core::Index::between(first(task) + from, 512);
    let between = [horma_core::Inserted {
        index: index.expect("between"),
        touch: None,
    }];
    let positions = horma_proto::pack_positions(first(task), &[None], &between);
    DigitizeReply {
        id: task.id,
        kind: Some(Kind::Positions(positions)),
        counters: None,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn workers_that_answer_wrongly_are_found_out() {
    let lies: [(&str, Lie); 8] = [
        ("checksum", |task| {
            let mut reply = positions(&task, 0, 10);
            if let Some(Kind::Positions(p)) = &mut reply.kind {
                p.crc32c ^= 1;
            }
            vec![reply]
        }),
        ("twice", |task| {
            vec![positions(&task, 5, 10), positions(&task, 0, 6)]
        }),
        ("or not asked for", |task| {
            let too_many = task.runs[0].count + 1;
            vec![positions(&task, 0, too_many)]
        }),
        ("nobody asked for", |task| vec![inserted(&task, 0)]),
        ("was inserted after", |task| vec![inserted(&task, 1)]),
        ("it speaks of", |task| {
            let mut reply = positions(&task, 0, 10);
            if let Some(id) = &mut reply.id {
                id.attempt += 1;
            }
            vec![reply]
        }),
        ("positions left", |task| {
            vec![DigitizeReply {
                id: task.id,
                kind: Some(Kind::Finished(wire::Finished::default())),
                counters: None,
            }]
        }),
        ("it asked for the rows of", |task| {
            let source = task.id;
            let reason = String::new();
            vec![DigitizeReply {
                id: task.id,
                kind: Some(Kind::HaloLost(wire::HaloLost { source, reason })),
                counters: None,
            }]
        }),
    ];
    let dir = scratch();
    let alone = path_of(&sample(), dir.path(), "alone", &[]);
    for (i, (found, how)) in lies.into_iter().enumerate() {
        let (_master, address) = master(&[]);
        // The liar is first in the alphabet, so it gets an extent as soon as there is one.
        lie(&address, "a liar", how).await;
        let _honest = worker(&address, "honest");
        let out = dir.path().join(i.to_string());
        let (code, log) = submit(&sample(), &address, &out).end();
        assert_eq!(code, Some(0), "{log}");
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
        let report = report(&out);
        let lost = &report["lost"].as_array().expect("lost attempts")[0];
        assert_eq!(lost["worker"], "a liar");
        let reason = lost["reason"].as_str().expect("a reason");
        assert!(
            reason.contains("wrong") && reason.contains(found),
            "{reason}"
        );
        // Until it starts anew it is not trusted again.
        let again = register(&address, "a liar", horma_proto::VERSION, address.clone()).await;
        assert_eq!(
            again.expect_err("refused").code(),
            tonic::Code::FailedPrecondition
        );
    }
}

#[tokio::test]
async fn a_worker_of_another_version_is_refused() {
    let (_master, address) = master(&[]);
    let refused = register(&address, "old", "0.0.0", address.clone()).await;
    let status = refused.expect_err("refused");
    assert_eq!(status.code(), tonic::Code::FailedPrecondition);
    assert!(status.message().contains("0.0.0"), "{status}");
}

#[test]
fn a_worker_outlives_a_restart_of_its_master_and_stops_when_it_is_gone_for_good() {
    let (first, address) = master(&["--lease", "1"]);
    let args = [
        "worker",
        "--master",
        &address,
        "--id",
        "w",
        "--patience",
        "2",
    ];
    let mut worker = Process::start("w", &args, "info");
    worker.wait_for(&["registered"]);
    drop(first);
    worker.wait_for(&["no answer"]);
    let again = ["master", "--bind", &address, "--lease", "1"];
    let mut second = Process::start("master", &again, "info");
    second.wait_for(&["registered", "w"]);
    drop(second);
    let (code, log) = worker.end();
    assert_eq!(
        code,
        Some(0),
        "there was a master, so the work is over: {log}"
    );
}
