//! What becomes of a case whose attempt ended without result.

use tracktwin_library::{Ending, State};

/// Attempts after which a case that fails is given up.
///
/// Three is the usual choice: the next worker may be the sound one. Simulations are pure, so three
/// failures are the case's own.
pub const FAILURES_MAX: u32 = 3;

/// Attempts after which a case that loses its workers is given up.
///
/// A lost worker takes its whole lease with it, and where a scheduler takes nodes away every few
/// seconds an innocent case loses one attempt in two. Twenty in a row are then one in a million, and
/// a case that kills its workers stops after so many.
pub const LOSSES_MAX: u32 = 20;

/// Attempts without result after which a case is handed out alone, so that it takes no other case
/// with it if it is what ends its workers, and is soon done if it isn't.
pub const SUSPECT_AFTER: u32 = 4;

/// Where a case goes after so many attempts without result, the last of which ended so.
pub const fn after_attempt(ending: Ending, attempts: u32) -> State {
    match ending {
        Ending::Failed if attempts < FAILURES_MAX => State::Waiting,
        Ending::Lost if attempts < LOSSES_MAX => State::Waiting,
        Ending::Failed | Ending::Lost => State::Failed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_is_given_up_after_three_failures_or_twenty_lost_workers() {
        let states = |ending| [1, 2, 3, 19, 20].map(|attempts| after_attempt(ending, attempts));
        let (wait, give_up) = (State::Waiting, State::Failed);
        assert_eq!(states(Ending::Failed), [wait, wait, give_up, give_up, give_up]);
        assert_eq!(states(Ending::Lost), [wait, wait, wait, wait, give_up]);
    }
}
