//! Traces: what a collector gets of a job, from every process that had a part in it; and that nobody waits
//! for a collector.

use std::collections::BTreeSet;
use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Mutex, MutexGuard};

use crate::common::{horma, master, path_of, run, sample, scratch, succeed, text};
use crate::common::{texts, worker_with};
use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{
    TraceService, TraceServiceServer,
};
use opentelemetry_proto::tonic::collector::trace::v1::{
    ExportTraceServiceRequest, ExportTraceServiceResponse,
};
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value::Value};
use opentelemetry_proto::tonic::trace::v1::Span as Sent;
use opentelemetry_proto::tonic::trace::v1::status::StatusCode;
use tokio::runtime::Runtime;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status};

/// A span with who sent it.
#[derive(Debug, Clone)]
struct Span {
    service: String,
    /// Which process of that service.
    instance: String,
    name: String,
    trace: Vec<u8>,
    id: Vec<u8>,
    parent: Vec<u8>,
    failed: bool,
    attributes: Vec<(String, String)>,
}

/// A collector that keeps what it gets.
#[derive(Clone, Default)]
struct Collector {
    spans: Arc<Mutex<Vec<Span>>>,
}

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        for group in request.into_inner().resource_spans {
            let of = told(&group.resource.unwrap_or_default().attributes);
            let one = |key: &str| {
                let found = of.iter().find(|(k, _)| k == key);
                found.map_or_else(String::new, |(_, value)| value.clone())
            };
            let sent = group.scope_spans.into_iter().flat_map(|scope| scope.spans);
            self.spans().extend(sent.map(|sent: Sent| Span {
                service: one("service.name"),
                instance: one("service.instance.id"),
                name: sent.name,
                trace: sent.trace_id,
                id: sent.span_id,
                parent: sent.parent_span_id,
                failed: sent.status.is_some_and(|s| s.code() == StatusCode::Error),
                attributes: told(&sent.attributes),
            }));
        }
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}

/// Attributes as text.
fn told(attributes: &[KeyValue]) -> Vec<(String, String)> {
    let text = |kv: &KeyValue| {
        let value = match kv.value.as_ref().and_then(|v| v.value.as_ref()) {
            Some(Value::StringValue(text)) => text.clone(),
            Some(Value::IntValue(number)) => number.to_string(),
            other => format!("{other:?}"),
        };
        (kv.key.clone(), value)
    };
    attributes.iter().map(text).collect()
}

impl Collector {
    /// Listens for as long as the runtime lives; returns where.
    fn listen() -> (Self, Runtime, String) {
        let runtime = Runtime::new().expect("threads");
        let collector = Self::default();
        let service = TraceServiceServer::new(collector.clone());
        let entered = runtime.enter();
        let any: SocketAddr = "127.0.0.1:0".parse().expect("an address");
        let incoming = TcpIncoming::bind(any).expect("a port");
        let address = incoming.local_addr().expect("its number");
        runtime.spawn(
            Server::builder()
                .add_service(service)
                .serve_with_incoming(incoming),
        );
        drop(entered);
        (collector, runtime, format!("http://{address}"))
    }

    fn spans(&self) -> MutexGuard<'_, Vec<Span>> {
        self.spans.lock().expect("nobody panics with it")
    }

    fn named(&self, name: &str) -> Vec<Span> {
        let all = self.spans();
        all.iter().filter(|s| s.name == name).cloned().collect()
    }

    fn only(&self, name: &str) -> Span {
        let found = self.named(name);
        assert_eq!(found.len(), 1, "{name}: {found:#?}");
        found.into_iter().next().expect("one")
    }
}

/// Whose child each of them is.
fn parents(children: &[Span], of: &[Span]) -> Vec<Span> {
    let parent = |child: &Span| {
        let found = of
            .iter()
            .find(|p| p.id == child.parent && p.trace == child.trace);
        found
            .unwrap_or_else(|| panic!("{child:#?} is a child of none of {of:#?}"))
            .clone()
    };
    children.iter().map(parent).collect()
}

#[test]
fn a_job_is_one_trace_through_all_processes() {
    let (collector, _runtime, url) = Collector::listen();
    let dir = scratch();
    let (master, address) = master(&["--otlp", &url]);
    let workers = ["a", "b"].map(|id| worker_with(&address, id, &["--otlp", &url]));
    let (sample, out) = (sample(), dir.path().join("out"));
    let submit = [
        "submit",
        text(&sample),
        "--master",
        &address,
        "-q",
        "--otlp",
        &url,
    ];
    let more = ["--distribution", "halo", "--no-verify", "-o", text(&out)];
    succeed(&[&submit[..], &more].concat());
    // Whoever ends in good order sends what it has.
    for process in workers.into_iter().chain([master]) {
        process.signal("-TERM");
        assert_eq!(process.end().0, Some(0));
    }
    assert!(
        std::fs::read(out.join("path.csv")).expect("a path")
            == path_of(&sample, dir.path(), "here", &[]),
        "another path"
    );

    let submit = collector.only("submit");
    assert_eq!(
        (&*submit.service, &submit.parent[..]),
        ("horma-submit", &[][..])
    );
    let all = collector.spans().clone();
    // Where one worker helps the other, on a busy machine, what comes too late is given up.
    let helped = collector.named("extent").len() > 2;
    assert!(
        all.iter()
            .all(|s| s.trace == submit.trace && (helped || !s.failed)),
        "{all:#?}"
    );

    // From the client into the master ...
    let send = collector.only("send");
    assert_eq!(send.parent, submit.id);
    let taken = collector.only("take in");
    assert_eq!((&*taken.service, &taken.parent), ("horma-master", &send.id));
    let job = collector.only("job");
    assert_eq!((&*job.service, &job.parent), ("horma-master", &taken.id));
    for phase in ["discretize", "stitch"] {
        assert_eq!(collector.only(phase).parent, job.id, "{phase}");
    }
    // ... from there to each of the two workers, with rows and with a task ...
    for (call, answer) in [("place", "hold rows"), ("extent", "task")] {
        let (calls, answers) = (collector.named(call), collector.named(answer));
        assert!(
            calls
                .iter()
                .all(|c| c.service == "horma-master" && c.parent == job.id)
        );
        assert!(answers.iter().all(|a| a.service == "horma-worker"));
        parents(&answers, &calls);
        let instances: BTreeSet<_> = answers.iter().map(|a| a.instance.clone()).collect();
        assert_eq!(instances.len(), 2, "{answers:#?}");
    }
    // ... and from one worker to the other.
    let tasks = collector.named("task");
    let fetches = collector.named("fetch rows");
    assert!(fetches.len() >= 2, "each needs rows of the other: {all:#?}");
    let fetching = parents(&fetches, &tasks);
    assert!(
        fetches
            .iter()
            .zip(&fetching)
            .all(|(f, t)| f.instance == t.instance)
    );
    let given = collector.named("give rows");
    assert_eq!(given.len(), fetches.len());
    let asked = parents(&given, &fetches);
    assert!(
        given
            .iter()
            .zip(&asked)
            .all(|(g, f)| g.instance != f.instance && g.service == f.service)
    );
    parents(&collector.named("digitize"), &tasks);
}

/// Spans and whose they are, as the documentation has them.
fn documented() -> BTreeSet<(String, String)> {
    let page = include_str!("../docs/traces.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
    let pairs = rows.flat_map(|row| {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let name = cells[0].trim_matches('`').to_owned();
        let of = cells[1].split(", ");
        of.map(move |of| (name.clone(), format!("horma-{of}")))
            .collect::<Vec<_>>()
    });
    pairs.collect()
}

#[test]
fn spans_are_those_that_the_documentation_lists() {
    let (collector, _runtime, url) = Collector::listen();
    let (dir, sample) = (scratch(), sample());
    let (master, address) = master(&["--otlp", &url]);
    let workers = ["a", "b"].map(|id| worker_with(&address, id, &["--otlp", &url]));
    let ways: [&[&str]; 4] = [
        &["submit", "--master", &address, "--distribution", "halo"],
        &["run", "--workers", "2", "--distribution", "halo"],
        &["run", "--workers", "2", "--distribution", "surface"],
        &["run"],
    ];
    for way in ways {
        let out = dir.path().join("out");
        let args = ["--otlp", &url, "-q", text(&sample), "-o", text(&out)];
        succeed(&[way, &args].concat());
    }
    for process in workers.into_iter().chain([master]) {
        process.signal("-TERM");
        assert_eq!(process.end().0, Some(0));
    }
    let spans = collector.spans();
    let sent: BTreeSet<_> = spans
        .iter()
        .map(|s| (s.name.clone(), s.service.clone()))
        .collect();
    assert_eq!(sent, documented());
}

#[test]
fn workers_of_a_local_run_send_what_they_have_before_they_end() {
    let (collector, _runtime, url) = Collector::listen();
    let (dir, sample) = (scratch(), sample());
    let here = path_of(&sample, dir.path(), "here", &[]);
    for way in ["overlap", "surface"] {
        collector.spans().clear();
        let args = ["--workers", "2", "--distribution", way, "--otlp", &url];
        assert!(
            path_of(&sample, dir.path(), way, &args) == here,
            "another path"
        );
        let run = collector.only("run");
        assert_eq!(
            (&*run.service, collector.only("job").parent),
            ("horma-run", run.id)
        );
        let tasks = collector.named("task");
        let instances: BTreeSet<_> = tasks.iter().map(|t| t.instance.clone()).collect();
        assert_eq!(instances.len(), 2, "{tasks:#?}");
        let extents = collector.named("extent");
        parents(&tasks, &extents);
        let rows = collector.named("make rows");
        let made = if way == "surface" {
            2..=tasks.len()
        } else {
            0..=0
        };
        assert!(made.contains(&rows.len()), "{way}: {made:?}, {rows:#?}");
        parents(&rows, &tasks);
        // Where one worker helps the other, on a busy machine, what comes too late is given up.
        let helped = extents.len() > 2;
        let spans = collector.spans();
        assert!(spans.iter().all(|s| s.trace == run.trace));
        assert!(helped || spans.iter().all(|s| !s.failed));
    }
}

#[test]
fn an_attempt_that_is_lost_is_told_as_failed() {
    let (collector, _runtime, url) = Collector::listen();
    let dir = scratch();
    let job = crate::common::brute_job(
        dir.path(),
        "job.toml",
        &sample().with_file_name("last.step"),
        "point",
        [300, 300],
    );
    let (master, address) = master(&["--otlp", &url]);
    let mut lost = worker_with(&address, "lost", &[]);
    let args = ["submit", text(&job), "--master", &address, "--detach"];
    let number = succeed(&args);
    lost.wait_for(&["positions"]);
    lost.signal("-KILL");
    let _other = worker_with(&address, "other", &[]);
    let out = dir.path().join("out");
    succeed(&[
        "fetch",
        number.trim(),
        "--master",
        &address,
        "--wait",
        "-q",
        "-o",
        text(&out),
    ]);
    master.signal("-TERM");
    assert_eq!(master.end().0, Some(0));
    let extents = collector.named("extent");
    let by = |worker: &str| {
        let by = ("worker".to_owned(), worker.to_owned());
        let mut found = extents.iter().filter(|e| e.attributes.contains(&by));
        found
            .next()
            .unwrap_or_else(|| panic!("{worker}: {extents:#?}"))
    };
    assert!(by("lost").failed && !by("other").failed, "{extents:#?}");
    // Its client told of no span: the job has a trace of its own.
    let taken = collector.only("take in");
    assert!(taken.parent.is_empty());
    assert_eq!(collector.only("job").parent, taken.id);
}

#[test]
fn a_job_stays_in_its_trace_when_its_master_is_killed() {
    let (collector, _runtime, url) = Collector::listen();
    let (dir, sample) = (scratch(), sample());
    let store = dir.path().join("store");
    let serving = ["--store", text(&store), "--otlp", &url];
    let (killed, address) = master(&serving);
    let args = ["submit", text(&sample), "--master", &address, "--detach"];
    let number = succeed(&[&args[..], &["--otlp", &url]].concat());
    killed.signal("-KILL");
    drop(killed);
    let (master, address) = master(&serving);
    let _worker = worker_with(&address, "w", &[]);
    let args = ["fetch", number.trim(), "--master", &address, "--wait", "-q"];
    succeed(&[&args[..], &["-o", text(&dir.path().join("out"))]].concat());
    master.signal("-TERM");
    assert_eq!(master.end().0, Some(0));
    let (submit, job) = (collector.only("submit"), collector.only("job"));
    assert_eq!(job.trace, submit.trace);
}

#[test]
fn without_a_collector_there_is_a_warning_and_the_same_path() {
    let (dir, sample) = (scratch(), sample());
    // Ports that are taken: by nobody, and by somebody who never says a word.
    let nobody = TcpListener::bind("127.0.0.1:0").expect("a port");
    let silent = TcpListener::bind("127.0.0.1:0").expect("a port");
    let [nowhere, never] = [&nobody, &silent].map(|l| l.local_addr().expect("its number"));
    drop(nobody);
    let here = path_of(&sample, dir.path(), "here", &[]);
    for (name, collector) in [("nowhere", nowhere), ("never", never)] {
        let (out, url) = (dir.path().join(name), format!("http://{collector}"));
        let args = [
            "run",
            text(&sample),
            "--no-verify",
            "-q",
            "-w",
            "2",
            "-o",
            text(&out),
        ];
        let output = run(&[&args[..], &["--otlp", &url]].concat());
        let (_, err) = texts(&output);
        assert!(output.status.success(), "{err}");
        assert_eq!(err.lines().count(), 1, "{err}");
        assert!(err.contains("warning") && err.contains(&url), "{err}");
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == here);
    }
}

#[test]
fn a_collector_is_said_by_its_own_name_only() {
    let output = run(&[
        "worker",
        "--master",
        "127.0.0.1:1",
        "--otlp",
        "https://here:4317",
    ]);
    let (_, err) = texts(&output);
    assert_eq!(output.status.code(), Some(2), "{err}");
    assert!(
        err.contains("https://here:4317") && err.contains("http://HOST:PORT"),
        "{err}"
    );

    let (collector, _runtime, url) = Collector::listen();
    let (dir, sample) = (scratch(), sample());
    let mut command = horma();
    let out = dir.path().join("out");
    command.args(["run", text(&sample), "-q", "-o", text(&out)]);
    let output = command.env("OTEL_EXPORTER_OTLP_ENDPOINT", &url).output();
    assert!(output.expect("the binary starts").status.success());
    assert!(collector.spans().is_empty());
    let output = command.env("HORMA_OTLP", &url).output();
    assert!(output.expect("the binary starts").status.success());
    let run = collector.only("run");
    for phase in ["read", "digitize", "verify", "write"] {
        assert_eq!(collector.only(phase).parent, run.id, "{phase}");
    }
}
