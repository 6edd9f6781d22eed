//! What others may look at over HTTP: metrics, health, and a master's page. Nothing can be changed here.
//!
//! On this machine anybody may look. Beyond it the rule is that of every other port: with certificates
//! the connection is encrypted and shown to whoever has one, of any role, else it takes `--insecure`.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use axum::routing::get;
use axum::serve::Listener;
use horma_master::Window;
use horma_proto::metrics::{self, MEMORY};
use horma_proto::{Role, Tls, transport};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio_stream::StreamExt;
use tokio_util::sync::CancellationToken;
use tracing::warn;

use crate::cluster::bind;
use crate::error::{Error, Result};
use crate::{say, system};

/// Upper ends of the classes that phases are counted in, s.
const SECONDS: [f64; 7] = [0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0];

/// How often what was written down is summed up, whether anybody asks or not.
const UPKEEP: Duration = Duration::from_secs(5);

/// A port that is bound, and figures that are counted from now on.
pub(crate) struct Http {
    listener: TcpListener,
    bound: SocketAddr,
    figures: PrometheusHandle,
}

/// Whose state there is to look at.
#[derive(Clone)]
pub(crate) enum Watched {
    /// A master's.
    Master(Box<Window>),
    /// A worker's: whether it is registered.
    Worker(watch::Receiver<bool>),
}

/// Listens, and prints where; a bare port is one of this machine alone.
pub(crate) async fn listen(
    address: Option<&str>,
    role: Role,
    trusted: bool,
) -> Result<Option<Http>> {
    let Some(address) = address else {
        return Ok(None);
    };
    let address = match address.parse::<u16>() {
        Ok(port) => format!("127.0.0.1:{port}"),
        Err(_) => address.to_owned(),
    };
    let (listener, bound) = bind(&address, trusted).await?;
    let figures = PrometheusBuilder::new()
        .set_buckets_for_metric(Matcher::Suffix("_seconds".to_owned()), &SECONDS)
        .and_then(PrometheusBuilder::install_recorder)
        .map_err(|e| Error::Metrics(e.to_string()))?;
    metrics::announce(role);
    say(&format!("http on {bound}"));
    Ok(Some(Http {
        listener,
        bound,
        figures,
    }))
}

/// Serves until `shutdown`; whatever is open then ends with the process.
pub(crate) async fn serve(
    http: Http,
    tls: Option<&Tls>,
    watched: Watched,
    shutdown: CancellationToken,
) {
    let Http {
        listener,
        bound,
        figures,
    } = http;
    let upkeep = figures.clone();
    let seen = Seen {
        figures,
        watched: watched.clone(),
        shutdown: shutdown.clone(),
    };
    let routes = Router::new()
        .route("/metrics", get(render))
        .route("/healthz", get(|| async { "alive\n" }))
        .route("/readyz", get(ready))
        .with_state(seen);
    let routes = match watched {
        Watched::Master(window) => routes.merge(horma_master::page(*window)),
        Watched::Worker(_) => routes,
    };
    let serving = async {
        match tls.filter(|_| !bound.ip().is_loopback()) {
            None => axum::serve(listener, routes).await,
            Some(tls) => {
                let connections = transport::secured_http(listener, tls);
                axum::serve(Secured { connections, bound }, routes).await
            }
        }
    };
    let summing_up = async {
        let mut ticks = tokio::time::interval(UPKEEP);
        loop {
            ticks.tick().await;
            upkeep.run_upkeep();
        }
    };
    tokio::select! {
        served = serving => if let Err(error) = served {
            warn!(%error, "no more http");
        },
        () = summing_up => {}
        () = shutdown.cancelled() => {}
    }
}

#[derive(Clone)]
struct Seen {
    figures: PrometheusHandle,
    watched: Watched,
    shutdown: CancellationToken,
}

async fn render(State(seen): State<Seen>) -> impl IntoResponse {
    if let Watched::Master(window) = &seen.watched
        && let Ok((state, _)) = window.look(0).await
    {
        state.set_gauges();
    }
    MEMORY.set("", system::memory_held() as f64);
    let kind = "text/plain; version=0.0.4; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], seen.figures.render())
}

/// Whether it makes sense to send anybody here.
async fn ready(State(seen): State<Seen>) -> (StatusCode, &'static str) {
    let unready = |why| (StatusCode::SERVICE_UNAVAILABLE, why);
    if seen.shutdown.is_cancelled() {
        return unready("stopping\n");
    }
    match &seen.watched {
        Watched::Master(window) if !window.is_open() => unready("stopping\n"),
        Watched::Worker(registered) if !*registered.borrow() => unready("not registered\n"),
        Watched::Worker(_) | Watched::Master(_) => (StatusCode::OK, "ready\n"),
    }
}

/// Connections with TLS, as axum takes them.
struct Secured {
    connections: transport::Secured,
    bound: SocketAddr,
}

impl Listener for Secured {
    type Io = transport::SecuredStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            match self.connections.next().await {
                Some(Ok(stream)) => return (stream, self.bound),
                Some(Err(error)) => warn!(%error, "no connection"),
                // Whoever accepts them is gone: there will be no more.
                None => std::future::pending().await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        Ok(self.bound)
    }
}
