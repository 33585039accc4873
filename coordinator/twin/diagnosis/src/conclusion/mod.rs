//! Conclusion: the diagnosis that follows from a search.

mod alone;
mod finding;
mod fit;
mod look_alikes;
mod nameless;
mod notes;
mod place;
mod round;
mod speed_disagreement;
mod support_changes;
mod unlike_neighbours;

pub use self::alone::passes_alone;
use self::look_alikes::{add_rail_waves, add_siblings, add_unknown_of_lone, add_wheel_mode};
pub(crate) use self::support_changes::further;
use self::unlike_neighbours::unlike_neighbours;
use crate::calibration::CalibrationError;
use crate::outcome::{Diagnosis, FORMAT, Hypothesis, Location, UNKNOWN, Verdict, meet};
use crate::prepared_recording::PreparedRecording;
use crate::search::SearchOutcome;
use crate::sentence::sentence;
use crate::sleeper_pattern::SleeperPattern;
use tracktwin_inspection::chain::PassDefect;
use tracktwin_inspection::wheel::Order;
use tracktwin_inspection::{Inspection, separate_wavelengths};
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::Kind;

/// Largest probability of what no held-out speed confirms: none could be held out, because at a single speed structure
/// and geometry have the same effect, or unknown physics does not predict those that were.
const UNPREDICTED_MAX: f64 = 0.5;

/// Largest probability if no pass repeats another: the variation between passes is then an assumption.
const ONE_PASS_MAX: f64 = 0.9;

/// Largest probability of any hypothesis: the model itself may be wrong.
const MODEL_MAX: f64 = 0.97;

/// Largest probability of unknown physics on a track without measured error rates: of two unknown
/// hypotheses on recordings of a railway line, one had the correct location (docs/diagnosis-examples.md).
const UNMEASURED_UNKNOWN_MAX: f64 = 0.5;

/// Share of a group's probability that belongs to the kind which the fit names or, without a fit, the inspection.
const NAMED_SHARE: f64 = 0.65;

/// Probability from which physics is accepted beside a fault of the measuring chain.
const LIKELY: f64 = 0.5;

/// Factor on the probability of a hypothesis that does not predict withheld speeds better, that lacks a detected shape,
/// or that has no more evidence than errors of a line's model reach.
const FAILED_SHARE: f64 = 0.1;

/// Hypotheses with a smaller probability are not reported.
const PROBABILITY_MIN: f64 = 0.001;

/// Input of a conclusion.
pub struct Evidence<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// The prepared recording.
    pub prepared: &'a PreparedRecording,
    /// Inspection of the passes without a track model.
    pub inspection: &'a Inspection,
    /// Result of the search with the track model.
    pub search: &'a SearchOutcome,
}

impl Evidence<'_> {
    /// Draws the conclusion.
    ///
    /// # Errors
    /// [`CalibrationError`] if no model exists for the values of a calibrated track.
    pub fn conclude(&self) -> Result<Diagnosis, CalibrationError> {
        let mut hypotheses = self.hypotheses();
        self.add_patch(&mut hypotheses);
        let (most, unknown_max) = (self.probability_max(), self.unknown_max());
        for hypothesis in &mut hypotheses {
            let most = if hypothesis.physics == UNKNOWN { unknown_max } else { most };
            hypothesis.probability = hypothesis.probability.min(most);
        }
        // Before a probability is divided among names.
        let nothing_left_out = self.nothing(&hypotheses).min(most);
        let fitted: Vec<&str> =
            self.search.accepted.iter().map(|candidate| candidate.kind.physics).collect();
        add_siblings(&mut hypotheses, &fitted);
        add_rail_waves(&mut hypotheses, |number| self.rail_waves_by_chance(number));
        add_wheel_mode(&mut hypotheses);
        add_unknown_of_lone(&mut hypotheses, unknown_max);
        add_families(&mut hypotheses, most);
        hypotheses.sort_by(|a, b| {
            b.probability.total_cmp(&a.probability).then(b.accepted.cmp(&a.accepted))
        });
        let verdict = verdict(&hypotheses);
        if verdict == Verdict::Consistent {
            hypotheses.clear();
        }
        let levels = self.levels()?;
        let fit = self.fit(&hypotheses);
        let bias_removed = self.bias_removed(&hypotheses);
        let count = self.prepared.forward.section.sleepers();
        let sleepers: Vec<String> = (0..count).map(|sleeper| self.id(sleeper)).collect();
        let said = sentence(verdict, &hypotheses, nothing_left_out, &sleepers, &fit, &bias_removed);
        let support_changes = self.support_changes(verdict);
        let loss_of_contact = self.inspection.loss_of_contact.clone();
        let track = self.track(&hypotheses);
        let unlike = unlike_neighbours(&track, verdict, &hypotheses);
        let doubts: Vec<String> = unlike.into_iter().chain(self.misplaced()).collect();
        let further = further(&support_changes, loss_of_contact.as_ref());
        let sentence = [said, further, doubts.concat(), self.much_lost()].concat();
        let mut notes = self.notes(&hypotheses);
        notes.extend(doubts.iter().map(|doubt| doubt.trim_start().to_owned()));
        Ok(Diagnosis {
            format: FORMAT.to_owned(),
            recording: self.recording.name.clone(),
            verdict,
            sentence,
            nothing_left_out: Some(nothing_left_out),
            mismatches: self.mismatches(verdict, &levels),
            hypotheses,
            fit,
            bias_removed,
            track,
            levels,
            confirmation: None,
            support_changes,
            loss_of_contact,
            notes,
            sections: Vec::new(),
        })
    }

    /// Sentence on sleepers that are not covered at every speed, with a space before it, if they are many.
    fn much_lost(&self) -> String {
        let (lost, compared) = (self.prepared.uncovered.sleepers, self.prepared.sleepers().len());
        if 2 * lost > compared { format!(" {}", self.lost()) } else { String::new() }
    }

    /// Sentence on sleepers that do not lie at their stated positions, with a space before it.
    fn misplaced(&self) -> Option<String> {
        let fitted = (self.prepared, &self.prepared.forward.unknowns, &self.search.last.values);
        Some(format!(" {}", SleeperPattern::of(self.recording, &[fitted])?.doubt()?))
    }

    /// Probability that waves of the rail lie near an order by chance; `None` if passes at one speed differ by it.
    fn rail_waves_by_chance(&self, number: usize) -> Option<f64> {
        let is_it = |order: &&Order| order.number == number && !order.turns;
        self.inspection.orders.iter().find(is_it).map(Order::share_of_lengths)
    }

    /// Largest probability that the recording permits.
    fn probability_max(&self) -> f64 {
        if self.is_one_speed() {
            UNPREDICTED_MAX
        } else if self.repeats() {
            MODEL_MAX
        } else {
            ONE_PASS_MAX
        }
    }

    /// Probability that nothing is left out, given these hypotheses.
    fn nothing(&self, hypotheses: &[Hypothesis]) -> f64 {
        let first = self
            .search
            .rounds
            .first()
            .map_or(1.0, |round| round.probabilities().nothing.min(round::chance_max(round)));
        let accepted = hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
        if accepted.clone().next().is_none() {
            // Something without a name is no more certain than unknown physics.
            return first.max(1.0 - self.unknown_max());
        }
        first * accepted.map(|hypothesis| 1.0 - hypothesis.probability).product::<f64>()
    }

    /// Largest probability of unknown physics.
    fn unknown_max(&self) -> f64 {
        let most = self.probability_max();
        if self.prepared.forward.section.is_v_track() {
            most
        } else {
            most.min(UNMEASURED_UNKNOWN_MAX)
        }
    }

    /// Whether all speeds are so near each other that they tell no more than one.
    fn is_one_speed(&self) -> bool {
        !separate_wavelengths(&self.prepared.forward.speeds_m_s)
    }

    /// Whether some pass repeats another at its speed.
    fn repeats(&self) -> bool {
        self.prepared.passes_repeat
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let mut all: Vec<Hypothesis> = Vec::new();
        let rounds = self.search.rounds.iter().filter(|round| round.is_significant());
        for round in rounds {
            for hypothesis in self.of_round(round) {
                let known = all.iter_mut().find(|known| self.is_same(known, &hypothesis));
                match known {
                    Some(known) if known.accepted => {
                        known.probability = known.probability.max(hypothesis.probability);
                    }
                    Some(known) if known.probability >= hypothesis.probability => {}
                    Some(known) => *known = hypothesis,
                    None => all.push(hypothesis),
                }
            }
        }
        self.add_speed_disagreement(&mut all);
        for finding in &self.inspection.findings {
            self.add_finding(finding, &mut all);
        }
        for finding in &self.inspection.nameless {
            self.add_nameless(finding, &mut all);
        }
        // What a faulty chain makes of the recording is not unknown physics, nor physics that is less likely
        // than not, and what is left of a saturated one no physics at all.
        let is_chain = |known: &Hypothesis| {
            Kind::from_name(&known.physics).is_some_and(|kind| kind.measuring_chain)
        };
        if all.iter().any(|known| known.accepted && is_chain(known)) {
            let saturated = |defect: &PassDefect| matches!(defect, PassDefect::Saturated { .. });
            let is_saturated = self.inspection.pass_defects.iter().any(saturated);
            let made_by_chain = |known: &&mut Hypothesis| {
                // An alternative to the fault itself keeps its probability.
                let is_unlikely = known.accepted && known.probability < LIKELY;
                !is_chain(known) && (known.physics == UNKNOWN || is_saturated || is_unlikely)
            };
            for known in all.iter_mut().filter(made_by_chain) {
                known.accepted = false;
                known.probability *= FAILED_SHARE;
            }
        }
        all.retain(|hypothesis| hypothesis.accepted || hypothesis.probability >= PROBABILITY_MIN);
        all
    }
}

/// Sets the probability of each hypothesis's family at its location; its members exclude each other there.
fn add_families(hypotheses: &mut [Hypothesis], most: f64) {
    let all: Vec<_> = hypotheses
        .iter()
        .map(|it| (it.family.clone(), it.location.clone(), it.probability))
        .collect();
    for hypothesis in hypotheses {
        let is_member = |(family, location, _): &&(Option<String>, Option<Location>, f64)| {
            family.is_some()
                && *family == hypothesis.family
                && meet(location.as_ref(), hypothesis.location.as_ref())
        };
        let members: f64 = all.iter().filter(is_member).map(|(.., share)| share).sum();
        hypothesis.family_probability = members.max(hypothesis.probability).min(most);
    }
}

/// The verdict that follows from the most probable accepted hypothesis.
pub(crate) fn verdict(hypotheses: &[Hypothesis]) -> Verdict {
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
