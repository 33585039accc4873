//! Agreement of baseline and extended model with the recording, and their track parameters.

use super::Evidence;
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::estimate::Estimate;
use crate::outcome::{BeforeAfter, FitScores, Hypothesis, Levels, Score, Scores, SleeperValues};
use crate::port_scan::UnknownElement;
use crate::quantity::{Common, Own};
use crate::search::Fitted;
use crate::spectra::DECIBEL;
use nalgebra::DVector;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use tracktwin_parameters::Parameter;

impl Evidence<'_> {
    pub(super) fn problem<'p>(&'p self, candidates: &'p [Candidate]) -> Problem<'p> {
        let (forward, observation) = (&self.prepared.forward, &self.search.observation);
        Problem { forward, observation, candidates }
    }

    pub(super) fn levels(&self) -> Result<Levels, CalibrationError> {
        let forward = &self.prepared.forward;
        let predicted = |candidates: &[Candidate], calibration: &Calibration| {
            let extensions = self.problem(candidates).extensions(&calibration.values)?;
            Ok::<_, CalibrationError>(forward.log_power(&calibration.values, &extensions)?)
        };
        let before = predicted(&[], &self.search.baseline)?;
        let after = predicted(&self.search.accepted, &self.search.last)?;
        let measured = self.search.observation.difference(&DVector::zeros(forward.count()));
        let in_db = |values: &DVector<f64>| {
            let bands = forward.bands.count();
            let of = |speed: usize, sleeper: usize| {
                let row = sleeper * forward.per_sleeper() + speed * bands;
                values.rows(row, bands).iter().map(|value| DECIBEL * value).collect()
            };
            let sleepers = |speed| (0..forward.section.sleepers()).map(|s| of(speed, s)).collect();
            (0..forward.speeds_m_s.len()).map(sleepers).collect()
        };
        let scatter = |speed: usize| {
            let first = speed * forward.bands.count();
            let deviations = self.search.deviation.rows(first, forward.bands.count());
            let in_db = |deviation: &f64| deviation.is_finite().then_some(DECIBEL * deviation);
            deviations.iter().map(in_db).collect()
        };
        Ok(Levels {
            frequency_hz: forward.bands.centres_hz().to_vec(),
            speeds_km_h: forward.speeds_m_s.iter().map(|speed| 3.6 * speed).collect(),
            measured_db: in_db(&measured),
            before_db: in_db(&before),
            after_db: in_db(&after),
            scatter_db: (0..forward.speeds_m_s.len()).map(scatter).collect(),
        })
    }

    pub(super) fn fit(&self, hypotheses: &[Hypothesis]) -> FitScores {
        let search = self.search;
        let in_sample = |calibration: &Calibration| {
            let count = calibration.residual.len() as f64;
            let square = calibration.residual.norm_squared() / count;
            Score { score: -0.5 * (square + TAU.ln()) - search.observation.log_deviation() / count }
        };
        let held_out = |index: usize| {
            let known = self.prepared.forward.speeds_m_s.len() > 1;
            known.then(|| Score { score: search.held_out[index] })
        };
        let speeds = &self.prepared.forward.speeds_m_s;
        let mut gains = BTreeMap::new();
        let is_accepted = |unknown: &UnknownElement| {
            let port = Some(unknown.place.name());
            hypotheses.iter().any(|it| it.accepted && it.port.as_deref() == port)
        };
        let is_named = |best: &Fitted| {
            hypotheses.iter().any(|it| it.accepted && it.physics == best.candidate.kind.physics)
        };
        for round in &search.rounds {
            let gain = match round.accepted {
                true if round.fitted.first().is_some_and(is_named) => &round.held_out_gain[..],
                false if round.port.as_ref().is_some_and(is_accepted) => &round.unknown_gain[..],
                _ => &[],
            };
            for (speed, gain) in speeds.iter().zip(gain) {
                *gains.entry(format!("{:.0}", 3.6 * speed)).or_insert(0.0) += gain;
            }
        }
        FitScores {
            score: "mean log predictive density per band and sleeper, nats".to_owned(),
            before: Scores { in_sample: in_sample(&search.baseline), held_out: held_out(0) },
            after: Scores { in_sample: in_sample(&search.last), held_out: held_out(1) },
            held_out_gain_nats: gains,
        }
    }

    /// Parameters without and with the accepted physics, at its location or on the whole section.
    pub(super) fn bias_removed(
        &self,
        hypotheses: &[Hypothesis],
    ) -> BTreeMap<String, BeforeAfter<f64>> {
        let accepted = hypotheses.iter().find(|hypothesis| hypothesis.accepted);
        if accepted.is_none() || self.search.accepted.is_empty() {
            return BTreeMap::new();
        }
        let place = accepted.and_then(|hypothesis| hypothesis.location.as_ref());
        let section = &self.prepared.forward.section;
        let half_m = section.track.design.sleeper.spacing_m;
        let at_place = |sleeper: &usize| {
            place.is_none_or(|place| {
                let x_m = section.x_m(*sleeper);
                place.x_m[0] - half_m <= x_m && x_m <= place.x_m[1] + half_m
            })
        };
        let near: Vec<usize> = (0..section.sleepers()).filter(at_place).collect();
        if near.is_empty() {
            return BTreeMap::new();
        }
        let unknowns = &self.prepared.forward.unknowns;
        let of = |value: &dyn Fn(&DVector<f64>) -> f64| BeforeAfter {
            before: value(&self.search.baseline.values),
            after: value(&self.search.estimates.values),
        };
        let common = |quantity| of(&|values| values[unknowns.common(quantity)].exp());
        let mean = |quantity| {
            of(&|values| {
                let near_by = near.iter().map(|&sleeper| unknowns.at(quantity, sleeper));
                near_by.map(|index| values[index].exp()).sum::<f64>() / near.len() as f64
            })
        };
        let mut railpad = mean(Own::RailpadStiffness);
        let replaced = near.iter().filter_map(|&sleeper| {
            let at = unknowns.at(Own::RailpadStiffness, sleeper);
            let fitted = self.search.estimates.values[at].exp();
            Some(self.replaced_railpad(hypotheses, sleeper)?.mean - fitted)
        });
        railpad.after += replaced.sum::<f64>() / near.len() as f64;
        BTreeMap::from([
            ("sleeper_EI_N_m2".to_owned(), common(Common::SleeperBendingStiffness)),
            ("railpad_damping_N_s_m".to_owned(), common(Common::RailpadDamping)),
            ("ballast_damping_N_s_m".to_owned(), common(Common::BallastDamping)),
            ("ballast_stiffness_N_m".to_owned(), mean(Own::BallastStiffness)),
            ("railpad_stiffness_N_m".to_owned(), railpad),
            ("irregularity_level".to_owned(), mean(Own::Level)),
        ])
    }

    /// Flags of a sleeper's estimates.
    fn flags(&self, sleeper: usize) -> Vec<String> {
        let id = self.id(sleeper);
        let lost = self.inspection.loss_of_contact.as_ref();
        let flies = lost.is_some_and(|lost| lost.sleepers.contains(&id));
        flies.then(|| "loss_of_contact".to_owned()).into_iter().collect()
    }

    /// What is left of the railpad of a sleeper, if an accepted hypothesis states it.
    fn replaced_railpad(&self, hypotheses: &[Hypothesis], sleeper: usize) -> Option<Estimate> {
        let id = self.id(sleeper);
        hypotheses.iter().find_map(|it| it.in_place_of(Parameter::RailpadStiffness, &id))
    }

    /// Parameters of every sleeper without and with the accepted physics.
    pub(super) fn track(&self, hypotheses: &[Hypothesis]) -> Vec<SleeperValues> {
        let unknowns = &self.prepared.forward.unknowns;
        let [before, after] =
            [&self.search.baseline, &self.search.estimates].map(Calibration::moments);
        let estimate = |[logarithms, deviations]: &[DVector<f64>; 2], index: usize| {
            let mean = logarithms[index].exp();
            Estimate { mean, sd: mean * deviations[index] }
        };
        let both = |quantity, sleeper| {
            let index = unknowns.at(quantity, sleeper);
            BeforeAfter { before: estimate(&before, index), after: estimate(&after, index) }
        };
        let railpad = |sleeper| {
            let fitted = both(Own::RailpadStiffness, sleeper);
            let after = self.replaced_railpad(hypotheses, sleeper).unwrap_or(fitted.after);
            BeforeAfter { after, ..fitted }
        };
        (0..self.prepared.forward.section.sleepers())
            .map(|sleeper| SleeperValues {
                id: self.id(sleeper),
                x_m: self.prepared.forward.section.x_m(sleeper),
                railpad_stiffness: railpad(sleeper),
                ballast_stiffness: both(Own::BallastStiffness, sleeper),
                irregularity_level: both(Own::Level, sleeper),
                flags: self.flags(sleeper),
            })
            .collect()
    }
}
