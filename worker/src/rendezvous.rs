//! Where the master is: an address that was given, or one that it has written into a file.
//!
//! The file is read again whenever the master does not answer, in case it came back elsewhere; nothing
//! is ever written here.

use std::fmt;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::path::PathBuf;

/// How to find the master.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Rendezvous {
    /// At this address, `host:port`.
    Address(String),
    /// At the address in this file, which the master writes once it listens.
    File(PathBuf),
}

impl fmt::Display for Rendezvous {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address(address) => f.write_str(address),
            Self::File(file) => write!(f, "the address in {}", file.display()),
        }
    }
}

impl Rendezvous {
    /// Where the master is by now.
    ///
    /// # Errors
    /// Why nobody knows.
    pub async fn look(&self) -> Result<String, String> {
        let file = match self {
            Self::Address(address) => return Ok(address.clone()),
            Self::File(file) => file.clone(),
        };
        let unread = |error: &dyn fmt::Display| format!("{}: {error}", file.display());
        // A file that others write to lies on a network, more often than not.
        let (reading, name) = (file.clone(), &file);
        let read = tokio::task::spawn_blocking(move || std::fs::read_to_string(reading)).await;
        let text = read.map_err(|e| unread(&e))?.map_err(|e| unread(&e))?;
        match text.trim() {
            "" => Err(format!("{} is empty", name.display())),
            address => Ok(address.to_owned()),
        }
    }
}

/// The listener's address as others see it: a listener on every interface is reached at the one
/// that leads to the master.
pub fn reachable(bound: SocketAddr, master: &str) -> SocketAddr {
    if !bound.ip().is_unspecified() {
        return bound;
    }
    // Connecting a datagram socket sends nothing; it only asks the system for a route.
    let any: IpAddr = bound.ip();
    let towards = UdpSocket::bind((any, 0)).and_then(|socket| {
        socket.connect(master)?;
        socket.local_addr()
    });
    towards.map_or(bound, |local| SocketAddr::new(local.ip(), bound.port()))
}
