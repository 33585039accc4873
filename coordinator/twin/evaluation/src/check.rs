//! Check of a recording against the track and the speeds of the models.

use crate::Error;
use crate::speeds;
use tracktwin_parameters::TrackDesign;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, SAMPLES_A_PERIOD};

/// Largest deviation of the distance of two sleepers from a multiple of the spacing, as a share of the spacing.
const UNEVEN: f64 = 0.1;

/// Compares the track, vehicle, sensor and speeds stated in a recording with those of the models.
///
/// Quantities missing in `recording.json` are not compared.
///
/// # Errors
/// [`Error::GainUnknown`]; [`Error::UnknownSpeed`] with the first pass that models for `speeds_km_h`
/// cannot evaluate; [`Error::OtherTrack`] with the first quantity that differs by more than 2 %;
/// [`Error::Uneven`] with the first distance of two sleepers that is no multiple of the models' spacing.
pub fn check_recording(
    recording: &Recording,
    design: &TrackDesign,
    speeds_km_h: &[f64],
) -> Result<(), Error> {
    if !recording.gain_known() {
        return Err(Error::GainUnknown);
    }
    recording.check_track(design)?;
    check_spacings(recording, design.sleeper.spacing_m)?;
    for pass in &recording.passes {
        speeds::check(recording, pass.speed_km_h, speeds_km_h)?;
    }
    Ok(())
}

/// Checks that neighbouring sleepers are one or several of the models' spacings in m apart.
fn check_spacings(recording: &Recording, spacing_m: f64) -> Result<(), Error> {
    let uneven = recording.sleepers.windows(2).find(|pair| {
        let spacings = (pair[1].x_m - pair[0].x_m) / spacing_m;
        (spacings - spacings.round().max(1.0)).abs() > UNEVEN
    });
    match uneven {
        Some(pair) => Err(Error::Uneven {
            between: [0, 1].map(|end| pair[end].id.clone()),
            distance_m: pair[1].x_m - pair[0].x_m,
            spacing_m,
        }),
        None => Ok(()),
    }
}

/// Checks that a sample rate in Hz is high enough for the features of the models.
///
/// # Errors
/// [`Error::Rate`].
pub(crate) fn check_sample_rate(extractor: &Extractor, rate_hz: f64) -> Result<(), Error> {
    let highest_hz = (rate_hz / SAMPLES_A_PERIOD).floor();
    extractor.check_rate(rate_hz).map_err(|source| Error::Rate { source, highest_hz })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use serde_json::{Value, json};

    fn refusal(change: impl Fn(&mut Recording)) -> String {
        let mut recording = testing::recording(3.0, &[10.0]);
        change(&mut recording);
        check_recording(&recording, &TrackDesign::v_track(), &[10.0]).unwrap_err().to_string()
    }

    #[test]
    fn a_speed_that_no_model_knows_is_refused() {
        let recording = testing::recording(3.0, &[10.1, 13.0]);
        let check = |speeds: &[f64]| check_recording(&recording, &TrackDesign::v_track(), speeds);
        check(&[10.0, 13.0]).unwrap();
        let refusal = check(&[7.0, 10.0]).unwrap_err().to_string();
        assert!(refusal.contains("passes at 13 km/h; the models are for 7, 10 km/h"), "{refusal}");
    }

    #[test]
    fn a_low_sample_rate_is_refused_with_the_features_that_it_allows() {
        let features = tracktwin_signal::FeatureDefinition::default();
        let all = Extractor::new(&features).unwrap();
        check_sample_rate(&all, 10_000.0).unwrap();
        let refusal = check_sample_rate(&all, 8000.0).unwrap_err().to_string();
        assert!(refusal.contains("8000 Hz is too low; at least 10000 Hz"), "{refusal}");
        assert!(refusal.contains("--highest 3200"), "{refusal}");
        check_sample_rate(&Extractor::up_to(&features, 3200.0).unwrap(), 8000.0).unwrap();
    }

    #[test]
    fn another_track_vehicle_or_gain_is_refused_and_what_is_not_said_is_not() {
        let same = testing::recording(3.0, &[10.0]);
        check_recording(&same, &TrackDesign::v_track(), &[10.0]).unwrap();
        let text = refusal(|recording| recording.spacing_m = 0.6);
        assert!(text.starts_with("nominal.sleeper.spacing_m is 0.6 m, the models are of 0.125 m"));
        let text = refusal(|recording| recording.sleepers.iter_mut().for_each(|s| s.x_m *= 1.12));
        assert!(text.contains("in the recording is 0.14 m, the models are of 0.125 m"), "{text}");
        let text = refusal(|recording| recording.sleepers[3].x_m += 0.02);
        assert!(
            text.contains("between SN2 and SN3 is 0.145 m, that of the models 0.125 m"),
            "{text}"
        );
        let mut with_a_gap = same.clone();
        with_a_gap.sleepers.remove(3);
        check_recording(&with_a_gap, &TrackDesign::v_track(), &[10.0]).unwrap();
        let nominal = |part: &str, value: Value| {
            refusal(|recording| drop(recording.nominal.insert(part.to_owned(), value.clone())))
        };
        let text = nominal("rail", json!({"area_m2": 7.67e-3, "second_moment_m4": 5.15e-7}));
        assert!(text.contains("0.00767 m2") && text.contains("0.000865 m2"), "{text}");
        assert!(nominal("wheel", json!({"mass_kg": 600})).contains("600 kg"));
        assert!(nominal("gain_known", json!(false)).contains("nominal.gain_known"));
    }
}
