//! Hypotheses and diagnoses made by hand, for tests.

use std::collections::BTreeMap;
use tracktwin_diagnosis::{
    Diagnosis, FitScores, Hypothesis, Levels, Location, Score, Scores, Verdict,
};

/// A hypothesis of a kind at a place in m, or nowhere.
pub(crate) fn hypothesis(physics: &str, x_m: Option<[f64; 2]>) -> Hypothesis {
    Hypothesis {
        family: None,
        family_probability: 0.9,
        physics: physics.to_owned(),
        probability: 0.5,
        accepted: false,
        location: x_m.map(|x_m| Location { x_m, sleepers: Vec::new() }),
        port: None,
        behaviour: None,
        parameters: BTreeMap::new(),
        assumed: BTreeMap::new(),
        look_alikes: Vec::new(),
        would_separate: String::new(),
        detectability: 0.0,
        log_evidence: 0.0,
    }
}

/// A diagnosis with these hypotheses, of a track without sleepers.
pub(crate) fn diagnosis(verdict: Verdict, hypotheses: Vec<Hypothesis>) -> Diagnosis {
    let scores = Scores { in_sample: Score { score: 0.0 }, held_out: None };
    let (score, held_out_gain_nats) = (String::new(), BTreeMap::new());
    Diagnosis {
        format: String::new(),
        recording: String::new(),
        verdict,
        sentence: String::new(),
        nothing_left_out: None,
        mismatches: Vec::new(),
        hypotheses,
        fit: FitScores { score, before: scores, after: scores, held_out_gain_nats },
        bias_removed: BTreeMap::new(),
        track: Vec::new(),
        levels: Levels::default(),
        confirmation: None,
        support_changes: Vec::new(),
        loss_of_contact: None,
        notes: Vec::new(),
        sections: Vec::new(),
    }
}
