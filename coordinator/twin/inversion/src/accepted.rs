//! Physics that a diagnosis accepted, as a known part of the track model.

use crate::record::Inversion;
use tracktwin_diagnosis::{
    Candidate, Diagnosis, Estimate, Hypothesis, Location, PreparedRecording,
};
use tracktwin_evaluation::Flag;
use tracktwin_parameters::Parameter;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::{
    Class, EffectFamily, ExtensionInstance, Kind, KindParameter, PlaceKind,
};

/// Distance in sleepers from which a point of the track has no effect on a section.
const REACH: f64 = 2.0;

/// Relative standard deviation from which a parameter counts as not determined.
const UNDETERMINED: f64 = 0.5;

/// Kind of a hypothesis that can be a part of the track model: it is in the catalogue, and it is no shape of
/// the wheel, whose angle in each pass is unknown.
pub fn modelled(hypothesis: &Hypothesis) -> Option<&'static Kind> {
    Kind::from_name(&hypothesis.physics).filter(|kind| kind.family != EffectFamily::Wheel)
}

/// Extensions that a diagnosis of the recording accepted, as far as they act on a section ([`modelled`]).
/// They keep the values of the diagnosis. Only what it could not determine is fitted again, from its value (the
/// only trial) and with the prior of the catalogue: bolts that are free in every section, for example, lead
/// some of the sections to another minimum.
pub fn accepted(
    diagnosis: &Diagnosis,
    recording: &Recording,
    prepared: &PreparedRecording,
) -> Vec<Candidate> {
    let found = diagnosis.hypotheses.iter().filter(|hypothesis| hypothesis.accepted);
    found
        .filter_map(|hypothesis| {
            let kind = modelled(hypothesis)?;
            let length_ratio = prepared.forward.section.track.design.length_ratio();
            let extension = with_values(hypothesis, kind, length_ratio);
            let extension = match &hypothesis.location {
                Some(location) if kind.place != PlaceKind::Nowhere => {
                    let is_everywhere = location.sleepers.len() == diagnosis.track.len();
                    placed(extension, kind, location, is_everywhere, recording, prepared)?
                }
                _ => extension,
            };
            let free = free(hypothesis, kind);
            let values = free.iter().map(|it| hypothesis.parameters[it.name].mean).collect();
            Some(Candidate {
                kind,
                extension,
                free,
                trials: vec![values],
                length_ratio,
                choice_nats: 0.0,
            })
        })
        .collect()
}

impl Inversion {
    /// Takes from a diagnosis what replaces a parameter of a sleeper, such as what is left of a missing railpad. The
    /// recording says nothing on the sleeper's own value, which the fit takes from the neighbours.
    pub fn take_replaced(&mut self, diagnosis: &Diagnosis) {
        for sleeper in &mut self.sleepers {
            let found = |parameter: &Parameter| {
                diagnosis.hypotheses.iter().find_map(|it| it.in_place_of(*parameter, &sleeper.id))
            };
            let replaced: Vec<_> =
                Parameter::ALL.iter().filter_map(|it| Some((*it, found(it)?))).collect();
            for (parameter, Estimate { mean, sd }) in replaced {
                sleeper.estimates.insert(parameter, tracktwin_evaluation::Estimate { mean, sd });
                if !sleeper.flags.contains(&Flag::UnlikeNeighbours) {
                    sleeper.flags.push(Flag::UnlikeNeighbours);
                }
            }
        }
    }
}

/// Parameters of a hypothesis that the inversion fits again; none of a force law.
fn free(hypothesis: &Hypothesis, kind: &'static Kind) -> Vec<&'static KindParameter> {
    if kind.classes.contains(&Class::Load) {
        return Vec::new();
    }
    let is_open = |parameter: &&KindParameter| {
        hypothesis.parameters.get(parameter.name).is_some_and(|it| it.sd > UNDETERMINED * it.mean)
    };
    kind.parameters.iter().filter(is_open).collect()
}

/// The extension with the fitted and the assumed values of a hypothesis, and values that are typical of the
/// track's scale for what else it requires.
fn with_values(hypothesis: &Hypothesis, kind: &Kind, length_ratio: f64) -> ExtensionInstance {
    let fitted =
        hypothesis.parameters.iter().map(|(name, estimate)| (name.as_str(), estimate.mean));
    let assumed = hypothesis.assumed.iter().map(|(name, &value)| (name.as_str(), value));
    let given: Vec<(&str, f64)> = fitted.chain(assumed).collect();
    let is_missing = |name: &str| given.iter().all(|(known, _)| *known != name);
    let required = kind.parameters.iter().filter(|parameter| parameter.default.is_none());
    let typical = required
        .filter(|parameter| is_missing(parameter.name))
        .map(|parameter| (parameter.name, parameter.scaled(parameter.typical, length_ratio)));
    let is_known = |name: &str| kind.parameter(name).is_some();
    let all = given.iter().copied().filter(|(name, _)| is_known(name)).chain(typical);
    all.fold(ExtensionInstance::new(kind.physics), |extension, (name, value)| {
        extension.with(name, value)
    })
}

/// The extension at its place in a section: indices of compared sleepers, positions in m of the recording.
/// `None` if it lies outside.
fn placed(
    extension: ExtensionInstance,
    kind: &Kind,
    location: &Location,
    is_everywhere: bool,
    recording: &Recording,
    prepared: &PreparedRecording,
) -> Option<ExtensionInstance> {
    let section = &prepared.forward.section;
    if kind.place != PlaceKind::Sleepers {
        let reach_m = REACH * section.track.design.sleeper.spacing_m;
        let ends = [section.x_m(0) - reach_m, section.x_m(section.sleepers() - 1) + reach_m];
        let is_inside = location.x_m[0] <= ends[1] && location.x_m[1] >= ends[0];
        let middle_m = 0.5 * (location.x_m[0] + location.x_m[1]);
        let x_m = if kind.place == PlaceKind::Point { [middle_m; 2] } else { location.x_m };
        return is_inside.then(|| extension.at(x_m));
    }
    if is_everywhere {
        return Some(extension);
    }
    let compared = recording.sleepers.iter().skip(prepared.first_sleeper).take(section.sleepers());
    let is_there = |(index, id): (usize, &String)| location.sleepers.contains(id).then_some(index);
    let sleepers: Vec<usize> =
        compared.map(|sleeper| &sleeper.id).enumerate().filter_map(is_there).collect();
    (!sleepers.is_empty()).then(|| extension.on(sleepers))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use std::path::Path;

    /// A diagnosis of all sleepers of the bundled sample that accepted these hypotheses.
    fn diagnosis(recording: &Recording, accepted: &[Value]) -> Diagnosis {
        let score = json!({"in_sample": {"score": 0.0}, "held_out": {"score": 0.0}});
        let both = json!({"before": {"mean": 1.0, "sd": 0.1}, "after": {"mean": 1.0, "sd": 0.1}});
        let sleeper = |id: &String, x_m: f64| {
            json!({"id": id, "x_m": x_m, "railpad_stiffness_N_m": both,
                "ballast_stiffness_N_m": both, "irregularity_level": both})
        };
        let track = recording.sleepers.iter().map(|it| sleeper(&it.id, it.x_m));
        let all = |hypothesis: &Value| {
            let mut all = json!({
                "probability": 0.9, "accepted": true, "look_alikes": [], "would_separate": "",
                "detectability": 9.0, "log_evidence": 50.0, "parameters": {}
            });
            let stated = hypothesis.as_object().unwrap().clone();
            all.as_object_mut().unwrap().extend(stated);
            all
        };
        serde_json::from_value(json!({
            "format": tracktwin_diagnosis::FORMAT, "recording": recording.name,
            "verdict": "left_out_physics", "sentence": "", "mismatches": [], "bias_removed": {},
            "fit": {"score": "", "before": score, "after": score, "held_out_gain_nats": {}},
            "levels": {"frequency_Hz": [], "speeds_km_h": [], "measured_dB": [], "before_dB": [],
                "after_dB": [], "scatter_dB": []},
            "track": track.collect::<Vec<_>>(), "notes": [],
            "hypotheses": accepted.iter().map(all).collect::<Vec<_>>(),
        }))
        .unwrap()
    }

    #[test]
    fn accepted_physics_takes_its_place_in_every_section_on_which_it_acts() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sample");
        let recording = Recording::open(&folder).unwrap();
        let track = recording.stated_track().track;
        let section = crate::sections(&recording, &track).unwrap().remove(0);
        let ids: Vec<&String> = recording.sleepers.iter().map(|sleeper| &sleeper.id).collect();
        let x_m = [recording.sleepers[0].x_m, recording.sleepers[ids.len() - 1].x_m];
        let first = section.first_sleeper;
        let bolts = json!({"physics": "sleeper_bolt",
            "parameters": {"stiffness_N_per_m": {"mean": 3e7, "sd": 1e6}}});
        let some = json!({"physics": "missing_railpad",
            "location": {"x_m": x_m, "sleepers": [ids[0], ids[first + 2]]}});
        let far = json!({"physics": "rail_joint",
            "location": {"x_m": [900.0, 900.0], "sleepers": []}});
        // The passes alone state a stretch in which a joint lies.
        let between_m = [recording.sleepers[first + 3].x_m, recording.sleepers[first + 4].x_m];
        let joint = json!({"physics": "rail_joint",
            "parameters": {"dip_m": {"mean": 1e-4, "sd": 1e-5}, "length_m": {"mean": 0.02, "sd": 0.02}},
            "location": {"x_m": between_m, "sleepers": [ids[first + 3], ids[first + 4]]}});
        let everywhere =
            json!({"physics": "subgrade_layer", "location": {"x_m": x_m, "sleepers": ids}});
        let nameless = json!({"physics": "unknown_physics"});
        let flat = json!({"physics": "wheel_flat"});
        let diagnosis =
            diagnosis(&recording, &[bolts, some, far, everywhere, nameless, flat, joint]);
        let known = accepted(&diagnosis, &recording, &section);
        let found: Vec<_> =
            known.iter().map(|it| (it.kind.physics, it.extension.sleepers.clone())).collect();
        let expected = [
            ("sleeper_bolt", None),
            ("missing_railpad", Some(vec![2])),
            ("subgrade_layer", None),
            ("rail_joint", None),
        ];
        assert_eq!(found, expected);
        let middle_m = 0.5 * (between_m[0] + between_m[1]);
        assert_eq!(known[3].extension.x_m, Some([middle_m; 2]));
        let design = &section.forward.section.track.design;
        for candidate in &known {
            let placed = section.forward.section.in_model(&candidate.extension);
            placed.build(design, section.forward.section.spans()).unwrap();
        }
        assert_eq!(known[0].extension.parameters["stiffness_N_per_m"], 3e7);
        let free =
            |candidate: &Candidate| candidate.free.iter().map(|it| it.name).collect::<Vec<_>>();
        // The dip is known to a tenth, its length to a half and less.
        assert_eq!(free(&known[3]), ["length_m"]);
        assert_eq!(known[3].trials, [[0.02]]);
        assert!(known[..3].iter().all(|candidate| free(candidate).is_empty()));
    }
}
