//! The states of campaigns and cases, and the ways an attempt at a case ends.
//!
//! `docs/case-states.md` draws them.

use crate::LibraryError;

/// The one of `all` that is stored as `name`. What another version of the program, or another hand, has
/// stored is not taken for something else.
///
/// # Errors
/// [`LibraryError::Damaged`] says what `of` is in a state that nobody here knows.
pub(crate) fn named<T: Copy, const N: usize>(
    of: &str,
    name: &str,
    all: [T; N],
    spelled: impl Fn(T) -> &'static str,
) -> Result<T, LibraryError> {
    let unknown = || LibraryError::Damaged {
        what: format!("{of} is `{name}`, which this version of the program does not know"),
    };
    all.into_iter().find(|&it| spelled(it) == name).ok_or_else(unknown)
}

/// Where a case stands.
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

/// Whether a campaign's cases are handed out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CampaignState {
    /// They are.
    Running,
    /// None are handed out; those in work are finished.
    Paused,
    /// None are handed out, and those in work are taken back.
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
pub enum Ending {
    /// The worker could not simulate the case.
    Failed,
    /// The lease expired.
    Lost,
}

/// What becomes of a case whose last attempt ended so, after so many attempts: those that failed where it
/// [failed](Ending::Failed), all that were without result where it was [lost](Ending::Lost).
///
/// It is to answer [`State::Waiting`] or [`State::Failed`].
pub type Policy = fn(Ending, attempts: u32) -> State;

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
}
