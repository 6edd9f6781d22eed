//! Who is who: roles, the certificates that prove them, and what each role may call.
//!
//! Every certificate of a cluster's authority names its roles as DNS names, `worker.horma.internal`
//! for one. Whoever dials a worker asks for that name and not for a host's: workers come and go at
//! addresses that no certificate could list, and what matters is that no worker passes for the master.
//! Whoever is dialled reads the same names from the caller's certificate, by the same rules. No file is
//! read here, and nothing is trusted but the authority given.

use std::fmt;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use tokio_rustls::rustls::client::verify_server_name;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use tokio_rustls::rustls::server::{ParsedCertificate, WebPkiClientVerifier};
use tokio_rustls::rustls::sign::{CertifiedKey, SingleCertAndKey};
use tokio_rustls::rustls::{self, CertificateError, ClientConfig, RootCertStore, ServerConfig};
use tokio_rustls::{TlsAcceptor, TlsConnector};

use crate::error::Error;

/// Longest time for the two ends to agree on keys.
pub(crate) const HANDSHAKE: Duration = Duration::from_secs(10);

/// What a certificate entitles to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Takes registrations and jobs; sends tasks.
    Master,
    /// Registers, and takes tasks.
    Worker,
    /// Submits jobs.
    Client,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Master, Self::Worker, Self::Client];

    /// The DNS name that stands for this role in a certificate. Names under `internal` belong to
    /// nobody on the internet.
    pub fn dns_name(self) -> &'static str {
        match self {
            Self::Master => "master.horma.internal",
            Self::Worker => "worker.horma.internal",
            Self::Client => "client.horma.internal",
        }
    }

    /// Whether this certificate names the role.
    fn is_in(self, certificate: &ParsedCertificate<'_>) -> bool {
        let name = ServerName::try_from(self.dns_name());
        name.is_ok_and(|name| verify_server_name(certificate, &name).is_ok())
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Master => "master",
            Self::Worker => "worker",
            Self::Client => "client",
        })
    }
}

/// The roles that a certificate names; none if it is no certificate.
fn roles(certificate: &CertificateDer<'_>) -> Vec<Role> {
    let Ok(certificate) = ParsedCertificate::try_from(certificate) else {
        return Vec::new();
    };
    let named = Role::ALL.into_iter().filter(|r| r.is_in(&certificate));
    named.collect()
}

/// Roles in words.
fn words(roles: &[Role]) -> String {
    match roles {
        [] => "no role".to_owned(),
        _ => {
            let names: Vec<String> = roles.iter().map(ToString::to_string).collect();
            format!("the role {}", names.join(" and "))
        }
    }
}

/// What a process needs to prove its roles and to have others prove theirs. Clones are one: what one is
/// given anew, all have, for whatever handshake comes next.
#[derive(Clone)]
pub struct Tls {
    identity: Arc<RwLock<Identity>>,
}

#[derive(Clone)]
struct Identity {
    roles: Vec<Role>,
    days: u64,
    connector: TlsConnector,
    acceptor: TlsAcceptor,
}

impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The rest is secret, or long.
        f.debug_struct("Tls").field("roles", &self.roles()).finish()
    }
}

impl Tls {
    /// From an authority's certificate, one's own with those in between, and its private key, all as
    /// PEM. Everything that the other end would refuse is refused here already.
    ///
    /// # Errors
    /// [`BadTls`] tells which of the three is wrong, and how.
    pub fn from_pem(authority: &[u8], certificate: &[u8], key: &[u8]) -> Result<Self, BadTls> {
        let chain = certificates(certificate).ok_or(BadTls::Certificate("not PEM"))?;
        let mut roots = RootCertStore::empty();
        for root in certificates(authority).ok_or(BadTls::Authority("not PEM"))? {
            let added = roots.add(root);
            added.map_err(|_| BadTls::Authority("not a certificate"))?;
        }
        let secret = PrivateKeyDer::from_pem_slice(key).map_err(|_| BadTls::Key("not PEM"))?;

        let provider = Arc::new(ring::default_provider());
        let roots = Arc::new(roots);
        let identity = match CertifiedKey::from_der(chain.clone(), secret, &provider) {
            Ok(identity) => identity,
            Err(rustls::Error::InconsistentKeys(_)) => return Err(BadTls::Mismatch),
            Err(rustls::Error::InvalidCertificate(_)) => {
                return Err(BadTls::Certificate("not a certificate"));
            }
            Err(_) => return Err(BadTls::Key("of no kind that is known here")),
        };
        let verifier = WebPkiClientVerifier::builder_with_provider(roots.clone(), provider.clone())
            .build()
            .map_err(|_| BadTls::Authority("not a certificate"))?;
        let (own, between) = chain.split_first().ok_or(BadTls::Certificate("not PEM"))?;
        let verified = |time| verifier.verify_client_cert(own, between, time);
        verified(UnixTime::now()).map_err(|error| BadTls::of(&error))?;
        let days = days_left(|time| verified(time).is_ok());

        // Whatever the peers run, it is the same version of this.
        let version = [&rustls::version::TLS13];
        let unusable = |_| BadTls::Key("of no kind that is known here");
        let identity = Arc::new(SingleCertAndKey::from(identity));
        let mut server = ServerConfig::builder_with_provider(provider.clone())
            .with_protocol_versions(&version)
            .map_err(unusable)?
            .with_client_cert_verifier(verifier)
            .with_cert_resolver(identity.clone());
        let mut client = ClientConfig::builder_with_provider(provider)
            .with_protocol_versions(&version)
            .map_err(unusable)?
            .with_root_certificates(roots)
            .with_client_cert_resolver(identity);
        server.alpn_protocols = vec![b"h2".to_vec()];
        client.alpn_protocols = vec![b"h2".to_vec()];
        let identity = Identity {
            roles: roles(own),
            days,
            connector: TlsConnector::from(Arc::new(client)),
            acceptor: TlsAcceptor::from(Arc::new(server)),
        };
        Ok(Self {
            identity: Arc::new(RwLock::new(identity)),
        })
    }

    fn identity(&self) -> Identity {
        // Every change is a single assignment: there is no half of one to be seen.
        let identity = self.identity.read().unwrap_or_else(PoisonError::into_inner);
        identity.clone()
    }

    /// Goes by what another one has from now on. Connections that are open stay as they are.
    pub fn renew(&self, newer: &Self) {
        let newer = newer.identity();
        let mut identity = self
            .identity
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        *identity = newer;
    }

    /// Makes connections.
    pub(crate) fn connector(&self) -> TlsConnector {
        self.identity().connector
    }

    /// Takes them in.
    pub(crate) fn acceptor(&self) -> TlsAcceptor {
        self.identity().acceptor
    }

    /// Takes in connections of another protocol than gRPC's.
    pub(crate) fn acceptor_of(&self, protocol: &[u8]) -> TlsAcceptor {
        let mut server = ServerConfig::clone(self.acceptor().config());
        server.alpn_protocols = vec![protocol.to_vec()];
        TlsAcceptor::from(Arc::new(server))
    }

    /// What the certificate entitles to.
    pub fn roles(&self) -> Vec<Role> {
        self.identity().roles
    }

    /// Whole days for which it and its authority stay valid, counted to a hundred years.
    pub fn days_left(&self) -> u64 {
        self.identity().days
    }

    /// Whether others will take this process for one of that role: a server has to know, since nobody
    /// else would tell it.
    ///
    /// # Errors
    /// [`BadTls::Role`].
    pub fn expect(&self, role: Role) -> Result<(), BadTls> {
        let roles = self.roles();
        if roles.contains(&role) {
            return Ok(());
        }
        Err(BadTls::Role {
            wanted: role,
            found: words(&roles),
        })
    }
}

/// Whole days from now at which a certificate that is valid still is: the library that verifies does not
/// tell the end.
fn days_left(valid: impl Fn(UnixTime) -> bool) -> u64 {
    let now = UnixTime::now().as_secs();
    let after = |days: u64| UnixTime::since_unix_epoch(Duration::from_secs(now + days * 86_400));
    let (mut valid_after, mut invalid_after) = (0, 36_525);
    while invalid_after - valid_after > 1 {
        let middle = u64::midpoint(valid_after, invalid_after);
        if valid(after(middle)) {
            valid_after = middle;
        } else {
            invalid_after = middle;
        }
    }
    valid_after
}

/// All certificates of a PEM file; `None` if there is none, or one is broken.
fn certificates(pem: &[u8]) -> Option<Vec<CertificateDer<'static>>> {
    let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(pem).collect();
    all.ok().filter(|all| !all.is_empty())
}

/// Why a process cannot prove who it is.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BadTls {
    /// The authority's certificate.
    #[error("{0}")]
    Authority(&'static str),
    /// The process's own certificate, whatever the authority.
    #[error("{0}")]
    Certificate(&'static str),
    /// The process's private key.
    #[error("{0}")]
    Key(&'static str),
    /// The key is another certificate's.
    #[error("the key does not belong to the certificate")]
    Mismatch,
    /// The certificate is another authority's.
    #[error("not signed by the authority given")]
    OtherAuthority,
    /// The certificate is for something else.
    #[error("it names {found} and has to name the role {wanted}")]
    Role {
        /// What the process wants to be.
        wanted: Role,
        /// What its certificate says, in words.
        found: String,
    },
}

impl BadTls {
    fn of(error: &rustls::Error) -> Self {
        use CertificateError as C;
        match error {
            rustls::Error::InvalidCertificate(error) => match error {
                C::Expired | C::ExpiredContext { .. } => Self::Certificate("expired"),
                C::NotValidYet | C::NotValidYetContext { .. } => Self::Certificate("not valid yet"),
                C::InvalidPurpose | C::InvalidPurposeContext { .. } => {
                    Self::Certificate("not meant for proving oneself to a server")
                }
                C::BadEncoding => Self::Certificate("not a certificate"),
                _ => Self::OtherAuthority,
            },
            _ => Self::OtherAuthority,
        }
    }
}

/// Who may call: anybody where traffic is plain; where it is not, who proves to have the role.
#[derive(Debug, Clone, Copy)]
pub enum Guard {
    /// Anybody who can connect.
    Open,
    /// The bearer of the role's certificate.
    ByRole,
}

impl Guard {
    /// The guard of a server with these settings.
    pub fn of(tls: Option<&Tls>) -> Self {
        match tls {
            None => Self::Open,
            Some(_) => Self::ByRole,
        }
    }

    /// Lets a call pass, or not.
    ///
    /// # Errors
    /// [`Error::Unproven`] or [`Error::Forbidden`].
    pub fn admit<T>(self, call: &tonic::Request<T>, role: Role) -> Result<(), Error> {
        match self {
            Self::Open => Ok(()),
            Self::ByRole => {
                let certificates = call.peer_certs().ok_or(Error::Unproven)?;
                let found = roles(certificates.first().ok_or(Error::Unproven)?);
                if found.contains(&role) {
                    return Ok(());
                }
                let found = words(&found);
                Err(Error::Forbidden { role, found })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};

    use super::*;

    const DAY: Duration = Duration::from_secs(86400);

    struct Authority {
        pem: String,
        issuer: Issuer<'static, KeyPair>,
    }

    fn authority() -> Authority {
        let key = KeyPair::generate().expect("a key");
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let certificate = params.self_signed(&key).expect("signed");
        Authority {
            pem: certificate.pem(),
            issuer: Issuer::new(params, key),
        }
    }

    /// A certificate and its key, valid for three days that begin this many days from now.
    fn issue(authority: &Authority, names: &[&str], begin: i32) -> (String, String) {
        let key = KeyPair::generate().expect("a key");
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let mut params = CertificateParams::new(names).expect("names");
        // A week ago, to count from without signs.
        let week_ago = SystemTime::now() - 7 * DAY;
        let begin = week_ago + DAY * u32::try_from(begin + 7).expect("at most a week ago");
        params.not_before = begin.into();
        // Not to the second, in which it is still valid.
        params.not_after = (begin + 3 * DAY - DAY / 2).into();
        let certificate = params.signed_by(&key, &authority.issuer).expect("signed");
        (certificate.pem(), key.serialize_pem())
    }

    fn load(authority: &str, certificate: &str, key: &str) -> Result<Tls, BadTls> {
        Tls::from_pem(authority.as_bytes(), certificate.as_bytes(), key.as_bytes())
    }

    #[test]
    fn what_others_would_refuse_is_refused_at_once() {
        let (ours, theirs) = (authority(), authority());
        let worker = [Role::Worker.dns_name()];
        let (certificate, key) = issue(&ours, &worker, -1);
        let (past, past_key) = issue(&ours, &worker, -5);
        let (future, future_key) = issue(&ours, &worker, 1);
        let refused = |authority: &str, certificate: &str, key: &str| {
            load(authority, certificate, key).expect_err("refused")
        };
        assert!(load(&ours.pem, &certificate, &key).is_ok());
        let not_pem = "not PEM";
        let cases = [
            (refused("", &certificate, &key), BadTls::Authority(not_pem)),
            (refused(&ours.pem, "x", &key), BadTls::Certificate(not_pem)),
            (refused(&ours.pem, &certificate, ""), BadTls::Key(not_pem)),
            (
                refused(&ours.pem, &certificate, &past_key),
                BadTls::Mismatch,
            ),
            (
                refused(&theirs.pem, &certificate, &key),
                BadTls::OtherAuthority,
            ),
            (
                refused(&ours.pem, &past, &past_key),
                BadTls::Certificate("expired"),
            ),
            (
                refused(&ours.pem, &future, &future_key),
                BadTls::Certificate("not valid yet"),
            ),
        ];
        for (found, expected) in cases {
            assert_eq!(found, expected);
        }
        let both = format!("{}{}", theirs.pem, ours.pem);
        assert!(load(&both, &certificate, &key).is_ok(), "one of several");
    }

    #[test]
    fn a_certificate_knows_its_days() {
        let authority = authority();
        let (certificate, key) = issue(&authority, &[], -1);
        let tls = load(&authority.pem, &certificate, &key).expect("valid");
        assert_eq!(tls.days_left(), 1, "of the day and a half that are left");
    }

    #[test]
    fn a_certificate_has_the_roles_that_it_names() {
        let authority = authority();
        let cases: [(&[&str], &[Role]); 5] = [
            (&["worker.horma.internal", "10.0.0.1"], &[Role::Worker]),
            (
                &["client.horma.internal", "master.horma.internal"],
                &[Role::Master, Role::Client],
            ),
            (&["example.org"], &[]),
            (&["worker.horma.internal.example.org"], &[]),
            (&[], &[]),
        ];
        for (names, expected) in cases {
            let (certificate, key) = issue(&authority, names, -1);
            let tls = load(&authority.pem, &certificate, &key).expect("valid");
            assert_eq!(tls.roles(), expected, "{names:?}");
            for role in Role::ALL {
                assert_eq!(tls.expect(role).is_ok(), expected.contains(&role));
            }
        }
        assert!(roles(&CertificateDer::from(vec![1, 2, 3])).is_empty());
    }

    #[test]
    fn a_call_without_a_certificate_passes_only_an_open_guard() {
        let call = tonic::Request::new(());
        assert_eq!(Guard::Open.admit(&call, Role::Master), Ok(()));
        let refused = Guard::ByRole.admit(&call, Role::Master);
        assert_eq!(refused, Err(Error::Unproven));
    }
}
