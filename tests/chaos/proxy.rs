//! A way to a worker on which one bit is flipped.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// Listens for the worker; what passes on all connections counts.
pub struct Proxy {
    address: String,
    leads_to: Arc<OnceLock<String>>,
    passed: Arc<AtomicU64>,
    bit: u64,
}

impl Proxy {
    /// Flips that bit of all that comes from the worker, or of all that goes to it.
    pub fn new(bit: u64, from_worker: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let proxy = Self {
            address: listener.local_addr().expect("bound").to_string(),
            leads_to: Arc::default(),
            passed: Arc::default(),
            bit,
        };
        let (leads_to, passed) = (proxy.leads_to.clone(), proxy.passed.clone());
        std::thread::spawn(move || {
            for caller in listener.incoming().map_while(Result::ok) {
                let Ok(worker) = TcpStream::connect(leads_to.wait()) else {
                    continue;
                };
                let ways = [
                    (&caller, &worker, !from_worker),
                    (&worker, &caller, from_worker),
                ];
                for (from, to, corrupt) in ways {
                    let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) else {
                        continue;
                    };
                    let passed = passed.clone();
                    let bit = corrupt.then_some(bit);
                    std::thread::spawn(move || pass(from, to, &passed, bit));
                }
            }
        });
        proxy
    }

    /// Where the worker seems to be.
    pub fn address(&self) -> String {
        self.address.clone()
    }

    /// Where it is.
    pub fn lead_to(&self, address: &str) {
        self.leads_to.set(address.to_owned()).expect("told once");
    }

    /// Whether the bit has come.
    pub fn has_flipped(&self) -> bool {
        self.passed.load(Ordering::SeqCst) > self.bit / 8
    }
}

/// Passes on what comes until an end closes.
fn pass(mut from: TcpStream, mut to: TcpStream, passed: &AtomicU64, bit: Option<u64>) {
    let mut buffer = [0; 1 << 16];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        if let Some(bit) = bit {
            let first = passed.fetch_add(count as u64, Ordering::SeqCst);
            if let Some(byte) = (bit / 8).checked_sub(first).filter(|b| *b < count as u64) {
                buffer[byte as usize] ^= 1 << (bit % 8);
            }
        }
        if to.write_all(&buffer[..count]).is_err() {
            break;
        }
    }
    // The other way ends as well.
    let _ = from.shutdown(Shutdown::Both);
    let _ = to.shutdown(Shutdown::Both);
}
