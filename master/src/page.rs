//! The master's page, and what it is made of: the state as JSON and events as they happen, over HTTP.
//! Whoever asks may look and change nothing. Files are part of the binary and come from nowhere else.

use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval};
use tokio_stream::wrappers::ReceiverStream;

use crate::window::Window;

/// How often a page is told how things stand.
const REFRESH: Duration = Duration::from_millis(500);

/// Events that may wait for a page to take them.
const WAITING: usize = 16;

/// Nothing but what this server gives: a worker's name, whatever it is, is text.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                      img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const HTML: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");
const ICON: &str = include_str!("page/icon.svg");

/// The page at `/` and what it asks for: `/api/state` is the state, `/api/events` a stream of states
/// and events.
pub fn page(window: Window) -> Router {
    let file = |kind, text| get(move || async move { served(kind, text) });
    Router::new()
        .route("/", file("text/html; charset=utf-8", HTML))
        .route("/page.css", file("text/css; charset=utf-8", STYLE))
        .route("/page.js", file("text/javascript; charset=utf-8", SCRIPT))
        .route("/icon.svg", file("image/svg+xml", ICON))
        .route("/api/state", get(state))
        .route("/api/events", get(events))
        .with_state(window)
}

fn served(kind: &'static str, text: &'static str) -> impl IntoResponse {
    let headers: [(HeaderName, &str); 4] = [
        (header::CONTENT_TYPE, kind),
        (header::CACHE_CONTROL, "no-cache"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    (headers, text)
}

async fn state(State(window): State<Window>) -> Response {
    match window.look(0).await {
        Ok((seen, _)) => Json(seen).into_response(),
        Err(error) => (StatusCode::SERVICE_UNAVAILABLE, error.to_string()).into_response(),
    }
}

/// States, and the events between them; from the beginning of what is remembered, or from the one
/// that a page has seen last. Ends with the master.
async fn events(State(window): State<Window>, headers: HeaderMap) -> impl IntoResponse {
    let last = headers.get("last-event-id");
    let last = last.and_then(|id| id.to_str().ok()?.parse().ok());
    let (told, stream) = mpsc::channel(WAITING);
    tokio::spawn(watch(window, last.unwrap_or(0), told));
    Sse::new(ReceiverStream::new(stream)).keep_alive(KeepAlive::default())
}

/// Tells somebody who watches how things stand and what happens, until they go or the master stops.
async fn watch(window: Window, mut last: u64, told: mpsc::Sender<Result<Event, axum::Error>>) {
    let mut refresh = interval(REFRESH);
    refresh.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            _ = refresh.tick() => {}
            () = told.closed() => return,
        }
        let Ok((seen, happened)) = window.look(last).await else {
            return;
        };
        let happenings = happened.iter().map(|h| {
            let event = Event::default().event("happening").id(h.id.to_string());
            event.json_data(h)
        });
        let state = Event::default().event("state").json_data(&seen);
        for event in happenings.chain([state]) {
            if told.send(event).await.is_err() {
                return;
            }
        }
        last = happened.last().map_or(last, |h| h.id);
    }
}
