//! Kind of a hidden effect in the catalogue of the diagnosis. Simulators and catalogue share only the
//! names.

use tracktwin_reference_simulator::Hidden;
use tracktwin_track::extension::Kind;

/// The kind in the catalogue, if the catalogue contains the effect. If not, the correct result is
/// "unknown".
pub(crate) fn kind(hidden: &Hidden) -> Option<&'static Kind> {
    Kind::from_name(hidden.physics())
}

/// Whether it is a fault of the measuring chain, not physics of track or vehicle.
pub(crate) fn is_artefact(hidden: &Hidden) -> bool {
    kind(hidden).is_some_and(|kind| kind.measuring_chain)
}
