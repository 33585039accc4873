//! Certificates and token of a coordinator.

use std::net::SocketAddr;
use std::sync::Arc;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::server::{VerifierBuilderError, WebPkiClientVerifier};
use tokio_rustls::rustls::{self, RootCertStore, ServerConfig};

/// The protocol inside TLS.
pub(crate) const HTTP2: &[u8] = b"h2";

/// Certificates and token of a coordinator; all empty if it serves this machine only.
#[derive(Clone, Debug, Default)]
pub struct Security {
    /// Certificate chain and private key of the coordinator (PEM).
    pub identity_pem: Option<[Vec<u8>; 2]>,
    /// Certificate of the authority that must have signed the certificates of workers (PEM).
    pub client_ca_pem: Option<Vec<u8>>,
    /// Token that workers must send.
    pub token: Option<String>,
    /// Whether plain text and calls without a token are allowed from other machines, on a trusted network.
    pub insecure: bool,
}

/// Reasons for not opening a port. Each message has the remedy.
#[derive(Debug, thiserror::Error)]
pub enum SecurityError {
    /// The port is reachable from other machines and has no certificate.
    #[error(
        "{address} is reachable from other machines, but has no certificate; create one \
             with `tracktwin certs` and use --tls-cert and --tls-key, or use --insecure on a \
             trusted network"
    )]
    PlainText {
        /// Address of the port.
        address: SocketAddr,
    },
    /// The port is reachable from other machines and requires neither token nor certificate.
    #[error(
        "{address} is reachable from other machines, but requires no token; use \
             --token-file or worker certificates (--tls-client-ca), or --insecure on a trusted \
             network"
    )]
    Anybody {
        /// Address of the port.
        address: SocketAddr,
    },
    /// A file is not a PEM file with the expected content.
    #[error("{what}: not a valid PEM file ({source}); create one with `tracktwin certs`")]
    Pem {
        /// Expected content.
        what: &'static str,
        /// Cause.
        source: pem::Error,
    },
    /// Certificate and key do not belong together, or cannot be used.
    #[error(
        "the certificate cannot be used ({0}); check that certificate and key belong together, or \
             create both with `tracktwin certs`"
    )]
    Tls(#[from] rustls::Error),
    /// The certificate of the authority cannot be used.
    #[error(
        "--tls-client-ca: the authority cannot be used ({0}); give the ca.pem of `tracktwin certs`"
    )]
    Authority(#[from] VerifierBuilderError),
}

impl Security {
    /// Checks that a port at this address would be protected.
    ///
    /// # Errors
    /// Returns [`SecurityError`] with the missing protection.
    pub fn check(&self, address: SocketAddr) -> Result<(), SecurityError> {
        if address.ip().is_loopback() || self.insecure {
            return Ok(());
        }
        if self.identity_pem.is_none() {
            return Err(SecurityError::PlainText { address });
        }
        if self.token.is_none() && self.client_ca_pem.is_none() {
            return Err(SecurityError::Anybody { address });
        }
        Ok(())
    }

    /// Creates the TLS acceptor; `None` for plain text.
    ///
    /// # Errors
    /// Returns [`SecurityError`] if the certificates cannot be used.
    pub fn acceptor(&self) -> Result<Option<TlsAcceptor>, SecurityError> {
        let Some([certificate, key]) = &self.identity_pem else { return Ok(None) };
        let key = PrivateKeyDer::from_pem_slice(key)
            .map_err(|source| SecurityError::Pem { what: "--tls-key", source })?;
        let provider = Arc::new(ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider.clone())
            .with_safe_default_protocol_versions()?;
        let config = match &self.client_ca_pem {
            None => config.with_no_client_auth(),
            Some(ca) => {
                let mut authorities = RootCertStore::empty();
                for certificate in certificates("--tls-client-ca", ca)? {
                    authorities.add(certificate)?;
                }
                let verifier =
                    WebPkiClientVerifier::builder_with_provider(authorities.into(), provider);
                config.with_client_cert_verifier(verifier.build()?)
            }
        };
        let mut config = config.with_single_cert(certificates("--tls-cert", certificate)?, key)?;
        config.alpn_protocols = vec![HTTP2.to_vec()];
        Ok(Some(TlsAcceptor::from(Arc::new(config))))
    }
}

fn certificates(
    what: &'static str,
    text: &[u8],
) -> Result<Vec<CertificateDer<'static>>, SecurityError> {
    let all = CertificateDer::pem_slice_iter(text).collect::<Result<Vec<_>, _>>();
    let none = Err(pem::Error::NoItemsFound);
    let all = all.and_then(|all| if all.is_empty() { none } else { Ok(all) });
    all.map_err(|source| SecurityError::Pem { what, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reachable() -> SocketAddr {
        "10.0.0.7:7700".parse().unwrap()
    }

    #[test]
    fn a_port_that_others_reach_needs_a_certificate_and_a_demand() {
        let open = Security::default();
        assert!(open.check("127.0.0.1:7700".parse().unwrap()).is_ok());
        assert!(open.check("[::1]:7700".parse().unwrap()).is_ok());
        let error = open.check(reachable()).unwrap_err().to_string();
        assert!(error.contains("--tls-cert") && error.contains("--insecure"), "{error}");

        let certified =
            Security { identity_pem: Some([Vec::new(), Vec::new()]), ..Security::default() };
        let error = certified.check(reachable()).unwrap_err().to_string();
        assert!(error.contains("--token-file") && error.contains("--tls-client-ca"), "{error}");

        let token = Security { token: Some("t".to_owned()), ..certified };
        assert!(token.check(reachable()).is_ok());
        assert!(Security { insecure: true, ..open }.check(reachable()).is_ok());
    }

    #[test]
    fn files_that_hold_no_certificate_are_refused_by_their_argument() {
        let security =
            Security { identity_pem: Some([b"x".to_vec(), b"y".to_vec()]), ..Security::default() };
        let Err(error) = security.acceptor() else { panic!("it takes anything") };
        assert!(error.to_string().starts_with("--tls-key"), "{error}");
    }
}
