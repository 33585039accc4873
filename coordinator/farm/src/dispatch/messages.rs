//! Conversion between messages and values of the library.

use tonic::Status;
use tracktwin_experiment::{CODE_VERSION, MODEL_HASH};
use tracktwin_library::{Held, ReportVerdict};
use tracktwin_protocol::{BadMessage, PROTOCOL_VERSION, Registration, farm, held_from_messages};

/// Reason why a worker is incompatible with this coordinator, with the remedy; `None` if it is compatible.
pub(crate) fn incompatibility(registration: &Registration) -> Option<String> {
    let Registration { worker, code_version, model_hash, protocol_version, .. } = registration;
    if *protocol_version != PROTOCOL_VERSION {
        let remedy = if *protocol_version < PROTOCOL_VERSION {
            "update the worker to the coordinator's version"
        } else {
            "install the coordinator's version on the worker, or update the coordinator"
        };
        return Some(format!(
            "worker {worker} (version {code_version}) uses protocol {protocol_version}, this \
                 coordinator (version {CODE_VERSION}) uses {PROTOCOL_VERSION}: {remedy}"
        ));
    }
    (model_hash != MODEL_HASH).then(|| {
        format!(
            "worker {worker} simulates other physics than this coordinator: its model hash is \
                 {model_hash} (version {code_version}), the coordinator's is {MODEL_HASH} (version \
                 {CODE_VERSION}); install the coordinator's version"
        )
    })
}

pub(crate) fn held(messages: Vec<farm::HeldCase>) -> Result<Vec<Held>, Status> {
    let held = held_from_messages(messages).map_err(|error| malformed(&error))?;
    Ok(held.into_iter().map(|(index, epoch)| Held { index, epoch }).collect())
}

pub(crate) const fn verdict_message(verdict: ReportVerdict) -> farm::Verdict {
    match verdict {
        ReportVerdict::Stored => farm::Verdict::Stored,
        ReportVerdict::Duplicate => farm::Verdict::Duplicate,
        ReportVerdict::Late => farm::Verdict::Late,
        ReportVerdict::Refused => farm::Verdict::Refused,
    }
}

pub(crate) fn malformed(error: &BadMessage) -> Status {
    Status::invalid_argument(error.to_string())
}
