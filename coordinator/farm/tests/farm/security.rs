//! Certificates, tokens, and invalid data from unknown callers.

use crate::support::{CORES, Coordinator, coordinator, coordinator_with, stand_in};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;
use time::OffsetDateTime;
use tokio_util::sync::CancellationToken;
use tracktwin_farm::dispatch::Settings;
use tracktwin_farm::security::{Security, issue};
use tracktwin_worker::agent::{self, AgentError, Config};
use tracktwin_worker::{Credentials, Token};

/// Creates a folder of certificates for this machine, issued at `now` and valid for a day.
fn certificates(now: OffsetDateTime) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    issue(folder.path(), &["127.0.0.1".to_owned()], 1, now, false).unwrap();
    folder
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

fn pair(folder: &Path, name: &str) -> [Vec<u8>; 2] {
    [read(folder, &format!("{name}.pem")), read(folder, &format!("{name}-key.pem"))]
}

fn token(folder: &Path) -> String {
    String::from_utf8(read(folder, "token")).unwrap()
}

/// A coordinator with TLS that requires the token.
async fn guarded(folder: &Path) -> Coordinator {
    let security = Security {
        identity_pem: Some(pair(folder, "coordinator")),
        token: Some(token(folder)),
        ..Security::default()
    };
    coordinator_with(Settings { prepare: stand_in, ..Settings::default() }, security, 20).await
}

/// Runs a worker until there are no more cases, or until the worker fails or gives up.
async fn work(coordinator: &Coordinator, credentials: Credentials) -> Result<(), AgentError> {
    work_at(coordinator.url.clone(), credentials).await
}

async fn work_at(url: String, credentials: Credentials) -> Result<(), AgentError> {
    let config = Config {
        prepare: stand_in,
        credentials,
        idle_exit: Some(Duration::from_millis(300)),
        give_up_after: Some(Duration::from_millis(600)),
        ..Config::new(url, CORES)
    };
    let run = agent::run(config, CancellationToken::new());
    tokio::time::timeout(Duration::from_secs(20), run).await.unwrap()
}

async fn finished(coordinator: &Coordinator) -> u32 {
    coordinator.library.status(&coordinator.campaign.id()).await.unwrap().finished
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn with_certificate_and_token_a_worker_works() {
    let certificates = certificates(OffsetDateTime::now_utc());
    let folder = certificates.path();
    let coordinator = guarded(folder).await;
    let credentials = Credentials {
        token: Some(Token::new(&token(folder)).unwrap()),
        ca_pem: Some(read(folder, "ca.pem")),
        ..Credentials::default()
    };
    work(&coordinator, credentials).await.unwrap();
    assert_eq!(finished(&coordinator).await, 20);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_wrong_token_or_none_is_refused_at_once_and_the_worker_ends() {
    let certificates = certificates(OffsetDateTime::now_utc());
    let folder = certificates.path();
    let coordinator = guarded(folder).await;
    for token in [None, Some(Token::new("guessed").unwrap())] {
        let credentials =
            Credentials { token, ca_pem: Some(read(folder, "ca.pem")), ..Credentials::default() };
        let error = work(&coordinator, credentials).await.unwrap_err();
        assert!(matches!(&error, AgentError::Refused { reason } if reason.contains("token")));
        assert!(!error.may_pass());
    }
    assert_eq!(finished(&coordinator).await, 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_coordinator_of_another_authority_or_with_an_expired_certificate_gets_nothing() {
    let now = OffsetDateTime::now_utc();
    let ours = certificates(now);
    let others = certificates(now);
    let expired = certificates(now - time::Duration::days(3));
    for (shown, trusted, fault) in [
        (&others, &ours, "not signed by the authority of --tls-ca"),
        (&expired, &expired, "expired"),
    ] {
        let coordinator = guarded(shown.path()).await;
        let credentials = Credentials {
            token: Some(Token::new(&token(shown.path())).unwrap()),
            ca_pem: Some(read(trusted.path(), "ca.pem")),
            ..Credentials::default()
        };
        let error = work(&coordinator, credentials).await.unwrap_err();
        assert!(error.to_string().contains(fault), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn where_workers_need_a_certificate_only_those_of_the_authority_are_let_in() {
    let now = OffsetDateTime::now_utc();
    let (ours, others) = (certificates(now), certificates(now));
    let folder = ours.path();
    let security = Security {
        identity_pem: Some(pair(folder, "coordinator")),
        client_ca_pem: Some(read(folder, "ca.pem")),
        ..Security::default()
    };
    let settings = Settings { prepare: stand_in, ..Settings::default() };
    let coordinator = coordinator_with(settings, security, 20).await;
    let credentials = |identity_pem| Credentials {
        ca_pem: Some(read(folder, "ca.pem")),
        identity_pem,
        ..Credentials::default()
    };
    for (stranger, hint) in [(None, "--tls-cert"), (Some(pair(others.path(), "worker")), "")] {
        let error = work(&coordinator, credentials(stranger)).await.unwrap_err();
        let gave_up = |reason: &str| reason.contains(hint);
        assert!(matches!(&error, AgentError::GaveUp { reason, .. } if gave_up(reason)), "{error}");
    }
    assert_eq!(finished(&coordinator).await, 0);
    work(&coordinator, credentials(Some(pair(folder, "worker")))).await.unwrap();
    assert_eq!(finished(&coordinator).await, 20);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_speaks_tls_to_plain_text_or_the_other_way_round_is_told_so() {
    let certificates = certificates(OffsetDateTime::now_utc());
    let folder = certificates.path();
    let credentials =
        || Credentials { ca_pem: Some(read(folder, "ca.pem")), ..Credentials::default() };
    let (plain, guarded) = (coordinator().await, guarded(folder).await);
    let as_tls = work_at(plain.url.replace("http:", "https:"), credentials()).await;
    let as_plain = work_at(guarded.url.replace("https:", "http:"), Credentials::default()).await;
    for (answer, hint) in [(as_tls, "may use plain text"), (as_plain, "may use TLS: try https://")]
    {
        let error = answer.unwrap_err().to_string();
        assert!(error.contains(hint), "{error}");
    }
}

#[test]
fn certificates_can_be_renewed_without_touching_authority_and_token() {
    use std::os::unix::fs::PermissionsExt;
    let now = OffsetDateTime::now_utc();
    let certificates = certificates(now);
    let folder = certificates.path();
    let names = ["ca.pem", "ca-key.pem", "token", "coordinator.pem"];
    let before = names.map(|name| read(folder, name));
    issue(folder, &["head".to_owned()], 30, now, false).unwrap();
    let after = names.map(|name| read(folder, name));
    assert_eq!(before[..3], after[..3]);
    assert_ne!(before[3], after[3]);
    for secret in ["ca-key.pem", "coordinator-key.pem", "worker-key.pem", "token"] {
        let mode = std::fs::metadata(folder.join(secret)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{secret}");
    }
}

/// Data that are not a valid request; some begin like one.
fn garbage() -> Vec<Vec<u8>> {
    let preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_vec();
    let mut noise = Vec::new();
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    for _ in 0..4096 {
        // xorshift64: noise that is the same every time.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        noise.push((state >> 32) as u8);
    }
    let with = |tail: &[u8]| [&preface[..], tail].concat();
    // A frame of 16 MiB that never comes; a truncated SETTINGS frame.
    let huge = with(&[0xff, 0xff, 0xff, 0, 0, 0, 0, 0, 1]);
    let cut = with(&[0, 0, 12, 4]);
    let mut all: Vec<Vec<u8>> = noise.chunks(64).map(<[u8]>::to_vec).collect();
    all.extend(noise.chunks(64).map(with));
    all.extend([b"GET / HTTP/1.1\r\n\r\n".to_vec(), preface, huge, cut, Vec::new(), noise]);
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn garbage_on_the_port_is_turned_away_and_workers_go_on_working() {
    let plain = coordinator_with(
        Settings { prepare: stand_in, ..Settings::default() },
        Security::default(),
        20,
    )
    .await;
    let certificates = certificates(OffsetDateTime::now_utc());
    let guarded = guarded(certificates.path()).await;
    for coordinator in [&plain, &guarded] {
        let address = coordinator.url.split_once("://").unwrap().1.to_owned();
        tokio::task::spawn_blocking(move || {
            for bytes in garbage() {
                let mut stream = TcpStream::connect(&address).unwrap();
                stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
                // It may be turned away before everything is written.
                let _ = stream.write_all(&bytes);
                let _ = stream.read(&mut [0; 256]);
            }
        })
        .await
        .unwrap();
    }
    work(&plain, Credentials::default()).await.unwrap();
    assert_eq!(finished(&plain).await, 20);
    let credentials = Credentials {
        token: Some(Token::new(&token(certificates.path())).unwrap()),
        ca_pem: Some(read(certificates.path(), "ca.pem")),
        ..Credentials::default()
    };
    work(&guarded, credentials).await.unwrap();
    assert_eq!(finished(&guarded).await, 20);
}
