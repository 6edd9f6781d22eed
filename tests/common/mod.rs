//! What the tests share: the real binary, jobs to give it, and processes that are waited for by what
//! they say and never by the clock.

#![allow(dead_code)] // Each test binary uses its part of this.

pub mod browser;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Far longer than anything takes: a test that waits this long has failed.
const DEADLINE: Duration = Duration::from_secs(120);

/// The binary, without the caller's settings.
pub fn horma() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_horma"));
    forget_settings(&mut command);
    command.stdin(Stdio::null());
    command
}

/// Takes the caller's settings from a command.
pub fn forget_settings(command: &mut Command) {
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("HORMA_") {
            command.env_remove(name);
        }
    }
}

/// Runs the binary to its end.
pub fn run(args: &[&str]) -> Output {
    horma().args(args).output().expect("the binary starts")
}

/// Runs the binary to a good end.
pub fn succeed(args: &[&str]) -> String {
    let output = run(args);
    let (out, err) = texts(&output);
    assert!(output.status.success(), "horma {args:?}\n{out}{err}");
    out
}

/// Standard output and standard error.
pub fn texts(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// What `--json` told, event by event.
pub fn events(told: &str) -> Vec<Value> {
    let parse = |line: &str| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"));
    told.lines().map(parse).collect()
}

/// What sends a job to a master and waits for its path, which nobody holds against the part: that would be
/// most of the work.
pub fn submission<'a>(job: &'a Path, master: &'a str, out: &'a Path) -> Vec<&'a str> {
    let (job, out) = (text(job), text(out));
    let words = [
        "submit",
        job,
        "--master",
        master,
        "-q",
        "--no-verify",
        "-o",
        out,
    ];
    words.to_vec()
}

/// That, going on.
pub fn submit(job: &Path, master: &str, out: &Path) -> Process {
    Process::start("submit", &submission(job, master, out), "error")
}

/// A scratch directory.
pub fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a scratch directory")
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("a UTF-8 path")
}

/// The sample job.
pub fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/last/job.toml")
}

/// A file of the test data that lies beside the project on some machines; says so if it is missing.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/data")
        .join(name);
    if path.exists() {
        return path.canonicalize().ok();
    }
    eprintln!("skipped: no {} here", path.display());
    None
}

/// A job file over `files`, each line of `more` a table or a key.
pub fn job(dir: &Path, name: &str, files: &[&Path], more: &str) -> PathBuf {
    let files: Vec<String> = files.iter().map(|f| format!("{f:?}")).collect();
    let job = dir.join(name);
    let text = format!("[part]\nfiles = [{}]\n{more}", files.join(", "));
    std::fs::write(&job, text).expect("writable");
    job
}

/// A job over a part by brute force, which takes long enough to be interrupted in the middle of each
/// extent.
pub fn brute_job(dir: &Path, name: &str, part: &Path, contact: &str, grid: [u32; 2]) -> PathBuf {
    let [rows, columns] = grid;
    let more = format!(
        "axis = \"auto\"
[discretization]\ngrid = {{ rows = {rows}, columns = {columns} }}
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 2.0\npoints_per_revolution = 90
[digitizing]\ncontact = \"{contact}\"\nmethod = \"brute\"\n"
    );
    job(dir, name, &[part], &more)
}

/// `path.csv` of a run of `job` with more arguments.
pub fn path_of(job: &Path, dir: &Path, name: &str, args: &[&str]) -> Vec<u8> {
    let out = dir.join(name);
    let mut all = vec!["run", text(job), "-o", text(&out), "--quiet", "--no-verify"];
    all.extend(args);
    succeed(&all);
    std::fs::read(out.join("path.csv")).expect("a path")
}

/// Makes a path of the sample's wheel half a millimetre too low at one position in the middle, where it touches what
/// faces it; where that is.
pub fn lower(path: &Path, lowered: &Path) -> [f64; 2] {
    let read = std::fs::read_to_string(path).expect("a path");
    let mut lines: Vec<String> = read.lines().map(str::to_owned).collect();
    let numbers =
        |line: &str| -> Vec<f64> { line.split(',').filter_map(|n| n.parse().ok()).collect() };
    let facing = |line: &String| {
        let [_, x, angle, y, contact_x, contact_y, contact_z] = numbers(line)[..] else {
            return false;
        };
        let reach = contact_y.hypot(contact_z);
        (contact_x - x).abs() < 0.05 && (y - 48.0 - reach).abs() < 0.001 && angle > 20000.0
    };
    let low = (1..lines.len())
        .find(|&k| facing(&lines[k]))
        .expect("one that is faced");
    let [index, x, angle, y, ..] = numbers(&lines[low])[..] else {
        panic!("a touch: {}", lines[low]);
    };
    lines[low] = format!("{index},{x},{angle},{},,,", y - 0.5);
    std::fs::write(lowered, lines.join("\n") + "\n").expect("writable");
    [x, angle]
}

/// `report.json` of a directory.
pub fn report(dir: &Path) -> Value {
    let text = std::fs::read(dir.join("report.json")).expect("a report");
    serde_json::from_slice(&text).expect("JSON")
}

/// A process whose lines, of both its outputs, are waited for. Killed when dropped.
pub struct Process {
    pub child: Child,
    name: String,
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Process {
    pub fn start(name: &str, args: &[&str], log: &str) -> Self {
        let mut command = horma();
        command.args(args).env("HORMA_LOG", log);
        Self::of(name, command)
    }

    /// Starts what may be the binary on another host.
    pub fn of(name: &str, mut command: Command) -> Self {
        let spawned = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = spawned.expect("the binary starts");
        let (sender, lines) = channel();
        let outputs: [Box<dyn Read + Send>; 2] = [
            Box::new(child.stdout.take().expect("piped")),
            Box::new(child.stderr.take().expect("piped")),
        ];
        for output in outputs {
            let sender = sender.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(output).lines().map_while(Result::ok) {
                    if sender.send(line).is_err() {
                        break;
                    }
                }
            });
        }
        Self {
            child,
            name: name.to_owned(),
            lines,
            seen: Vec::new(),
        }
    }

    /// Waits for a line that contains all of `words`, which may have come already.
    pub fn wait_for(&mut self, words: &[&str]) -> String {
        let has = |line: &String| words.iter().all(|w| line.contains(w));
        if let Some(line) = self.seen.iter().find(|l| has(l)) {
            return line.clone();
        }
        let begin = Instant::now();
        loop {
            match self
                .lines
                .recv_timeout(DEADLINE.saturating_sub(begin.elapsed()))
            {
                Ok(line) => {
                    self.seen.push(line.clone());
                    if has(&line) {
                        return line;
                    }
                }
                Err(RecvTimeoutError::Timeout) => panic!("{words:?} never came\n{}", self.log()),
                Err(RecvTimeoutError::Disconnected) => {
                    panic!(
                        "{} ended before it said {words:?}\n{}",
                        self.name,
                        self.log()
                    )
                }
            }
        }
    }

    /// The last word of such a line.
    pub fn wait_for_word(&mut self, words: &[&str]) -> String {
        let line = self.wait_for(words);
        line.rsplit(' ').next().expect("a word").to_owned()
    }

    /// Whether it has said, by now, a line that contains all of `words`.
    pub fn has_said(&mut self, words: &[&str]) -> bool {
        self.times_said(words) > 0
    }

    /// How many such lines it has said by now.
    pub fn times_said(&mut self, words: &[&str]) -> usize {
        self.seen.extend(self.lines.try_iter());
        let has = |line: &&String| words.iter().all(|w| line.contains(w));
        self.seen.iter().filter(has).count()
    }

    /// Whether it has ended.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().expect("a child of ours").is_some()
    }

    /// Waits for the end; returns the exit code and everything that was said.
    pub fn end(mut self) -> (Option<i32>, String) {
        let begin = Instant::now();
        // Both outputs close when the process ends.
        loop {
            match self
                .lines
                .recv_timeout(DEADLINE.saturating_sub(begin.elapsed()))
            {
                Ok(line) => self.seen.push(line),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => panic!("it does not end\n{}", self.log()),
            }
        }
        let status = self.child.wait().expect("its end");
        (status.code(), self.log())
    }

    /// Sends a signal by its name.
    pub fn signal(&self, signal: &str) {
        let pid = self.child.id().to_string();
        let status = Command::new("kill").args([signal, &pid]).status();
        assert!(status.expect("kill exists").success());
    }

    fn log(&self) -> String {
        let lines = self.seen.iter().map(|l| format!("{}: {l}\n", self.name));
        lines.collect()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if std::thread::panicking() {
            eprint!("{}", self.log());
        }
    }
}

/// Looks again and again until something holds.
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < DEADLINE, "{what}: not in {DEADLINE:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A master on a port of the system's choice, and its address.
pub fn master(more: &[&str]) -> (Process, String) {
    master_saying("info", more)
}

/// The same, with what it is to log.
pub fn master_saying(log: &str, more: &[&str]) -> (Process, String) {
    let mut args = vec!["master", "--bind", "127.0.0.1:0"];
    args.extend(more);
    let mut process = Process::start("master", &args, log);
    let address = process.wait_for_word(&["listening on"]);
    (process, address)
}

/// Where that process serves HTTP.
pub fn http(process: &mut Process) -> String {
    process.wait_for_word(&["http on"])
}

/// A worker of that master, once it is registered.
pub fn worker(master: &str, id: &str) -> Process {
    worker_with(master, id, &[])
}

/// The same, with more arguments.
pub fn worker_with(master: &str, id: &str, more: &[&str]) -> Process {
    let mut args = vec!["worker", "--master", master, "--id", id, "--threads", "1"];
    args.extend(more);
    let mut process = Process::start(id, &args, "debug");
    process.wait_for(&["registered"]);
    process
}

/// The answer to a GET over plain HTTP: its status and its body.
pub fn get(address: &str, path: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).expect("listening");
    stream.set_read_timeout(Some(DEADLINE)).expect("a deadline");
    // Of version 1.0, the end of the connection is the end of the answer.
    write!(stream, "GET {path} HTTP/1.0\r\nHost: horma\r\n\r\n").expect("writable");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok());
    (status.expect("a status"), body.to_owned())
}
