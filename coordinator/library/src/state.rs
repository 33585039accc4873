//! The states of a case, and the ways an attempt at it ends.

/// Where a case stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Nobody works on it.
    Waiting,
    /// A worker holds it.
    Leased,
    /// Its results are stored.
    Finished,
    /// It was given up.
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

/// How an attempt ended that brought no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The worker could not simulate the case.
    Failed,
    /// The lease expired.
    Lost,
}

/// What becomes of a case after so many attempts without result, the last of which ended so.
///
/// It is to answer [`State::Waiting`] or [`State::Failed`].
pub type Policy = fn(Ending, attempts: u32) -> State;
