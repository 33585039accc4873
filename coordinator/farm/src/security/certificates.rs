//! Certificate authority and certificates of a farm.

use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose,
};
use std::fs::File;
use std::hash::{BuildHasher, RandomState};
use std::io::Read;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use time::{Duration, OffsetDateTime};
use tracktwin_files::{FileName, FilesError, Kind, Output};

/// Validity of the authority in days.
const AUTHORITY_DAYS: i64 = 3650;

/// Tolerance for the differences between the clocks of a cluster.
const CLOCKS: Duration = Duration::hours(1);

/// Name of the authority.
const AUTHORITY: &str = "tracktwin farm";

/// Number of random bytes in a token.
const TOKEN_BYTES: usize = 32;

/// Reasons for not creating certificates.
#[derive(Debug, thiserror::Error)]
pub enum CertificatesError {
    /// The folder, or a file in it, can't be read.
    #[error("cannot read {path}: {source}")]
    File {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file cannot be written, or exists already.
    #[error("{0}")]
    Files(#[from] FilesError),
    /// The name of a host is not a valid host name or address.
    #[error(
        "{host:?} is not a host; write a name such as head.cluster or an address such as \
             10.0.0.1"
    )]
    Host {
        /// The given name.
        host: String,
    },
    /// A name that is not allowed in certificates, or an invalid key.
    #[error("cannot create a certificate: {0}")]
    Certificate(#[from] rcgen::Error),
}

/// Writes the authority, the certificates and the token of a farm into a folder.
///
/// An existing authority and an existing token are kept. Certificates can therefore be renewed, or created
/// for further hosts, without changes on the other machines. Other existing files are replaced only with
/// `force`.
///
/// | file | needed by |
/// |---|---|
/// | `ca.pem` | all machines |
/// | `ca-key.pem` | only the machine on which certificates are created |
/// | `coordinator.pem`, `coordinator-key.pem` | coordinators; valid for `hosts` |
/// | `worker.pem`, `worker-key.pem` | workers |
/// | `token` | all machines |
///
/// # Errors
/// Returns [`CertificatesError`] if a file cannot be written or the name of a host is invalid.
pub fn issue(
    folder: &Path,
    hosts: &[String],
    days: u32,
    now: OffsetDateTime,
    force: bool,
) -> Result<(), CertificatesError> {
    let is_host = |host: &str| {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "-_.*".contains(c);
        host.parse::<IpAddr>().is_ok() || (!host.is_empty() && host.chars().all(is_name))
    };
    if let Some(wrong) = hosts.iter().find(|host| !is_host(host)) {
        return Err(CertificatesError::Host { host: wrong.clone() });
    }
    let mut output = Output::begin(folder, Kind::Certificates, force)?;
    let authority = authority(folder, now, &mut output)?;
    let end = now + Duration::days(i64::from(days));
    let coordinator = leaf("tracktwin coordinator", hosts, ExtendedKeyUsagePurpose::ServerAuth);
    let worker = leaf("tracktwin worker", &[], ExtendedKeyUsagePurpose::ClientAuth);
    for (name, params) in [("coordinator", coordinator?), ("worker", worker?)] {
        let mut params = params;
        (params.not_before, params.not_after) = (now - CLOCKS, end);
        let key = KeyPair::generate()?;
        let certificate = params.signed_by(&key, &authority)?;
        let name = FileName::new(name)?;
        output.add_secret(
            &FileName::new(&format!("{name}-key.pem"))?,
            key.serialize_pem().as_bytes(),
        )?;
        output.add(&name.with_ending("pem"), certificate.pem().as_bytes())?;
    }
    let token = folder.join("token");
    if !token.try_exists().map_err(at(&token))? {
        let text = format!("{}\n", random_token().map_err(at(&token))?);
        output.add_secret(&FileName::new("token")?, text.as_bytes())?;
    }
    Ok(output.commit()?)
}

/// Reads the authority in the folder, or creates a new one.
fn authority(
    folder: &Path,
    now: OffsetDateTime,
    output: &mut Output,
) -> Result<Issuer<'static, KeyPair>, CertificatesError> {
    let mut params = CertificateParams::default();
    params.distinguished_name = named(AUTHORITY);
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    (params.not_before, params.not_after) = (now - CLOCKS, now + Duration::days(AUTHORITY_DAYS));
    let key_path = folder.join("ca-key.pem");
    // The issuer's name and key are all that a certificate takes from its authority.
    if key_path.try_exists().map_err(at(&key_path))? {
        let key = std::fs::read_to_string(&key_path).map_err(at(&key_path))?;
        return Ok(Issuer::new(params, KeyPair::from_pem(&key)?));
    }
    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?;
    output.add(&FileName::new("ca.pem")?, certificate.pem().as_bytes())?;
    output.add_secret(&FileName::new("ca-key.pem")?, key.serialize_pem().as_bytes())?;
    Ok(Issuer::new(params, key))
}

fn leaf(
    name: &str,
    hosts: &[String],
    purpose: ExtendedKeyUsagePurpose,
) -> Result<CertificateParams, rcgen::Error> {
    let mut params = CertificateParams::new(hosts)?;
    params.distinguished_name = named(name);
    params.extended_key_usages = vec![purpose];
    params.use_authority_key_identifier_extension = true;
    Ok(params)
}

fn named(name: &str) -> DistinguishedName {
    let mut full = DistinguishedName::new();
    full.push(DnType::CommonName, name);
    full
}

/// Returns a random token of 256 bits, in hexadecimal.
pub(crate) fn random_token() -> std::io::Result<blake3::Hash> {
    let mut chance = [0; TOKEN_BYTES];
    File::open("/dev/urandom")?.read_exact(&mut chance)?;
    // A second source costs nothing.
    let more = RandomState::new().hash_one(()).to_le_bytes();
    Ok(blake3::Hasher::new().update(&chance).update(&more).finalize())
}

fn at(path: &Path) -> impl Fn(std::io::Error) -> CertificatesError {
    let path = path.to_owned();
    move |source| CertificatesError::File { path: path.clone(), source }
}
