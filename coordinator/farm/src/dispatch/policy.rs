//! Numbers of attempts without result after which a case is given up, or leased alone.

use tracktwin_library::AttemptsMax;

/// Attempts after which a case that fails is given up.
///
/// Three is the usual choice: the next worker may be the sound one. Simulations are pure, so three
/// failures are the case's own.
pub const FAILURES_MAX: u32 = 3;

/// Attempts after which a case that loses its workers is given up.
///
/// A lost worker loses its whole lease. If a scheduler removes machines every few seconds, a sound
/// case loses one attempt in two; twenty in a row then have a probability of one in a million, and
/// a case that kills its workers stops after twenty.
pub const LOSSES_MAX: u32 = 20;

/// Attempts without result after which a case is leased alone: if it kills its workers, no other
/// case is lost; otherwise it is soon done.
pub const SUSPECT_AFTER: u32 = 4;

/// Both, as an argument for the library.
pub const ATTEMPTS_MAX: AttemptsMax = AttemptsMax { failed: FAILURES_MAX, lost: LOSSES_MAX };
