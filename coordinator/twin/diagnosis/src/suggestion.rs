//! Candidates from the findings of an inspection.

use crate::candidate::{Candidate, parameter};
use crate::prepared_recording::PreparedRecording;
use crate::profile::WheelTurns;
use std::f64::consts::TAU;
use tracktwin_inspection::{Finding, Inspection, Place};
use tracktwin_track::extension::{ExtensionInstance, Kind, KindParameter, PlaceKind};

impl PreparedRecording {
    /// Sets the start of the wheel's revolutions from the blows of a flat, and the detected shapes of the
    /// rail. Returns the candidates that the inspection suggests.
    pub fn suggested(&mut self, inspection: &Inspection) -> Vec<Candidate> {
        let section = &self.forward.section;
        let turn_m = inspection.flat.as_ref().map(|flat| flat.circumference_m.0);
        let design_m = TAU * section.track.design.wheel.radius_m;
        let turn_start_m = |pass: &usize| {
            let blows = inspection.flat.as_ref().and_then(|flat| flat.blows_m.get(*pass));
            let start = blows.and_then(|blows| start_m(blows, turn_m?));
            start.map_or(0.0, |x_m| section.model_x_m(x_m))
        };
        let starts = |passes: &Vec<usize>| passes.iter().map(turn_start_m).collect();
        self.forward.wheel_turns = WheelTurns {
            starts_m: self.pass_numbers.iter().map(starts).collect(),
            circumference_ratio: turn_m.map_or(1.0, |turn_m| turn_m / design_m),
        };
        self.detected_shapes_m = inspection
            .findings
            .iter()
            .chain(&inspection.nameless)
            .filter_map(detected_shape_m)
            .collect();
        let length_ratio = section.track.design.length_ratio();
        let candidate = |finding| candidate(finding, length_ratio);
        inspection.findings.iter().filter_map(candidate).collect()
    }
}

/// Position in m of the first blow of a flat, from all blows of a pass and the circumference of the wheel in m.
fn start_m(blows_m: &[f64], turn_m: f64) -> Option<f64> {
    let first_m = blows_m.first()?;
    let turn = |x_m: &f64| x_m - turn_m * ((x_m - first_m) / turn_m).round();
    Some(blows_m.iter().map(turn).sum::<f64>() / blows_m.len() as f64)
}

/// Stretch in m in which a finding indicates a shape of the rail.
fn detected_shape_m(finding: &Finding) -> Option<[f64; 2]> {
    match finding.place {
        Place::Stretch { from_m, to_m } => Some([from_m, to_m]),
        Place::Everywhere => None,
    }
}

/// The candidate that a finding suggests; `None` if a track model cannot represent its kind.
fn candidate(finding: &Finding, length_ratio: f64) -> Option<Candidate> {
    let kind = Kind::from_name(finding.physics)?;
    if kind.screening.suggested.is_empty() {
        return None;
    }
    let new = ExtensionInstance::new(finding.physics);
    let extension = match finding.place {
        Place::Stretch { from_m, to_m } if kind.place == PlaceKind::Stretch => {
            new.at([from_m, to_m])
        }
        Place::Stretch { from_m, to_m } => new.at([0.5 * (from_m + to_m); 2]),
        Place::Everywhere => new,
    };
    let suggested = kind.screening.suggested.iter();
    let free: Vec<&KindParameter> = suggested.map(|name| parameter(kind, name)).collect();
    // What the finding knows exactly is not fitted, such as the order of a wheel.
    let is_exact = |name: &str, sd: f64| {
        sd == 0.0 && kind.parameter(name).is_some() && free.iter().all(|it| it.name != name)
    };
    let exact = finding.parameters.iter().filter(|(name, (_, sd))| is_exact(name, *sd));
    let extension = exact.fold(extension, |it, (name, (value, _))| it.with(name, *value));
    let found = |parameter: &&KindParameter| {
        let found = finding.parameters.get(parameter.name);
        found.map_or(parameter.scaled(parameter.typical, length_ratio), |&(mean, _)| mean)
    };
    let trial = free.iter().map(found).collect();
    Some(Candidate { kind, extension, free, trials: vec![trial], length_ratio, choice_nats: 0.0 })
}

#[cfg(test)]
mod tests {
    use super::start_m;

    #[test]
    fn all_blows_of_a_pass_say_where_a_turn_begins() {
        // The third blow is missing, and each is found to 10 mm.
        let blows_m = [1.01, 3.89, 9.73, 12.59];
        let start_m = start_m(&blows_m, 2.9).unwrap();
        assert!((start_m - (1.01 + 0.99 + 1.03 + 0.99) / 4.0).abs() < 1e-9, "{start_m}");
    }

    #[test]
    fn a_pass_without_a_blow_says_nothing() {
        assert_eq!(start_m(&[], 2.9), None);
    }
}
