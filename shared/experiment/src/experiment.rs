//! Experiment of a campaign: all settings except the parameters that determine results.

use crate::ExperimentError;
use serde::{Deserialize, Serialize};
use tracktwin_parameters::quantity::SPEED;
use tracktwin_parameters::{DesignAxis, TrackDesign, check_wavelengths};
use tracktwin_signal::{FeatureDefinition, FeatureError, ThirdOctave};
use tracktwin_track::extension::{SampledExtension, check_together};
use tracktwin_track::model::Vehicle;

/// Smallest number of spans between the evaluated stretch and the held ends of the rail.
pub(crate) const END_SPANS: f64 = 8.0;

/// Largest number of time steps of a pass: a hundred times that of the built-in campaign, at least 16 MB
/// per case.
pub(crate) const STEPS_MAX: f64 = 2e6;

/// Km/h in a m/s.
const KM_H: f64 = 3.6;

/// Shortest and longest wavelength of the irregularity in m. The paper does not state them. At 7 km/h a
/// wavelength of 0.5 mm has a frequency of 3.9 kHz, inside the range of the features.
const WAVELENGTHS_M: [f64; 2] = [0.25e-3, 1.0];

/// A virtual measurement: track, vehicle, speeds and features of the signal.
///
/// [`Experiment::checked`] checks the fields. They are public, so that a campaign can change them before
/// the check.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Design of track and vehicle: sections, masses, spacing and load.
    pub design: TrackDesign,
    /// Numbers of the design that differ from case to case.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub design_axes: Vec<DesignAxis>,
    /// Number of spans of the track.
    pub spans: usize,
    /// Number of rail elements in each span.
    pub rail_elements_per_span: usize,
    /// Number of elements of a half sleeper.
    pub sleeper_elements: usize,
    /// Whether the contact includes the local flexibility inside the loaded rail element.
    pub local_flexibility: bool,
    /// Time step in s. It is also the sample interval.
    pub time_step_s: f64,
    /// Speeds in km/h, ascending. A case has one pass at each speed, all over the same surface.
    pub speeds_km_h: Vec<f64>,
    /// Smallest number of spans that the wheel runs before the recorded stretch.
    pub run_in_spans: f64,
    /// Shortest and longest wavelength of the irregularity in m.
    pub wavelengths_m: [f64; 2],
    /// Definition of the features.
    pub features: FeatureDefinition,
    /// Extensions: physics beyond the model of the paper, and faults of the measuring chain. The
    /// evaluated sleeper has the index `spans / 2 - 1`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extensions: Vec<SampledExtension>,
}

/// Stretch of the wheel at one speed, and its recorded part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the unit belongs to the name")]
pub(crate) struct Stretch {
    /// Where the wheel starts in m.
    pub(crate) start_m: f64,
    /// Where the kept part starts: the window and its margin.
    pub(crate) kept_m: f64,
    /// Where the window starts.
    pub(crate) window_m: f64,
    /// Where it ends.
    pub(crate) window_end_m: f64,
    /// Where the margin behind it, and the pass, ends.
    pub(crate) end_m: f64,
}

impl Experiment {
    /// The simulation of the paper on a track of this design, at the speeds of Table D1. The track has
    /// 40 spans, because with the 25 spans of the paper the ends of the rail have an effect. Each span
    /// has 4 rail elements. With the local flexibility their result is within 0.012 dB of that of 32
    /// elements.
    pub fn new(design: TrackDesign) -> Self {
        Self {
            design,
            design_axes: Vec::new(),
            spans: 40,
            rail_elements_per_span: 4,
            sleeper_elements: 8,
            local_flexibility: true,
            time_step_s: 1e-5,
            speeds_km_h: vec![7.0, 10.0, 13.0],
            run_in_spans: 2.0,
            wavelengths_m: WAVELENGTHS_M,
            features: FeatureDefinition::default(),
            extensions: Vec::new(),
        }
    }

    /// Checks all settings and returns the experiment.
    ///
    /// # Errors
    /// [`ExperimentError`] names the invalid setting and its allowed values.
    pub fn checked(self) -> Result<Self, ExperimentError> {
        self.check_speeds()?;
        self.features.check().map_err(FeatureError::from)?;
        if self.features.bands().count() != ThirdOctave::COUNT {
            return Err(ExperimentError::Bands);
        }
        check_wavelengths(self.wavelengths_m)?;
        let range = |setting, value: f64, [low, high]: [f64; 2]| {
            let fits = (low..=high).contains(&value);
            if fits {
                Ok(())
            } else {
                Err(ExperimentError::OutOfRange { setting, value, low, high })
            }
        };
        range("spans", self.spans as f64, [2.0, 1000.0])?;
        range("rail_elements_per_span", self.rail_elements_per_span as f64, [1.0, 512.0])?;
        range("sleeper_elements", self.sleeper_elements as f64, [1.0, 512.0])?;
        // Ten steps a period of the highest feature.
        range("time_step_s", self.time_step_s, [1e-8, 0.1 / self.features.highest_hz])?;
        range("run_in_spans", self.run_in_spans, [0.0, 1000.0])?;
        DesignAxis::check_all(&self.design_axes, &self.design)?;
        for design in self.end_designs() {
            self.check_room(&design)?;
            self.check_steps(&design)?;
            let wheels_m = self.check_extensions(&design)?;
            self.check_wheels(&design, &wheels_m)?;
        }
        Ok(self)
    }

    /// Checks the extensions at both ends of their ranges. Returns the distances in m of all further wheels.
    fn check_extensions(&self, design: &TrackDesign) -> Result<Vec<f64>, ExperimentError> {
        let mut wheels_m = design.wheel.further_wheels_m.clone();
        let mut built = Vec::new();
        for extension in &self.extensions {
            let ends = extension.checked(design, self.spans)?;
            for at_end in &ends {
                let mut vehicle = Vehicle::rigid(&design.wheel);
                at_end.equip(&mut vehicle);
                wheels_m.extend(vehicle.further_wheels_m);
            }
            built.push((extension, ends));
        }
        let low = built.iter().map(|(it, [low, _])| (&*it.physics, it.sleepers.as_deref(), &**low));
        check_together(&low.collect::<Vec<_>>())?;
        Ok(wheels_m)
    }

    /// Reads the canonical JSON of an experiment and checks it.
    ///
    /// # Errors
    /// [`ExperimentError::Json`] if the text is not an experiment of this program version; also the
    /// errors of [`Experiment::checked`].
    pub fn from_json(json: &str) -> Result<Self, ExperimentError> {
        serde_json::from_str::<Self>(json)
            .map_err(|error| ExperimentError::Json { message: error.to_string() })?
            .checked()
    }

    /// The experiment as canonical JSON: fields in order of declaration, shortest numbers.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("numbers and names become JSON")
    }

    /// BLAKE3 of [`Experiment::to_json`], hexadecimal.
    pub fn hash(&self) -> String {
        blake3::hash(self.to_json().as_bytes()).to_hex().to_string()
    }

    /// Number of the evaluated sleeper, which is in the middle of the track, at the end of this number
    /// of spans.
    pub const fn sleeper(&self) -> usize {
        self.spans / 2
    }

    fn check_speeds(&self) -> Result<(), ExperimentError> {
        let speeds = &self.speeds_km_h;
        let positive = speeds.iter().all(|speed| speed.is_finite() && *speed > 0.0);
        let ascending = speeds.windows(2).all(|pair| pair[0] < pair[1]);
        if !positive || !ascending || speeds.is_empty() {
            return Err(ExperimentError::Speeds { speeds: speeds.clone() });
        }
        for &speed in speeds {
            SPEED.check(speed)?;
        }
        Ok(())
    }

    /// The slowest pass is held in memory, a group of cases at a time.
    fn check_steps(&self, design: &TrackDesign) -> Result<(), ExperimentError> {
        let Some(&speed_km_h) = self.speeds_km_h.first() else { return Ok(()) };
        let stretch = self.stretch(design, speed_km_h);
        let way_m = stretch.end_m - stretch.start_m;
        let steps = way_m / metres_per_second(speed_km_h) / self.time_step_s;
        if steps <= STEPS_MAX {
            return Ok(());
        }
        Err(ExperimentError::TooManySteps { time_step_s: self.time_step_s, steps, speed_km_h })
    }

    /// The way over a track of this design at one speed: the window is one spacing, centred at the middle sleeper.
    pub(crate) fn stretch(&self, design: &TrackDesign, speed_km_h: f64) -> Stretch {
        let spacing = design.sleeper.spacing_m;
        let margin = self.features.margin_s * speed_km_h / KM_H;
        let window_m = (self.sleeper() as f64 - 0.5) * spacing;
        let kept_m = window_m - margin;
        Stretch {
            start_m: kept_m - self.run_in_spans * spacing,
            kept_m,
            window_m,
            window_end_m: window_m + spacing,
            end_m: window_m + spacing + margin,
        }
    }

    /// Everything kept stays [`END_SPANS`] off the ends, and the run-in begins on the track.
    fn check_room(&self, design: &TrackDesign) -> Result<(), ExperimentError> {
        // The margin is a time, so that the fastest pass needs the longest track.
        let speed_km_h = self.speeds_km_h.iter().copied().fold(0.0, f64::max);
        let spacing = design.sleeper.spacing_m;
        let stretch = self.stretch(design, speed_km_h);
        let half = (stretch.window_end_m - stretch.kept_m) / spacing - 0.5;
        let needed = ((half + END_SPANS.max(self.run_in_spans)).ceil() * 2.0) as usize;
        if self.spans < needed {
            return Err(ExperimentError::TooShort { spans: self.spans, speed_km_h, needed });
        }
        Ok(())
    }

    /// Every further wheel stays on the track. `wheels_m` are the distances in m in front of the first one.
    fn check_wheels(&self, design: &TrackDesign, wheels_m: &[f64]) -> Result<(), ExperimentError> {
        let speed_km_h = self.speeds_km_h.iter().copied().fold(0.0, f64::max);
        let (spans, spacing) = (self.spans, design.sleeper.spacing_m);
        let Stretch { start_m, end_m, .. } = self.stretch(design, speed_km_h);
        let length_m = spans as f64 * spacing;
        let beyond_m = |ahead_m: f64| (-(start_m + ahead_m)).max(end_m + ahead_m - length_m);
        let farthest =
            wheels_m.iter().copied().max_by(|a, b| beyond_m(*a).total_cmp(&beyond_m(*b)));
        match farthest.map(|ahead_m| (ahead_m, beyond_m(ahead_m))) {
            Some((ahead_m, beyond_m)) if beyond_m > 0.0 => {
                // More spans move both ends of the track away from its middle.
                let needed = spans + 2 * (beyond_m / spacing).ceil() as usize + 1;
                Err(ExperimentError::WheelOffTrack { spans, ahead_m, speed_km_h, needed })
            }
            _ => Ok(()),
        }
    }
}

/// A speed in m/s.
pub fn metres_per_second(speed_km_h: f64) -> f64 {
    speed_km_h / KM_H
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use tracktwin_parameters::Scale;
    use tracktwin_track::extension::SampledValue;

    fn experiment() -> Experiment {
        Experiment::new(TrackDesign::v_track())
    }

    fn refusal(change: impl FnOnce(&mut Experiment)) -> String {
        let mut experiment = experiment();
        change(&mut experiment);
        experiment.checked().unwrap_err().to_string()
    }

    #[test]
    fn the_paper_s_experiment_can_be_done() {
        assert_eq!(experiment().checked().unwrap(), experiment());
        let real_scale = Experiment {
            speeds_km_h: vec![35.0, 50.0, 65.0],
            ..Experiment::new(TrackDesign::v_track().enlarged(5.0))
        };
        real_scale.checked().unwrap();
    }

    #[test]
    fn what_is_kept_stays_eight_spans_off_the_ends() {
        let spacing = experiment().design.sleeper.spacing_m;
        for speed in experiment().speeds_km_h {
            let stretch = experiment().stretch(&experiment().design, speed);
            assert!(stretch.kept_m >= 8.0 * spacing);
            assert!(stretch.end_m <= 32.0 * spacing);
            assert!(stretch.start_m > 0.0);
        }
    }

    #[test]
    fn a_track_too_short_is_refused_with_a_length_that_suffices() {
        let message = refusal(|experiment| experiment.spans = 16);
        assert!(message.starts_with("spans: 16 is too small for 13 km/h"), "{message}");
        let mut longer = experiment();
        longer.speeds_km_h = vec![13.0, 100.0];
        let Err(ExperimentError::TooShort { needed, .. }) = longer.clone().checked() else {
            panic!("100 km/h needs more than 40 spans")
        };
        longer.spans = needed;
        longer.checked().unwrap();
    }

    #[test]
    fn a_wheel_that_leaves_the_track_is_refused_with_a_length_that_suffices() {
        for ahead_m in [3.2, -3.2] {
            let mut far = experiment();
            far.design.wheel.further_wheels_m = vec![0.3, ahead_m];
            let Err(ExperimentError::WheelOffTrack { needed, .. }) = far.clone().checked() else {
                panic!("a wheel {ahead_m} m ahead leaves a track of 5 m")
            };
            far.spans = needed;
            far.checked().unwrap();
        }
        let distance = SampledValue::Scaled { low: 0.8, high: 3.2, scale: Scale::Logarithmic };
        let wheel = SampledExtension {
            physics: "second_wheel".to_owned(),
            x_m: None,
            sleepers: None,
            share: 0.5,
            parameters: BTreeMap::from([("distance_m".to_owned(), distance)]),
        };
        let message = refusal(|experiment| experiment.extensions = vec![wheel]);
        assert!(message.contains("the wheel 3.2 m ahead"), "{message}");
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        assert!(refusal(|e| e.speeds_km_h = vec![]).starts_with("speeds_km_h"));
        assert!(refusal(|e| e.speeds_km_h = vec![10.0, 7.0]).starts_with("speeds_km_h"));
        assert!(refusal(|e| e.speeds_km_h = vec![f64::NAN]).starts_with("speeds_km_h"));
        assert!(refusal(|e| e.time_step_s = 1.0).starts_with("time_step_s"));
        assert!(refusal(|e| e.sleeper_elements = 0).starts_with("sleeper_elements"));
        assert!(refusal(|e| e.wavelengths_m = [1.0, 0.1]).starts_with("wavelengths_m"));
        assert!(refusal(|e| e.features.highest_hz = 2000.0).starts_with("features"));
    }

    #[test]
    fn an_experiment_without_extensions_does_not_speak_of_them() {
        assert!(!experiment().to_json().contains("extension"));
    }

    #[test]
    fn an_extension_that_cannot_be_is_refused() {
        let message = refusal(|experiment| {
            let bolts = r#"{"physics": "sleeper_bolt", "stiffness_N_per_m": [-1e7, 1e7]}"#;
            experiment.extensions = vec![serde_json::from_str(bolts).unwrap()];
        });
        assert!(message.starts_with("extension: sleeper_bolt: stiffness_N_per_m"), "{message}");
    }

    #[test]
    fn an_experiment_survives_its_json_and_an_unknown_setting_does_not() {
        let json = experiment().to_json();
        let back = Experiment::from_json(&json).unwrap();
        assert_eq!(back.hash(), experiment().hash());
        let unknown = json.replacen('{', "{\"wheel_flat_m\":1e-5,", 1);
        let error = Experiment::from_json(&unknown).unwrap_err();
        assert!(error.to_string().contains("wheel_flat_m"), "{error}");
    }
}
