//! Configuration of a worker.

use crate::counters::Counters;
use crate::credentials::Credentials;
use crate::holdings::Holdings;
use crate::slot::host;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;
use tonic::transport::{Channel, Endpoint};
use tracktwin_experiment::{MODEL_HASH, Prepare, prepare_simulation};

/// Function that creates a connection to a coordinator.
pub type Dial = fn(&Endpoint) -> Channel;

/// Configuration of a worker.
#[derive(Clone, Debug)]
pub struct Config {
    /// Addresses of coordinators that serve one library: `http://HOST:PORT` or `https://HOST:PORT`. If
    /// one of them does not respond, the worker calls the next one.
    pub coordinators: Vec<String>,
    /// Number of groups of cases that the worker simulates at a time.
    pub cores: NonZeroUsize,
    /// The worker's name, unique among workers; see [`unique_name`]. Quarantine and suspension belong to the
    /// name, so a worker of a farm keeps it over a restart.
    pub worker: String,
    /// Credentials of the worker and of its coordinators.
    pub credentials: Credentials,
    /// Time limit of retries without a response of a coordinator. `None`: unlimited.
    pub give_up_after: Option<Duration>,
    /// Time without work after which the worker ends. `None`: unlimited.
    pub idle_exit: Option<Duration>,
    /// Function that creates the simulator: [`prepare_simulation`], or a substitute in tests of the
    /// farm.
    pub prepare: Prepare,
    /// Counters of the worker.
    pub counters: Arc<Counters>,
    /// Cases that the worker holds.
    pub holdings: Holdings,
    /// Parts that tests of the farm replace.
    #[doc(hidden)]
    pub seams: Seams,
}

/// Parts of a worker that tests of the farm replace.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct Seams {
    /// Hash of the physics to register with.
    pub model_hash: String,
    /// [`Endpoint::connect_lazy`], or the connection of a simulated network.
    pub dial: Dial,
    /// Whether to simulate in the task that leases, instead of a separate thread. With simulated network
    /// and time, nothing may run in parallel.
    pub inline: bool,
}

impl Default for Seams {
    fn default() -> Self {
        let model_hash = MODEL_HASH.to_owned();
        Self { model_hash, dial: Endpoint::connect_lazy, inline: false }
    }
}

impl Config {
    /// Configuration of a worker with the track model, for a coordinator without credentials on this
    /// machine.
    pub fn new(coordinator: String, cores: NonZeroUsize) -> Self {
        let counters = Arc::<Counters>::default();
        let holdings = Holdings::new(&counters);
        Self {
            coordinators: vec![coordinator],
            cores,
            worker: unique_name(),
            credentials: Credentials::default(),
            give_up_after: None,
            idle_exit: None,
            prepare: prepare_simulation,
            counters,
            holdings,
            seams: Seams::default(),
        }
    }
}

/// A unique name of a worker, from host name, process id and a random number.
pub fn unique_name() -> String {
    let chance = (crate::backoff::random_unit() * f64::from(u32::MAX)) as u32;
    let host = host().unwrap_or_else(|| "worker".to_owned());
    format!("{host}-{}-{chance:08x}", std::process::id())
}
