//! The workers registered with this coordinator.

use super::Breaker;
use parking_lot::Mutex;
use std::collections::HashMap;
use std::time::Duration;
use tokio::time::Instant;
use tracktwin_protocol::Registration;

/// A worker without a message for this time is removed from the roster. It must register again.
const FORGET_AFTER: Duration = Duration::from_mins(10);

/// A worker with a message within this time counts as present.
const PRESENT: Duration = Duration::from_mins(1);

/// Minimum interval of recording a worker's last message in the library.
const NOTE_EVERY: Duration = Duration::from_secs(5);

/// Maximum number of registered workers. It bounds the memory that callers with the token can occupy.
const WORKERS_MAX: usize = 65_536;

/// Registered workers.
#[derive(Default)]
pub(crate) struct Roster(Mutex<HashMap<String, Worker>>);

struct Worker {
    registration: Registration,
    heard_of: Instant,
    /// Time at which the last message was recorded in the library.
    noted: Instant,
    /// Reason of the quarantine, if the worker is in quarantine.
    quarantine: Option<String>,
    breaker: Breaker,
    /// Whether a case has succeeded since the registration.
    has_succeeded: bool,
}

/// Whether a worker may get cases.
#[derive(Clone, Debug)]
pub(crate) struct WorkerEligibility {
    /// Version of the worker's program.
    pub(crate) code_version: String,
    /// Hash of the worker's physics.
    pub(crate) model_hash: String,
    /// Time for which the worker gets no cases, and the reason; `None` if it may get cases.
    pub(crate) exclusion: Option<(Duration, String)>,
    /// Whether the worker gets only one case, as a trial after a suspension.
    pub(crate) on_trial: bool,
    /// Whether the caller must record in the library that the worker is alive.
    pub(crate) to_be_noted: bool,
}

/// The roster has [`WORKERS_MAX`] workers.
#[derive(Debug)]
pub(crate) struct Full;

impl Roster {
    /// Adds a worker, or registers it again.
    pub(crate) fn add(&self, registration: Registration) -> Result<(), Full> {
        let mut workers = self.0.lock();
        workers.retain(|_, worker| worker.heard_of.elapsed() < FORGET_AFTER);
        if workers.len() >= WORKERS_MAX && !workers.contains_key(&registration.worker) {
            return Err(Full);
        }
        let now = Instant::now();
        let name = registration.worker.clone();
        // A restart of the connection forgives nothing.
        let breaker = workers.get(&name).map(|worker| worker.breaker).unwrap_or_default();
        let worker = Worker {
            registration,
            heard_of: now,
            noted: now,
            quarantine: None,
            breaker,
            has_succeeded: false,
        };
        workers.insert(name, worker);
        Ok(())
    }

    /// Eligibility of a worker; `None` if it has not registered.
    pub(crate) fn eligibility(&self, worker: &str) -> Option<WorkerEligibility> {
        let mut workers = self.0.lock();
        let worker = workers.get_mut(worker)?;
        let now = Instant::now();
        worker.heard_of = now;
        let to_be_noted = now.duration_since(worker.noted) >= NOTE_EVERY;
        if to_be_noted {
            worker.noted = now;
        }
        let quarantine = worker.quarantine.clone();
        let exclusion = quarantine.map(|reason| (PRESENT, format!("in quarantine: {reason}")));
        let failing = || {
            let left = worker.breaker.open_for(now)?;
            Some((left, "suspended: its cases fail, those of other workers do not".to_owned()))
        };
        Some(WorkerEligibility {
            code_version: worker.registration.code_version.clone(),
            model_hash: worker.registration.model_hash.clone(),
            exclusion: exclusion.or_else(failing),
            on_trial: worker.breaker.is_on_trial(),
            to_be_noted,
        })
    }

    /// Sets the reason of a worker's quarantine, or removes the quarantine with `None`.
    pub(crate) fn set_quarantine(&self, worker: &str, reason: Option<String>) {
        if let Some(worker) = self.0.lock().get_mut(worker) {
            worker.quarantine = reason;
        }
    }

    /// Records the outcomes of a worker's cases; returns whether it was suspended.
    ///
    /// A worker is suspended only if another worker is present whose cases succeed. Otherwise the cases
    /// themselves are the probable cause.
    pub(crate) fn reported(&self, worker: &str, failed: &[bool]) -> bool {
        let mut workers = self.0.lock();
        let Some(it) = workers.get_mut(worker) else { return false };
        it.breaker.reported(failed.iter().copied());
        it.has_succeeded |= failed.contains(&false);
        let present = |it: &Worker| it.heard_of.elapsed() < PRESENT;
        let failing = it.breaker.is_failing();
        let others = workers.iter().filter(|(name, it)| *name != worker && present(it));
        let mut sound = others.filter(|(_, it)| it.has_succeeded && !it.breaker.is_failing());
        let suspended = failing && sound.next().is_some();
        if suspended && let Some(it) = workers.get_mut(worker) {
            it.breaker.open(Instant::now());
        }
        suspended
    }

    /// Number of present workers, and the sum of their cores.
    pub(crate) fn present(&self) -> (usize, u32) {
        let workers = self.0.lock();
        let present = workers.values().filter(|worker| worker.heard_of.elapsed() < PRESENT);
        present.fold((0, 0), |(count, cores), worker| {
            (count + 1, cores.saturating_add(worker.registration.cores))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roster(names: &[&str]) -> Roster {
        let roster = Roster::default();
        for name in names {
            let registration = Registration {
                worker: (*name).to_owned(),
                code_version: "1".to_owned(),
                model_hash: "m".to_owned(),
                cores: 2,
                protocol_version: 1,
            };
            roster.add(registration).unwrap();
        }
        roster
    }

    #[test]
    fn a_worker_that_fails_where_others_do_not_is_put_aside_and_then_on_trial() {
        let roster = roster(&["bad", "good"]);
        assert!(!roster.reported("good", &[false]));
        assert!(roster.reported("bad", &[true; 8]));
        let eligibility = roster.eligibility("bad").unwrap();
        assert!(eligibility.exclusion.is_some() && eligibility.on_trial);
        assert!(roster.eligibility("good").unwrap().exclusion.is_none());
    }

    #[test]
    fn where_everybody_fails_nobody_is_put_aside() {
        let roster = roster(&["a", "b"]);
        assert!(!roster.reported("a", &[true; 8]), "b has reported nothing yet");
        assert!(!roster.reported("b", &[true; 8]));
        let alone = self::roster(&["alone"]);
        assert!(!alone.reported("alone", &[true; 100]));
        assert!(alone.eligibility("alone").unwrap().exclusion.is_none());
    }

    #[test]
    fn quarantine_is_told_with_its_reason() {
        let roster = roster(&["w"]);
        roster.set_quarantine("w", Some("it differs".to_owned()));
        let (_, reason) = roster.eligibility("w").unwrap().exclusion.unwrap();
        assert_eq!(reason, "in quarantine: it differs");
        roster.set_quarantine("w", None);
        assert!(roster.eligibility("w").unwrap().exclusion.is_none());
    }
}
