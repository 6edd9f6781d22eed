//! The files that prove who is who, read once.

use std::path::Path;

use horma_proto::Role;
use horma_proto::tls::{BadTls, Tls};

use crate::args;
use crate::error::{Error, Result};

const CA: &str = "--tls-ca";
const CERT: &str = "--tls-cert";
const KEY: &str = "--tls-key";

/// Reads what was given; nothing if nothing was.
pub(crate) fn load(args: &args::Tls) -> Result<Option<Tls>> {
    checked(args, |_| Ok(()))
}

/// Reads what was given for a server of that role.
pub(crate) fn load_as(args: &args::Tls, role: Role) -> Result<Option<Tls>> {
    checked(args, |tls| tls.expect(role))
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
