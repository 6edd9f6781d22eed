//! One trace through all processes: a call carries the span that it is made for, as the W3C's
//! `traceparent`, and what is done for it elsewhere is a child of that span.
//!
//! Nothing is collected or exported here. In a process that exports nothing no span has a context: its
//! calls carry nothing, and it forgets what others' calls carry.

use std::collections::HashMap;
use std::fmt::Display;

use opentelemetry::global::get_text_map_propagator;
use opentelemetry::trace::Status;
use tonic::Request;
use tonic::metadata::AsciiMetadataValue;
use tracing::{Instrument, Span};
use tracing_opentelemetry::OpenTelemetrySpanExt;

/// The header that tells the caller's span.
const HEADER: &str = "traceparent";

/// A call that is made for the current span.
pub fn calling<T>(message: T) -> Request<T> {
    let mut call = Request::new(message);
    let parent = current().and_then(|parent| AsciiMetadataValue::try_from(parent).ok());
    if let Some(parent) = parent {
        call.metadata_mut().insert(HEADER, parent);
    }
    call
}

/// The span that a call says it is made for, as [`current`] tells it there.
pub fn caller<T>(call: &Request<T>) -> Option<&str> {
    call.metadata().get(HEADER)?.to_str().ok()
}

/// The current span as other processes may be told of it, if it is exported.
pub fn current() -> Option<String> {
    let context = Span::current().context();
    let mut headers = HashMap::new();
    get_text_map_propagator(|w3c| w3c.inject_context(&context, &mut headers));
    headers.remove(HEADER)
}

/// Makes a new span the child of one in another process; anything but what [`current`] tells is taken
/// for nothing. Returns the span.
pub fn child_of(parent: Option<&str>, span: Span) -> Span {
    if let Some(parent) = parent {
        let headers = HashMap::from([(HEADER.to_owned(), parent.to_owned())]);
        // Where nothing is exported there is no context to be had, and none to be given.
        let _ = span.set_parent(get_text_map_propagator(|w3c| w3c.extract(&headers)));
    }
    span
}

/// Does some work within a span, which tells why if nothing comes of it.
///
/// # Errors
/// Those of the work.
pub async fn within<T, E: Display>(
    span: Span,
    work: impl Future<Output = Result<T, E>>,
) -> Result<T, E> {
    let done = work.instrument(span.clone()).await;
    if let Err(why) = &done {
        span.set_status(Status::error(why.to_string()));
    }
    done
}
