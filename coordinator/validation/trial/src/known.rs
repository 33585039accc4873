//! What the twin's catalogue knows of a hidden effect: the two simulators share names, and nothing else.

use tracktwin_reference_simulator::Hidden;
use tracktwin_track::extension::Kind;

/// The kind of the catalogue, if it has it; if not, the right answer is "unknown".
pub(crate) fn kind(hidden: &Hidden) -> Option<&'static Kind> {
    Kind::from_name(hidden.physics())
}

/// Whether it is a fault of the measuring chain, not physics of track or vehicle.
pub(crate) fn is_artefact(hidden: &Hidden) -> bool {
    kind(hidden).is_some_and(|kind| kind.measuring_chain)
}
