//! Connections, the same everywhere: how one is made, kept alive and given up, plain or with TLS, and
//! what it means that one failed. Who connects to whom, and when, is decided elsewhere.

use std::convert::Infallible;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use hyper_util::rt::TokioIo;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_rustls::rustls::{self, AlertDescription, CertificateError};
use tokio_rustls::server::TlsStream as Accepted;
use tokio_stream::wrappers::ReceiverStream;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response, Uri};
use tonic::server::NamedService;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Channel, Endpoint, Server};
use tonic_health::ServingStatus;
use tower::Service;
use tower::util::MapResponseLayer;

use crate::refused::Refused;
use crate::tls::{Role, Tls};
use crate::wire::DESCRIPTORS;
use crate::{accept, limit};

/// Longest time to connect.
const CONNECT: Duration = Duration::from_secs(5);

/// How often a connection with open calls is tried: a host that is cut off sends no reset.
const KEEPALIVE: Duration = Duration::from_secs(5);

/// How long the answer to such a try may take.
const ANSWER: Duration = Duration::from_secs(10);

/// The way to `address`, `host:port`.
///
/// # Errors
/// The address cannot be one.
pub fn endpoint(address: &str) -> Result<Endpoint, tonic::transport::Error> {
    Ok(Endpoint::from_shared(format!("http://{address}"))?
        .connect_timeout(CONNECT)
        .http2_keep_alive_interval(KEEPALIVE)
        .keep_alive_timeout(ANSWER)
        .tcp_keepalive(Some(KEEPALIVE))
        .tcp_nodelay(true))
}

/// Connects to a peer, who has to prove that role if there is TLS.
///
/// # Errors
/// Nobody answers, or one end does not trust the other; [`Trouble`] tells which.
pub async fn connect(
    to: &Endpoint,
    role: Role,
    tls: Option<&Tls>,
) -> Result<Channel, tonic::transport::Error> {
    match tls {
        None => to.connect().await,
        Some(tls) => to.connect_with_connector(connector(to, role, tls)).await,
    }
}

/// As [`connect`], at the first call, and again when the connection is lost.
pub fn connect_lazily(to: &Endpoint, role: Role, tls: Option<&Tls>) -> Channel {
    match tls {
        None => to.connect_lazy(),
        Some(tls) => to.connect_with_connector_lazy(connector(to, role, tls)),
    }
}

/// What tonic is given to connect with TLS.
fn connector(
    to: &Endpoint,
    role: Role,
    tls: &Tls,
) -> impl Service<Uri, Response = Io, Error = io::Error, Future: Send> + Send + use<> {
    let address = to.uri().authority().map_or("", |a| a.as_str()).to_owned();
    let tls = tls.clone();
    tower::service_fn(move |_| dial(address.clone(), role, tls.connector()))
}

type Io = TokioIo<TlsStream<TcpStream>>;

async fn dial(address: String, role: Role, connector: TlsConnector) -> io::Result<Io> {
    let socket = TcpStream::connect(&address).await?;
    socket.set_nodelay(true)?;
    let name = ServerName::try_from(role.dns_name()).map_err(io::Error::other)?;
    let mut stream = connector.connect(name, socket).await?;
    // With TLS 1.3 the other end judges this one's certificate after this one is done. Whatever it says
    // first, it says to both; left to a call, its refusal would be one closed connection among others.
    if stream.fill_buf().await?.is_empty() {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(TokioIo::new(stream))
}

/// Serves on `listener` until `shutdown` and the end of all open calls, at most so many connections at
/// once: more wait until others are closed. Then the log is told what was refused. Beside the service it
/// answers gRPC's own questions: after health, which ends when `stopping` does, and after what is served
/// here. Whoever got through the handshake may ask these.
///
/// # Errors
/// The listener is gone.
pub async fn serve<S>(
    service: S,
    listener: TcpListener,
    connections: usize,
    tls: Option<&Tls>,
    stopping: impl Future<Output = ()>,
    shutdown: impl Future<Output = ()>,
) -> Result<(), tonic::transport::Error>
where
    S: Service<
            Request<Body>,
            Response = Response<Body>,
            Error = Infallible,
            Future: Send + 'static,
        > + NamedService
        + Clone
        + Send
        + Sync
        + 'static,
{
    let (health, asked_after) = tonic_health::server::health_reporter();
    health.set_serving::<S>().await;
    let reflection = tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(DESCRIPTORS)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        .build_v1()
        .expect("descriptors that code was generated from");
    let refused = Arc::new(Refused::default());
    let counting = refused.clone();
    let services = Server::builder()
        .http2_keepalive_interval(Some(KEEPALIVE))
        .http2_keepalive_timeout(Some(ANSWER))
        .layer(MapResponseLayer::new(move |response: Response<Body>| {
            counting.count(&response);
            response
        }))
        .add_service(service)
        .add_service(asked_after)
        .add_service(reflection);
    let serving = async {
        match tls {
            None => {
                let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
                let incoming = limit::at_most(connections, incoming);
                let serving = services.serve_with_incoming_shutdown(incoming, shutdown);
                serving.await
            }
            Some(tls) => {
                let tls = tls.clone();
                let incoming = accept::secured(listener, move || tls.acceptor(), refused.clone());
                let incoming = limit::at_most(connections, incoming);
                let serving = services.serve_with_incoming_shutdown(incoming, shutdown);
                serving.await
            }
        }
    };
    let telling = async {
        stopping.await;
        health.set_not_serving::<S>().await;
        let all = ServingStatus::NotServing;
        health.set_service_status("", all).await;
        std::future::pending::<Infallible>().await
    };
    let served = tokio::select! {
        biased;
        never = telling => match never {},
        served = serving => served,
    };
    refused.tell();
    served
}

/// A connection with TLS that somebody else made.
pub type SecuredStream = Accepted<TcpStream>;

/// Such connections, until this is dropped.
pub type Secured = ReceiverStream<io::Result<SecuredStream>>;

/// Connections of HTTP/1.1, from whoever proves to have a certificate, of any role.
pub fn secured_http(listener: TcpListener, tls: &Tls) -> Secured {
    let refused = Arc::new(Refused::default());
    let tls = tls.clone();
    accept::secured(listener, move || tls.acceptor_of(b"http/1.1"), refused)
}

/// Bytes of the word by which [`answer`] is known.
pub const WORD: usize = 16;

/// Dials `address` and hears whether somebody there says `word`, as [`answer`] does.
///
/// # Errors
/// Why not, in words.
pub async fn reach(
    address: &str,
    role: Role,
    tls: Option<&Tls>,
    word: &[u8; WORD],
) -> Result<(), String> {
    let hear = async {
        let mut heard = [0; WORD];
        match tls {
            None => {
                TcpStream::connect(address)
                    .await?
                    .read_exact(&mut heard)
                    .await?
            }
            Some(tls) => {
                let stream = dial(address.to_owned(), role, tls.connector()).await?;
                stream.into_inner().read_exact(&mut heard).await?
            }
        };
        Ok::<_, io::Error>(heard)
    };
    match tokio::time::timeout(CONNECT, hear).await {
        Ok(Ok(heard)) if heard == *word => Ok(()),
        Ok(Ok(_)) => Err("somebody else answers there".to_owned()),
        Ok(Err(error)) => Err(match Trouble::of(&error, role) {
            Trouble::Untrusted(why) | Trouble::Unreachable(why) | Trouble::Broken(why) => why,
        }),
        Err(_) => Err(format!("nobody answers within {} s", CONNECT.as_secs())),
    }
}

/// Says `word` to whoever connects, one after the other, until it is dropped.
pub async fn answer(listener: &TcpListener, tls: Option<&Tls>, word: &[u8; WORD]) {
    while let Ok((mut socket, _)) = listener.accept().await {
        let say = async {
            let mut nothing = [0];
            match tls {
                None => {
                    socket.write_all(word).await?;
                    socket.read(&mut nothing).await
                }
                Some(tls) => {
                    let mut stream = tls.acceptor().accept(socket).await?;
                    stream.write_all(word).await?;
                    stream.flush().await?;
                    stream.read(&mut nothing).await
                }
            }
        };
        // Whoever connected may have gone by now.
        let _ = tokio::time::timeout(CONNECT, say).await;
    }
}

/// What may help where a plain connection broke before anything was heard.
pub const WANTS_TLS: &str = "if it wants TLS, give --tls-ca, --tls-cert and --tls-key";

/// Why there is no connection, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Trouble {
    /// One of the two ends does not trust the other: no second try will help.
    Untrusted(String),
    /// Nobody is there: another try may help.
    Unreachable(String),
    /// Somebody was there, and then not any more: another try may help.
    Broken(String),
}

impl Trouble {
    /// What it means that a connection to a peer of that role, or a call on it, failed with this error.
    pub fn of(error: &(dyn std::error::Error + 'static), role: Role) -> Self {
        let all = || std::iter::successors(Some(error), |e| e.source());
        if let Some(why) = all().find_map(rustls_error).and_then(|e| distrust(e, role)) {
            return Self::Untrusted(why);
        }
        let text = all().last().map_or_else(String::new, ToString::to_string);
        if all().any(|e| e.downcast_ref::<tonic::ConnectError>().is_some()) {
            Self::Unreachable(text)
        } else {
            Self::Broken(text)
        }
    }
}

/// The TLS error within an error.
fn rustls_error<'a>(error: &'a (dyn std::error::Error + 'static)) -> Option<&'a rustls::Error> {
    let within = || error.downcast_ref::<io::Error>()?.get_ref()?.downcast_ref();
    error.downcast_ref().or_else(within)
}

/// Why a handshake ended, if one of the ends wanted it so.
fn distrust(error: &rustls::Error, role: Role) -> Option<String> {
    use AlertDescription as A;
    use CertificateError as C;
    let why = match error {
        rustls::Error::InvalidMessage(_) => {
            "it does not speak TLS; give it --tls-ca, --tls-cert and --tls-key, or none of them here"
        }
        rustls::Error::PeerIncompatible(_)
        | rustls::Error::AlertReceived(A::ProtocolVersion | A::NoApplicationProtocol) => {
            "it speaks another TLS"
        }
        rustls::Error::InvalidCertificate(error) => match error {
            C::NotValidForName | C::NotValidForNameContext { .. } => {
                return Some(format!("its certificate does not name the role {role}"));
            }
            C::Expired | C::ExpiredContext { .. } => "its certificate has expired",
            C::NotValidYet | C::NotValidYetContext { .. } => {
                "its certificate is not valid yet; compare the clocks"
            }
            _ => "its certificate is not from the authority given",
        },
        rustls::Error::AlertReceived(A::CertificateRequired) => "it demands a certificate",
        rustls::Error::AlertReceived(A::CertificateExpired) => {
            "it refuses the certificate shown to it, which has expired by its clock"
        }
        rustls::Error::AlertReceived(A::UnknownCA | A::DecryptError) => {
            "it refuses the certificate shown to it, which is not from its authority"
        }
        rustls::Error::AlertReceived(
            A::BadCertificate
            | A::UnsupportedCertificate
            | A::CertificateRevoked
            | A::CertificateUnknown
            | A::AccessDenied,
        ) => "it refuses the certificate shown to it",
        _ => return None,
    };
    Some(why.to_owned())
}
