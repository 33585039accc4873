//! Credentials of a worker, and checks of its coordinator.

use std::net::IpAddr;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::transport::{Certificate, ClientTlsConfig, Identity, Uri};
use tonic::{Request, Status};

/// Credentials between worker and coordinator. Empty if both run on one machine.
#[derive(Clone, Debug, Default)]
pub struct Credentials {
    /// Token of the farm.
    pub token: Option<Token>,
    /// Certificate of the certificate authority of the coordinators (PEM), for `https` addresses.
    pub ca_pem: Option<Vec<u8>>,
    /// Certificate and key of the worker (PEM), if the coordinator requires them.
    pub identity_pem: Option<[Vec<u8>; 2]>,
    /// Whether plain-text connections to other machines are allowed.
    pub insecure: bool,
}

/// A secret that the workers of a farm share with its coordinators.
#[derive(Clone)]
pub struct Token(MetadataValue<Ascii>);

/// Errors of an address or a token, each with the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CredentialsError {
    /// The token contains characters that are not allowed in headers.
    #[error(
        "the token contains characters other than visible ASCII; create one with `tracktwin \
             certs`"
    )]
    Token,
    /// The address would send plain text over a network.
    #[error(
        "coordinator {url}: plain text over a network is not allowed; use https:// and \
             --tls-ca, or --insecure on a trusted network"
    )]
    PlainText {
        /// The address.
        url: String,
    },
    /// There is no certificate authority to check the certificate of the coordinator.
    #[error("coordinator {url}: https needs --tls-ca with the ca.pem made by `tracktwin certs`")]
    NoAuthority {
        /// The address.
        url: String,
    },
    /// The file of the certificate authority does not contain a certificate.
    #[error("--tls-ca: the file contains no certificate; use the ca.pem made by `tracktwin certs`")]
    NoCertificate,
    /// The address is neither `http` nor `https`.
    #[error("coordinator {url}: not an address; write http://HOST:PORT or https://HOST:PORT")]
    Address {
        /// The address.
        url: String,
    },
}

impl Token {
    /// Reads a token from a text, without white space at both ends.
    ///
    /// # Errors
    /// [`CredentialsError::Token`] if the token is empty or not visible ASCII.
    pub fn new(text: &str) -> Result<Self, CredentialsError> {
        let text = text.trim();
        let visible = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_graphic());
        let header = format!("Bearer {text}").parse().ok().filter(|_| visible);
        header.map(Self).ok_or(CredentialsError::Token)
    }
}

impl std::fmt::Debug for Token {
    /// A secret does not belong in logs.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token")
    }
}

impl Credentials {
    /// The TLS settings for an address. `None` for plain text.
    ///
    /// # Errors
    /// [`CredentialsError`] if address and credentials are inconsistent.
    pub(crate) fn tls_for(&self, url: &str) -> Result<Option<ClientTlsConfig>, CredentialsError> {
        let address = || CredentialsError::Address { url: url.to_owned() };
        let uri: Uri = url.parse().map_err(|_| address())?;
        let host = uri.host().ok_or_else(address)?;
        match uri.scheme_str() {
            Some("http") if self.insecure || is_loopback(host) => Ok(None),
            Some("http") => Err(CredentialsError::PlainText { url: url.to_owned() }),
            Some("https") => {
                let ca = self.ca_pem.as_ref();
                let ca = ca.ok_or_else(|| CredentialsError::NoAuthority { url: url.to_owned() })?;
                if !String::from_utf8_lossy(ca).contains("-----BEGIN CERTIFICATE-----") {
                    return Err(CredentialsError::NoCertificate);
                }
                let tls = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(ca));
                Ok(Some(match &self.identity_pem {
                    Some([certificate, key]) => tls.identity(Identity::from_pem(certificate, key)),
                    None => tls,
                }))
            }
            _ => Err(address()),
        }
    }
}

/// Whether a host is this machine, without name resolution.
fn is_loopback(host: &str) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Adds the token to every call.
#[derive(Clone, Debug)]
pub(crate) struct Bearer(pub(crate) Option<Token>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(Token(header)) = &self.0 {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_stays_on_this_machine_unless_the_network_is_trusted() {
        let careful = Credentials::default();
        for url in ["http://127.0.0.1:7000", "http://localhost:7000", "http://[::1]:7000"] {
            assert!(careful.tls_for(url).is_ok(), "{url}");
        }
        let error = careful.tls_for("http://node7:7000").unwrap_err();
        assert!(error.to_string().contains("--insecure"), "{error}");
        let trusting = Credentials { insecure: true, ..careful };
        assert!(trusting.tls_for("http://node7:7000").is_ok());
    }

    #[test]
    fn what_cannot_be_called_is_refused_with_what_to_write() {
        let careful = Credentials::default();
        for url in ["node7:7000", "ftp://node7", "", "http://"] {
            let error = careful.tls_for(url).unwrap_err();
            assert!(matches!(error, CredentialsError::Address { .. }), "{url}: {error}");
        }
        let error = careful.tls_for("https://node7:7000").unwrap_err();
        assert!(matches!(error, CredentialsError::NoAuthority { .. }), "{error}");
        let token = Credentials { ca_pem: Some(b"a token".to_vec()), ..careful };
        let error = token.tls_for("https://node7:7000").unwrap_err();
        assert_eq!(error, CredentialsError::NoCertificate);
    }

    #[test]
    fn a_token_is_visible_ascii_and_not_shown() {
        assert_eq!(Token::new("a b").unwrap_err(), CredentialsError::Token);
        assert_eq!(Token::new(" \n").unwrap_err(), CredentialsError::Token);
        assert_eq!(format!("{:?}", Token::new("s3cret\n").unwrap()), "Token");
    }
}
