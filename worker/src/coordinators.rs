//! The coordinators of a worker. Each call goes to a coordinator that responds.

use crate::backoff::Backoff;
use crate::config::Config;
use crate::connection::{Client, connect};
use crate::counters::Counters;
use crate::error::AgentError;
use parking_lot::Mutex;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Response, Status};

/// Interval between two warnings about a coordinator that does not respond.
const WARN_EVERY: Duration = Duration::from_mins(1);

/// The coordinators of a worker. All of them serve the same library, so each of them can take any call.
pub(crate) struct Coordinators {
    known: Vec<(String, Client)>,
    /// Index of the coordinator that responded last, or of the next one to call.
    current: AtomicUsize,
    contact: Mutex<Contact>,
    /// Time limit of retrying; unlimited if `None`.
    patience: Option<Duration>,
    backoff: Backoff,
    /// After cancellation there are no more retries.
    give_up: CancellationToken,
    counters: Arc<Counters>,
}

/// Times of the last responses and warnings.
struct Contact {
    answered: Instant,
    warned: Option<Instant>,
}

impl Coordinators {
    pub(crate) fn new(config: &Config, give_up: CancellationToken) -> Result<Self, AgentError> {
        let line =
            |url: &String| Ok((url.clone(), connect(url, &config.credentials, config.seams.dial)?));
        let known = config.coordinators.iter().map(line).collect::<Result<Vec<_>, AgentError>>()?;
        if known.is_empty() {
            return Err(AgentError::NoCoordinator);
        }
        Ok(Self {
            known,
            current: AtomicUsize::new(0),
            contact: Mutex::new(Contact { answered: Instant::now(), warned: None }),
            patience: config.give_up_after,
            backoff: Backoff::of(&config.worker),
            give_up,
            counters: config.counters.clone(),
        })
    }

    /// Repeats a call until a coordinator responds or rejects it. `None` if `end` is cancelled before.
    ///
    /// A call in progress is always completed, because the worker must know the leased cases to return
    /// them.
    pub(crate) async fn ask<T, F>(
        &self,
        end: &CancellationToken,
        call: impl Fn(Client) -> F,
    ) -> Result<Option<T>, AgentError>
    where
        F: Future<Output = Result<Response<T>, Status>>,
    {
        let mut backoff = self.backoff;
        while !end.is_cancelled() {
            let answer = tokio::select! {
                answer = self.once(&call) => answer,
                () = self.give_up.cancelled() => return Ok(None),
            };
            let status = match answer {
                Ok(answer) => return Ok(Some(answer)),
                Err(status) => status,
            };
            match status.code() {
                Code::Unauthenticated => return Err(AgentError::Unknown),
                Code::InvalidArgument => {
                    return Err(AgentError::NotUnderstood { reason: status.message().to_owned() });
                }
                Code::FailedPrecondition
                | Code::OutOfRange
                | Code::PermissionDenied
                | Code::Unimplemented => {
                    return Err(AgentError::Refused { reason: status.message().to_owned() });
                }
                _ => self.out_of_patience(&status)?,
            }
            tokio::select! {
                () = tokio::time::sleep(backoff.next()) => {}
                () = end.cancelled() => {}
            }
        }
        Ok(None)
    }

    /// Makes one call to the current coordinator. If it cannot be reached, the next coordinator becomes
    /// the current one.
    pub(crate) async fn once<T, F>(&self, call: impl Fn(Client) -> F) -> Result<T, Status>
    where
        F: Future<Output = Result<Response<T>, Status>>,
    {
        let index = self.current.load(Ordering::Relaxed);
        let (url, client) = &self.known[index];
        let answer = call(client.clone()).await;
        match &answer {
            Err(status) if is_silence(status.code()) => {
                self.counters.silent_calls.inc();
                self.warn(url, status);
                let next = (index + 1) % self.known.len();
                // Another task may have moved on already.
                let _ = self.current.compare_exchange(
                    index,
                    next,
                    Ordering::Relaxed,
                    Ordering::Relaxed,
                );
            }
            _ => self.record_answer(url),
        }
        answer.map(Response::into_inner)
    }

    /// Time since the last response of a coordinator.
    pub(crate) fn silent_for(&self) -> Duration {
        self.contact.lock().answered.elapsed()
    }

    fn record_answer(&self, url: &str) {
        let mut contact = self.contact.lock();
        contact.answered = Instant::now();
        if contact.warned.take().is_some() {
            tracing::warn!(coordinator = url, "the coordinator responds again");
        }
        self.counters.answered_calls.inc();
    }

    fn warn(&self, url: &str, status: &Status) {
        let mut contact = self.contact.lock();
        if contact.warned.is_none_or(|warned| warned.elapsed() >= WARN_EVERY) {
            contact.warned = Some(Instant::now());
            let reason = reason(url, status);
            tracing::warn!(coordinator = url, "the coordinator does not respond: {reason}");
        }
    }

    fn out_of_patience(&self, status: &Status) -> Result<(), AgentError> {
        let silent = self.silent_for();
        match self.patience {
            Some(patience) if silent >= patience => {
                let (url, _) = &self.known[self.current.load(Ordering::Relaxed)];
                let reason = reason(url, status);
                Err(AgentError::GaveUp { silent_s: silent.as_secs(), reason })
            }
            _ => Ok(()),
        }
    }
}

/// Whether a call failed without a response.
const fn is_silence(code: Code) -> bool {
    matches!(
        code,
        Code::Unavailable
            | Code::Unknown
            | Code::DeadlineExceeded
            | Code::Cancelled
            | Code::Internal
            | Code::Aborted
            | Code::DataLoss
    )
}

/// The failure with a possible remedy: TLS reports little if a connection breaks early.
fn reason(url: &str, status: &Status) -> String {
    let reason = chain(status);
    let tls = url.starts_with("https:");
    let says = |words: &[&str]| words.iter().any(|it| reason.contains(it));
    // Authorities that `tracktwin certs` makes have one name: of another one's certificate the
    // signature is wrong.
    let remedy = if says(&["UnknownIssuer", "BadSignature"]) {
        "; its certificate is not signed by the authority of --tls-ca"
    } else if tls && says(&["CertificateRequired", "connection closed", "broken pipe"]) {
        "; it may require a certificate: use --tls-cert and --tls-key"
    } else if tls && says(&["InvalidContentType"]) {
        "; it may use plain text: try http://"
    } else if tls && says(&["Connection reset"]) {
        "; it may use plain text, http://, or require a certificate: use --tls-cert and --tls-key"
    } else if says(&["frame with invalid size", "broken pipe", "connection closed"]) {
        "; it may use TLS: try https://"
    } else if says(&["compression flag"]) {
        "; this may be the port of its dashboard"
    } else {
        ""
    };
    format!("{reason}{remedy}")
}

/// What failed and why, in one line: a failed connection hides its reason in its sources.
fn chain(status: &Status) -> String {
    let mut text = status.message().to_owned();
    let mut source = status.source();
    while let Some(error) = source {
        let reason = error.to_string();
        if !text.contains(&reason) {
            text = format!("{text}: {reason}");
        }
        source = error.source();
    }
    text
}
