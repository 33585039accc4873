//! Comparison of the diagnosis of each lap with the truth of the ring.

use crate::statement::{Found, Statement};
use crate::{Method, Study};
use serde::Serialize;
use tracktwin_diagnosis::Diagnosis;

/// Least share of the joints that every lap must name.
const NAMED: f64 = 0.75;

/// What is accepted of one lap.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Accepted {
    /// Kind of physics, or unknown physics.
    physics: String,
    /// Sleepers of the hypothesis. Empty if the hypothesis has no place.
    sleepers: Vec<String>,
    /// Its probability.
    probability: f64,
}

/// Accepted hypotheses of the diagnoses of all laps. Each lap is diagnosed section by section.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Diagnoses {
    laps: Vec<Vec<Accepted>>,
}

impl Diagnoses {
    /// Adds the diagnosis of a lap.
    pub fn add_lap(&mut self, diagnosis: &Diagnosis) {
        let accepted = diagnosis.hypotheses.iter().filter(|it| it.accepted);
        let named = accepted.map(|it| Accepted {
            physics: it.physics.clone(),
            sleepers: it.location.iter().flat_map(|place| place.sleepers.clone()).collect(),
            probability: it.probability,
        });
        self.laps.push(named.collect());
    }
}

/// What is hidden in the ring, one structure each: kind of physics and the sleepers it may be named at.
struct Structure {
    physics: &'static str,
    sleepers: Vec<String>,
}

impl Structure {
    /// Whether its kind is named at one of its sleepers or more.
    fn is_named(&self, accepted: &[Accepted]) -> bool {
        let here = |it: &Accepted| it.sleepers.iter().any(|id| self.sleepers.contains(id));
        accepted.iter().any(|it| it.physics == self.physics && here(it))
    }
}

fn structures(study: &Study) -> Vec<Structure> {
    let truth = &study.truth;
    let ids = |wanted: &dyn Fn(&crate::SleeperTruth) -> bool| -> Vec<String> {
        truth.sleepers.iter().filter(|it| wanted(it)).map(|it| it.id.clone()).collect()
    };
    let joint =
        |name| Structure { physics: "rail_joint", sleepers: ids(&|it| it.joint == Some(name)) };
    let mut all: Vec<Structure> = truth.joints.iter().map(|it| joint(it.name)).collect();
    for (physics, sleepers) in [
        ("missing_railpad", ids(&|it| it.missing_railpad)),
        ("fastening_clamp", ids(&|it| it.clamp)),
        ("sleeper_bolt", ids(&|it| it.bolt)),
    ] {
        if !sleepers.is_empty() {
            all.push(Structure { physics, sleepers });
        }
    }
    all
}

pub(crate) fn statements(study: &Study) -> Vec<Statement> {
    if study.diagnoses.laps.is_empty() {
        return Vec::new();
    }
    let all = structures(study);
    let of = |physics: &str, [claim, tolerance]: [&str; 2], least: f64| {
        let some: Vec<&Structure> = all.iter().filter(|it| it.physics == physics).collect();
        let found = (!some.is_empty()).then(|| named(study, &some, least));
        Statement::of(("section 5.2", Method::Diagnosis), [claim, "-", tolerance], found)
    };
    vec![
        of(
            "rail_joint",
            [
                "Each lap names the joints",
                "at least 75 % of the joints in every lap, at one of their two sleepers",
            ],
            NAMED,
        ),
        of(
            "missing_railpad",
            ["Each lap names the missing railpad", "in every lap, at its sleeper"],
            1.0,
        ),
        of(
            "fastening_clamp",
            ["Each lap names clamps", "in every lap, at a sleeper with a clamp"],
            1.0,
        ),
        of("sleeper_bolt", ["Each lap names bolts", "in every lap, at a sleeper with bolts"], 1.0),
        Statement::of(
            ("section 5.2", Method::Diagnosis),
            [
                "Nothing else is named",
                "-",
                "no kind that the ring does not have, and no sleeper without the named kind, in any lap",
            ],
            Some(others(study, &all)),
        ),
    ]
}

fn named(study: &Study, some: &[&Structure], least: f64) -> Found {
    let counts = study
        .diagnoses
        .laps
        .iter()
        .map(|accepted| some.iter().filter(|structure| structure.is_named(accepted)).count());
    let counts: Vec<usize> = counts.collect();
    let texts: Vec<_> = (1..)
        .zip(&counts)
        .map(|(lap, count)| format!("lap {lap}: {count} of {}", some.len()))
        .collect();
    let enough = |count: &usize| *count as f64 >= least * some.len() as f64;
    Found::new(counts.iter().all(enough), texts.join(", "))
}

/// Kinds that the ring does not have, and sleepers that do not have the kind that is named there.
fn others(study: &Study, all: &[Structure]) -> Found {
    let mut texts = Vec::new();
    for (lap, accepted) in (1..).zip(&study.diagnoses.laps) {
        for it in accepted {
            let is_known = all.iter().any(|of| of.physics == it.physics);
            let wrong = wrong_sleepers(it, all);
            // A known kind without a place is at no wrong sleeper.
            if !is_known || !wrong.is_empty() {
                let text = format!("lap {lap}: {} {}", it.physics, wrong.join(" "));
                texts.push(text.trim_end().to_owned());
            }
        }
    }
    let text = if texts.is_empty() { "nothing".to_owned() } else { texts.join(", ") };
    Found::new(texts.is_empty(), text)
}

/// Sleepers of a hypothesis that belong to no structure of its kind.
fn wrong_sleepers<'a>(accepted: &'a Accepted, all: &[Structure]) -> Vec<&'a str> {
    let is_right = |id: &String| {
        let mut alike = all.iter().filter(|of| of.physics == accepted.physics);
        alike.any(|of| of.sleepers.contains(id))
    };
    accepted.sleepers.iter().filter(|id| !is_right(id)).map(String::as_str).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::study;
    use tracktwin_reproduction::ClaimVerdict;

    fn accepted(physics: &str, sleepers: &[&str]) -> Accepted {
        let sleepers = sleepers.iter().map(ToString::to_string).collect();
        Accepted { physics: physics.to_owned(), sleepers, probability: 0.9 }
    }

    #[test]
    fn what_every_lap_names_is_found_and_what_the_ring_lacks_is_listed() {
        let mut study = study();
        assert!(statements(&study).is_empty());
        let joints = ["SN12", "SN38", "SN63", "SN88"].map(|id| accepted("rail_joint", &[id]));
        let rest = [
            accepted("missing_railpad", &["SN91"]),
            accepted("fastening_clamp", &["SN4", "SN8"]),
            accepted("sleeper_bolt", &["SN20"]),
        ];
        let lap: Vec<_> = joints.into_iter().chain(rest).collect();
        study.diagnoses.laps = vec![lap.clone(), lap.clone()];
        let all = statements(&study);
        assert!(all.iter().all(|it| it.verdict == ClaimVerdict::Reproduced), "{all:#?}");

        study.diagnoses.laps[1] =
            vec![accepted("missing_railpad", &["SN90"]), accepted("squat", &[])];
        let all = statements(&study);
        assert!(all.iter().all(|it| it.verdict == ClaimVerdict::Differs), "{all:#?}");
        assert_eq!(all[0].found, "lap 1: 4 of 4, lap 2: 0 of 4");
        assert_eq!(all[4].found, "lap 2: missing_railpad SN90, lap 2: squat");
    }

    #[test]
    fn wrong_sleepers_beside_right_ones_are_listed() {
        let mut study = study();
        study.diagnoses.laps = vec![vec![
            accepted("fastening_clamp", &["SN4", "SN5", "SN6"]),
            accepted("rail_joint", &["SN12", "SN13"]),
            accepted("missing_railpad", &[]),
        ]];
        let all = statements(&study);
        // One clamp at its sleeper is enough to name clamps.
        assert_eq!(all[2].verdict, ClaimVerdict::Reproduced, "{:?}", all[2]);
        assert_eq!(all[4].verdict, ClaimVerdict::Differs, "{:?}", all[4]);
        assert_eq!(all[4].found, "lap 1: fastening_clamp SN5 SN6");
    }
}
