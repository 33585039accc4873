//! How a worker introduces itself.

use crate::check::{BadMessage, name};
use crate::farm;

/// Upper limit of the cores: a false number would make other workers wait.
const CORES_MAX: u32 = 1 << 14;

/// A worker, as it introduces itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// What it calls itself, unique among workers.
    pub worker: String,
    /// Version of its program, for people.
    pub code_version: String,
    /// Hash of everything that decides what a parameter set becomes.
    pub model_hash: String,
    /// Groups of cases it simulates at a time, at least one.
    pub cores: u32,
    /// Version of its protocol; 0 from programs without a version.
    pub protocol_version: u32,
}

impl From<Registration> for farm::RegisterRequest {
    fn from(registration: Registration) -> Self {
        let Registration { worker, code_version, model_hash, cores, protocol_version } =
            registration;
        Self { worker, code_version, model_hash, cores, protocol_version }
    }
}

impl TryFrom<farm::RegisterRequest> for Registration {
    type Error = BadMessage;

    fn try_from(message: farm::RegisterRequest) -> Result<Self, BadMessage> {
        match message.cores {
            0 => return Err(BadMessage::Missing { field: "cores" }),
            CORES_MAX.. => {
                return Err(BadMessage::TooLarge {
                    field: "cores",
                    value: message.cores,
                    limit: CORES_MAX,
                });
            }
            _ => {}
        }
        Ok(Self {
            worker: name("worker", message.worker)?,
            code_version: name("code_version", message.code_version)?,
            model_hash: name("model_hash", message.model_hash)?,
            cores: message.cores,
            protocol_version: message.protocol_version,
        })
    }
}
