//! Numbers of attempts without result after which a case is given up, or leased alone.

use tracktwin_library::AttemptsMax;

/// Attempts after which a case that fails is given up.
///
/// Three is the usual choice: the next worker may be a sound one. Simulations are deterministic, so after
/// three failures the case itself is the cause.
pub const FAILURES_MAX: u32 = 3;

/// Attempts after which a case whose workers were lost is given up.
///
/// A lost worker loses all cases of its lease. If a scheduler removes machines every few seconds, a sound
/// case loses half of its attempts; the probability of twenty losses in a row is then one in a million. A
/// case that kills its workers is given up after twenty attempts.
pub const LOSSES_MAX: u32 = 20;

/// Attempts without result after which a case is leased alone. If the case kills its workers, no other case
/// is lost with it.
pub const SUSPECT_AFTER: u32 = 4;

/// Both limits, as an argument for the library.
pub const ATTEMPTS_MAX: AttemptsMax = AttemptsMax { failed: FAILURES_MAX, lost: LOSSES_MAX };
