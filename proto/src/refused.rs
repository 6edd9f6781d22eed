//! What a server has refused, counted by what was wrong with it: a look at the log tells a wrong
//! certificate from a broken network and from an attack.

use std::sync::atomic::{AtomicU64, Ordering};

use tonic::codegen::http::Response;
use tonic::{Code, Status};
use tracing::info;

/// Counters since the server started.
#[derive(Debug, Default)]
pub(crate) struct Refused {
    /// Connections whose other end did not prove who it is.
    pub connections: AtomicU64,
    /// Calls by somebody of another role.
    pub forbidden: AtomicU64,
    /// Calls whose messages are no messages, or come in no order.
    pub malformed: AtomicU64,
    /// Calls with more than is accepted.
    pub oversized: AtomicU64,
    /// Calls that did not arrive as they were sent.
    pub damaged: AtomicU64,
    /// Calls that failed for any other reason.
    pub other: AtomicU64,
}

impl Refused {
    /// Counts a response if it is a refusal.
    pub fn count<B>(&self, response: &Response<B>) {
        // A status among the headers means that nothing was answered but this.
        let status = Status::from_header_map(response.headers());
        let counter = match status.map(|s| s.code()) {
            None | Some(Code::Ok) => return,
            Some(Code::PermissionDenied | Code::Unauthenticated) => &self.forbidden,
            Some(Code::InvalidArgument) => &self.malformed,
            Some(Code::OutOfRange) => &self.oversized,
            Some(Code::DataLoss) => &self.damaged,
            Some(_) => &self.other,
        };
        counter.fetch_add(1, Ordering::Relaxed);
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
