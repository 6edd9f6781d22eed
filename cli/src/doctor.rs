//! `doctor`: whether this host is fit for a worker. Every check is one line, and says what to do.
//!
//! It listens as a worker would and has the master dial back; it never registers, and mends nothing.

use std::fmt;
use std::net::SocketAddr;
use std::time::Duration;

use horma_core::Simd;
use horma_proto::clock::{incarnation, unix_ms};
use horma_proto::transport::{self, Trouble, WORD};
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::{DialBackReply, DialBackRequest};
use horma_proto::{Answer, Role, Tls, VERSION};
use horma_worker::reachable;
use tokio::net::TcpListener;

use crate::args::Joining;
use crate::cluster::bind;
use crate::error::{Error, Result};
use crate::serve::{rendezvous, runtime};
use crate::{reach, say, system, tls};

/// Longest time for the master's answer; it dials back meanwhile.
const DEADLINE: Duration = Duration::from_secs(15);
/// Days before the end of a certificate from which on it is told.
const SOON: u64 = 30;
/// Difference of clocks that is told, ms: certificates and logs go by them, heartbeats do not.
const CLOCKS: u64 = 2_000;
/// Files that a worker has open, with a dozen of others to talk to.
const FILES: u64 = 256;
/// Memory below which a worker hardly holds a part, bytes.
const MEMORY: u64 = 512 << 20;

/// What a check found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Found {
    Ok,
    Warning,
    /// Something here is wrong.
    Wrong,
    /// Master and worker do not reach each other.
    Cut,
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Wrong | Self::Cut => "failed",
        })
    }
}

/// One line.
struct Check {
    found: Found,
    what: &'static str,
    words: String,
}

impl Check {
    fn new(found: Found, what: &'static str, words: impl Into<String>) -> Self {
        let words = words.into();
        Self { found, what, words }
    }
}

/// Checks everything and says what it found, check by check.
pub(crate) fn doctor(args: &Joining) -> Result<()> {
    let runtime = runtime()?;
    let checks = runtime.block_on(examine(args));
    for Check { found, what, words } in &checks {
        say(&format!("{found:<7}  {what}: {words}"));
    }
    let failed = |c: &&Check| matches!(c.found, Found::Wrong | Found::Cut);
    match checks.iter().filter(failed).count() {
        0 => Ok(()),
        failed => Err(Error::Unfit {
            failed,
            checks: checks.len(),
            here: checks.iter().any(|c| c.found == Found::Wrong),
        }),
    }
}

async fn examine(args: &Joining) -> Vec<Check> {
    let mut checks = vec![version(), addresses(), memory()];
    checks.extend(open_files());
    let tls = match tls::load(&args.tls) {
        Ok(tls) => tls,
        Err(error) => {
            checks.push(Check::new(Found::Wrong, "certificate", error.to_string()));
            return checks;
        }
    };
    checks.push(certificate(tls.as_ref()));
    let trusted = tls.is_some() || args.insecure;
    let (listener, bound) = match bind(&args.bind, trusted).await {
        Ok(listening) => listening,
        Err(error) => {
            checks.push(Check::new(Found::Wrong, "bind", error.to_string()));
            return checks;
        }
    };
    checks.push(Check::new(Found::Ok, "bind", bound.to_string()));
    if args.master.is_none() && args.rendezvous.is_none() {
        let words = "not looked for; give --master or --rendezvous";
        checks.push(Check::new(Found::Warning, "master", words));
        return checks;
    }
    let master = rendezvous(args);
    match master.look().await {
        Ok(master) => checks.extend(both_ways(args, &master, &listener, bound, tls.as_ref()).await),
        Err(unknown) => {
            let words = format!("{unknown}; is the master running, and does it write that file");
            checks.push(Check::new(Found::Cut, "master", words));
        }
    }
    checks
}

fn version() -> Check {
    let words = format!("{VERSION}, {}, {} cores", Simd::best(), system::cores());
    Check::new(Found::Ok, "horma", words)
}

/// Those among which to choose one to advertise.
fn addresses() -> Check {
    let all = system::addresses();
    let words = match &all[..] {
        [] => "this host tells none but loopback".to_owned(),
        all => all.join(", "),
    };
    Check::new(Found::Ok, "addresses", words)
}

fn memory() -> Check {
    let bytes = system::memory();
    let words = format!(
        "{} MB to be had, within the limits of a container",
        bytes / 1_000_000
    );
    if bytes < MEMORY {
        let words = format!("{words}; give it {} MB at least", MEMORY / 1_000_000);
        return Check::new(Found::Warning, "memory", words);
    }
    Check::new(Found::Ok, "memory", words)
}

fn open_files() -> Option<Check> {
    let limit = system::open_files()?;
    Some(if limit < FILES {
        let words = format!("{limit} at most; raise it to {FILES} (ulimit -n)");
        Check::new(Found::Warning, "open files", words)
    } else {
        Check::new(Found::Ok, "open files", format!("{limit} at most"))
    })
}

fn certificate(tls: Option<&Tls>) -> Check {
    const WHAT: &str = "certificate";
    let Some(tls) = tls else {
        let words = "none: a bind beyond this machine needs one, or --insecure";
        return Check::new(Found::Warning, WHAT, words);
    };
    if let Err(bad) = tls.expect(Role::Worker) {
        let words = format!("{bad}; give a worker's certificate");
        return Check::new(Found::Wrong, WHAT, words);
    }
    let days = tls.days_left();
    let words = format!("of the authority given, for a worker, {days} days left");
    if days < SOON {
        let words = format!("{words}; have new ones signed (`horma certs`)");
        return Check::new(Found::Warning, WHAT, words);
    }
    Check::new(Found::Ok, WHAT, words)
}

/// The way to the master, and from there back to this host.
async fn both_ways(
    args: &Joining,
    master: &str,
    listener: &TcpListener,
    bound: SocketAddr,
    tls: Option<&Tls>,
) -> Vec<Check> {
    let address = match &args.advertise {
        Some(given) => reach::advertised(given, bound),
        None => reachable(bound, master).to_string(),
    };
    let word = word();
    let begin = unix_ms();
    let asked = tokio::select! {
        asked = ask(master, &address, word, tls) => asked,
        // Never before the other.
        () = transport::answer(listener, tls, &word) => return Vec::new(),
    };
    let reply = match asked {
        Ok(reply) => reply,
        Err(check) => return vec![check],
    };
    let clocks = (begin.midpoint(unix_ms())).abs_diff(reply.unix_ms);
    vec![
        answered(master, &reply),
        if clocks > CLOCKS {
            let words = format!(
                "{:.1} s from the master's; set both by NTP",
                clocks as f64 / 1e3
            );
            Check::new(Found::Warning, "clock", words)
        } else {
            Check::new(Found::Ok, "clock", format!("{clocks} ms from the master's"))
        },
        if reply.trouble.is_empty() {
            Check::new(
                Found::Ok,
                "dial-back",
                format!("the master reaches {address}"),
            )
        } else {
            let words = format!(
                "the master does not reach {address}: {}; bind an interface that it reaches, give \
                 --advertise, or open the firewall",
                reply.trouble
            );
            Check::new(Found::Cut, "dial-back", words)
        },
    ]
}

fn answered(master: &str, reply: &DialBackReply) -> Check {
    if reply.version == VERSION {
        return Check::new(Found::Ok, "master", format!("{master} answers, {VERSION}"));
    }
    let words = format!(
        "{master} is horma {} and this is {VERSION}; install the same on both",
        reply.version
    );
    Check::new(Found::Wrong, "master", words)
}

async fn ask(
    master: &str,
    address: &str,
    word: [u8; WORD],
    tls: Option<&Tls>,
) -> std::result::Result<DialBackReply, Check> {
    let failed = |found, words: String| Check::new(found, "master", words);
    let unreachable = |reason: &str| {
        let words = format!("nobody answers at {master}: {reason}; is it running, and reachable");
        failed(Found::Cut, words)
    };
    let trouble = |trouble| match trouble {
        Trouble::Untrusted(why) => {
            let words = format!("{master} and this host do not trust each other: {why}");
            failed(Found::Wrong, words)
        }
        Trouble::Unreachable(why) => unreachable(&why),
        Trouble::Broken(why) if tls.is_none() => {
            unreachable(&format!("{why}; {}", transport::WANTS_TLS))
        }
        Trouble::Broken(why) => unreachable(&why),
    };
    let to = transport::endpoint(master)
        .map_err(|_| failed(Found::Wrong, format!("{master:?} is not host:port")))?;
    let to = to.timeout(DEADLINE);
    let connected = transport::connect(&to, Role::Master, tls).await;
    let channel = connected.map_err(|e| trouble(Trouble::of(&e, Role::Master)))?;
    let request = DialBackRequest {
        address: address.to_owned(),
        word: word.to_vec().into(),
    };
    match MasterClient::new(channel).dial_back(request).await {
        Ok(reply) => Ok(reply.into_inner()),
        Err(status) => Err(match Answer::of(&status) {
            Answer::Silence => trouble(Trouble::of(&status, Role::Master)),
            _ => failed(
                Found::Wrong,
                format!("{master} refuses: {}", status.message()),
            ),
        }),
    }
}

/// What nobody else would say.
fn word() -> [u8; WORD] {
    let mut word = [0; WORD];
    word[..8].copy_from_slice(&incarnation().to_le_bytes());
    word[8..].copy_from_slice(b"horma-dr");
    word
}
