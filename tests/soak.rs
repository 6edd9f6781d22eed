//! A serving master under many clients for a stated time, with workers and the master itself killed at
//! random from a seed: every path that comes back is the one of a run in one process, no job is lost,
//! and the master's memory does not grow. Too long for every day:
//!
//! ```sh
//! SOAK_MINUTES=60 SOAK_CLIENTS=50 cargo test --release soak:: -- --ignored --nocapture
//! ```
//!
//! `SOAK_SEED` makes another run, `SOAK_LIFE` is how long the master lives between two kills, in seconds,
//! and 0 lets it live.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use fastrand::Rng;

use crate::common::{Process, horma, master, path_of, sample, scratch, succeed, text, texts};

/// How long a client looks for a master that is just being started again, and for its path.
const PATIENCE: &str = "300";

const WORKERS: usize = 3;

/// Jobs that are over and that the master still knows, at least.
const REMEMBERED: usize = 10_000;

struct Soak {
    address: String,
    dir: PathBuf,
    /// Job files with the paths that they have to give, and more arguments.
    jobs: Vec<(PathBuf, Vec<u8>, &'static str)>,
    over: AtomicBool,
    master: Mutex<Process>,
    counts: [AtomicU64; COUNTS.len()],
}

const COUNTS: [&str; 8] = [
    "jobs sent",
    "paths compared",
    "paths that differ",
    "jobs cancelled",
    "jobs lost",
    "tries while there was no master",
    "workers killed",
    "masters killed",
];
const SENT: usize = 0;
const COMPARED: usize = 1;
const DIFFER: usize = 2;
const CANCELLED: usize = 3;
const LOST: usize = 4;
const AWAY: usize = 5;
const WORKERS_KILLED: usize = 6;
const MASTERS_KILLED: usize = 7;

/// Chance of one client, or of whoever kills workers: what happens follows from the seed.
fn chance(seed: u64, of: u64) -> Rng {
    Rng::with_seed(seed << 16 | of)
}

fn setting(name: &str, default: u64) -> u64 {
    let given = std::env::var(name).ok();
    given.map_or(default, |v| v.parse().expect("a whole number"))
}

#[test]
#[ignore = "takes minutes; see the module's documentation"]
fn a_serving_master_loses_nothing_under_clients_and_kills() {
    let (minutes, clients) = (setting("SOAK_MINUTES", 2), setting("SOAK_CLIENTS", 12));
    let (seed, life) = (setting("SOAK_SEED", 1), setting("SOAK_LIFE", 20));
    let dir = scratch();
    let jobs = jobs(dir.path());
    let (master, address) = master(&["--store", text(&dir.path().join("store"))]);
    let soak = Soak {
        address,
        dir: dir.path().to_owned(),
        jobs,
        over: AtomicBool::new(false),
        master: Mutex::new(master),
        counts: Default::default(),
    };
    let end = Instant::now() + Duration::from_secs(60 * minutes);
    let mut memory = Vec::new();
    thread::scope(|scope| {
        let working = scope.spawn(|| kill_workers(&soak, &mut chance(seed, 0)));
        let serving = scope.spawn(|| kill_masters(&soak, life));
        let all: Vec<_> = (1..=clients)
            .map(|client| {
                let soak = &soak;
                scope.spawn(move || {
                    let mut chance = chance(seed, client);
                    while Instant::now() < end {
                        one_job(soak, client, &mut chance);
                    }
                })
            })
            .collect();
        while all.iter().any(|client| !client.is_finished()) {
            memory.extend(resident(&soak));
            thread::sleep(Duration::from_millis(500));
        }
        soak.over.store(true, Ordering::Relaxed);
        for thread in all.into_iter().chain([working, serving]) {
            thread.join().expect("no panic");
        }
    });
    report(&soak, minutes, clients, seed, &memory);
}

/// Small jobs of every distribution, and one that takes longer.
fn jobs(dir: &Path) -> Vec<(PathBuf, Vec<u8>, &'static str)> {
    let part = sample().with_file_name("last.step");
    let rows = [
        (40, "exact", "overlap"),
        (60, "exact", "halo"),
        (50, "exact", "surface"),
        (90, "brute", "overlap"),
    ];
    let job = |(rows, method, distribution): (u32, &str, &'static str)| {
        let more = format!(
            "axis = \"auto\"
[discretization]\ngrid = {{ rows = {rows}, columns = 40 }}
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 4.0\npoints_per_revolution = 60
[digitizing]\ncontact = \"point\"\nmethod = \"{method}\"\n"
        );
        let file = crate::common::job(dir, &format!("{rows}.toml"), &[&part], &more);
        let path = path_of(&file, dir, "alone", &["--method", "exact"]);
        (file, path, distribution)
    };
    rows.map(job).into()
}

impl Soak {
    fn count(&self, what: usize) {
        self.counts[what].fetch_add(1, Ordering::Relaxed);
    }

    /// Runs a command of a client to a good end, again when there was no master to begin with.
    fn ask(&self, args: &[&str]) -> Result<String, String> {
        let begin = Instant::now();
        loop {
            let mut command = horma();
            command.args(args).args(["--master", &self.address]);
            command.args(["--patience", PATIENCE]);
            let output = command.output().expect("the binary starts");
            let (out, err) = texts(&output);
            if output.status.success() {
                return Ok(out.trim().to_owned());
            }
            let away = err.contains("no master answers");
            if !away || begin.elapsed() > Duration::from_secs(120) {
                return Err(format!("{args:?}: {err}"));
            }
            self.count(AWAY);
            thread::sleep(Duration::from_millis(100));
        }
    }
}

/// What one client does with one job.
fn one_job(soak: &Soak, client: u64, chance: &mut Rng) {
    let (job, expected, distribution) = &soak.jobs[chance.usize(..soak.jobs.len())];
    let out = soak.dir.join(format!("client-{client}"));
    let send = ["submit", text(job), "--distribution", distribution];
    let quiet = ["-q", "--no-verify", "-o", text(&out)];
    soak.count(SENT);
    let sent = match chance.u32(..10) {
        0..6 => soak.ask(&[&send[..], &quiet].concat()),
        6..9 => soak
            .ask(&[&send[..], &["--detach"]].concat())
            .and_then(|id| soak.ask(&[&["fetch", &id, "--wait"][..], &quiet].concat())),
        _ => {
            let cancelled = soak
                .ask(&[&send[..], &["--detach"]].concat())
                .and_then(|id| soak.ask(&["cancel", &id]));
            match cancelled {
                Ok(_) => soak.count(CANCELLED),
                Err(why) => lost(soak, &why),
            }
            return;
        }
    };
    match sent {
        Err(why) => lost(soak, &why),
        Ok(_) => {
            soak.count(COMPARED);
            if std::fs::read(out.join("path.csv")).expect("a path") != *expected {
                soak.count(DIFFER);
            }
            std::fs::remove_dir_all(&out).expect("there");
        }
    }
}

fn lost(soak: &Soak, why: &str) {
    eprintln!("lost: {why}");
    soak.count(LOST);
}

/// Keeps workers going: now and then one is killed, or told to stop, and another comes.
fn kill_workers(soak: &Soak, chance: &mut Rng) {
    let mut next = 0;
    let mut start = || {
        next += 1;
        let id = format!("w{next}");
        let args = ["worker", "--master", &soak.address, "--id", &id];
        Process::start(&id, &[&args[..], &["--threads", "1"]].concat(), "off")
    };
    let mut workers: Vec<Process> = (0..WORKERS).map(|_| start()).collect();
    while !soak.over.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(500 + 100 * chance.u64(..30)));
        let worker = workers.remove(chance.usize(..WORKERS));
        worker.signal(["-KILL", "-TERM"][chance.usize(..2)]);
        drop(worker);
        soak.count(WORKERS_KILLED);
        workers.push(start());
    }
}

/// Kills the master after each of its lives, and starts it again on the same store and address.
fn kill_masters(soak: &Soak, life: u64) {
    let mut born = Instant::now();
    while !soak.over.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(200));
        if life == 0 || born.elapsed() < Duration::from_secs(life) {
            continue;
        }
        let mut master = soak.master.lock().expect("no panic");
        master.child.kill().expect("alive");
        master.child.wait().expect("its end");
        let store = soak.dir.join("store");
        let args = ["master", "--bind", &soak.address, "--store", text(&store)];
        *master = Process::start("master", &args, "error");
        master.wait_for(&["listening on"]);
        soak.count(MASTERS_KILLED);
        born = Instant::now();
    }
}

/// Memory that the master holds, MB.
fn resident(soak: &Soak) -> Option<f64> {
    let id = soak.master.lock().expect("no panic").child.id();
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS"))?;
    let kb: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb / 1e3)
}

/// Prints what there was, and fails if anything was wrong.
fn report(soak: &Soak, minutes: u64, clients: u64, seed: u64, memory: &[f64]) {
    eprintln!("{minutes} minutes, {clients} clients, {WORKERS} workers, seed {seed}");
    for (name, count) in COUNTS.iter().zip(&soak.counts) {
        eprintln!("{name:<34} {:>8}", count.load(Ordering::Relaxed));
    }
    let file = soak.dir.join("store/jobs.redb");
    let bytes = std::fs::metadata(file).map_or(0, |m| m.len());
    eprintln!("{:<34} {:>8.1}", "store at the end, MB", bytes as f64 / 1e6);
    let quarter = (memory.len() / 4).max(1);
    let medians: Vec<f64> = memory.chunks(quarter).take(4).map(median).collect();
    for (i, median) in (1..).zip(&medians) {
        eprintln!("memory of the master, quarter {i}, MB {median:>7.1}");
    }
    let jobs = succeed(&["status", "--json", "--master", &soak.address]);
    let jobs: Vec<serde_json::Value> = serde_json::from_str(&jobs).expect("JSON");
    let known = |stage: &str| jobs.iter().filter(|job| job["stage"] == stage).count();
    for stage in ["fetched", "cancelled", "done", "dropped"] {
        eprintln!("known as {stage:<25} {:>8}", known(stage));
    }
    let count = |what: usize| soak.counts[what].load(Ordering::Relaxed);
    assert!(count(COMPARED) > 0 && count(WORKERS_KILLED) > 0);
    assert_eq!((count(DIFFER), count(LOST)), (0, 0));
    for stage in ["queued", "running", "failed", "dropped"] {
        assert_eq!(known(stage), 0, "{stage}");
    }
    // None has been forgotten, and none is there twice; those that are over for long are forgotten.
    let sent = count(SENT) as usize;
    assert!(jobs.len() == sent || (sent > REMEMBERED && jobs.len() >= REMEMBERED));
    let (first, last) = (medians[0], medians[medians.len() - 1]);
    assert!(last < 1.5 * first + 30.0, "the master grows: {medians:?}");
}

fn median(of: &[f64]) -> f64 {
    let mut sorted = of.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
