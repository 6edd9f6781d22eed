//! Under which address and name others know this process, whatever engine started it.
//!
//! Nothing is dialled here; `doctor` tells whether an address is any good.

use std::io::Write;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

use horma_formats::output;

use crate::error::Result;
use crate::system;

/// An address for others: as it was given, with the listener's port if it has none.
pub(crate) fn advertised(given: &str, bound: SocketAddr) -> String {
    if let Ok(ip) = given.parse::<IpAddr>() {
        return SocketAddr::new(ip, bound.port()).to_string();
    }
    match given.rsplit_once(':') {
        Some((_, port)) if port.parse::<u16>().is_ok() => given.to_owned(),
        _ => format!("{given}:{}", bound.port()),
    }
}

/// Where others find a master that does not say: at its listener, or under this host's name if it
/// listens on every interface.
pub(crate) fn of_master(given: Option<&str>, bound: SocketAddr) -> String {
    match given {
        Some(given) => advertised(given, bound),
        None if bound.ip().is_unspecified() => advertised(&system::host_name(), bound),
        None => bound.to_string(),
    }
}

/// A file that tells workers where the master is, until this is dropped.
#[derive(Debug)]
pub(crate) struct Published {
    file: PathBuf,
    text: String,
}

/// Writes a master's address into a file: whoever reads it sees all of it or nothing.
pub(crate) fn publish(file: &Path, address: &str) -> Result<Published> {
    let text = format!("{address}\n");
    output::write(file, |out| out.write_all(text.as_bytes()))?;
    let file = file.to_owned();
    Ok(Published { file, text })
}

impl Drop for Published {
    fn drop(&mut self) {
        // Another master may have written its own by now.
        if std::fs::read_to_string(&self.file).is_ok_and(|now| now == self.text) {
            // Workers that read it anyway will find nobody there.
            let _ = std::fs::remove_file(&self.file);
        }
    }
}

/// A name for a worker that was given none. Under Slurm it is that of its place in the job, the same
/// after a requeue, so that the master knows at once that the one before is gone.
pub(crate) fn worker_name(variable: impl Fn(&str) -> Option<String>) -> String {
    let job = variable("SLURM_ARRAY_JOB_ID").or_else(|| variable("SLURM_JOB_ID"));
    let Some(job) = job else {
        return format!("{}-{}", system::host_name(), std::process::id());
    };
    let place = ["SLURM_ARRAY_TASK_ID", "SLURM_PROCID"].map(&variable);
    let place = place.into_iter().flatten().map(|n| format!("-{n}"));
    format!("slurm-{job}{}", place.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_without_a_port_takes_the_listeners() {
        let bound = SocketAddr::from(([0, 0, 0, 0], 7000));
        for (given, expected) in [
            ("10.0.0.1", "10.0.0.1:7000"),
            ("10.0.0.1:9", "10.0.0.1:9"),
            ("node1", "node1:7000"),
            ("node1:9", "node1:9"),
            ("::1", "[::1]:7000"),
            ("[::1]:9", "[::1]:9"),
        ] {
            assert_eq!(advertised(given, bound), expected);
        }
        assert!(of_master(None, bound).ends_with(":7000"));
        assert!(!of_master(None, bound).contains("0.0.0.0"));
        let local = SocketAddr::from(([127, 0, 0, 1], 7000));
        assert_eq!(of_master(None, local), "127.0.0.1:7000");
    }

    #[test]
    fn a_worker_under_slurm_has_the_name_of_its_place() {
        let named = |given: &[(&str, &str)]| {
            worker_name(|name| {
                let found = given.iter().find(|(n, _)| *n == name);
                found.map(|(_, value)| (*value).to_owned())
            })
        };
        let step = [("SLURM_JOB_ID", "7"), ("SLURM_PROCID", "2")];
        assert_eq!(named(&step), "slurm-7-2");
        let array = [
            ("SLURM_JOB_ID", "9"),
            ("SLURM_ARRAY_JOB_ID", "8"),
            ("SLURM_ARRAY_TASK_ID", "1"),
            ("SLURM_PROCID", "0"),
            ("SLURM_RESTART_COUNT", "1"),
        ];
        assert_eq!(named(&array), "slurm-8-1-0");
        assert!(named(&[]).ends_with(&format!("-{}", std::process::id())));
    }

    #[test]
    fn a_published_address_goes_with_its_master_and_no_other() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join("master");
        let read = || std::fs::read_to_string(&file).ok();
        let first = publish(&file, "a:1").expect("writable");
        assert_eq!(read().as_deref(), Some("a:1\n"));
        let second = publish(&file, "b:2").expect("writable");
        drop(first);
        assert_eq!(read().as_deref(), Some("b:2\n"));
        drop(second);
        assert_eq!(read(), None);
    }
}
