//! Hosts that can be cut off from each other: network namespaces on a bridge of their own.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::common::forget_settings;

/// Some hosts, gone when dropped.
pub struct Lab {
    script: PathBuf,
    /// What the names of the namespaces begin with: that of this process.
    prefix: String,
}

/// Where a host is.
pub fn address(host: usize) -> String {
    format!("10.77.0.{}", 11 + host)
}

impl Lab {
    /// So many hosts, or why there can be none.
    pub fn up(hosts: usize) -> Result<Self, String> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/labs/netns.sh");
        if !script.exists() {
            return Err(format!("no {} here", script.display()));
        }
        // The hosts can be made without it, but not cut off.
        if Command::new("nft").arg("--version").output().is_err() {
            return Err("nft is missing (on Debian: apt-get install nftables)".to_owned());
        }
        let lab = Self {
            script,
            prefix: format!("chaos{}", std::process::id()),
        };
        let hosts = hosts.to_string();
        let up = lab.command(&["up", &hosts]).output();
        let up = up.map_err(|e| format!("network namespaces: {e}"))?;
        if up.status.success() {
            return Ok(lab);
        }
        let why = String::from_utf8_lossy(&up.stderr).trim().to_owned();
        Err(format!("network namespaces cannot be made: {why}"))
    }

    /// The binary on a host.
    pub fn on(&self, host: usize) -> Command {
        let name = format!("h{}", host + 1);
        let mut command = self.command(&["x", &name, env!("CARGO_BIN_EXE_horma")]);
        command.stdin(Stdio::null());
        command
    }

    /// Drops what comes to a host or leaves it, or only what comes from or goes to one other, and counts.
    pub fn cut_off(&self, host: usize, from: Option<usize>) {
        let (come, go) = match from {
            None => ("iif eth0".to_owned(), "oif eth0".to_owned()),
            Some(other) => {
                let other = address(other);
                (format!("ip saddr {other}"), format!("ip daddr {other}"))
            }
        };
        let rules = format!(
            "table inet fault {{
                chain come {{ type filter hook input priority 0; {come} counter drop; }}
                chain go {{ type filter hook output priority 0; {go} counter drop; }}
            }}"
        );
        self.nft(host, &[&rules]);
    }

    /// How many packets that has dropped.
    pub fn dropped(&self, host: usize) -> u64 {
        let listed = self.nft(host, &["list table inet fault"]);
        let mut words = listed.split_whitespace();
        let mut dropped = 0;
        while words.by_ref().any(|word| word == "packets") {
            let count = words.next().and_then(|n| n.parse::<u64>().ok());
            dropped += count.expect("a number of packets");
        }
        dropped
    }

    /// Lets everything through again.
    pub fn heal(&self, host: usize) {
        self.nft(host, &["delete table inet fault"]);
    }

    fn nft(&self, host: usize, args: &[&str]) -> String {
        let namespace = format!("{}-h{}", self.prefix, host + 1);
        let mut command = Command::new("ip");
        command
            .args(["netns", "exec", &namespace, "nft"])
            .args(args);
        let output = command.output().expect("nft runs");
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new("bash");
        forget_settings(&mut command);
        command
            .arg(&self.script)
            .args(args)
            .env("LAB", &self.prefix);
        command
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        // What is left of the hosts is in nobody's way.
        let _ = self.command(&["down"]).output();
    }
}
