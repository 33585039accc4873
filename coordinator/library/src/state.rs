//! The states of campaigns and cases, and the ways an attempt at a case ends.
//!
//! `docs/case-states.md` draws them.

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

    /// The schema admits no other names.
    pub(crate) fn from_name(name: &str) -> Self {
        [Self::Waiting, Self::Leased, Self::Finished]
            .into_iter()
            .find(|state| state.name() == name)
            .unwrap_or(Self::Failed)
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

    /// The schema admits no other names.
    pub(crate) fn from_name(name: &str) -> Self {
        [Self::Running, Self::Paused]
            .into_iter()
            .find(|state| state.name() == name)
            .unwrap_or(Self::Cancelled)
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
