//! Null simulations of a recording's track. They are read from the library, or computed and stored there.

use super::compute::compute;
use nalgebra::DVector;
use serde::Serialize;
use tracktwin_diagnosis::{NullError, NullModel, PreparedRecording};
use tracktwin_experiment::MODEL_HASH;
use tracktwin_library::{Library, LibraryError, StoredArray};
use tracktwin_parameters::TrackDesign;

/// Number of simulated random surfaces.
pub const SURFACES: u32 = 40;

/// Seed of the first surface.
const SEED: u64 = 0x6e75_6c6c;

/// Errors of creating a null model.
#[derive(Debug, thiserror::Error)]
pub enum NullModelError {
    /// The library cannot be read or written.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// A null simulation failed.
    #[error("the null simulations failed: {0}")]
    Simulation(#[from] NullError),
}

/// All inputs that determine the null simulations.
#[derive(Serialize)]
struct Key<'a> {
    model_hash: &'static str,
    design: &'a TrackDesign,
    wavelengths_m: [f64; 2],
    sleepers: usize,
    version: u32,
    speeds_m_s: &'a [f64],
    bands_hz: &'a [f64],
    values: &'a [f64],
    surfaces: u32,
    seed: u64,
}

/// Returns the null model of a prepared recording whose baseline has the parameters `values`. `progress` is
/// called with the number of completed surfaces.
///
/// # Errors
/// Returns [`NullModelError`] if the library or a simulation fails.
pub async fn of(
    prepared: &PreparedRecording,
    values: &DVector<f64>,
    library: Option<&Library>,
    progress: impl Fn(u64) + Sync,
) -> Result<NullModel, NullModelError> {
    let forward = &prepared.forward;
    let grid = NullModel::grid_values(forward, values);
    let key = Key {
        model_hash: MODEL_HASH,
        design: &forward.section.track.design,
        wavelengths_m: forward.section.track.wavelengths_m,
        sleepers: forward.section.sleepers(),
        version: NullModel::VERSION,
        speeds_m_s: &forward.speeds_m_s,
        bands_hz: forward.bands.centres_hz(),
        values: grid.as_slice(),
        surfaces: SURFACES,
        seed: SEED,
    };
    let meta_json = serde_json::to_string(&key).expect("a key is plain JSON");
    let key = blake3::hash(meta_json.as_bytes()).to_hex().to_string();
    if let Some(library) = library
        && let Some(stored) = library.array(&key).await?
        && let Some(null) = NullModel::from_numbers(forward, &stored.numbers)
    {
        return Ok(null);
    }
    let simulated = compute(|| {
        NullModel::simulate(forward, &grid, u64::from(SURFACES), SEED, &|done| {
            progress(done as u64);
        })
    });
    let null = simulated?;
    if let Some(library) = library {
        let numbers = null.differences.concat();
        let kind = "null-campaign".to_owned();
        library.store_array(StoredArray { key, kind, meta_json, numbers }).await?;
    }
    Ok(null)
}
