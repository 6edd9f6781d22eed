//! Traces: the spans of this process, sent to a collector over OTLP as jobs go on.
//!
//! Where and whether is said by `--otlp` alone: `OTEL_EXPORTER_OTLP_ENDPOINT`, which may be set for
//! everything on a host, turns nothing on here. No job waits for a collector. Spans wait in a queue and are
//! dropped when it is full, and a process takes [`FAREWELL`] at most to send what is left in the end. TLS
//! is the business of a collector on the same host.

use std::io::{Write, stderr};
use std::str::FromStr;
use std::sync::Once;
use std::time::Duration;

use horma_proto::{VERSION, transport};
use opentelemetry::trace::TracerProvider;
use opentelemetry::{KeyValue, global};
use opentelemetry_otlp::{RetryPolicy, WithExportConfig, WithTonicConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::{SdkTracerProvider, SpanData, SpanExporter};
use tokio::runtime::{self, Runtime};
use tonic::transport::Endpoint;
use tracing::{Level, Subscriber, warn};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::registry::LookupSpan;

use crate::error::{Error, Result};
use crate::system;

/// Longest time for a collector to take what it is sent.
const PATIENCE: Duration = Duration::from_secs(2);

/// Longest time for what is left in the end: one try and a little.
const FAREWELL: Duration = Duration::from_secs(3);

/// Whose log is told that there is no collector: a run's workers have its standard error, and it has
/// complained there already.
pub(crate) const WORKER: &str = "horma-worker";

/// A process whose spans are exported.
pub(crate) struct Traces {
    provider: SdkTracerProvider,
    /// Of the exporter alone: it is needed when all others have ended.
    runtime: Runtime,
}

/// Where spans are sent.
#[derive(Debug, Clone)]
pub(crate) struct Collector {
    /// As it was typed.
    pub url: String,
    endpoint: Endpoint,
}

impl FromStr for Collector {
    type Err = String;

    fn from_str(url: &str) -> std::result::Result<Self, String> {
        let address = url.strip_prefix("http://");
        let endpoint = address.and_then(|address| transport::endpoint(address).ok());
        let fits = |e: &Endpoint| e.uri().port().is_some() && e.uri().path() == "/";
        match endpoint.filter(fits) {
            Some(endpoint) => Ok(Self {
                url: url.to_owned(),
                endpoint,
            }),
            None => Err(
                "it is not http://HOST:PORT; where TLS is wanted, have a collector on this host"
                    .to_owned(),
            ),
        }
    }
}

impl Traces {
    /// Has the spans of this process, which is a `service`, sent to a collector.
    pub fn begin(service: &'static str, collector: &Collector) -> Result<Self> {
        let runtime = runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(|e| Error::Threads(e.to_string()))?;
        let endpoint = collector.endpoint.clone();
        let endpoint = endpoint.connect_timeout(PATIENCE).timeout(PATIENCE);
        let _entered = runtime.enter();
        let exporter = opentelemetry_otlp::SpanExporter::builder()
            .with_tonic()
            .with_channel(endpoint.connect_lazy())
            .with_timeout(PATIENCE)
            .with_retry_policy(RetryPolicy::disabled())
            .build();
        let exporter = Telling {
            exporter: exporter.map_err(|e| Error::Traces(e.to_string()))?,
            collector: collector.url.clone(),
            service,
            told: Once::new(),
        };
        let instance = format!("{}:{}", system::host_name(), std::process::id());
        let resource = Resource::builder()
            .with_service_name(service)
            .with_attribute(KeyValue::new("service.version", VERSION))
            .with_attribute(KeyValue::new("service.instance.id", instance));
        let provider = SdkTracerProvider::builder()
            .with_resource(resource.build())
            .with_batch_exporter(exporter)
            .build();
        global::set_text_map_propagator(TraceContextPropagator::new());
        Ok(Self { provider, runtime })
    }

    /// What takes spans, and what happens within them.
    pub fn layer<S: Subscriber + for<'a> LookupSpan<'a>>(&self) -> impl Layer<S> + use<S> {
        tracing_opentelemetry::layer()
            .with_tracer(self.provider.tracer("horma"))
            .with_location(false)
            .with_threads(false)
            .with_tracked_inactivity(false)
            .with_filter(Targets::new().with_target("horma", Level::INFO))
    }

    /// Sends what is left.
    pub fn end(self) {
        // Whatever goes wrong has been told by the exporter.
        let _ = self.provider.shutdown_with_timeout(FAREWELL);
        self.runtime.shutdown_background();
    }
}

/// An exporter that tells when it cannot reach its collector, the first time.
#[derive(Debug)]
struct Telling {
    exporter: opentelemetry_otlp::SpanExporter,
    collector: String,
    service: &'static str,
    told: Once,
}

impl Telling {
    fn tell(&self, reason: &str) {
        let collector = &self.collector;
        if self.service == WORKER {
            warn!(collector, reason, "no traces");
        } else {
            // Standard error may be closed.
            let _ = writeln!(
                stderr(),
                "horma: warning: no traces for {collector} ({reason}); does it listen there for OTLP over gRPC"
            );
        }
    }
}

impl SpanExporter for Telling {
    async fn export(&self, batch: Vec<SpanData>) -> OTelSdkResult {
        let exported = self.exporter.export(batch).await;
        if let Err(error) = &exported {
            self.told.call_once(|| self.tell(&error.to_string()));
        }
        exported
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.exporter.shutdown_with_timeout(timeout)
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.exporter.force_flush()
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.exporter.set_resource(resource);
    }
}
