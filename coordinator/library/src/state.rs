//! States of campaigns and cases, and endings of attempts.
//!
//! See `docs/case-states.md` for a diagram.

use crate::LibraryError;

/// Returns the element of `all` that is stored as `name`. A name that this program version does not define
/// is an error.
///
/// # Errors
/// Returns [`LibraryError::Damaged`] with a description of the row `of`.
pub(crate) fn named<T: Copy, const N: usize>(
    of: &str,
    name: &str,
    all: [T; N],
    spelled: impl Fn(T) -> &'static str,
) -> Result<T, LibraryError> {
    let unknown = || LibraryError::Damaged {
        what: format!("{of} is `{name}`, which is unknown to this version of the program"),
    };
    all.into_iter().find(|&it| spelled(it) == name).ok_or_else(unknown)
}

/// State of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// The case waits for a worker.
    Waiting,
    /// The case is leased to a worker.
    Leased,
    /// The results of the case are stored.
    Finished,
    /// The case was given up after too many failures or lost workers.
    Failed,
}

impl State {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Leased => "leased",
            Self::Finished => "finished",
            Self::Failed => "failed",
        }
    }

    /// # Errors
    /// Returns [`LibraryError::Damaged`] if there is no such state.
    pub(crate) fn from_name(name: &str) -> Result<Self, LibraryError> {
        let all = [Self::Waiting, Self::Leased, Self::Finished, Self::Failed];
        named("a case", name, all, Self::name)
    }
}

/// State of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CampaignState {
    /// Cases are leased.
    Running,
    /// No cases are leased; workers finish those already leased.
    Paused,
    /// No cases are leased, and existing leases were ended.
    Cancelled,
}

impl CampaignState {
    /// Name in the library, on pages and in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Cancelled => "cancelled",
        }
    }

    /// # Errors
    /// Returns [`LibraryError::Damaged`] if there is no such state.
    pub(crate) fn from_name(name: &str) -> Result<Self, LibraryError> {
        named("a campaign", name, [Self::Running, Self::Paused, Self::Cancelled], Self::name)
    }
}

/// Ending of an attempt without result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The worker could not simulate the case.
    Failed,
    /// The lease expired.
    Lost,
}

/// Number of attempts without result after which a case is given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttemptsMax {
    /// Limit after a failure: number of failed attempts.
    pub failed: u32,
    /// Limit after the loss of a worker: number of all attempts without result.
    pub lost: u32,
}

impl AttemptsMax {
    /// State of a case after its last attempt ended with `ending`. `attempts` is the number of failed
    /// attempts after a failure, and the number of all attempts without result after a lost worker.
    pub(crate) const fn after(self, ending: Ending, attempts: u32) -> State {
        let most = match ending {
            Ending::Failed => self.failed,
            Ending::Lost => self.lost,
        };
        if attempts < most { State::Waiting } else { State::Failed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_is_read_as_it_is_written_and_no_other_is_known() {
        for state in [State::Waiting, State::Leased, State::Finished, State::Failed] {
            assert_eq!(State::from_name(state.name()).unwrap(), state);
        }
        for state in [CampaignState::Running, CampaignState::Paused, CampaignState::Cancelled] {
            assert_eq!(CampaignState::from_name(state.name()).unwrap(), state);
        }
        let unknown = [State::from_name("parked").err(), CampaignState::from_name("").err()];
        for error in unknown {
            assert!(matches!(error, Some(LibraryError::Damaged { .. })), "{error:?}");
        }
    }

    #[test]
    fn a_case_is_given_up_after_so_many_failures_or_lost_workers() {
        let most = AttemptsMax { failed: 3, lost: 20 };
        let states = |ending| [1, 2, 3, 19, 20].map(|attempts| most.after(ending, attempts));
        let (wait, give_up) = (State::Waiting, State::Failed);
        assert_eq!(states(Ending::Failed), [wait, wait, give_up, give_up, give_up]);
        assert_eq!(states(Ending::Lost), [wait, wait, wait, wait, give_up]);
    }
}
