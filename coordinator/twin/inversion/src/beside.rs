//! Comparison of an inversion with an evaluation by the Gaussian processes of a library.

use crate::record::{Inversion, PER_SLEEPER};
use tracktwin_evaluation::{Evaluation, SleeperEvaluation};
use tracktwin_parameters::Parameter;

/// Two estimates contradict each other if they differ by more than this number of standard deviations of
/// their difference; by chance one pair in 370 does.
const BEYOND_CHANCE: f64 = 3.0;

/// Agreement of two evaluations of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Beside {
    /// The parameter.
    pub parameter: Parameter,
    /// Number of sleepers with valid estimates in both evaluations.
    pub sleepers: usize,
    /// Ids of the sleepers at which the estimates contradict each other beyond chance.
    pub contradict: Vec<String>,
}

/// Compares two evaluations at every sleeper that is valid in both; one entry per parameter.
pub fn beside(inversion: &Inversion, models: &Evaluation) -> Vec<Beside> {
    let valid = |id: &str| -> Option<&SleeperEvaluation> {
        models.sleepers.iter().find(|it| it.id == id && it.is_valid())
    };
    let known = models.parameters();
    let of = |parameter: Parameter| {
        let mut beside = Beside { parameter, sleepers: 0, contradict: Vec::new() };
        for sleeper in inversion.sleepers.iter().filter(|sleeper| sleeper.is_valid()) {
            let one = sleeper.estimates.get(&parameter);
            let other = valid(&sleeper.id).and_then(|other| other.estimates.get(&parameter));
            let (Some(one), Some(other)) = (one, other) else { continue };
            beside.sleepers += 1;
            if (one.mean - other.mean).abs() > BEYOND_CHANCE * one.sd.hypot(other.sd) {
                beside.contradict.push(sleeper.id.clone());
            }
        }
        beside
    };
    PER_SLEEPER.into_iter().filter(|parameter| known.contains(parameter)).map(of).collect()
}

impl Beside {
    /// Whether the estimates contradict each other at more sleepers than chance allows.
    pub fn contradicts(&self) -> bool {
        self.contradict.len() > 1 + self.sleepers / 50
    }

    /// The comparison in a sentence.
    pub fn sentence(&self) -> String {
        let label = self.parameter.label();
        let (count, all) = (self.contradict.len(), self.sleepers);
        if !self.contradicts() {
            return format!("{label}: both methods agree within their uncertainty.");
        }
        format!(
            "{label}: the methods contradict each other at {count} of {all} sleepers. Trust the \
             inversion there: it fits each sleeper for itself, while the Gaussian processes learned \
             from even tracks and average over neighbours."
        )
    }
}
