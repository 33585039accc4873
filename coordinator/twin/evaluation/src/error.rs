//! Errors of an evaluation.

use crate::speeds::BETWEEN_MAX;
use tracktwin_number::rounded;
use tracktwin_signal::FeatureError;
use tracktwin_signal::recording::OtherTrack;

/// Errors of an evaluation.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The passes have a speed for which there is no model.
    #[error(
        "the recording {recording} has passes at {} km/h; the models are for {} km/h \
             (within 2 %, or within {:.0} % of one of them and between two); evaluate by \
             inversion, or train models on a campaign with this speed",
        rounded(*speed_km_h, 4),
        join(known),
        100.0 * BETWEEN_MAX
    )]
    UnknownSpeed {
        /// The recording's name.
        recording: String,
        /// The speed of the passes in km/h.
        speed_km_h: f64,
        /// The speeds of the models in km/h.
        known: Vec<f64>,
    },
    /// The features are defined differently from those in training.
    #[error("the models were trained on other features: {trained_on}, not {offered}")]
    OtherFeatures {
        /// The definition of the models, as JSON.
        trained_on: String,
        /// The definition of this evaluation, as JSON.
        offered: String,
    },
    /// The sensor gain is unknown.
    #[error(
        "recording.json: nominal.gain_known: is false; the evaluation needs levels: import again with \
         `--unit m/s2` or `--unit g`"
    )]
    GainUnknown,
    /// The recording belongs to another track or vehicle.
    #[error(
        "{} {}, the models are of {}; train models of such a track, or of a campaign that varies this number",
        .0.quantity, .0.found(), .0.known()
    )]
    OtherTrack(OtherTrack),
    /// Two sleepers have another distance than those of the models.
    #[error(
        "recording.json: sleepers: the distance between {} and {} is {distance_m:.3} m, that of the models \
         {spacing_m} m or a multiple; correct `x_m`, or leave out unevenly spaced sleepers", .between[0], .between[1]
    )]
    Uneven {
        /// Ids of the two sleepers.
        between: [String; 2],
        /// Distance of the two sleepers in m.
        distance_m: f64,
        /// Sleeper spacing of the models in m.
        spacing_m: f64,
    },
    /// There is no model for these speeds and this feature set.
    #[error("the {feature} model for {} km/h is missing; train it", join(speeds_km_h))]
    NoModel {
        /// Speeds in km/h.
        speeds_km_h: Vec<f64>,
        /// The feature set.
        feature: &'static str,
    },
    /// The features of a window cannot be computed.
    #[error("pass {file}, sleeper {sleeper}: {source}")]
    Features {
        /// The file of the pass.
        file: String,
        /// The sleeper's id.
        sleeper: String,
        /// Reason.
        source: FeatureError,
    },
    /// The sample rate is too low for the features of the models.
    #[error(
        "recording.json: sample_rate_Hz: {source}; evaluate without models, or train models for this rate \
         (`tracktwin train --highest {}`)",
        rounded(*highest_hz, 5)
    )]
    Rate {
        /// Rate of the recording and the lowest that is allowed.
        source: FeatureError,
        /// Highest frequency in Hz of features that this rate allows.
        highest_hz: f64,
    },
    /// The sample rate of a stream differs from the declared rate.
    #[error(
        "time_s: the samples come at {} Hz, but recording.json states {} Hz in sample_rate_Hz",
        rounded(*observed_hz, 6),
        rounded(*declared_hz, 6)
    )]
    OtherSampleRate {
        /// Sample rate in Hz, computed from the times of the samples.
        observed_hz: f64,
        /// Sample rate in Hz declared in the recording.
        declared_hz: f64,
    },
    /// No sleeper has a window at any speed.
    #[error("no sleeper of the recording {recording} has a window inside a pass")]
    NothingToEvaluate {
        /// The recording's name.
        recording: String,
    },
    /// Error of the models or of the training set.
    #[error(transparent)]
    Surrogate(#[from] tracktwin_surrogate::Error),
}

impl From<OtherTrack> for Error {
    // Not a source: the message contains its numbers.
    fn from(other: OtherTrack) -> Self {
        Self::OtherTrack(other)
    }
}

fn join(speeds: &[f64]) -> String {
    speeds.iter().map(|speed| rounded(*speed, 4)).collect::<Vec<_>>().join(", ")
}
