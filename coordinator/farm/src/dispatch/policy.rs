//! After how many attempts without result a case is given up, or handed out alone.

use tracktwin_library::AttemptsMax;

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

/// Both, as the library is told them.
pub const ATTEMPTS_MAX: AttemptsMax = AttemptsMax { failed: FAILURES_MAX, lost: LOSSES_MAX };
