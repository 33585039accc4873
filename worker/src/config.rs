//! Configuration of a worker.

use crate::counters::Counters;
use crate::credentials::Credentials;
use crate::holdings::Holdings;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;
use tonic::transport::{Channel, Endpoint};
use tracktwin_experiment::{MODEL_HASH, Prepare, prepare_simulation};

/// How a line to a coordinator is made.
pub type Dial = fn(&Endpoint) -> Channel;

/// Configuration of a worker.
#[derive(Clone, Debug)]
pub struct Config {
    /// Addresses of coordinators that serve one library; `http://HOST:PORT` or `https://HOST:PORT`.
    /// When one does not answer, the next is asked.
    pub coordinators: Vec<String>,
    /// Groups of cases simulated at a time.
    pub cores: NonZeroUsize,
    /// The worker's name, unique among workers; see [`unique_name`].
    pub worker: String,
    /// How it and its coordinators trust each other.
    pub credentials: Credentials,
    /// How long to try while no coordinator answers; for ever if none.
    pub give_up_after: Option<Duration>,
    /// How long to wait for work before it ends; for ever if none.
    pub idle_exit: Option<Duration>,
    /// What simulates: [`prepare_simulation`], or a stand-in in tests of the farm.
    pub prepare: Prepare,
    /// What it counts.
    pub counters: Arc<Counters>,
    /// What it holds.
    pub holdings: Holdings,
    /// Where tests of the farm take another part.
    #[doc(hidden)]
    pub seams: Seams,
}

/// Parts of a worker that tests of the farm exchange.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct Seams {
    /// Hash of the physics to register with.
    pub model_hash: String,
    /// [`Endpoint::connect_lazy`], or a simulated network's.
    pub dial: Dial,
    /// Whether to simulate on the leasing task instead of a separate thread: with simulated network
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
    /// A worker that simulates with the track model for a coordinator on this machine.
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

/// A name that no other worker has: host, process, and chance.
pub fn unique_name() -> String {
    let host = std::fs::read_to_string("/etc/hostname").unwrap_or_default();
    let host = if host.trim().is_empty() { "worker" } else { host.trim() };
    let chance = (crate::backoff::random_unit() * f64::from(u32::MAX)) as u32;
    format!("{host}-{}-{chance:08x}", std::process::id())
}
