//! `horma certs`: an authority for tests and small private networks, and a certificate of it for each
//! role. It writes files and touches no cluster.

use std::fs::{DirBuilder, OpenOptions};
use std::io::Write;
use std::net::IpAddr;
use std::path::Path;
use std::time::{Duration, SystemTime};

use horma_proto::Role;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};

use crate::args::Certs;
use crate::error::{Error, Result};
use crate::say;

const DAY: Duration = Duration::from_secs(86400);

/// Makes the authority and its certificates, and says what to do with them.
pub(crate) fn certs(args: &Certs) -> Result<()> {
    check_names(&args.name)?;
    let ca_key = KeyPair::generate()?;
    let ca = authority(args.days)?;
    let mut files = vec![
        ("ca.pem".to_owned(), ca.self_signed(&ca_key)?.pem()),
        ("ca.key".to_owned(), ca_key.serialize_pem()),
    ];
    let issuer = Issuer::new(ca, ca_key);
    for role in Role::ALL {
        let key = KeyPair::generate()?;
        let certificate = params(role, args)?.signed_by(&key, &issuer)?;
        files.push((format!("{role}.pem"), certificate.pem()));
        files.push((format!("{role}.key"), key.serialize_pem()));
    }

    let dir = &args.directory;
    let there = files.iter().map(|(name, _)| dir.join(name));
    if let Some(file) = there.into_iter().find(|f| f.symlink_metadata().is_ok()) {
        return Err(Error::CertExists { file });
    }
    let made = DirBuilder::new().recursive(true).create(dir);
    made.map_err(|source| Error::CertWrite {
        file: dir.clone(),
        source,
    })?;
    for (name, pem) in &files {
        write(&dir.join(name), pem)?;
    }
    explain(args);
    Ok(())
}

/// Names for other programs; roles are not theirs to give.
fn check_names(names: &[String]) -> Result<()> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-._:".contains(c);
    for name in names {
        let lower = name.trim_end_matches('.').to_ascii_lowercase();
        let reason = if lower == "horma.internal" || lower.ends_with(".horma.internal") {
            "such names are roles, and each certificate has its own"
        } else if name.is_empty() || !name.chars().all(plain) {
            "it is neither a host name nor an address"
        } else {
            continue;
        };
        return Err(Error::CertName {
            name: name.clone(),
            reason: reason.to_owned(),
        });
    }
    Ok(())
}

fn authority(days: u32) -> Result<CertificateParams> {
    let mut ca = valid_for(days);
    ca.distinguished_name
        .push(DnType::CommonName, "horma test authority");
    ca.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    ca.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    Ok(ca)
}

/// A certificate's content. Masters and workers both serve and call; clients only call.
fn params(role: Role, args: &Certs) -> Result<CertificateParams> {
    let mut params = valid_for(args.days);
    let common = format!("horma {role}");
    params.distinguished_name.push(DnType::CommonName, common);
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
    params.use_authority_key_identifier_extension = true;
    let mut names = vec![role.dns_name().to_owned()];
    if role != Role::Client {
        params
            .extended_key_usages
            .push(ExtendedKeyUsagePurpose::ServerAuth);
        names.extend(args.name.iter().cloned());
    }
    for name in names {
        let alternative = match name.parse::<IpAddr>() {
            Ok(address) => rcgen::SanType::IpAddress(address),
            Err(_) => rcgen::SanType::DnsName(name.as_str().try_into().map_err(|_| {
                let reason = "it is neither a host name nor an address".to_owned();
                Error::CertName { name, reason }
            })?),
        };
        params.subject_alt_names.push(alternative);
    }
    Ok(params)
}

/// From yesterday on, for clocks that go behind.
fn valid_for(days: u32) -> CertificateParams {
    let now = SystemTime::now();
    let mut params = CertificateParams::default();
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.not_before = (now - DAY).into();
    params.not_after = (now + DAY * days).into();
    params
}

/// Writes a new file; a key for its owner alone.
fn write(file: &Path, pem: &str) -> Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    if file.extension().is_some_and(|e| e == "key") {
        use std::os::unix::fs::OpenOptionsExt;
        options.mode(0o600);
    }
    let written = options
        .open(file)
        .and_then(|mut open| open.write_all(pem.as_bytes()));
    written.map_err(|source| Error::CertWrite {
        file: file.to_owned(),
        source,
    })
}

fn explain(args: &Certs) {
    let dir = args.directory.display();
    let tls = |role| {
        format!("--tls-ca {dir}/ca.pem --tls-cert {dir}/{role}.pem --tls-key {dir}/{role}.key")
    };
    say(&format!(
        "\
A test authority and certificates for {} days are in {dir}: fit for tests and small private networks.

Give ca.pem to everybody, and to each machine the certificate and key of its role and no other:
  horma master --bind 10.0.0.1:7171 {}
  horma worker --master 10.0.0.1:7171 --bind 0.0.0.0:0 {}
  horma submit job.toml --master 10.0.0.1:7171 -o out {}

Whoever has ca.key can make certificates: keep it away from the cluster, or delete it. Nothing can be
revoked; to shut somebody out, make a new authority.",
        args.days,
        tls(Role::Master),
        tls(Role::Worker),
        tls(Role::Client),
    ));
}
