//! Errors that end a worker.

use crate::credentials::CredentialsError;
use tracktwin_experiment::ExperimentError;
use tracktwin_protocol::BadMessage;

/// Errors that end a worker.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// No address at all.
    #[error("no coordinator; use --coordinator URL")]
    NoCoordinator,
    /// The address or the certificates can't be used.
    #[error("coordinator {url}: cannot connect")]
    Address {
        /// The address.
        url: String,
        /// What is wrong with it.
        source: tonic::transport::Error,
    },
    /// Address and credentials don't go together.
    #[error(transparent)]
    Credentials(#[from] CredentialsError),
    /// The coordinator refuses the worker or its message.
    #[error("refused by the coordinator: {reason}")]
    Refused {
        /// Why.
        reason: String,
    },
    /// The coordinator rejects the messages of the worker.
    #[error("the coordinator rejects the messages of this worker: {reason}")]
    NotUnderstood {
        /// Its reason.
        reason: String,
    },
    /// No coordinator has answered for longer than was asked for.
    #[error("no response from a coordinator for {silent_s} s: {reason}")]
    GaveUp {
        /// For how long, in s.
        silent_s: u64,
        /// Result of the last attempt.
        reason: String,
    },
    /// The coordinator does not know the worker (any more).
    #[error("the coordinator does not know this worker")]
    Unknown,
    /// The coordinator sends an invalid message.
    #[error("invalid message from the coordinator: {0}")]
    BadMessage(#[from] BadMessage),
    /// The experiment can't be done here.
    #[error("cannot simulate the campaign's experiment: {0}")]
    Experiment(#[from] ExperimentError),
    /// The experiment is not the one whose hash came with it.
    #[error("the campaign's experiment does not match its hash")]
    ExperimentHash,
}

impl AgentError {
    /// Whether the same worker might succeed when it is started again.
    pub const fn may_pass(&self) -> bool {
        matches!(self, Self::GaveUp { .. })
    }
}
