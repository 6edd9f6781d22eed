//! The files that prove who is who: read at the start, and by a server again when they change.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::time::Duration;

use horma_proto::Role;
use horma_proto::tls::{BadTls, Tls};
use tracing::{info, warn};

use crate::args;
use crate::error::{Error, Result};

const CA: &str = "--tls-ca";
const CERT: &str = "--tls-cert";
const KEY: &str = "--tls-key";

/// How often a server looks whether its files have changed.
const LOOK: Duration = Duration::from_secs(2);

/// Reads what was given; nothing if nothing was.
pub(crate) fn load(args: &args::Tls) -> Result<Option<Tls>> {
    checked(args, |_| Ok(()))
}

/// Reads what was given for a server of that role.
pub(crate) fn load_as(args: &args::Tls, role: Role) -> Result<Option<Tls>> {
    checked(args, |tls| tls.expect(role))
}

/// Renews what was loaded for a server of that role when the files have changed, until it is dropped. What
/// is no good is not taken: files that belong together are seldom replaced in one instant.
pub(crate) async fn renew(args: &args::Tls, role: Role, tls: Option<&Tls>) -> Infallible {
    let Some(tls) = tls else {
        return std::future::pending().await;
    };
    // They may have changed since they were loaded.
    let mut seen = None;
    let mut ticks = tokio::time::interval(LOOK);
    loop {
        ticks.tick().await;
        // Three small files.
        let now = Some([&args.tls_ca, &args.tls_cert, &args.tls_key].map(contents));
        if now == seen {
            continue;
        }
        match load_as(args, role) {
            Ok(newer) => {
                newer.iter().for_each(|newer| tls.renew(newer));
                info!(days = tls.days_left(), "certificates read");
            }
            Err(error) => warn!(%error, "certificates not renewed"),
        }
        seen = now;
    }
}

/// What is in a file, if it can be read.
fn contents(file: &Option<PathBuf>) -> Option<Vec<u8>> {
    std::fs::read(file.as_ref()?).ok()
}

fn checked(
    args: &args::Tls,
    check: impl FnOnce(&Tls) -> std::result::Result<(), BadTls>,
) -> Result<Option<Tls>> {
    // One without the others is refused when the arguments are parsed.
    let (Some(ca), Some(cert), Some(key)) = (&args.tls_ca, &args.tls_cert, &args.tls_key) else {
        return Ok(None);
    };
    let pem = [read(CA, ca)?, read(CERT, cert)?, read(KEY, key)?];
    let tls = Tls::from_pem(&pem[0], &pem[1], &pem[2]);
    let tls = tls.and_then(|tls| check(&tls).map(|()| tls));
    tls.map(Some).map_err(|bad| {
        let (flag, file, reason) = match bad {
            BadTls::Authority(what) => {
                (CA, ca, format!("it is {what}; give the authority's ca.pem"))
            }
            BadTls::Certificate(what) => (
                CERT,
                cert,
                format!("it is {what}; have a new one signed (`horma certs`)"),
            ),
            BadTls::Key(what) => (
                KEY,
                key,
                format!("it is {what}; give the certificate's key"),
            ),
            BadTls::Mismatch => {
                let why = "it is not the key of --tls-cert";
                (
                    KEY,
                    key,
                    format!("{why} {}; give the two together", cert.display()),
                )
            }
            BadTls::OtherAuthority => {
                let why = "it is not signed by the authority of --tls-ca";
                (
                    CERT,
                    cert,
                    format!("{why} {}; give files of one authority", ca.display()),
                )
            }
            BadTls::Role { .. } => (
                CERT,
                cert,
                format!("{bad}; give a certificate of that role"),
            ),
        };
        let file = file.clone();
        Error::Tls { flag, file, reason }
    })
}

fn read(flag: &'static str, file: &Path) -> Result<Vec<u8>> {
    std::fs::read(file).map_err(|source| Error::Tls {
        flag,
        file: file.to_owned(),
        reason: format!("it cannot be read: {source}"),
    })
}
