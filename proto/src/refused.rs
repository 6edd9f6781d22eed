//! What a server has refused, counted by what was wrong with it: a look at the log tells a wrong
//! certificate from a broken network and from an attack.

use std::sync::atomic::{AtomicU64, Ordering};

use tonic::codegen::http::Response;
use tonic::{Code, Status};
use tracing::info;

use crate::metrics::REFUSED;

/// Counters since the server started.
#[derive(Debug, Default)]
pub(crate) struct Refused {
    /// Connections whose other end did not prove who it is.
    connections: AtomicU64,
    /// Calls by somebody of another role.
    forbidden: AtomicU64,
    /// Calls whose messages are no messages, or come in no order.
    malformed: AtomicU64,
    /// Calls with more than is accepted.
    oversized: AtomicU64,
    /// Calls that did not arrive as they were sent.
    damaged: AtomicU64,
    /// Calls that failed for any other reason.
    other: AtomicU64,
}

impl Refused {
    /// Counts a response if it is a refusal.
    pub fn count<B>(&self, response: &Response<B>) {
        // A status among the headers means that nothing was answered but this.
        let status = Status::from_header_map(response.headers());
        let (counter, reason) = match status.map(|s| s.code()) {
            None | Some(Code::Ok) => return,
            Some(Code::PermissionDenied | Code::Unauthenticated) => (&self.forbidden, "forbidden"),
            Some(Code::InvalidArgument) => (&self.malformed, "malformed"),
            Some(Code::OutOfRange) => (&self.oversized, "oversized"),
            Some(Code::DataLoss) => (&self.damaged, "damaged"),
            Some(_) => (&self.other, "other"),
        };
        counter.fetch_add(1, Ordering::Relaxed);
        REFUSED.add(reason, 1);
    }

    /// Counts a connection whose other end did not prove who it is.
    pub fn connection(&self) {
        self.connections.fetch_add(1, Ordering::Relaxed);
        REFUSED.add("connection", 1);
    }

    /// Tells the log.
    pub fn tell(&self) {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        info!(
            connections = of(&self.connections),
            forbidden = of(&self.forbidden),
            malformed = of(&self.malformed),
            oversized = of(&self.oversized),
            damaged = of(&self.damaged),
            other = of(&self.other),
            "refused"
        );
    }
}
