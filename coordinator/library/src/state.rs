//! The states of campaigns and cases, and the ways an attempt at a case ends.
//!
//! `docs/case-states.md` draws them.

use crate::LibraryError;

/// The one of `all` that is stored as `name`. What another version of the program, or another hand, has
/// stored is not taken for something else.
///
/// # Errors
/// [`LibraryError::Damaged`] names the row that is in an unknown state.
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
    /// Nobody works on it.
    Waiting,
    /// A worker holds it.
    Leased,
    /// Its results are stored.
    Finished,
    /// It was given up: it failed, or lost its worker, too often.
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
    /// [`LibraryError::Damaged`] where there is no such state.
    pub(crate) fn from_name(name: &str) -> Result<Self, LibraryError> {
        let all = [Self::Waiting, Self::Leased, Self::Finished, Self::Failed];
        named("a case", name, all, Self::name)
    }
}

/// Whether cases of a campaign are leased.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CampaignState {
    /// They are.
    Running,
    /// No cases are leased; leased ones are finished.
    Paused,
    /// No cases are leased, and leases have ended.
    Cancelled,
}

impl CampaignState {
    /// As the library and people spell it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Cancelled => "cancelled",
        }
    }

    /// # Errors
    /// [`LibraryError::Damaged`] where there is no such state.
    pub(crate) fn from_name(name: &str) -> Result<Self, LibraryError> {
        named("a campaign", name, [Self::Running, Self::Paused, Self::Cancelled], Self::name)
    }
}

/// How an attempt ended that brought no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The worker could not simulate the case.
    Failed,
    /// The lease expired.
    Lost,
}

/// After how many attempts without result a case is given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttemptsMax {
    /// Where the last one failed: so many that failed.
    pub failed: u32,
    /// Where the last one's worker was lost: so many that were without result.
    pub lost: u32,
}

impl AttemptsMax {
    /// Where a case stands after so many attempts, the last of which ended so: those that failed where it failed, all
    /// that were without result where it was lost.
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
