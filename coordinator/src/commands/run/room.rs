//! Whether there is room for what a campaign will make.

use super::super::files::free_bytes;
use super::super::{Stop, println_stderr};
use tracktwin_farm::campaign::Campaign;
use tracktwin_library::Library;
use tracktwin_signal::ThirdOctave;

/// Bytes of a pass beside its numbers: keys, hashes, indices and the log that is written before the file.
const BESIDE_A_PASS_BYTES: u64 = 1500;

/// Says at once where the disk of a library in a file will not hold the cases that are left. That is no reason
/// not to begin: what is stored by then stays, and the same command goes on when there is room.
pub(super) async fn check(library: &Library, campaign: &Campaign) -> Result<(), Stop> {
    let Some(path) = library.path() else { return Ok(()) };
    let finished = library.status(&campaign.id()).await?.finished;
    let needed = u64::from(campaign.cases.saturating_sub(finished)) * case_bytes(campaign);
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    let free = free_bytes(folder.unwrap_or(std::path::Path::new(".")));
    if let Some(free) = free.filter(|free| *free < needed) {
        println_stderr(&format!(
            "{}: the disk has {:.1} GB left, and the cases to be simulated will take about {:.1} GB; make room, \
             or give another --library",
            library.name(),
            free as f64 / 1e9,
            needed as f64 / 1e9
        ));
    }
    Ok(())
}

/// Bytes that a case's results take.
fn case_bytes(campaign: &Campaign) -> u64 {
    let experiment = &campaign.definition.experiment;
    let numbers = experiment.features.frequencies_hz().len() + ThirdOctave::COUNT;
    experiment.speeds_km_h.len() as u64 * (8 * numbers as u64 + BESIDE_A_PASS_BYTES)
}
