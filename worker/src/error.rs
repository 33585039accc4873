//! Errors that end a worker.

use crate::credentials::CredentialsError;
use tracktwin_experiment::ExperimentError;
use tracktwin_protocol::BadMessage;

/// Errors that end a worker.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// No address of a coordinator was given.
    #[error("no coordinator; use --coordinator URL")]
    NoCoordinator,
    /// An address or its certificates are invalid.
    #[error("coordinator {url}: cannot connect")]
    Address {
        /// The address.
        url: String,
        /// Error of the address or the certificates.
        source: tonic::transport::Error,
    },
    /// Address and credentials are inconsistent.
    #[error(transparent)]
    Credentials(#[from] CredentialsError),
    /// The coordinator rejects the worker.
    #[error("refused by the coordinator: {reason}")]
    Refused {
        /// Reason of the coordinator.
        reason: String,
    },
    /// The coordinator rejects the messages of the worker.
    #[error("the coordinator rejects the messages of this worker: {reason}")]
    NotUnderstood {
        /// Reason of the coordinator.
        reason: String,
    },
    /// No coordinator has responded within the configured time.
    #[error("no response from a coordinator for {silent_s} s: {reason}")]
    GaveUp {
        /// Time without a response in s.
        silent_s: u64,
        /// Result of the last attempt.
        reason: String,
    },
    /// The coordinator has no registration of the worker (any more).
    #[error("the coordinator does not know this worker")]
    Unknown,
    /// The coordinator sent an invalid message.
    #[error("invalid message from the coordinator: {0}")]
    BadMessage(#[from] BadMessage),
    /// The experiment is not possible.
    #[error("cannot simulate the campaign's experiment: {0}")]
    Experiment(#[from] ExperimentError),
    /// The hash of the experiment does not match.
    #[error("the campaign's experiment does not match its hash")]
    ExperimentHash,
}

impl AgentError {
    /// Whether the worker may succeed after a restart.
    pub const fn may_pass(&self) -> bool {
        matches!(self, Self::GaveUp { .. })
    }
}
