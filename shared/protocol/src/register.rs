//! Registration of a worker.

use crate::check::{BadMessage, name};
use crate::farm;

/// Upper limit of the cores: a false number would make other workers wait.
const CORES_MAX: u32 = 1 << 14;

/// Registration of a worker.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// Name of the worker, unique among workers.
    pub worker: String,
    /// Version of the program of the worker, for display.
    pub code_version: String,
    /// Version of the physics: [`MODEL_HASH`](tracktwin_experiment::MODEL_HASH) of the worker.
    pub model_hash: String,
    /// Number of groups of cases that the worker simulates at a time, at least one.
    pub cores: u32,
    /// Protocol version of the worker. Programs without a version send 0.
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
