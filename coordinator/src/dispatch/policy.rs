//! What becomes of a case whose attempt ended without result.

use tracktwin_library::{Ending, State};

/// Attempts after which a case is given up.
///
/// Three is the usual choice: one lost machine and one unlucky restart are forgiven, and a case
/// that kills its workers kills no more than three.
pub const ATTEMPTS_MAX: u32 = 3;

/// Where a case goes after so many attempts without result, the last of which ended so.
///
/// A failure is tried again like a lost lease: the next worker may be the sound one. Simulations
/// are pure, so three failures are the case's own.
pub const fn after_attempt(ending: Ending, attempts: u32) -> State {
    match ending {
        Ending::Failed | Ending::Lost if attempts < ATTEMPTS_MAX => State::Waiting,
        Ending::Failed | Ending::Lost => State::Failed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_is_given_up_after_three_attempts_however_they_ended() {
        for ending in [Ending::Failed, Ending::Lost] {
            let states = [1, 2, 3, 4].map(|attempts| after_attempt(ending, attempts));
            assert_eq!(states, [State::Waiting, State::Waiting, State::Failed, State::Failed]);
        }
    }
}
