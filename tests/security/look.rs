//! What whoever has a certificate of the authority may look at, of any role: HTTP beyond this machine,
//! and health.

use std::path::PathBuf;
use std::sync::Arc;

use horma_proto::tls::Role;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;

use super::{Authority, dial, words};
use crate::common::{self, scratch};

/// What a GET over TLS gets, from whoever has these files of its own.
async fn get(address: &str, trusted: &Authority, own: Option<(&Authority, Role)>) -> String {
    let read = |file: PathBuf| std::fs::read(file).expect("readable");
    let mut roots = RootCertStore::empty();
    for root in CertificateDer::pem_slice_iter(&read(trusted.file("ca.pem"))) {
        roots.add(root.expect("PEM")).expect("a certificate");
    }
    let builder = ClientConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .expect("versions")
        .with_root_certificates(roots);
    let config = match own {
        None => builder.with_no_client_auth(),
        Some((authority, role)) => {
            let chain = read(authority.file(&format!("{role}.pem")));
            let key = read(authority.file(&format!("{role}.key")));
            let chain = CertificateDer::pem_slice_iter(&chain).map(|c| c.expect("PEM"));
            let key = PrivateKeyDer::from_pem_slice(&key).expect("PEM");
            let built = builder.with_client_auth_cert(chain.collect(), key);
            built.expect("a pair")
        }
    };
    let name = ServerName::try_from(Role::Master.dns_name()).expect("a name");
    let socket = TcpStream::connect(address).await.expect("listening");
    let connector = TlsConnector::from(Arc::new(config));
    let mut answer = String::new();
    let talk = async {
        let mut stream = connector.connect(name, socket).await?;
        stream.write_all(b"GET /readyz HTTP/1.0\r\n\r\n").await?;
        stream.read_to_string(&mut answer).await
    };
    match talk.await {
        Ok(_) => answer,
        Err(error) => error.to_string(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_has_a_certificate_of_any_role_may_look_from_elsewhere() {
    let dir = scratch();
    let ours = Authority::new(dir.path(), "ours");
    let theirs = Authority::new(dir.path(), "theirs");
    let mut args = ours.args("master");
    args.extend(["--http", "0.0.0.0:0"].map(str::to_owned));
    let (mut master, _) = common::master(&words(&args));
    let address = common::http(&mut master).replace("0.0.0.0", "127.0.0.1");
    for role in Role::ALL {
        let answer = get(&address, &ours, Some((&ours, role))).await;
        assert!(answer.ends_with("ready\n"), "{role}: {answer}");
    }
    let strangers = [
        (None, "peer sent no certificates"),
        (Some((&theirs, Role::Client)), "invalid peer certificate"),
    ];
    for (own, why) in strangers {
        let answer = get(&address, &ours, own).await;
        assert!(!answer.contains("HTTP"), "{answer}");
        master.wait_for(&["connection refused", why]);
    }
    let mut plain = TcpStream::connect(&address).await.expect("listening");
    let mut answer = Vec::new();
    let sent = plain.write_all(b"GET / HTTP/1.0\r\n\r\n").await;
    // Whatever comes, it is an alert or nothing.
    let read = plain.read_to_end(&mut answer).await;
    assert!(sent.is_ok() && !answer.starts_with(b"HTTP"), "{read:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_has_a_certificate_of_any_role_may_ask_after_health() {
    let dir = scratch();
    let authority = Authority::new(dir.path(), "certs");
    let (_master, master) = authority.master();
    let (_worker, worker) = authority.worker(&master, "w");
    for caller in Role::ALL {
        let tls = authority.tls(caller);
        for (address, role) in [(&master, Role::Master), (&worker, Role::Worker)] {
            let mut client = HealthClient::new(dial(address, role, &tls).await);
            let health = client.check(HealthCheckRequest::default()).await;
            assert!(health.is_ok(), "{caller} asks a {role}: {health:?}");
        }
    }
    let plain = horma_proto::transport::endpoint(&master).expect("an address");
    let channel = plain.connect_lazy();
    let mut client = HealthClient::new(channel);
    let health = client.check(HealthCheckRequest::default()).await;
    assert!(health.is_err(), "nobody without a certificate");
}
