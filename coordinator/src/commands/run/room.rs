//! Checks the disk space for the results of a campaign.

use super::super::files::free_bytes;
use super::super::{Stop, println_stderr};
use tracktwin_farm::campaign::Campaign;
use tracktwin_library::Library;
use tracktwin_signal::ThirdOctave;

/// Bytes of a pass in addition to its numbers: keys, hashes, indices and write-ahead log.
const BESIDE_A_PASS_BYTES: u64 = 1500;

/// Warns if the disk of a SQLite library is too small for the remaining cases. The simulation may
/// start nevertheless: stored results are kept, and the command continues once there is space.
pub(super) async fn check(library: &Library, campaign: &Campaign) -> Result<(), Stop> {
    let Some(path) = library.path() else { return Ok(()) };
    let finished = library.status(&campaign.id()).await?.finished;
    let needed = u64::from(campaign.cases.saturating_sub(finished)) * case_bytes(campaign);
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    let free = free_bytes(folder.unwrap_or(std::path::Path::new(".")));
    if let Some(free) = free.filter(|free| *free < needed) {
        println_stderr(&format!(
            "{}: the disk has {:.1} GB of free space, but the remaining cases need about {:.1} GB; free space \
             or use another --library",
            library.name(),
            free as f64 / 1e9,
            needed as f64 / 1e9
        ));
    }
    Ok(())
}

/// Bytes of the results of a case.
fn case_bytes(campaign: &Campaign) -> u64 {
    let experiment = &campaign.definition.experiment;
    let numbers = experiment.features.frequencies_hz().len() + ThirdOctave::COUNT;
    experiment.speeds_km_h.len() as u64 * (8 * numbers as u64 + BESIDE_A_PASS_BYTES)
}
