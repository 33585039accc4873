//! From a search to the diagnosis that is written down.

use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::candidate::Candidate;
use crate::finding::{Finding, Place};
use crate::first_look::FirstLook;
use crate::outcome::{
    BeforeAfter, Diagnosis, Estimate, FORMAT, Fit, Hypothesis, Levels, Location, Mismatch, Score,
    Scores, SleeperValues, Verdict,
};
use crate::search::{Fitted, Round, Search, TEMPERATURE};
use crate::sentence::sentence;
use crate::subject::Subject;
use nalgebra::DVector;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::{Kind, PlaceKind};

/// Decibels in a neper of power.
const DECIBEL: f64 = 4.342_944_819_032_518;

/// Share of a trace's square by which a sleeper belongs to the place of a mismatch.
const PLACE_SHARE: f64 = 0.1;

/// Error of a place on the recording's scale in sleeper spacings: odometers wander by millimetres.
const PLACE_ERROR: f64 = 0.04;

/// Probability of an unnamed alternative against a name of equal evidence: most of what goes wrong
/// on a track is in the catalogue.
const UNKNOWN_PRIOR: f64 = 0.1;

/// Probability to see such evidence for an unknown stiffness if nothing is left out, up to which it
/// is said to be there.
const PORT_ALARM: f64 = 0.01;

/// Probability that what is left beside a named effect is something new.
const REMAINDER_PRIOR: f64 = 0.2;

/// Least prior of nothing at all.
const NOTHING_PRIOR: f64 = 0.5;

/// Hypotheses of less probability are not worth a line.
const PROBABILITY_MIN: f64 = 0.001;

/// Everything that a conclusion is drawn from.
pub struct Evidence<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// What was compared.
    pub subject: &'a Subject,
    /// What the passes tell alone.
    pub look: &'a FirstLook,
    /// What the model tells.
    pub search: &'a Search,
}

impl Evidence<'_> {
    /// The diagnosis.
    ///
    /// # Errors
    /// [`CalibrationError`] when a calibrated track makes no model.
    pub fn conclude(&self) -> Result<Diagnosis, CalibrationError> {
        let mut hypotheses = self.hypotheses();
        hypotheses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let verdict = verdict(&hypotheses);
        if verdict == Verdict::Consistent {
            hypotheses.clear();
        }
        let levels = self.levels()?;
        let fit = self.fit();
        let bias_removed = self.bias_removed(&hypotheses);
        let sleepers = self.subject.forward.section.sleepers;
        let sentence = sentence(verdict, &hypotheses, sleepers, &fit, &bias_removed);
        Ok(Diagnosis {
            format: FORMAT.to_owned(),
            recording: self.recording.name.clone(),
            verdict,
            sentence,
            mismatches: self.mismatches(verdict, &levels),
            hypotheses,
            fit,
            bias_removed,
            track: self.track(),
            levels,
            notes: self.notes(),
        })
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let mut all: Vec<Hypothesis> = Vec::new();
        let rounds = self.search.rounds.iter().filter(|round| round.p_value <= 0.05);
        for round in rounds {
            for hypothesis in self.of_round(round) {
                let known = all.iter_mut().find(|known| {
                    known.physics == hypothesis.physics && known.location == hypothesis.location
                });
                match known {
                    Some(known) => {
                        known.probability = known.probability.max(hypothesis.probability);
                    }
                    None => all.push(hypothesis),
                }
            }
        }
        for finding in &self.look.findings {
            self.add_finding(finding, &mut all);
        }
        all.retain(|hypothesis| hypothesis.accepted || hypothesis.probability >= PROBABILITY_MIN);
        all
    }

    /// Probabilities of what one search fitted: evidence, tempered, times prior.
    fn of_round(&self, round: &Round) -> Vec<Hypothesis> {
        let weight = |log_evidence: f64| (log_evidence / TEMPERATURE).min(300.0).exp();
        let kinds = tracktwin_track::extension::KINDS.len() as f64;
        let named: Vec<f64> = round
            .fitted
            .iter()
            .map(|fitted| (1.0 - NOTHING_PRIOR) / kinds * weight(fitted.log_evidence))
            .collect();
        let unknown = round.port.as_ref().map_or(0.0, |port| {
            UNKNOWN_PRIOR * (1.0 - NOTHING_PRIOR) / kinds * weight(port.log_evidence)
        });
        let all = NOTHING_PRIOR + unknown + named.iter().sum::<f64>();
        let mut hypotheses: Vec<Hypothesis> = round
            .fitted
            .iter()
            .zip(&named)
            .enumerate()
            .map(|(rank, (fitted, weight))| {
                self.hypothesis(fitted, weight / all, round.accepted && rank == 0)
            })
            .collect();
        // What is left beside a named effect may be its model's error as well as something new.
        let first = self.search.rounds.first().is_some_and(|first| std::ptr::eq(first, round));
        let alone = first && !round.accepted;
        if let Some(port) = &round.port {
            let location = port.sleeper.map(|sleeper| self.location(sleeper..sleeper + 1));
            hypotheses.push(Hypothesis {
                physics: "unknown_physics".to_owned(),
                probability: unknown / all * if alone { 1.0 } else { REMAINDER_PRIOR },
                accepted: alone && round.port_p_value <= PORT_ALARM && unknown / all > 0.5,
                location,
                parameters: BTreeMap::new(),
                look_alikes: Vec::new(),
                would_separate: "a hammer test at the place: its receptance names the element"
                    .to_owned(),
                detectability: 0.0,
                log_evidence: port.log_evidence,
            });
        }
        hypotheses
    }

    fn hypothesis(&self, fitted: &Fitted, probability: f64, accepted: bool) -> Hypothesis {
        let Fitted { candidate, calibration, log_evidence, detectability, .. } = fitted;
        let first = calibration.values.len() - candidate.free.len();
        let covariance = calibration.precision.inverse();
        let parameters = candidate.free.iter().enumerate().map(|(index, parameter)| {
            let mean = calibration.values[first + index].exp();
            let deviation = covariance[(first + index, first + index)].sqrt();
            (parameter.name.to_owned(), Estimate { mean, sd: mean * deviation })
        });
        Hypothesis {
            physics: candidate.kind.physics.to_owned(),
            probability,
            accepted,
            location: self.location_of(candidate),
            parameters: parameters.collect(),
            look_alikes: names(candidate.kind),
            would_separate: candidate.kind.would_separate.to_owned(),
            detectability: *detectability,
            log_evidence: *log_evidence,
        }
    }

    /// What the passes alone show stands by itself where the model has not found it as well.
    fn add_finding(&self, finding: &Finding, all: &mut Vec<Hypothesis>) {
        let Some(kind) = Kind::from_name(finding.physics) else { return };
        let probability = 1.0 - finding.p_value.clamp(1e-6, 1.0);
        let known = all.iter_mut().find(|known| known.physics == finding.physics);
        if let Some(known) = known {
            known.probability = known.probability.max(probability);
            if known.accepted {
                return;
            }
        }
        let explained = all.iter().any(|known| known.accepted && !kind.measuring_chain);
        let location = match finding.place {
            Place::Everywhere => None,
            Place::Stretch { from_m, to_m } => Some(self.location_between(from_m, to_m)),
        };
        let estimate =
            |(&name, &(mean, sd)): (&&str, &(f64, f64))| (name.to_owned(), Estimate { mean, sd });
        all.retain(|known| known.accepted || known.physics != finding.physics);
        all.push(Hypothesis {
            physics: finding.physics.to_owned(),
            probability: if explained { probability.min(0.5) } else { probability },
            accepted: !explained,
            location,
            parameters: finding.parameters.iter().map(estimate).collect(),
            look_alikes: names(kind),
            would_separate: kind.would_separate.to_owned(),
            detectability: 0.0,
            log_evidence: -finding.p_value.max(1e-300).ln(),
        });
    }

    fn location_of(&self, candidate: &Candidate) -> Option<Location> {
        let section = &self.subject.forward.section;
        match (candidate.kind.place, candidate.extension.x_m, &candidate.extension.sleepers) {
            (PlaceKind::Nowhere, _, _) => None,
            (_, Some([from_m, to_m]), _) => Some(self.location_between(from_m, to_m)),
            (_, None, Some(sleepers)) => {
                let ids = sleepers.iter().map(|&sleeper| self.id(sleeper)).collect();
                let (first, last) = (sleepers.first()?, sleepers.last()?);
                Some(Location { x_m: [section.x_m(*first), section.x_m(*last)], sleepers: ids })
            }
            (_, None, None) => Some(self.location(0..section.sleepers)),
        }
    }

    fn location(&self, sleepers: Range<usize>) -> Location {
        let section = &self.subject.forward.section;
        Location {
            x_m: [section.x_m(sleepers.start), section.x_m(sleepers.end - 1)],
            sleepers: sleepers.map(|sleeper| self.id(sleeper)).collect(),
        }
    }

    /// A stretch with the sleepers whose half bays it touches.
    fn location_between(&self, from_m: f64, to_m: f64) -> Location {
        let section = &self.subject.forward.section;
        let half_m = (0.5 + PLACE_ERROR) * section.design.sleeper.spacing_m;
        let near = |sleeper: &usize| {
            let x_m = section.x_m(*sleeper);
            from_m - half_m <= x_m && x_m <= to_m + half_m
        };
        let sleepers = (0..section.sleepers).filter(near).map(|sleeper| self.id(sleeper));
        Location { x_m: [from_m, to_m], sleepers: sleepers.collect() }
    }

    fn id(&self, sleeper: usize) -> String {
        self.recording.sleepers[self.subject.first_sleeper + sleeper].id.clone()
    }

    fn mismatches(&self, verdict: Verdict, levels: &Levels) -> Vec<Mismatch> {
        if verdict == Verdict::Consistent {
            return Vec::new();
        }
        let rounds = self.search.rounds.iter().filter(|round| round.p_value <= 0.05);
        let found = rounds.filter_map(|round| {
            let best = round.fitted.first()?;
            Some(self.mismatch(best, round.p_value, levels))
        });
        found.take(self.search.accepted.len().max(1)).collect()
    }

    /// Sleepers and bands where the best candidate changes the prediction most.
    fn mismatch(&self, fitted: &Fitted, p_value: f64, levels: &Levels) -> Mismatch {
        let forward = &self.subject.forward;
        let square = |row: usize| fitted.change[row].powi(2);
        let (mut by_sleeper, mut by_band) =
            (vec![0.0; forward.section.sleepers], vec![0.0; forward.bands.count()]);
        for row in 0..forward.count() {
            let (sleeper, _, band) = forward.place(row);
            by_sleeper[sleeper] += square(row);
            by_band[band] += square(row);
        }
        let sleepers = loud(&by_sleeper);
        let bands = loud(&by_band);
        let mut sum = (0.0, 0.0);
        for (measured, before) in levels.measured_db.iter().zip(&levels.before_db) {
            for sleeper in sleepers.clone() {
                for band in bands.clone() {
                    sum.0 += (measured[sleeper][band] - before[sleeper][band]).powi(2);
                    sum.1 += 1.0;
                }
            }
        }
        let Location { x_m, sleepers } = self.location(sleepers);
        let centres = forward.bands.centres_hz();
        Mismatch {
            x_m,
            sleepers,
            frequency_hz: [centres[bands.start], centres[bands.end - 1]],
            speeds_km_h: levels.speeds_km_h.clone(),
            level_db: f64::sqrt(sum.0 / sum.1),
            p_value,
        }
    }

    fn problem<'p>(&'p self, candidates: &'p [Candidate]) -> Problem<'p> {
        let (forward, observation) = (&self.subject.forward, &self.search.observation);
        Problem { forward, observation, candidates }
    }

    fn levels(&self) -> Result<Levels, CalibrationError> {
        let forward = &self.subject.forward;
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
            let sleepers = |speed| (0..forward.section.sleepers).map(|s| of(speed, s)).collect();
            (0..forward.speeds_m_s.len()).map(sleepers).collect()
        };
        let scatter = |speed: usize| {
            let first = speed * forward.bands.count();
            let of_band = |band| DECIBEL * self.search.deviation[first + band];
            (0..forward.bands.count()).map(of_band).collect()
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

    fn fit(&self) -> Fit {
        let search = self.search;
        let in_sample = |calibration: &Calibration| {
            let count = calibration.residual.len() as f64;
            let square = calibration.residual.norm_squared() / count;
            Score { score: -0.5 * (square + TAU.ln()) - search.observation.log_deviation() / count }
        };
        let held_out = |index: usize| {
            let known = self.subject.forward.speeds_m_s.len() > 1;
            known.then(|| Score { score: search.held_out[index] })
        };
        let speeds = &self.subject.forward.speeds_m_s;
        let mut gains = BTreeMap::new();
        for round in search.rounds.iter().filter(|round| round.accepted) {
            for (speed, gain) in speeds.iter().zip(&round.held_out_gain) {
                *gains.entry(format!("{:.0}", 3.6 * speed)).or_insert(0.0) += gain;
            }
        }
        Fit {
            score: "mean log predictive density per band and sleeper, nats".to_owned(),
            before: Scores { in_sample: in_sample(&search.baseline), held_out: held_out(0) },
            after: Scores { in_sample: in_sample(&search.last), held_out: held_out(1) },
            held_out_gain_nats: gains,
        }
    }

    /// Parameters at the place of what was accepted, or everywhere.
    fn bias_removed(&self, hypotheses: &[Hypothesis]) -> BTreeMap<String, BeforeAfter<f64>> {
        let accepted = hypotheses.iter().find(|hypothesis| hypothesis.accepted);
        if accepted.is_none() || self.search.accepted.is_empty() {
            return BTreeMap::new();
        }
        let place = accepted.and_then(|hypothesis| hypothesis.location.as_ref());
        let section = &self.subject.forward.section;
        let half_m = section.design.sleeper.spacing_m;
        let at_place = |sleeper: &usize| {
            place.is_none_or(|place| {
                let x_m = section.x_m(*sleeper);
                place.x_m[0] - half_m <= x_m && x_m <= place.x_m[1] + half_m
            })
        };
        let near: Vec<usize> = (0..section.sleepers).filter(at_place).collect();
        let unknowns = &self.subject.forward.unknowns;
        let mean = |calibration: &Calibration, range: Range<usize>| {
            let values = near.iter().map(|sleeper| calibration.values[range.start + sleeper].exp());
            values.sum::<f64>() / near.len() as f64
        };
        let of = |value: &dyn Fn(&Calibration) -> f64| BeforeAfter {
            before: value(&self.search.baseline),
            after: value(&self.search.last),
        };
        let global = unknowns.global().start;
        BTreeMap::from([
            ("sleeper_EI_N_m2".to_owned(), of(&|c| c.values[global].exp())),
            ("railpad_damping_N_s_m".to_owned(), of(&|c| c.values[global + 1].exp())),
            ("ballast_damping_N_s_m".to_owned(), of(&|c| c.values[global + 2].exp())),
            ("ballast_stiffness_N_m".to_owned(), of(&|c| mean(c, unknowns.ballast()))),
            ("railpad_stiffness_N_m".to_owned(), of(&|c| mean(c, unknowns.railpad()))),
            ("irregularity_level".to_owned(), of(&|c| mean(c, unknowns.level()))),
        ])
    }

    fn track(&self) -> Vec<SleeperValues> {
        let unknowns = &self.subject.forward.unknowns;
        let (before, after) = (&self.search.baseline, &self.search.last);
        let deviations = [before, after].map(|calibration| {
            let covariance = calibration.precision.inverse();
            covariance.diagonal().map(f64::sqrt)
        });
        let estimate = |calibration: &Calibration, deviation: &DVector<f64>, index: usize| {
            let mean = calibration.values[index].exp();
            Estimate { mean, sd: mean * deviation[index] }
        };
        let both = |index: usize| BeforeAfter {
            before: estimate(before, &deviations[0], index),
            after: estimate(after, &deviations[1], index),
        };
        (0..self.subject.forward.section.sleepers)
            .map(|sleeper| SleeperValues {
                id: self.id(sleeper),
                x_m: self.subject.forward.section.x_m(sleeper),
                railpad_stiffness: both(unknowns.railpad().start + sleeper),
                ballast_stiffness: both(unknowns.ballast().start + sleeper),
                irregularity_level: both(unknowns.level().start + sleeper),
            })
            .collect()
    }

    fn notes(&self) -> Vec<String> {
        let speeds = self.subject.forward.speeds_m_s.len();
        let mut notes: Vec<String> = self.look.troubles.iter().map(ToString::to_string).collect();
        if speeds == 1 {
            notes.push(
                "One speed only: nothing could be tested on a speed that was not fitted, so that \
                 no name is certain. Add a pass at a speed at least a quarter lower or higher."
                    .to_owned(),
            );
        }
        if self.subject.pass_numbers.iter().all(|passes| passes.len() == 1) {
            notes.push(
                "One pass a speed: how far passes repeat each other had to be assumed. Add a \
                 second pass at each speed."
                    .to_owned(),
            );
        }
        if let Some(round) = self.search.rounds.last().filter(|round| round.p_value <= 0.05) {
            let rest = if self.search.accepted.is_empty() { "Something" } else { "A remainder" };
            let place = round.port.as_ref().and_then(|port| port.sleeper);
            let place =
                place.map_or(String::new(), |sleeper| format!(" near {}", self.id(sleeper)));
            if !round.accepted {
                notes.push(format!(
                    "{rest} is not explained{place} (p = {:.1e}), and nothing in the catalogue \
                     predicts the held-out speeds better.",
                    round.p_value
                ));
            }
        }
        notes.extend(self.look.findings.iter().map(|finding| {
            format!("The passes alone show {}: {}.", finding.physics, finding.evidence)
        }));
        notes
    }
}

fn verdict(hypotheses: &[Hypothesis]) -> Verdict {
    let Some(first) = hypotheses.iter().find(|hypothesis| hypothesis.accepted) else {
        return Verdict::Consistent;
    };
    match Kind::from_name(&first.physics) {
        None => Verdict::UnknownPhysics,
        Some(kind) if kind.measuring_chain => Verdict::MeasurementChain,
        Some(_) => Verdict::LeftOutPhysics,
    }
}

fn names(kind: &Kind) -> Vec<String> {
    kind.look_alikes.iter().map(|&name| name.to_owned()).collect()
}

/// The stretch of entries that hold a good share of the sum.
fn loud(squares: &[f64]) -> Range<usize> {
    let highest = squares.iter().copied().fold(0.0, f64::max);
    let part = |square: &f64| *square >= PLACE_SHARE * highest;
    let first = squares.iter().position(part).unwrap_or(0);
    let last = squares.iter().rposition(part).unwrap_or(squares.len() - 1);
    first..last + 1
}
