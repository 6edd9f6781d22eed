//! Who may take part: with certificates the same bytes as without, and everybody who cannot prove the
//! right role is turned away and told why.

mod look;

use std::path::{Path, PathBuf};

use crate::common::{
    Process, horma, path_of, report, run, sample, scratch, submission, succeed, text, texts,
    wait_until,
};
use horma_proto::tls::{Role, Tls};
use horma_proto::transport::{connect, endpoint};
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::worker_client::WorkerClient;
use horma_proto::wire::{
    CancelRequest, DialBackRequest, DigitizeRequest, DiscardRequest, HeartbeatRequest,
    LeaveRequest, PathRequest, RegisterRequest, StatusRequest, SubmitRequest,
};
use tonic::transport::{Certificate, Channel, ClientTlsConfig};
use tonic::{Code, Status};

/// An authority with its certificates.
struct Authority {
    dir: PathBuf,
    /// What is trusted, if more than this authority.
    ca: PathBuf,
}

impl Authority {
    fn new(scratch: &Path, name: &str) -> Self {
        let dir = scratch.join(name);
        succeed(&["certs", text(&dir)]);
        let ca = dir.join("ca.pem");
        Self { dir, ca }
    }

    /// The same, and trusting another one as well.
    fn trusting(&self, other: &Self) -> Self {
        let both = [&self.ca, &other.ca].map(|ca| std::fs::read(ca).expect("an authority"));
        let ca = self.dir.join("both.pem");
        std::fs::write(&ca, both.concat()).expect("writable");
        let dir = self.dir.clone();
        Self { dir, ca }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    /// The arguments of a process with that certificate.
    fn args(&self, role: &str) -> Vec<String> {
        let [cert, key] = ["pem", "key"].map(|end| self.file(&format!("{role}.{end}")));
        let named = [
            ("--tls-ca", &self.ca),
            ("--tls-cert", &cert),
            ("--tls-key", &key),
        ];
        let words = named.map(|(flag, file)| [flag.to_owned(), text(file).to_owned()]);
        words.concat()
    }

    fn tls(&self, role: Role) -> Tls {
        let read = |name: String| std::fs::read(self.file(&name)).expect("readable");
        let [ca, cert, key] = ["ca.pem", &format!("{role}.pem"), &format!("{role}.key")]
            .map(|name| read(name.to_owned()));
        Tls::from_pem(&ca, &cert, &key).expect("valid")
    }

    fn master(&self) -> (Process, String) {
        let args = self.args("master");
        crate::common::master(&words(&args))
    }

    /// A worker, and the address at which it listens.
    fn worker(&self, master: &str, id: &str) -> (Process, String) {
        let args = self.args("worker");
        let mut process = crate::common::worker_with(master, id, &words(&args));
        let address = process.wait_for_word(&["listening on"]);
        (process, address)
    }
}

fn words(all: &[String]) -> Vec<&str> {
    all.iter().map(String::as_str).collect()
}

#[test]
fn a_cluster_with_certificates_gives_the_same_bytes() {
    let dir = scratch();
    let authority = Authority::new(dir.path(), "certs");
    let alone = path_of(&sample(), dir.path(), "alone", &[]);
    let (_master, address) = authority.master();
    // One that connects and says nothing keeps nobody waiting.
    let _silent = std::net::TcpStream::connect(&address).expect("listening");
    let _workers = ["a", "b"].map(|id| authority.worker(&address, id));
    let out = dir.path().join("out");
    let mut submit = horma();
    submit.args(submission(&sample(), &address, &out));
    for (name, file) in [
        ("CA", "ca.pem"),
        ("CERT", "client.pem"),
        ("KEY", "client.key"),
    ] {
        submit.env(format!("HORMA_TLS_{name}"), authority.file(file));
    }
    let output = submit.output().expect("the binary starts");
    assert!(output.status.success(), "{:?}", texts(&output));
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    let report = report(&out);
    assert_eq!(report["extents"].as_array().map(Vec::len), Some(2));
    assert_eq!(report["lost"].as_array().map(Vec::len), Some(0));
}

/// Has other files in the place of some.
fn replace(dir: &Path, by: &Authority, files: &[&str]) {
    for file in files {
        std::fs::copy(by.file(file), dir.join(file)).expect("writable");
    }
}

#[test]
fn servers_go_by_new_certificates_without_a_restart() {
    let dir = scratch();
    let alone = path_of(&sample(), dir.path(), "alone", &[]);
    let before = Authority::new(dir.path(), "before");
    let after = Authority::new(dir.path(), "after");
    let live = Authority::new(dir.path(), "live");
    let all = [
        "ca.pem",
        "master.pem",
        "master.key",
        "worker.pem",
        "worker.key",
    ];
    replace(&live.dir, &before, &all);
    let (mut master, address) = live.master();
    let (mut worker, _) = live.worker(&address, "w");
    for server in [&mut master, &mut worker] {
        server.wait_for(&["certificates read"]);
    }

    // An authority that did not sign what is shown: they stay with what they have.
    replace(&live.dir, &after, &["ca.pem"]);
    for server in [&mut master, &mut worker] {
        server.wait_for(&["certificates not renewed", "not signed by the authority"]);
    }
    let submit = |authority: &Authority, name: &str| {
        let out = dir.path().join(name);
        let (sample, tls) = (sample(), authority.args("client"));
        let mut args = submission(&sample, &address, &out);
        args.extend(words(&tls));
        succeed(&args);
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    };
    submit(&before, "still");

    replace(&live.dir, &after, &all);
    for server in [&mut master, &mut worker] {
        wait_until("the new certificates are read", || {
            server.times_said(&["certificates read"]) == 2
        });
    }
    submit(&after, "anew");
    let other = "its certificate is not from the authority given";
    check_submit(&address, &before.args("client"), 2, &[&address, other]);
}

/// The command ends with this exit code and a message that has all of these words.
fn check(args: &[&str], code: i32, expected: &[&str]) {
    let output = run(args);
    let (_, err) = texts(&output);
    assert_eq!(output.status.code(), Some(code), "horma {args:?}\n{err}");
    for word in expected {
        assert!(err.contains(word), "{word:?} is not in: {err}");
    }
}

fn check_worker(master: &str, tls: &[String], code: i32, expected: &[&str]) {
    let mut args = vec!["worker", "--master", master, "--patience", "0"];
    args.extend(words(tls));
    check(&args, code, expected);
}

fn check_submit(master: &str, tls: &[String], code: i32, expected: &[&str]) {
    let (dir, sample) = (scratch(), sample());
    let mut args = submission(&sample, master, dir.path());
    args.extend(words(tls));
    check(&args, code, expected);
    let left = std::fs::read_dir(dir.path()).expect("there").count();
    assert_eq!(left, 0, "a refused job leaves nothing behind");
}

#[test]
fn whoever_cannot_prove_the_right_role_is_refused_and_told_why() {
    let dir = scratch();
    let ours = Authority::new(dir.path(), "ours");
    let theirs = Authority::new(dir.path(), "theirs");
    // It believes the master, and is not believed.
    let credulous = theirs.trusting(&ours);
    let (mut master, address) = ours.master();
    let other = "its certificate is not from the authority given";
    let unknown = "refuses the certificate shown to it";

    check_worker(&address, &theirs.args("worker"), 2, &[&address, other]);
    check_worker(&address, &credulous.args("worker"), 2, &[&address, unknown]);
    master.wait_for(&["connection refused", "peer=127.0.0.1"]);
    let role = "names the role client and has to name the role worker";
    check_worker(&address, &ours.args("client"), 2, &["client.pem", role]);
    check_worker(&address, &[], 4, &[&address, "if it wants TLS", "--tls-ca"]);

    check_submit(&address, &theirs.args("client"), 2, &[&address, other]);
    check_submit(&address, &credulous.args("client"), 2, &[&address, unknown]);
    for role in ["worker", "master"] {
        let found = format!(
            "this call is for a client, and the caller's certificate names the role {role}"
        );
        check_submit(&address, &ours.args(role), 2, &[&address, &found]);
    }
    check_submit(&address, &[], 4, &[&address, "if it wants TLS", "--tls-ca"]);

    // A worker does not pass for a master.
    let (_worker, impostor) = ours.worker(&address, "honest");
    let role = "does not name the role master";
    check_submit(&impostor, &ours.args("client"), 2, &[&impostor, role]);

    master.signal("-TERM");
    let (code, log) = master.end();
    assert_eq!(code, Some(0));
    assert_eq!(
        log.matches("registered").count(),
        1,
        "the honest one: {log}"
    );
    assert!(!log.contains("submitted"), "{log}");
    let told = log.lines().find(|l| l.contains(" refused connections="));
    let told = told.expect("what was refused");
    assert!(told.contains("forbidden=2 malformed=0"), "{told}");
    assert!(!told.contains("connections=0"), "{told}");

    let (_plain, address) = crate::common::master(&[]);
    let plain = "it does not speak TLS";
    check_worker(&address, &ours.args("worker"), 2, &[&address, plain]);
    check_submit(&address, &ours.args("client"), 2, &[&address, plain]);
}

async fn dial(address: &str, role: Role, tls: &Tls) -> Channel {
    let to = endpoint(address).expect("an address");
    connect(&to, role, Some(tls)).await.expect("trusted")
}

/// Only the callers with that role get past the guard.
fn check_guard<T>(allowed: Role, caller: Role, outcome: Result<T, Status>) {
    let code = outcome.map_or_else(|status| status.code(), |_| Code::Ok);
    let refused = code == Code::PermissionDenied;
    assert_eq!(refused, caller != allowed, "{caller} calls: {code:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_call_is_for_one_role() {
    let dir = scratch();
    let authority = Authority::new(dir.path(), "certs");
    let (serving, master) = authority.master();
    let (_worker, worker) = authority.worker(&master, "w");
    for caller in Role::ALL {
        let tls = authority.tls(caller);
        let mut client = MasterClient::new(dial(&master, Role::Master, &tls).await);
        let register = client.register(RegisterRequest::default()).await;
        check_guard(Role::Worker, caller, register);
        let heartbeat = client.heartbeat(HeartbeatRequest::default()).await;
        check_guard(Role::Worker, caller, heartbeat);
        let dial_back = client.dial_back(DialBackRequest::default()).await;
        check_guard(Role::Worker, caller, dial_back);
        let leave = client.leave(LeaveRequest::default()).await;
        check_guard(Role::Worker, caller, leave);
        let nothing = tokio_stream::iter([SubmitRequest::default()]);
        check_guard(Role::Client, caller, client.submit(nothing).await);
        let job = 1;
        let status = client
            .status(StatusRequest {
                job: Some(job),
                after: 0,
            })
            .await;
        check_guard(Role::Client, caller, status);
        let cancel = client.cancel(CancelRequest { job }).await;
        check_guard(Role::Client, caller, cancel);
        let fetch = client.fetch(PathRequest { job, wait: true }).await;
        check_guard(Role::Client, caller, fetch);
        let discard = client.discard(DiscardRequest { job }).await;
        check_guard(Role::Client, caller, discard);
        let mut client = WorkerClient::new(dial(&worker, Role::Worker, &tls).await);
        let nothing = tokio_stream::iter([DigitizeRequest::default()]);
        check_guard(Role::Master, caller, client.digitize(nothing).await);
    }
    serving.signal("-TERM");
    let (_, log) = serving.end();
    // Two roles too many at each of nine calls, one call back without a word, and one submission
    // without a header.
    assert!(log.contains("forbidden=18 malformed=2"), "{log}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_without_a_certificate_gets_no_answer() {
    let dir = scratch();
    let authority = Authority::new(dir.path(), "certs");
    let (mut master, address) = authority.master();
    let ca = std::fs::read(&authority.ca).expect("an authority");
    let tls = ClientTlsConfig::new()
        .ca_certificate(Certificate::from_pem(ca))
        .domain_name(Role::Master.dns_name());
    let endpoint = Channel::from_shared(format!("https://{address}")).expect("an address");
    let channel = endpoint.tls_config(tls).expect("valid").connect_lazy();
    let mut client = MasterClient::new(channel);
    let call = client.register(RegisterRequest::default()).await;
    // The handshake succeeds for this end, and fails for the other; how a call then ends is up to chance.
    call.expect_err("refused");
    master.wait_for(&["connection refused", "peer sent no certificates"]);
}

/// What a worker says of its address proves nothing: the master believes the certificate found there.
#[tokio::test(flavor = "multi_thread")]
async fn an_address_that_is_no_workers_costs_time_and_no_byte() {
    let dir = scratch();
    let authority = Authority::new(dir.path(), "certs");
    let alone = path_of(&sample(), dir.path(), "alone", &[]);
    let (_plain, plain) = crate::common::master(&[]);
    let (_master, master) = authority.master();
    let tls = authority.tls(Role::Worker);
    let mut client = MasterClient::new(dial(&master, Role::Master, &tls).await);
    let liars = [
        ("a plain one", &plain, "it does not speak TLS"),
        ("a second master", &master, "does not name the role worker"),
    ];
    for (id, address, _) in liars {
        let request = RegisterRequest {
            version: horma_proto::VERSION.to_owned(),
            worker: id.to_owned(),
            incarnation: 1,
            address: address.clone(),
        };
        client.register(request).await.expect("welcome");
    }
    let _honest = authority.worker(&master, "honest");
    let out = dir.path().join("out");
    let (sample, tls) = (sample(), authority.args("client"));
    let mut args = submission(&sample, &master, &out);
    args.extend(words(&tls));
    succeed(&args);
    assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    let report = report(&out);
    for (id, _, why) in liars {
        let lost = report["lost"].as_array().expect("lost attempts");
        let lost = lost.iter().find(|l| l["worker"] == id).expect("its own");
        let reason = lost["reason"].as_str().expect("a reason");
        assert!(
            reason.contains("not trusted") && reason.contains(why),
            "{reason}"
        );
    }
}

#[test]
fn files_that_prove_nothing_are_refused_before_anything_else() {
    let dir = scratch();
    let ours = Authority::new(dir.path(), "ours");
    let theirs = Authority::new(dir.path(), "theirs");
    let text_file = dir.path().join("text.pem");
    std::fs::write(&text_file, "no PEM at all").expect("writable");
    let missing = dir.path().join("missing.pem");
    let [ca, cert, key] = ["ca.pem", "worker.pem", "worker.key"].map(|name| ours.file(name));
    let [their_ca, their_key] = ["ca.pem", "worker.key"].map(|name| theirs.file(name));
    let cases: [([&PathBuf; 3], &[&str]); 8] = [
        (
            [&missing, &cert, &key],
            &["--tls-ca", "missing.pem", "cannot be read"],
        ),
        (
            [&ca, &cert, &missing],
            &["--tls-key", "missing.pem", "cannot be read"],
        ),
        (
            [&text_file, &cert, &key],
            &["--tls-ca", "text.pem", "not PEM"],
        ),
        (
            [&ca, &text_file, &key],
            &["--tls-cert", "text.pem", "not PEM"],
        ),
        ([&ca, &cert, &cert], &["--tls-key", "worker.pem", "not PEM"]),
        ([&ca, &key, &key], &["--tls-cert", "worker.key", "not PEM"]),
        (
            [&ca, &cert, &their_key],
            &["--tls-key", "not the key of --tls-cert", "worker.pem"],
        ),
        (
            [&their_ca, &cert, &key],
            &["--tls-cert", "not signed by the authority", "ca.pem"],
        ),
    ];
    for (files, expected) in cases {
        let [ca, cert, key] = files.map(|f| text(f));
        let tls = ["--tls-ca", ca, "--tls-cert", cert, "--tls-key", key];
        let tls = tls.map(str::to_owned);
        check_worker("127.0.0.1:1", &tls, 2, expected);
        check_submit("127.0.0.1:1", &tls, 2, expected);
    }
    check_worker(
        "127.0.0.1:1",
        &ours.args("worker")[..2],
        2,
        &["--tls-cert", "--tls-key"],
    );
    let mut master = vec!["master".to_owned(), "--insecure".to_owned()];
    master.extend(ours.args("master"));
    check(&words(&master), 2, &["--insecure", "cannot be used with"]);
    master[1] = "--bind=0.0.0.0:0".to_owned();
    let mut process = Process::start("master", &words(&master), "error");
    process.wait_for(&["listening on 0.0.0.0"]);
}

#[test]
fn keys_are_for_their_owner_and_never_written_over() {
    let dir = scratch();
    let certs = dir.path().join("certs");
    let said = succeed(&[
        "certs",
        text(&certs),
        "--days",
        "3",
        "--name",
        "lathe.example",
    ]);
    for word in ["3 days", "small private networks", "--tls-ca", "ca.key"] {
        assert!(said.contains(word), "{word:?} is not in: {said}");
    }
    let names = ["ca", "master", "worker", "client"];
    for name in names {
        let key = certs.join(format!("{name}.key"));
        assert!(certs.join(format!("{name}.pem")).exists());
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = key.metadata().expect("there").permissions().mode();
            assert_eq!(mode & 0o777, 0o600, "{name}");
        }
        assert!(key.exists());
    }
    // One file that is there is enough to write none.
    std::fs::remove_file(certs.join("ca.pem")).expect("there");
    let before = std::fs::read(certs.join("client.key")).expect("a key");
    check(&["certs", text(&certs)], 2, &["is there already"]);
    assert!(std::fs::read(certs.join("client.key")).expect("a key") == before);
    assert!(!certs.join("ca.pem").exists());

    let other = dir.path().join("other");
    let other = text(&other);
    let roles = "such names are roles";
    check(
        &["certs", other, "--name", "master.horma.internal"],
        2,
        &[roles],
    );
    check(&["certs", other, "--name", "two words"], 2, &["two words"]);
    check(&["certs", other, "--days", "0"], 2, &["--days"]);
    assert!(!Path::new(other).exists());
}
