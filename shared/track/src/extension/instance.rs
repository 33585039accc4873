//! One extension with its place and the values of its parameters, as written in files.

use super::{Extension, Kind, PlaceKind, Stage};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use tracktwin_parameters::{QuantityError, TrackDesign};

/// An extension: name of its kind, place and values of its parameters.
///
/// In JSON and TOML the parameters are fields of the same object as the name:
/// `{"physics": "sleeper_bolt", "sleepers": [8, 9], "stiffness_N_per_m": 3e7}`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtensionInstance {
    /// Name of the kind.
    pub physics: String,
    /// Start and end of the extension along the track in m. Both are equal for a point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x_m: Option<[f64; 2]>,
    /// Indices of the sleepers, from 0. Sleeper `i` is at `(i + 1) * spacing`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sleepers: Option<Vec<usize>>,
    /// Values of the parameters by name. The name of a parameter contains its unit.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
}

/// Why an [`ExtensionInstance`] is not valid for a track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InstanceError {
    /// No kind has this name.
    #[error("unknown extension `{physics}`; known extensions: {}", known_kinds())]
    Unknown {
        /// The name.
        physics: String,
    },
    /// The kind has no such parameter.
    #[error("{physics}: has no parameter `{parameter}`; it has {}", known_parameters(.physics))]
    UnknownParameter {
        /// Name of the kind.
        physics: String,
        /// Name of the parameter.
        parameter: String,
    },
    /// The value of a parameter without a default is missing.
    #[error("{physics}: needs {parameter}, {meaning}; for example {parameter} = {typical:e}")]
    MissingParameter {
        /// Name of the kind.
        physics: String,
        /// Name of the parameter.
        parameter: &'static str,
        /// Meaning of the parameter.
        meaning: &'static str,
        /// Typical value on a track of this scale.
        typical: f64,
    },
    /// The value of a parameter is not allowed.
    #[error("{physics}: {parameter} is {value} but must be {form}")]
    Value {
        /// Name of the kind.
        physics: String,
        /// Name of the parameter.
        parameter: String,
        /// Its value.
        value: f64,
        /// Allowed values, to follow "must be".
        form: &'static str,
    },
    /// The value of a parameter is far outside its physical range.
    #[error("{physics}: {parameter}: {source}")]
    Number {
        /// Name of the kind.
        physics: String,
        /// Name of the parameter.
        parameter: &'static str,
        /// The violated limit.
        source: QuantityError,
    },
    /// Two extensions of a kind replace the support of one sleeper.
    #[error("{physics}: two of them act on one sleeper; give each sleeper one of them")]
    Twice {
        /// Name of the kind.
        physics: String,
    },
    /// The place has a sleeper that the track lacks.
    #[error(
        "{physics}: the track has no sleeper SN{}; it has SN1 to SN{sleepers} (in files 0 to {})",
        .index + 1, .sleepers.saturating_sub(1)
    )]
    NoSleeper {
        /// Name of the kind.
        physics: String,
        /// Index of the sleeper, from 0.
        index: usize,
        /// Number of sleepers of the track.
        sleepers: usize,
    },
    /// The place is missing, has another [`PlaceKind`] than the kind requires, or is not on the track.
    #[error(
        "{physics}: its place must be {form}, on the track of {length_m} m and {sleepers} sleepers"
    )]
    Place {
        /// Name of the kind.
        physics: String,
        /// Required form of the place.
        form: &'static str,
        /// Length of the track in m.
        length_m: f64,
        /// Number of sleepers of the track.
        sleepers: usize,
    },
}

/// Refuses two extensions of a kind that replace the support of one sleeper by a force law. Each extension has its name
/// and sleepers, `None` for all.
///
/// # Errors
/// [`InstanceError::Twice`].
pub fn check_together(
    extensions: &[(&str, Option<&[usize]>, &dyn Extension)],
) -> Result<(), InstanceError> {
    let meet = |one: Option<&[usize]>, other: Option<&[usize]>| match (one, other) {
        (Some(one), Some(other)) => one.iter().any(|sleeper| other.contains(sleeper)),
        _ => true,
    };
    for (number, (physics, sleepers, extension)) in extensions.iter().enumerate() {
        let mut before = extensions[..number].iter();
        let is_twice = extension.stage() == Stage::ForceLaw
            && before.any(|(other, at, _)| other == physics && meet(*at, *sleepers));
        if is_twice {
            return Err(InstanceError::Twice { physics: (*physics).to_owned() });
        }
    }
    Ok(())
}

/// The checked inputs from which a kind is built.
#[derive(Debug)]
pub struct Inputs<'a> {
    kind: &'static Kind,
    instance: &'a ExtensionInstance,
    /// Design of track and wheel.
    pub design: &'a TrackDesign,
    spans: usize,
}

impl ExtensionInstance {
    /// An extension of the kind `physics`, without place and values.
    pub fn new(physics: &str) -> Self {
        Self { physics: physics.to_owned(), ..Self::default() }
    }

    /// Sets the place to a stretch of the rail, `[from, to]` in m. For a point both are equal.
    #[must_use]
    pub fn at(mut self, x_m: [f64; 2]) -> Self {
        self.x_m = Some(x_m);
        self
    }

    /// Sets the place to these sleepers, by index from 0.
    #[must_use]
    pub fn on(mut self, sleepers: impl IntoIterator<Item = usize>) -> Self {
        self.sleepers = Some(sleepers.into_iter().collect());
        self
    }

    /// Sets the value of a parameter, in the unit that its name contains.
    #[must_use]
    pub fn with(mut self, parameter: &str, value: f64) -> Self {
        self.parameters.insert(parameter.to_owned(), value);
        self
    }

    /// The kind in the registry that has the name `physics`.
    ///
    /// # Errors
    /// [`InstanceError::Unknown`] if no kind has this name; the message lists all names.
    pub fn kind(&self) -> Result<&'static Kind, InstanceError> {
        Kind::from_name(&self.physics)
            .ok_or_else(|| InstanceError::Unknown { physics: self.physics.clone() })
    }

    /// Checks that every value is within the physical range of its parameter. The function ignores
    /// unknown parameters.
    ///
    /// # Errors
    /// [`InstanceError::Unknown`] for an unknown kind; [`InstanceError::Number`] names a parameter out
    /// of range.
    pub fn check_numbers(&self) -> Result<(), InstanceError> {
        for (name, &value) in &self.parameters {
            // One that is not known is refused where it is built.
            let Some(parameter) = self.kind()?.parameter(name) else { continue };
            parameter.quantity().check(value).map_err(|source| InstanceError::Number {
                physics: self.physics.clone(),
                parameter: parameter.name,
                source,
            })?;
        }
        Ok(())
    }

    /// Builds the extension for a track of this design with `spans` spans.
    ///
    /// # Errors
    /// [`InstanceError`] names the invalid kind, parameter or place.
    pub fn build(
        &self,
        design: &TrackDesign,
        spans: usize,
    ) -> Result<Arc<dyn Extension>, InstanceError> {
        let inputs = Inputs { kind: self.kind()?, instance: self, design, spans };
        inputs.check_parameters()?;
        inputs.check_place()?;
        (inputs.kind.build)(&inputs)
    }
}

impl Inputs<'_> {
    /// The value of a parameter of the kind: the given value, otherwise the default at the track's scale.
    pub fn value(&self, name: &str) -> f64 {
        let length_ratio = self.design.length_ratio();
        let default =
            self.kind.parameter(name).and_then(|parameter| parameter.default_at(length_ratio));
        let given = self.instance.parameters.get(name).copied();
        given.or(default).expect("parameters were checked against the registry")
    }

    /// Position of the point on the rail in m.
    pub fn point_m(&self) -> f64 {
        self.stretch_m()[0]
    }

    /// Start and end of the stretch of rail in m. Without a given place: the whole track.
    pub fn stretch_m(&self) -> [f64; 2] {
        self.instance.x_m.unwrap_or([0.0, self.length_m()])
    }

    /// Indices of the sleepers, from 0. Without a given place: all sleepers.
    pub fn sleepers(&self) -> Vec<usize> {
        let all = || (0..self.sleeper_count()).collect();
        self.instance.sleepers.clone().unwrap_or_else(all)
    }

    /// The error for an invalid value of `parameter`; `form` states the allowed values.
    pub fn refuse(&self, parameter: &str, form: &'static str) -> InstanceError {
        InstanceError::Value {
            physics: self.kind.physics.to_owned(),
            parameter: parameter.to_owned(),
            value: self.value(parameter),
            form,
        }
    }

    fn length_m(&self) -> f64 {
        self.spans as f64 * self.design.sleeper.spacing_m
    }

    fn sleeper_count(&self) -> usize {
        self.spans.saturating_sub(1)
    }

    fn check_parameters(&self) -> Result<(), InstanceError> {
        let physics = || self.kind.physics.to_owned();
        for (name, &value) in &self.instance.parameters {
            let Some(parameter) = self.kind.parameter(name) else {
                let parameter = name.clone();
                return Err(InstanceError::UnknownParameter { physics: physics(), parameter });
            };
            if !parameter.bound.holds(value) {
                return Err(self.refuse(name, parameter.bound.form()));
            }
        }
        for parameter in self.kind.parameters {
            if parameter.default.is_none() && !self.instance.parameters.contains_key(parameter.name)
            {
                return Err(InstanceError::MissingParameter {
                    physics: physics(),
                    parameter: parameter.name,
                    meaning: parameter.meaning,
                    typical: parameter.scaled(parameter.typical, self.design.length_ratio()),
                });
            }
        }
        Ok(())
    }

    fn check_place(&self) -> Result<(), InstanceError> {
        let (x_m, sleepers) = (self.instance.x_m, self.instance.sleepers.as_deref());
        let on_track = |[from, to]: [f64; 2]| 0.0 <= from && from <= to && to <= self.length_m();
        let ascending =
            |indices: &[usize]| !indices.is_empty() && indices.is_sorted_by(|one, next| one < next);
        let fits = match self.kind.place {
            PlaceKind::Nowhere => x_m.is_none() && sleepers.is_none(),
            // A diagnosis may say beside the point which sleepers are near it.
            PlaceKind::Point => x_m.is_some_and(|[from, to]| from == to && on_track([from, to])),
            PlaceKind::Stretch => {
                sleepers.is_none() && x_m.is_none_or(|[from, to]| from < to && on_track([from, to]))
            }
            PlaceKind::Sleepers => x_m.is_none() && sleepers.is_none_or(ascending),
        };
        let physics = self.kind.physics.to_owned();
        let count = self.sleeper_count();
        if !fits {
            let (form, length_m) = (self.kind.place.form(), self.length_m());
            return Err(InstanceError::Place { physics, form, length_m, sleepers: count });
        }
        let is_of_sleepers = self.kind.place == PlaceKind::Sleepers;
        match sleepers.and_then(|indices| indices.iter().find(|&&index| index >= count)) {
            Some(&index) if is_of_sleepers => {
                Err(InstanceError::NoSleeper { physics, index, sleepers: count })
            }
            _ => Ok(()),
        }
    }
}

fn known_kinds() -> String {
    let names: Vec<_> = Kind::all().map(|kind| kind.physics).collect();
    names.join(", ")
}

fn known_parameters(physics: &str) -> String {
    let parameters = Kind::from_name(physics).map_or(&[][..], |kind| kind.parameters);
    let names: Vec<_> = parameters.iter().map(|parameter| parameter.name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::TrackDesign;

    fn refusal(instance: &ExtensionInstance) -> String {
        instance.build(&TrackDesign::v_track(), 20).unwrap_err().to_string()
    }

    /// Without its place, the effect would be everywhere.
    #[test]
    fn a_place_of_another_form_is_refused() {
        let pad = ExtensionInstance::new("missing_railpad").with("stiffness_N_per_m", 1e7);
        let said = refusal(&pad.clone().at([1.5, 1.5]));
        assert!(said.contains("its place must be sleepers"), "{said}");
        let waves = ExtensionInstance::new("corrugation")
            .with("wavelength_m", 0.01)
            .with("amplitude_m", 1e-6);
        waves.clone().at([0.5, 1.0]).build(&TrackDesign::v_track(), 20).unwrap();
        let said = refusal(&waves.on([4, 5]));
        assert!(said.contains("its place must be a stretch"), "{said}");
    }

    #[test]
    fn a_support_is_replaced_once() {
        let design = TrackDesign::v_track();
        let gap = |sleepers: &[usize]| {
            let gap = ExtensionInstance::new("hanging_sleeper").with("gap_m", 1e-4);
            gap.on(sleepers.iter().copied())
        };
        let of = |instances: &[ExtensionInstance]| {
            let built: Vec<_> = instances.iter().map(|it| it.build(&design, 20).unwrap()).collect();
            let all = instances.iter().zip(&built);
            let all = all.map(|(it, built)| (&*it.physics, it.sleepers.as_deref(), &**built));
            check_together(&all.collect::<Vec<_>>()).map_err(|error| error.to_string())
        };
        assert_eq!(of(&[gap(&[3, 4]), gap(&[5])]), Ok(()));
        assert!(of(&[gap(&[3, 4]), gap(&[4])]).unwrap_err().contains("hanging_sleeper: two"));
        let everywhere = ExtensionInstance { sleepers: None, ..gap(&[1]) };
        assert!(of(&[gap(&[3]), everywhere]).is_err());
        // Springs add.
        let bolt = ExtensionInstance::new("sleeper_bolt").on([3]).with("stiffness_N_per_m", 1e7);
        assert_eq!(of(&[bolt.clone(), bolt]), Ok(()));
    }
}
