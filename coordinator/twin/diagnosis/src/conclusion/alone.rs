//! Conclusion from the passes alone, if no track model can be compared with them.

use super::finding::{probability, seen};
use super::notes::{lost, one_speed};
use super::{MODEL_MAX, ONE_PASS_MAX, UNPREDICTED_MAX, verdict};
use crate::outcome::{Diagnosis, FORMAT, FitScores, Hypothesis, Levels, Location, Score, Scores};
use crate::prepared_recording::PreparationError;
use std::collections::BTreeMap;
use tracktwin_inspection::wheel::{Comb, CombBlock};
use tracktwin_inspection::{Finding, Inspection, Place, separate_wavelengths};
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::{Kind, WHEEL_OUT_OF_ROUND};

/// The diagnosis of a recording that cannot be compared with a track, for the given reason. `None` if no
/// hypothesis is accepted.
///
/// The function accepts findings that were tested on withheld blocks, and faults of the measuring chain;
/// all other findings are alternatives.
pub fn passes_alone(
    recording: &Recording,
    inspection: &Inspection,
    reason: &PreparationError,
) -> Option<Diagnosis> {
    let mut found: Vec<(&Finding, Hypothesis)> = inspection
        .findings
        .iter()
        .filter_map(|finding| Some((finding, hypothesis(recording, inspection, finding)?)))
        .collect();
    found.sort_by(|(_, a), (_, b)| {
        let tested = |it: &Hypothesis| is_comb(&it.physics, inspection);
        tested(b).cmp(&tested(a)).then(b.probability.total_cmp(&a.probability))
    });
    let (first, best) = found.iter().find(|(_, it)| it.accepted)?;
    let summary = Kind::from_name(&best.physics)?.summary;
    let sentence = format!(
        "The passes alone show {summary} ({}, {:.0} %): {}.",
        best.physics,
        100.0 * best.probability,
        first.evidence
    );
    let hypotheses: Vec<Hypothesis> = found.iter().map(|(_, it)| it.clone()).collect();
    let mut notes = vec![format!("No track model was compared with the recording: {reason}.")];
    let speeds_km_h = recording.speeds_km_h();
    if !separate_wavelengths(&speeds_km_h) {
        notes.extend(speeds_km_h.first().copied().map(one_speed));
    }
    if !recording.gain_known() {
        notes.push("The unit of the signal is unknown: amplitudes are relative.".to_owned());
    }
    notes.extend(inspection.pass_defects.iter().map(ToString::to_string));
    notes.extend(lost(inspection, recording));
    notes.extend(inspection.findings.iter().map(Finding::sentence));
    notes.extend(inspection.doubts());
    Some(Diagnosis {
        format: FORMAT.to_owned(),
        recording: recording.name.clone(),
        verdict: verdict(&hypotheses),
        sentence,
        nothing_left_out: None,
        mismatches: Vec::new(),
        hypotheses,
        fit: fit(
            recording,
            inspection.comb.as_ref().filter(|_| is_comb(&best.physics, inspection)),
        ),
        bias_removed: BTreeMap::new(),
        track: Vec::new(),
        levels: Levels::default(),
        confirmation: None,
        support_changes: Vec::new(),
        loss_of_contact: inspection.loss_of_contact.clone(),
        notes,
        sections: Vec::new(),
    })
}

/// Whether a kind is the comb of a wheel, which is tested on withheld blocks.
fn is_comb(physics: &str, inspection: &Inspection) -> bool {
    physics == WHEEL_OUT_OF_ROUND.physics && inspection.comb.is_some()
}

fn hypothesis(
    recording: &Recording,
    inspection: &Inspection,
    finding: &Finding,
) -> Option<Hypothesis> {
    let kind = Kind::from_name(finding.physics)?;
    let is_tested = is_comb(finding.physics, inspection);
    let is_separated = separate_wavelengths(&recording.speeds_km_h());
    let most = match (is_tested || kind.measuring_chain, is_separated) {
        (true, _) => MODEL_MAX,
        (false, false) => UNPREDICTED_MAX,
        (false, true) => ONE_PASS_MAX,
    };
    let location = match finding.place {
        Place::Everywhere => None,
        Place::Stretch { from_m, to_m } => {
            let half_m = 0.5 * recording.spacing_m;
            let near = recording.sleepers.iter();
            let near = near.filter(|it| from_m - half_m <= it.x_m && it.x_m <= to_m + half_m);
            let sleepers = near.map(|sleeper| sleeper.id.clone()).collect();
            Some(Location { x_m: [from_m, to_m], sleepers })
        }
    };
    let probability = probability(finding).min(most);
    Some(Hypothesis {
        probability,
        family_probability: probability,
        accepted: is_tested || kind.measuring_chain,
        ..seen(finding, kind, location)
    })
}

/// Variance explained by the wheel orders, on all blocks and on withheld ones.
fn fit(recording: &Recording, comb: Option<&Comb>) -> FitScores {
    let Some(comb) = comb else {
        let none = Scores { in_sample: Score { score: 0.0 }, held_out: None };
        let score = "nothing was fitted".to_owned();
        return FitScores { score, before: none, after: none, held_out_gain_nats: BTreeMap::new() };
    };
    let blocks = comb.blocks.len() as f64;
    let mean = |of: fn(&CombBlock) -> f64| Score {
        score: comb.blocks.iter().map(of).sum::<f64>() / blocks,
    };
    let held_out = &comb.held_out;
    let [from_hz, to_hz] = comb.band_hz;
    let speed = recording.speeds_km_h().first().copied().unwrap_or_default();
    let nats = held_out.gain_nats * held_out.blocks as f64;
    FitScores {
        score: format!(
            "share of the variance between {from_hz:.0} and {to_hz:.0} Hz that a comb of lines \
             explains: one between the teeth of the wheel's, then the wheel's own; withheld was \
             every other block of two seconds"
        ),
        before: Scores {
            in_sample: mean(|block| block.by_chance),
            held_out: Some(Score { score: held_out.by_chance }),
        },
        after: Scores {
            in_sample: mean(|block| block.explained),
            held_out: Some(Score { score: held_out.explained }),
        },
        held_out_gain_nats: BTreeMap::from([(format!("{speed:.0}"), nats)]),
    }
}
