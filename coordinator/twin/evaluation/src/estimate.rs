//! Evaluation of one recording with surrogates and model selector.

use crate::evaluation::{
    Estimate, Estimates, Evaluation, FORMAT, Flag, Known, Measured, Provenance, SleeperEvaluation,
    Unevaluated,
};
use crate::matches::Matcher;
use crate::outside::by_speeds;
use crate::{BySpeeds, Error, OutsideLibrary, SleeperFeatures, Unevenness, features, outside};
use std::collections::BTreeMap;
use tracktwin_parameters::Parameter;
use tracktwin_signal::Extractor;
use tracktwin_signal::recording::Recording;
use tracktwin_surrogate::{Prediction, Trained, TrainingSet};

/// The feature set of the models in use: the global one (paper, eq. 9).
pub const METHOD_FEATURE: &str = "GF";

/// Distance of a mean from an end of the range, as a share of the range, below which it counts as at the
/// edge.
const EDGE: f64 = 0.02;

const ALL_SPEEDS: &str = "one model of all speeds together";
const SINGLE_SPEEDS: &str =
    "models of single speeds, combined by linear regression on the library's test half";

/// Surrogates, library and feature definition with which a recording is evaluated.
#[derive(Clone, Copy)]
pub struct Twin<'a> {
    /// Computes features with the definition used in training.
    pub extractor: &'a Extractor,
    /// The surrogates.
    pub models: &'a Trained,
    /// The library on which the surrogates were trained; the model selector searches it.
    pub library: &'a TrainingSet,
    /// Domain checks of that library, and combinations of its models.
    pub by_speeds: &'a BySpeeds,
}

/// Estimates the track parameters at every sleeper that a pass covers.
///
/// Passes of one speed are averaged in the logarithm of the power. A sleeper with all speeds of the
/// campaign is evaluated with the model of all speeds. Otherwise the single-speed models are combined by
/// linear regression ([`tracktwin_surrogate::Stack`]). All speeds share one surface, so that their errors are
/// partly common; the regression takes this from the library.
///
/// # Errors
/// [`Error::UnknownSpeed`], [`Error::OtherFeatures`], [`Error::NoModel`], [`Error::NothingToEvaluate`],
/// [`Error::Features`] or [`Error::Surrogate`].
pub fn evaluate(recording: &Recording, twin: &Twin<'_>) -> Result<Evaluation, Error> {
    check_features(twin)?;
    twin.models.belongs_to(&twin.library.library_digest)?;
    let speeds = twin.by_speeds.speeds(twin.library);
    let known = features(recording, twin.extractor, speeds)?;
    let (seen, unseen): (Vec<_>, Vec<_>) =
        known.into_iter().partition(|sleeper| !sleeper.speeds.is_empty());
    if seen.is_empty() {
        return Err(Error::NothingToEvaluate { recording: recording.name.clone() });
    }
    let mut estimates = estimates(&seen, twin)?;
    let tests = outside::judge(&seen, twin.library, twin.by_speeds)?;
    let outside_library = OutsideLibrary::of(&tests, twin.library);
    let told = estimates.iter().zip(&tests).filter(|(_, test)| !test.outside);
    let unevenness = Unevenness::of(&told.map(|(estimates, _)| estimates).collect::<Vec<_>>());
    let even: Vec<_> = estimates.iter_mut().map(|of| unevenness.widen(of)).collect();
    let mut matcher = Matcher::new(twin.library);
    let mut sleepers = seen
        .into_iter()
        .zip(estimates.into_iter().zip(even))
        .map(|(sleeper, estimates)| evaluated(recording, twin, &mut matcher, sleeper, estimates))
        .collect::<Result<Vec<_>, _>>()?;
    for (sleeper, test) in sleepers.iter_mut().zip(&tests) {
        sleeper.flags.extend(test.flag());
    }
    Ok(Evaluation {
        format: FORMAT,
        recording: recording.name.clone(),
        method: "gp",
        provenance: provenance(twin, &sleepers),
        sleepers,
        unevaluated: unseen.iter().map(|sleeper| unevaluated(recording, sleeper)).collect(),
        notes: [outside_library.sentences(), speeds.notes(recording)].concat(),
        outside_library,
        unevenness,
        frequencies_hz: twin.models.frequencies_hz().to_vec(),
    })
}

pub(crate) fn check_features(twin: &Twin<'_>) -> Result<(), Error> {
    let offered = serde_json::to_value(twin.extractor.definition()).unwrap_or_default();
    let trained_on = twin.models.feature_definition();
    if *trained_on == offered {
        return Ok(());
    }
    Err(Error::OtherFeatures { trained_on: trained_on.to_string(), offered: offered.to_string() })
}

/// Estimates for each of the sleepers, in the same order. Sleepers with the same speeds form one batch.
pub(crate) fn estimates(
    sleepers: &[SleeperFeatures],
    twin: &Twin<'_>,
) -> Result<Vec<Estimates>, Error> {
    let mut out = vec![Estimates::new(); sleepers.len()];
    for (speeds, members) in by_speeds(sleepers) {
        let chosen: Vec<_> = members.iter().map(|&index| &sleepers[index]).collect();
        for (index, predictions) in members.into_iter().zip(predict(&chosen, twin, &speeds)?) {
            let estimates = predictions.into_iter();
            out[index] =
                estimates.map(|it| (it.parameter, Estimate { mean: it.mean, sd: it.sd })).collect();
        }
    }
    Ok(out)
}

/// Predictions for sleepers that all have these speeds: by the model of all speeds, by that of the only
/// speed, or by the combination of the models of single speeds.
fn predict(
    sleepers: &[&SleeperFeatures],
    twin: &Twin<'_>,
    speeds: &[usize],
) -> Result<Vec<Vec<Prediction>>, Error> {
    if speeds.len() == 1 || speeds.len() == twin.models.speeds_km_h().len() {
        return predict_together(sleepers, twin.models, speeds);
    }
    let by_speed = speeds
        .iter()
        .map(|&speed| predict_together(sleepers, twin.models, &[speed]))
        .collect::<Result<Vec<_>, _>>()?;
    let stack = twin.by_speeds.stack(twin.models, twin.library, speeds)?;
    let of = |index: usize| by_speed.iter().map(|speed| speed[index].clone()).collect::<Vec<_>>();
    Ok((0..sleepers.len()).map(|index| stack.combine(&of(index))).collect())
}

/// Predictions by the model for these speeds, in one batch.
fn predict_together(
    sleepers: &[&SleeperFeatures],
    models: &Trained,
    speeds: &[usize],
) -> Result<Vec<Vec<Prediction>>, Error> {
    let speeds_km_h: Vec<f64> = speeds.iter().map(|&speed| models.speeds_km_h()[speed]).collect();
    let group = models
        .group(&speeds_km_h, METHOD_FEATURE)
        .ok_or(Error::NoModel { speeds_km_h, feature: METHOD_FEATURE })?;
    let observed = |sleeper: &&SleeperFeatures| -> Vec<f64> {
        let known = sleeper.speeds.iter().filter(|known| speeds.contains(&known.speed));
        known.flat_map(|known| known.log_power.iter().copied()).collect()
    };
    Ok(group.predict(&sleepers.iter().map(observed).collect::<Vec<_>>())?)
}

/// Makes the record of a sleeper from its features and estimates.
pub(crate) fn evaluated(
    recording: &Recording,
    twin: &Twin<'_>,
    matcher: &mut Matcher<'_>,
    sleeper: SleeperFeatures,
    (estimates, sd_without_unevenness): (Estimates, BTreeMap<Parameter, f64>),
) -> Result<SleeperEvaluation, Error> {
    let selector = matcher.select(&sleeper.speeds)?;
    let place = &recording.sleepers[sleeper.sleeper];
    let mut flags = sleeper.flags;
    if sleeper.speeds.len() < twin.models.speeds_km_h().len() {
        flags.push(Flag::MissingSpeed);
    }
    if is_at_edge(&estimates, twin.library) {
        flags.push(Flag::AtEdgeOfRange);
    }
    let measured = sleeper.speeds.into_iter().map(|known| Measured {
        speed_km_h: twin.models.speeds_km_h()[known.speed],
        passes: known.passes,
        log_power: known.log_power,
        matches: matcher.log_powers(known.speed, &selector.entries),
    });
    let measured = measured.collect();
    Ok(SleeperEvaluation {
        id: place.id.clone(),
        x_m: place.x_m,
        estimates,
        sd_without_unevenness,
        selector,
        flags,
        measured,
    })
}

/// Whether a mean lies at an end of its parameter's range in the library.
fn is_at_edge(estimates: &Estimates, library: &TrainingSet) -> bool {
    library.varied.iter().enumerate().any(|(column, parameter)| {
        let inside = EDGE..=1.0 - EDGE;
        let unit = |estimate: &Estimate| library.unit(column, estimate.mean);
        estimates.get(parameter).is_some_and(|estimate| !inside.contains(&unit(estimate)))
    })
}

fn unevaluated(recording: &Recording, sleeper: &SleeperFeatures) -> Unevaluated {
    let place = &recording.sleepers[sleeper.sleeper];
    Unevaluated { id: place.id.clone(), x_m: place.x_m, reason: "no pass covers its window" }
}

fn provenance(twin: &Twin<'_>, sleepers: &[SleeperEvaluation]) -> Provenance {
    let models = twin.models;
    let seen = |speed: &&f64| {
        sleepers.iter().flat_map(|sleeper| &sleeper.measured).any(|of| of.speed_km_h == **speed)
    };
    let speeds_km_h: Vec<f64> = models.speeds_km_h().iter().filter(seen).copied().collect();
    let together = speeds_km_h.len() == models.speeds_km_h().len();
    Provenance {
        code_version: env!("CARGO_PKG_VERSION"),
        campaign: models.campaign().to_owned(),
        library_digest: models.library_digest().to_owned(),
        library_entries: models.entries(),
        feature: METHOD_FEATURE,
        feature_definition: models.feature_definition().clone(),
        combination: if together { ALL_SPEEDS } else { SINGLE_SPEEDS },
        parameters: known(twin, &speeds_km_h),
        speeds_km_h,
    }
}

/// Ranges and errors of the parameters for the models of these speeds.
fn known(twin: &Twin<'_>, speeds_km_h: &[f64]) -> BTreeMap<Parameter, Known> {
    let Twin { models, library, .. } = twin;
    let groups: Vec<_> = match models.group(speeds_km_h, METHOD_FEATURE) {
        Some(together) => vec![together],
        None => {
            speeds_km_h.iter().filter_map(|&speed| models.group(&[speed], METHOD_FEATURE)).collect()
        }
    };
    let of = |(column, &parameter): (usize, &Parameter)| {
        let scores = groups.iter().flat_map(|group| group.models());
        let errors = scores.filter(|it| it.parameter == parameter).map(|it| it.score.mase_test);
        let values = library.parameters.iter().skip(column).step_by(library.varied.len());
        let mut values: Vec<f64> = values.map(|&value| library.unit(column, value)).collect();
        values.sort_unstable_by(f64::total_cmp);
        let median = values[values.len() / 2];
        let away: f64 = values.iter().map(|value| (value - median).abs()).sum();
        let known = Known {
            range: library.range(column),
            mase_test: errors.fold(f64::INFINITY, f64::min),
            mase_constant: away / values.len() as f64,
        };
        (parameter, known)
    };
    library.varied.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use tracktwin_surrogate::Side;

    #[test]
    fn the_level_of_an_unseen_recording_lies_within_three_standard_deviations() {
        let (extractor, library) = (testing::extractor(), testing::library());
        let models = testing::models(&library);
        let by_speeds = BySpeeds::default();
        let twin = Twin {
            extractor: &extractor,
            models: &models,
            library: &library,
            by_speeds: &by_speeds,
        };
        for speeds in [&[10.0, 13.0][..], &[10.0]] {
            for truth in [2.0, 4.0] {
                let recording = testing::recording(truth, speeds);
                let evaluation = evaluate(&recording, &twin).unwrap();
                let level = evaluation.sleepers[3].estimates[&Parameter::IrregularityLevel];
                assert!((level.mean - truth).abs() < 3.0 * level.sd, "{truth}: {level:?}");
                assert!(level.sd > 0.0 && level.sd < 1.0, "{level:?}");
                let known = evaluation.provenance.parameters[&Parameter::IrregularityLevel];
                assert!(
                    known.beats_constant() && (known.mase_constant - 0.25).abs() < 0.02,
                    "{known:?}"
                );
                let missing = evaluation.sleepers[3].flags.contains(&Flag::MissingSpeed);
                assert_eq!(missing, speeds.len() == 1);
            }
        }
    }

    #[test]
    fn a_mean_at_an_end_of_the_library_s_range_is_flagged() {
        let (extractor, library) = (testing::extractor(), testing::library());
        let models = testing::models(&library);
        let by_speeds = BySpeeds::default();
        let twin = Twin {
            extractor: &extractor,
            models: &models,
            library: &library,
            by_speeds: &by_speeds,
        };
        let flagged = |level: f64| {
            let evaluation = evaluate(&testing::recording(level, &[10.0, 13.0]), &twin).unwrap();
            evaluation.sleepers[3].flags.contains(&Flag::AtEdgeOfRange)
        };
        // Levels of the library are 1 to 5.
        assert!(flagged(40.0) && !flagged(3.0));
    }

    #[test]
    fn a_level_that_the_library_lacks_is_called_outside_with_the_range_to_widen() {
        let (extractor, library) = (testing::extractor(), testing::library());
        let models = testing::models(&library);
        let by_speeds = BySpeeds::default();
        let twin = Twin {
            extractor: &extractor,
            models: &models,
            library: &library,
            by_speeds: &by_speeds,
        };
        let evaluated =
            |level: f64| evaluate(&testing::recording(level, &[10.0, 13.0]), &twin).unwrap();
        let inside = evaluated(3.0);
        assert_eq!(inside.outside_library, OutsideLibrary::default());
        assert!(inside.sleepers.iter().all(SleeperEvaluation::is_valid));
        // Levels of the library are 1 to 5.
        for (level, side) in [(0.3, Side::Low), (20.0, Side::High)] {
            let evaluation = evaluated(level);
            let outside = &evaluation.outside_library;
            assert!(outside.is_most() && outside.widen[0] == Parameter::IrregularityLevel);
            assert_eq!(outside.ends[0].side, side);
            let json: serde_json::Value = serde_json::from_str(&evaluation.to_json()).unwrap();
            assert_eq!(json["outside_library"]["share"], outside.share);
            assert_eq!(json["outside_library"]["widen"][0], "irregularity_level");
            let flags = json["sleepers"][3]["flags"].as_array().unwrap();
            assert!(flags.contains(&"outside_library".into()), "{flags:?}");
            assert!(
                evaluation.notes.iter().any(|note| note.contains("widen `irregularity_level`"))
            );
            assert!(evaluation.to_csv().lines().nth(4).unwrap().contains(",true,"));
        }
    }

    #[test]
    fn json_and_csv_hold_every_sleeper_under_the_agreed_names() {
        let (extractor, library) = (testing::extractor(), testing::library());
        let models = testing::models(&library);
        let by_speeds = BySpeeds::default();
        let twin = Twin {
            extractor: &extractor,
            models: &models,
            library: &library,
            by_speeds: &by_speeds,
        };
        let evaluation = evaluate(&testing::recording(3.0, &[10.0, 13.0]), &twin).unwrap();
        let json: serde_json::Value = serde_json::from_str(&evaluation.to_json()).unwrap();
        assert_eq!(json["format"], "tracktwin-evaluation/1");
        assert_eq!((&json["recording"], &json["method"]), (&"noise".into(), &"gp".into()));
        let sleeper = &json["sleepers"][3];
        assert_eq!((&sleeper["id"], &sleeper["x_m"]), (&"SN3".into(), &0.375.into()));
        let level = evaluation.sleepers[3].estimates[&Parameter::IrregularityLevel];
        assert_eq!(sleeper["irregularity_level"]["mean"], level.mean);
        assert_eq!(sleeper["irregularity_level"]["sd"], level.sd);
        let csv = evaluation.to_csv();
        assert!(csv.starts_with("id,x_m,railpad_stiffness_N_m_mean,"), "{csv}");
        assert_eq!(json["sleepers"][0]["flags"][0], "incomplete_window");
        assert!(csv.contains(",incomplete_window;short_margin"), "{csv}");
        assert_eq!(csv.lines().count(), 1 + evaluation.sleepers.len());
    }

    #[test]
    fn an_extractor_of_other_features_is_refused() {
        let library = testing::library();
        let models = testing::models(&library);
        let other = Extractor::new(&tracktwin_signal::FeatureDefinition::default()).unwrap();
        let by_speeds = BySpeeds::default();
        let twin =
            Twin { extractor: &other, models: &models, library: &library, by_speeds: &by_speeds };
        let result = evaluate(&testing::recording(3.0, &[10.0]), &twin);
        assert!(matches!(result, Err(Error::OtherFeatures { .. })));
    }
}
