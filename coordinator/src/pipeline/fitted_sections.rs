//! Fits of a recording's sections. They are read from the library, or computed and stored there.

use super::compute::compute;
use super::invert::{InvertingError, Started};
use rayon::prelude::*;
use serde::Serialize;
use tracktwin_diagnosis::{CalibrationError, Candidate, NullModel, PreparedRecording};
use tracktwin_experiment::MODEL_HASH;
use tracktwin_inversion::{Fitted, fit};
use tracktwin_library::{Library, StoredArray};
use tracktwin_track::extension::ExtensionInstance;

/// All inputs that determine the fit of a section.
#[derive(Serialize)]
struct Key<'a> {
    model_hash: &'static str,
    version: u32,
    /// Track with its priors, and the known physics.
    track: String,
    known: String,
    speeds_m_s: &'a [f64],
    bands_hz: &'a [f64],
    /// Hash of log powers, covariance, sensor noise and start values.
    numbers: String,
}

/// What identifies known physics: the extension, and names of its free parameters. Their start values are
/// among the values of the first fit.
fn named(known: &Candidate) -> (&ExtensionInstance, Vec<&'static str>) {
    (&known.extension, known.free.iter().map(|parameter| parameter.name).collect())
}

impl Key<'_> {
    fn json(started: &Started, null: &NullModel) -> String {
        let Started { prepared, known, values } = started;
        let forward = &prepared.forward;
        let mut numbers = blake3::Hasher::new();
        let expected = prepared.expected_log_power(null);
        let covariance = prepared.covariance(null);
        let data = expected.iter().chain(covariance.iter()).chain(&forward.noise_density);
        for number in data.chain(values) {
            numbers.update(&number.to_le_bytes());
        }
        let key = Key {
            model_hash: MODEL_HASH,
            version: Fitted::VERSION,
            track: format!("{:?}", forward.section),
            known: format!("{:?}", known.iter().map(named).collect::<Vec<_>>()),
            speeds_m_s: &forward.speeds_m_s,
            bands_hz: forward.bands.centres_hz(),
            numbers: numbers.finalize().to_hex().to_string(),
        };
        serde_json::to_string(&key).expect("a key is plain JSON")
    }
}

/// Fits all sections. With a library, each fit is stored as soon as its group of sections is done, so that
/// an interrupted inversion continues there. `progress` is called with the number of completed sections.
///
/// # Errors
/// [`InvertingError`] if a fit or the library fails.
pub(super) async fn of(
    started: Vec<Started>,
    null: &NullModel,
    library: Option<&Library>,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<(PreparedRecording, Fitted)>, InvertingError> {
    let Some(library) = library else {
        let fitted = compute(|| all(&started, &[], null))?;
        progress(started.len());
        return Ok(with_fits(started, fitted));
    };
    let mut fitted = Vec::new();
    for group in started.chunks(rayon::current_num_threads()) {
        let keys = group
            .iter()
            .map(|section| Key::json(section, null))
            .map(|meta_json| (blake3::hash(meta_json.as_bytes()).to_hex().to_string(), meta_json));
        let keys: Vec<(String, String)> = keys.collect();
        let mut known = Vec::new();
        for (section, (key, _)) in group.iter().zip(&keys) {
            let stored = library.array(key).await?;
            known.push(stored.and_then(|it| Fitted::from_numbers(&section.prepared, &it.numbers)));
        }
        let found = compute(|| all(group, &known, null))?;
        for ((fit, (key, meta_json)), known) in found.iter().zip(keys).zip(&known) {
            if known.is_none() {
                let (kind, numbers) = ("inversion-section".to_owned(), fit.numbers());
                library.store_array(StoredArray { key, kind, meta_json, numbers }).await?;
            }
        }
        fitted.extend(found);
        progress(fitted.len());
    }
    Ok(with_fits(started, fitted))
}

/// Fits of all sections, in parallel; those that are known are taken.
fn all(
    started: &[Started],
    known: &[Option<Fitted>],
    null: &NullModel,
) -> Result<Vec<Fitted>, CalibrationError> {
    let one = |(number, section): (usize, &Started)| match known.get(number) {
        Some(Some(known)) => Ok(known.clone()),
        _ => fit(&section.prepared, null, &section.known, section.values.clone()),
    };
    started.par_iter().enumerate().map(one).collect()
}

fn with_fits(started: Vec<Started>, fitted: Vec<Fitted>) -> Vec<(PreparedRecording, Fitted)> {
    started.into_iter().map(|section| section.prepared).zip(fitted).collect()
}
