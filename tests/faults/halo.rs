//! Rows that cannot be had from the worker that holds them: it is dead, has forgotten them, or sends
//! others. Whoever asked is not to blame, and goes on.

use std::pin::Pin;
use std::sync::Arc;

use super::*;
use horma_proto::wire::{Chunk, FetchRequest, PlaceReply, PlaceRequest};
use tokio::sync::Notify;
use tokio_stream::Stream;

/// What a keeper answers if it is asked for rows.
#[derive(Debug, Clone, Copy)]
enum Answer {
    Corrupt,
    Forgotten,
    /// What it is sent is not a row of the part's.
    Wrong,
    /// Nothing, until it is told to say that it has none.
    Late,
}

/// A worker that takes in rows, and does not give them away as it should.
struct Keeper {
    answer: Answer,
    /// It takes the rows when it is told so.
    told: Arc<Notify>,
}

type Replies<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

#[tonic::async_trait]
impl Worker for Keeper {
    type DigitizeStream = Replies<DigitizeReply>;
    type FetchRowsStream = Replies<Chunk>;

    async fn digitize(
        &self,
        _: Request<Streaming<DigitizeRequest>>,
    ) -> Result<Response<Self::DigitizeStream>, Status> {
        std::future::pending().await
    }

    async fn place(
        &self,
        request: Request<Streaming<PlaceRequest>>,
    ) -> Result<Response<PlaceReply>, Status> {
        let mut requests = request.into_inner();
        while requests.message().await?.is_some() {}
        self.told.notified().await;
        Ok(Response::new(PlaceReply {}))
    }

    async fn fetch_rows(
        &self,
        _: Request<FetchRequest>,
    ) -> Result<Response<Self::FetchRowsStream>, Status> {
        let data = vec![1, 2, 3];
        let chunk = match self.answer {
            Answer::Corrupt => Chunk {
                data: data.into(),
                crc32c: 0,
            },
            Answer::Forgotten => return Err(Status::not_found("not here")),
            Answer::Wrong => {
                let row = wire::Row {
                    id: 1_000_000,
                    coordinates: Some(wire::row::Coordinates::Points(Vec::new().into())),
                    kind: Some(wire::row::Kind::Isoline(wire::Isoline::default())),
                };
                let mut chunks = horma_proto::Chunks::of(std::iter::once(row));
                chunks.next().expect("a chunk")
            }
            Answer::Late => {
                self.told.notified().await;
                return Err(Status::not_found("not here any more"));
            }
        };
        let reply = tokio_stream::iter(vec![Ok(chunk)]);
        Ok(Response::new(Box::pin(reply)))
    }
}

/// Serves a keeper and registers it; what it returns tells it to go on.
async fn keep(master: &str, id: &str, answer: Answer) -> Arc<Notify> {
    let told = Arc::new(Notify::new());
    let keeper = Keeper {
        answer,
        told: told.clone(),
    };
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("bound").to_string();
    let server = tonic::transport::Server::builder()
        .add_service(WorkerServer::new(keeper))
        .serve_with_incoming(TcpListenerStream::new(listener));
    tokio::spawn(server);
    register(master, id, horma_proto::VERSION, address)
        .await
        .expect("welcome");
    told
}

/// A job whose cutter is as wide as the part, so that every extent needs the rows of every other.
fn wide_job(dir: &Path) -> PathBuf {
    let part = sample().with_file_name("last.step");
    let more = "[discretization]\ngrid = { rows = 159, columns = 120 }
[cutter]\nkind = \"cylinder\"\nradius = 40.0\nwidth = 1000.0
[motion]\nstep = 5.0\npoints_per_revolution = 60\nfrom = 20.0\nto = 250.0
[cluster]\ndistribution = \"halo\"\n";
    crate::common::job(dir, "wide.toml", &[&part], more)
}

/// The reasons of the attempts that were lost, each with who made it.
fn lost(report: &serde_json::Value) -> Vec<(String, String)> {
    let lost = report["lost"].as_array().expect("lost attempts");
    let text = |v: &serde_json::Value| v.as_str().expect("a string").to_owned();
    let one = |l: &serde_json::Value| (text(&l["worker"]), text(&l["reason"]));
    lost.iter().map(one).collect()
}

fn check_extents(report: &serde_json::Value, honest: &[&str]) {
    let extents = report["extents"].as_array().expect("extents");
    assert_eq!(extents.len(), 3);
    for e in extents {
        let by = e["worker"].as_str().expect("a name");
        assert!(honest.contains(&by), "{e}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn rows_that_their_holder_does_not_give_away_are_placed_elsewhere() {
    let dir = scratch();
    let job = wide_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &[]);
    for (answer, found) in [
        (Answer::Corrupt, "checksum"),
        (Answer::Forgotten, "not here"),
        (Answer::Wrong, "expected"),
    ] {
        let (_master, address) = master(&[]);
        // It is first in the alphabet, so it is the first to hold rows.
        let keeper = keep(&address, "a keeper", answer).await;
        keeper.notify_one();
        let _honest = ["b", "c"].map(|id| worker(&address, id));
        let out = dir.path().join(format!("{answer:?}"));
        let (code, log) = submit(&job, &address, &out).end();
        assert_eq!(code, Some(0), "{log}");
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
        let report = report(&out);
        let lost = lost(&report);
        let by_halo = |(by, why): &&(String, String)| by != "a keeper" && why.contains("halo of");
        let (_, why) = lost.iter().find(by_halo).expect("the fault was there");
        assert!(why.contains("a keeper") && why.contains(found), "{why}");
        check_extents(&report, &["b", "c"]);
    }
}

/// The victim is killed when it holds its rows and before anybody may ask for them: the rows of the last
/// extent are not placed yet.
#[tokio::test(flavor = "multi_thread")]
async fn a_holder_killed_before_it_is_asked_costs_no_byte() {
    let dir = scratch();
    let job = wide_job(dir.path());
    let alone = path_of(&job, dir.path(), "alone", &[]);
    let (mut master, address) = master(&[]);
    let mut victim = worker(&address, "a victim");
    let mut honest = worker(&address, "b");
    let keeper = keep(&address, "keeper", Answer::Late).await;
    let out = dir.path().join("out");
    let client = submit(&job, &address, &out);
    master.wait_for(&["placed", "a victim"]);
    master.wait_for(&["placed", "worker=\"b\""]);
    victim.child.kill().expect("alive");
    victim.child.wait().expect("its end");
    keeper.notify_one();
    // Of the keeper it hears nothing, of the victim that nobody is there.
    honest.wait_for(&["halo lost", "a victim"]);
    keeper.notify_one();
    let (code, log) = client.end();
    assert_eq!(code, Some(0), "{log}");
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    let report = report(&out);
    let lost = lost(&report);
    let is_it = |(by, why): &(String, String)| {
        by == "b" && why.contains("halo of") && why.contains("a victim")
    };
    assert!(lost.iter().any(is_it), "{lost:?}");
    check_extents(&report, &["b"]);
}

/// Workers drop what they hold once the master says that the job is over.
#[test]
fn rows_are_dropped_when_their_job_is_over() {
    let dir = scratch();
    let (_master, address) = master(&["--lease", "1"]);
    let mut workers = ["a", "b"].map(|id| worker(&address, id));
    let job = wide_job(dir.path());
    let (code, log) = submit(&job, &address, &dir.path().join("out")).end();
    assert_eq!(code, Some(0), "{log}");
    for worker in &mut workers {
        worker.wait_for(&["holds rows"]);
        worker.wait_for(&["rows dropped", "job=1"]);
    }
}
