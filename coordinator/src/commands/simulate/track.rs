//! The simulated track and its description.

use super::super::{OrInput, Stop};
use super::setting::check_sleepers;
use super::{Arguments, Drive, END_SPANS, Setting};
use anyhow::anyhow;
use serde_json::{Map, Value, json};
use tracktwin_parameters::{Parameter, ParameterSet, Track, TrackDesign};
use tracktwin_signal::recording::{self, Sleeper};
use tracktwin_track::extension::{ExtensionInstance, Kind, check_together};
use tracktwin_track::model::{Mesh, Roughness, Support, TrackModel};

/// A track with separate parameters at every sleeper.
pub(super) struct SimulatedTrack {
    described: Track,
    spans: usize,
    sleepers: Vec<ParameterSet>,
    extensions: Vec<ExtensionInstance>,
    model: TrackModel,
}

impl SimulatedTrack {
    pub(super) fn new(arguments: &Arguments) -> Result<Self, Stop> {
        let spans = arguments.spans;
        if spans <= 2 * END_SPANS {
            return Err(anyhow!("--spans: {spans} is too small; give more than {}", 2 * END_SPANS))
                .or_input();
        }
        let described = arguments.track.track()?;
        let sleepers = sleepers(&described, spans - 1, &arguments.settings).or_input()?;
        let supports: Vec<_> = sleepers.iter().map(Support::from).collect();
        let mesh = Mesh::uniform(spans, arguments.rail_elements, arguments.sleeper_elements);
        let design = described.design.clone();
        let instances = arguments.extensions.instances()?;
        let extensions: Vec<_> = instances
            .iter()
            .map(|instance| instance.build(&design, spans))
            .collect::<Result<_, _>>()
            .or_input()?;
        let all = instances.iter().zip(&extensions);
        let all = all.map(|(it, built)| (&*it.physics, it.sleepers.as_deref(), &**built));
        check_together(&all.collect::<Vec<_>>()).or_input()?;
        let model = TrackModel::build(&design, &mesh, &supports, &extensions).or_input()?;
        let simulated = Self { described, spans, sleepers, extensions: instances, model };
        let [from_m, to_m] = simulated.recorded_m();
        if from_m >= to_m {
            let spacing_m = simulated.described.design.sleeper.spacing_m;
            let needed = spans + ((from_m - to_m) / spacing_m).ceil() as usize + 1;
            return Err(anyhow!(
                "--spans: {spans} is too small, because every wheel must stay {END_SPANS} spans away from the ends of \
                 the track; give {needed} or more"
            ))
            .or_input();
        }
        Ok(simulated)
    }

    pub(super) fn design(&self) -> &TrackDesign {
        &self.described.design
    }

    pub(super) fn model(&self) -> &TrackModel {
        &self.model
    }

    /// Spectrum of the surface.
    pub(super) fn roughness(&self) -> Roughness {
        let level = self.sleepers[0][Parameter::IrregularityLevel];
        Roughness::between(level, self.described.wavelengths_m)
    }

    /// Default speeds in km/h.
    pub(super) fn speeds_km_h(&self) -> Vec<f64> {
        self.described.speeds_km_h.clone()
    }

    /// Kinds of the track's extensions.
    pub(super) fn kinds(&self) -> impl Iterator<Item = &'static Kind> + '_ {
        self.extensions.iter().filter_map(|instance| Kind::from_name(&instance.physics))
    }

    /// Start and end of the recording in m. At both, all wheels are far from the ends of the track.
    pub(super) fn recorded_m(&self) -> [f64; 2] {
        let further_m = &self.model.vehicle().further_wheels_m;
        let behind_m = further_m.iter().copied().fold(0.0, f64::min);
        let ahead_m = further_m.iter().copied().fold(0.0, f64::max);
        let [from_m, to_m] = [END_SPANS, self.spans - END_SPANS]
            .map(|spans| spans as f64 * self.described.design.sleeper.spacing_m);
        [from_m - behind_m, to_m - ahead_m]
    }

    /// The sleepers within the recorded part.
    pub(super) fn sleepers_recorded(&self) -> Vec<Sleeper> {
        let spacing_m = self.described.design.sleeper.spacing_m;
        let [from_m, to_m] = self.recorded_m();
        // Half a spacing, so that rounding does not lose a sleeper at the end.
        let recorded = from_m - 0.5 * spacing_m..to_m + 0.5 * spacing_m;
        (0..self.sleepers.len())
            .map(|number| Sleeper { id: id(number), x_m: (number + 1) as f64 * spacing_m })
            .filter(|sleeper| recorded.contains(&sleeper.x_m))
            .collect()
    }

    /// Description of the track in the recording format.
    pub(super) fn nominal(&self) -> Map<String, Value> {
        recording::nominal(&self.described.design)
    }

    /// The truth: parameters of every sleeper, extensions, and the angle of the wheel at the start
    /// of every pass.
    pub(super) fn truth_json(&self, drives: &[Drive]) -> String {
        let of = |set: &ParameterSet| -> Map<String, Value> {
            set.iter()
                .map(|(parameter, value)| (parameter.name().to_owned(), json!(value)))
                .collect()
        };
        let sleepers: Map<String, Value> = self
            .sleepers
            .iter()
            .enumerate()
            .map(|(number, set)| (id(number), Value::Object(of(set))))
            .collect();
        let drive = |drive: &Drive| json!({"speed_km_h": drive.speed_km_h, "wheel_turned_m": drive.wheel_turned_m});
        let truth = json!({
            "left_out": self.extensions,
            "irregularity_level": self.roughness().level,
            "sleepers": sleepers,
            "passes": drives.iter().map(drive).collect::<Vec<_>>(),
        });
        format!("{truth:#}\n")
    }
}

/// Name of sleeper `number`, counted from the first that is not at the end of the rail.
fn id(number: usize) -> String {
    format!("SN{number}")
}

/// Parameters of every sleeper.
fn sleepers(
    described: &Track,
    count: usize,
    settings: &[Setting],
) -> Result<Vec<ParameterSet>, anyhow::Error> {
    check_sleepers(settings, count)?;
    let set_of =
        |number| settings.iter().fold(described.nominal, |set, setting| setting.apply(set, number));
    Ok((0..count).map(set_of).collect())
}
