//! What can be seen of a cluster from outside: metrics as they are documented, health, and who may look.

use std::collections::BTreeMap;

use crate::common::{Process, horma, submission};
use crate::common::{get, http, master, report, run, sample, scratch, succeed, texts, worker_with};
use horma_proto::tls::Role;
use horma_proto::transport::{connect, endpoint};
use serde_json::Value;
use tonic::transport::Channel;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;

/// The figures of a process: each series with its labels as they are written.
fn scrape(address: &str) -> (BTreeMap<String, f64>, String) {
    let (status, text) = get(address, "/metrics");
    assert_eq!(status, 200, "{text}");
    let lines = text
        .lines()
        .filter(|l| !l.is_empty() && !l.starts_with('#'));
    let series = lines.map(|line| {
        let (name, value) = line.rsplit_once(' ').expect("a value");
        (name.to_owned(), value.parse().expect("a number"))
    });
    (series.collect(), text)
}

/// Names with their kinds, labels and descriptions, as a process exports them.
fn exported(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in text.lines() {
        let Some(typed) = line.strip_prefix("# TYPE ") else {
            continue;
        };
        let (name, kind) = typed.split_once(' ').expect("a kind");
        let of_it = text.lines().filter(|l| {
            let after = l.strip_prefix(name);
            after.is_some_and(|rest| {
                let of_it = ["{", " ", "_bucket{", "_sum{", "_count{"];
                of_it.iter().any(|end| rest.starts_with(end))
            })
        });
        let label = |line: &str| {
            let inside = line.split_once('{')?.1.split_once('=')?;
            let value = inside.1.split('"').nth(1)?;
            Some((inside.0.to_owned(), value.to_owned()))
        };
        let labels: Vec<_> = of_it.filter_map(label).collect();
        let mut values: Vec<_> = labels.iter().map(|(_, value)| value.clone()).collect();
        values.sort();
        values.dedup();
        let key = labels.first().map_or("", |(key, _)| key);
        let help = format!("# HELP {name} ");
        let help = text.lines().find_map(|l| l.strip_prefix(&help));
        let help = help.expect("a description");
        found.push(format!("{name} {kind} {key} {}: {help}", values.join(" ")));
    }
    found.sort();
    found
}

/// The same, as the documentation has it for a process of that role.
fn documented(role: &str) -> Vec<String> {
    let page = include_str!("../docs/metrics.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
    let mut found: Vec<String> = rows
        .filter_map(|row| {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let [name, kind, label, of, what, ""] = cells[..] else {
                panic!("not a row: {row}");
            };
            let (key, values) = label.split_once(':').unwrap_or_default();
            let mut values: Vec<&str> = values.split(',').map(str::trim).collect();
            if values == ["its number"] {
                values = vec![env!("CARGO_PKG_VERSION")];
            }
            values.sort_unstable();
            let [name, key] = [name, key].map(|s| s.trim_matches('`'));
            let here = of == "both" || of == role;
            here.then(|| format!("{name} {kind} {key} {}: {what}", values.join(" ")))
        })
        .collect();
    found.sort();
    found
}

#[test]
fn metrics_are_what_the_documentation_lists_and_the_report_tells() {
    let dir = scratch();
    let (mut master, address) = master(&["--http", "0"]);
    let seen = http(&mut master);
    let mut workers = ["a", "b"].map(|id| worker_with(&address, id, &["--http", "0"]));
    let of_workers = workers.each_mut().map(http);
    // What has not happened yet is no gap.
    assert_eq!(exported(&scrape(&seen).1), documented("master"));
    for address in &of_workers {
        assert_eq!(exported(&scrape(address).1), documented("worker"));
    }

    let (sample, out) = (sample(), dir.path().join("out"));
    let submit = submission(&sample, &address, &out);
    succeed(&[&submit[..], &["--distribution", "halo"]].concat());

    let (master, page) = scrape(&seen);
    assert_eq!(exported(&page), documented("master"));
    let workers = of_workers.map(|address| {
        let (series, page) = scrape(&address);
        assert_eq!(exported(&page), documented("worker"));
        series
    });
    let all = |name: &str| workers.iter().map(|w| w[name]).sum::<f64>();

    let report = report(&out);
    let number = |value: &Value| value.as_f64().expect("a number");
    let positions = number(&report["path"]["positions"]);
    // On a busy machine one worker helps the other, and some of it is done twice.
    let helps = report["second"].as_array().map_or(0, Vec::len) as f64;
    let helped = helps > 0.0;
    let same = |found: f64, told: f64| found == told || (helped && found > told);
    let (received, digitized) = (
        master["horma_positions_total"],
        all("horma_digitized_positions_total"),
    );
    assert!(same(received, positions), "{received} {positions}");
    assert!(same(digitized, positions), "{digitized} {positions}");
    let traffic = &report["traffic"];
    for (series, kind) in [
        ("to_workers", "bytes_to_workers"),
        ("results", "bytes_of_results"),
    ] {
        let series = format!("horma_traffic_bytes_total{{kind={series:?}}}");
        assert!(same(master[&series], number(&traffic[kind])), "{kind}");
    }
    let between = all("horma_traffic_bytes_total{kind=\"between_workers\"}");
    let told = number(&traffic["bytes_between_workers"]);
    assert!(same(between, told), "{between} {told}");
    let counters = &report["counters"];
    for (series, key) in [
        ("horma_evaluations_total", "evaluations"),
        ("horma_nodes_total", "nodes"),
    ] {
        assert!(same(all(series), number(&counters[key])), "{key}");
    }
    assert_eq!(master["horma_jobs_ended_total{outcome=\"done\"}"], 1.0);
    assert_eq!(master["horma_jobs{state=\"running\"}"], 0.0);
    assert_eq!(master["horma_workers{state=\"idle\"}"], 2.0);
    assert_eq!(
        master["horma_job_phase_seconds_count{phase=\"stitch\"}"],
        1.0
    );
    assert_eq!(all("horma_registered"), 2.0);
    let tasks = all("horma_task_phase_seconds_count{phase=\"digitize\"}");
    // One whose worker was helped to the end is abandoned, not finished.
    let least = if helped { 1.0 } else { 2.0 };
    assert!((least..=2.0 + helps).contains(&tasks), "{tasks}");
    assert!(master["process_resident_memory_bytes"] > 1e6);
}

#[test]
fn a_worker_is_ready_once_it_is_registered() {
    // A port that is free for as long as nobody else takes it.
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = free.local_addr().expect("its number").to_string();
    drop(free);
    let args = ["worker", "--master", &address, "--http", "127.0.0.1:0"];
    let mut worker = Process::start("worker", &args, "info");
    let seen = http(&mut worker);
    worker.wait_for(&["no answer"]);
    assert_eq!(get(&seen, "/healthz"), (200, "alive\n".to_owned()));
    assert_eq!(get(&seen, "/readyz"), (503, "not registered\n".to_owned()));
    assert_eq!(scrape(&seen).0["horma_registered"], 0.0);
    let _master = Process::start("master", &["master", "--bind", &address], "info");
    worker.wait_for(&["registered"]);
    assert_eq!(get(&seen, "/readyz"), (200, "ready\n".to_owned()));
    assert_eq!(get(&seen, "/nothing").0, 404);
}

#[test]
fn http_is_for_this_machine_unless_said_otherwise() {
    for server in [
        &["master", "--bind", "127.0.0.1:0"][..],
        &["worker", "--master", "127.0.0.1:1"],
    ] {
        let output = run(&[server, &["--http", "0.0.0.0:0"]].concat());
        let (_, err) = texts(&output);
        assert_eq!(output.status.code(), Some(2), "{err}");
        assert!(
            err.contains("0.0.0.0") && err.contains("--insecure"),
            "{err}"
        );
    }
    let (mut open, _) = master(&["--http", "0.0.0.0:0", "--insecure"]);
    let address = http(&mut open).replace("0.0.0.0", "127.0.0.1");
    assert_eq!(get(&address, "/readyz").0, 200);
    let (mut local, _) = master(&["--http", "0"]);
    assert!(http(&mut local).starts_with("127.0.0.1:"));
    let output = horma()
        .args(["master", "--bind", "127.0.0.1:0"])
        .env("HORMA_HTTP", "nowhere")
        .output();
    let (_, err) = texts(&output.expect("the binary starts"));
    assert!(err.contains("nowhere"), "{err}");
}

async fn channel(address: &str, role: Role) -> Channel {
    let to = endpoint(address).expect("an address");
    connect(&to, role, None).await.expect("listening")
}

fn asked(service: &str) -> HealthCheckRequest {
    let service = service.to_owned();
    HealthCheckRequest { service }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_says_that_it_serves_until_it_is_told_to_stop() {
    let (master, address) = master(&[]);
    let mut worker = worker_with(&address, "w", &[]);
    let of_worker = worker.wait_for_word(&["listening on"]);
    let [serving, not] = [ServingStatus::Serving, ServingStatus::NotServing].map(i32::from);
    let servers = [
        (worker, of_worker, Role::Worker, "horma.cluster.v1.Worker"),
        (master, address, Role::Master, "horma.cluster.v1.Master"),
    ];
    for (process, address, role, service) in servers {
        let mut client = HealthClient::new(channel(&address, role).await);
        for name in ["", service] {
            let health = client.check(asked(name)).await.expect("an answer");
            assert_eq!(health.into_inner().status, serving, "{name:?}");
        }
        let unknown = client.check(asked("nothing")).await;
        assert_eq!(unknown.expect_err("unknown").code(), tonic::Code::NotFound);
        let watching = client.watch(asked(service)).await.expect("an answer");
        let mut watching = watching.into_inner();
        let mut next = async || watching.message().await.expect("one").expect("more").status;
        assert_eq!(next().await, serving);
        process.signal("-TERM");
        assert_eq!(next().await, not, "{service}");
        assert_eq!(process.end().0, Some(0));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_tells_what_it_serves() {
    let (_master, address) = master(&[]);
    let mut client = ServerReflectionClient::new(channel(&address, Role::Master).await);
    let request = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::FileContainingSymbol(
            "horma.cluster.v1.Master.Submit".to_owned(),
        )),
    };
    let answers = client
        .server_reflection_info(tokio_stream::iter([request]))
        .await;
    let answer = answers.expect("an answer").into_inner().message().await;
    let answer = answer.expect("one").expect("one");
    let Some(MessageResponse::FileDescriptorResponse(files)) = answer.message_response else {
        panic!("{answer:?}");
    };
    let file = files.file_descriptor_proto.first().expect("a file");
    let text = String::from_utf8_lossy(file);
    assert!(
        text.contains("SubmitRequest") && text.contains("FetchRows"),
        "{text}"
    );
}
