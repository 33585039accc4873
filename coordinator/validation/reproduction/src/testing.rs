//! Made-up libraries whose answers are known, for tests.

use crate::{ClaimVerdict, Compared, EvaluatedExample, Example, Figure, examples};
use tracktwin_evaluation::Estimate;
use tracktwin_parameters::{Parameter, ParameterSet, Scale};
use tracktwin_surrogate::TrainingSet;

/// Frequencies of the made-up bins: 24 an octave from 50 to 4000 Hz.
pub(crate) fn frequencies_hz() -> Vec<f64> {
    (0..152).map(|bin| 50.0 * 2.0_f64.powf(f64::from(bin) / 24.0)).collect()
}

/// A number between 0 and 1 that only looks drawn.
pub(crate) fn random(index: usize) -> f64 {
    (((index as f64 + 1.0) * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0)
}

/// Values of a case, spread over Table D1.
pub(crate) fn parameters(case: usize) -> ParameterSet {
    Parameter::ALL.iter().enumerate().fold(ParameterSet::nominal(), |set, (axis, &parameter)| {
        let [low, high] = parameter.range();
        // Additive recurrence: as even as a Sobol sequence.
        let share = (0.5 + (case + 1) as f64 * STEPS[axis]).fract();
        set.with(parameter, low + share * (high - low))
    })
}

const STEPS: [f64; 6] = [0.618_034, 0.754_878, 0.569_841, 0.819_173, 0.671_044, 0.549_701];

/// Value of a parameter as a share of its range in Table D1, 0 to 1.
pub(crate) fn share(set: &ParameterSet, parameter: Parameter) -> f64 {
    let [low, high] = parameter.range();
    (set[parameter] - low) / (high - low)
}

/// A library whose ln LWPS is a function of speed index, parameters and frequency, and a little
/// noise.
pub(crate) fn library(
    speeds_km_h: &[f64],
    entries: usize,
    of: impl Fn(usize, &ParameterSet, f64) -> f64,
) -> TrainingSet {
    let frequencies_hz = frequencies_hz();
    let sets: Vec<ParameterSet> = (0..entries).map(parameters).collect();
    let table = |speed: usize| {
        let row = |(case, set): (usize, &ParameterSet)| {
            let noise = |bin: usize| 0.05 * random(1000 * case + 7 * bin + speed);
            let bins = frequencies_hz.iter().enumerate();
            bins.map(|(bin, &f)| of(speed, set, f) + noise(bin)).collect::<Vec<_>>()
        };
        sets.iter().enumerate().flat_map(row).collect()
    };
    TrainingSet {
        log_power: (0..speeds_km_h.len()).map(table).collect(),
        frequencies_hz: frequencies_hz.clone(),
        speeds_km_h: speeds_km_h.to_vec(),
        varied: Parameter::ALL.to_vec(),
        scales: vec![Scale::Linear; Parameter::COUNT],
        parameters: sets.iter().flat_map(|set| *set.values()).collect(),
        campaign: "made up".to_owned(),
        library_digest: "0123".to_owned(),
        feature_definition: serde_json::json!({}),
    }
}

/// A bump at a frequency in Hz, of this height.
pub(crate) struct Bump(pub(crate) f64, pub(crate) f64);

impl Bump {
    pub(crate) fn at(&self, frequency_hz: f64) -> f64 {
        self.1 * (-((frequency_hz / self.0).ln() / 0.06).powi(2)).exp()
    }
}

pub(crate) fn verdicts(compared: &Compared) -> Vec<ClaimVerdict> {
    compared.rows.iter().map(|row| row.verdict).collect()
}

/// Estimates of a figure's examples: means as said of example, sleeper (from 1) and parameter, with
/// a standard deviation that is this share of the parameter's range.
pub(crate) fn told(
    figure: Figure,
    sd: f64,
    mean: impl Fn(&Example, usize, Parameter) -> f64,
) -> Vec<EvaluatedExample> {
    let estimate = |example: &Example, at: usize, parameter: Parameter| {
        let [low, high] = parameter.range();
        Estimate { mean: mean(example, at, parameter), sd: sd * (high - low) }
    };
    let of = |example: Example| {
        let sleeper = |at: usize| {
            let all = Parameter::ALL.iter();
            all.map(|&parameter| (parameter, estimate(&example, at, parameter))).collect()
        };
        let sleepers = (1..=example.sleepers.len()).map(sleeper).collect();
        EvaluatedExample { example, sleepers, inverted: None }
    };
    examples(figure).into_iter().map(of).collect()
}
