//! The section `[parameters]` of a campaign file: values and ranges of parameters and of numbers of the
//! design.

use super::{SpecError, number};
use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use std::collections::BTreeMap;
use std::fmt;
use tracktwin_experiment::{Experiment, ExperimentError};
use tracktwin_parameters::{
    Axis, DesignAxis, DesignNumber, Parameter, ParameterSet, ParameterSpace, Scale, Track,
};

/// Content of the section: values and ranges of the parameters, and of numbers of the design under their
/// keys in a track file.
#[derive(Default)]
pub(super) struct Parameters {
    catalogue: BTreeMap<Parameter, Range>,
    design: Vec<(DesignNumber, Range)>,
}

/// Value or range of a parameter, as written in the file.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number, [low, high] or { low, high, scale }")]
enum Range {
    Fixed(f64),
    Between([f64; 2]),
    Scaled { low: f64, high: f64, scale: Scale },
}

impl Range {
    /// All numbers of the range: one or two.
    fn values(self) -> Vec<f64> {
        match self {
            Self::Fixed(value) => vec![value],
            Self::Between(ends) => ends.to_vec(),
            Self::Scaled { low, high, .. } => vec![low, high],
        }
    }
}

/// A key of the section.
#[derive(Deserialize)]
#[serde(try_from = "String")]
enum Key {
    Parameter(Parameter),
    Number(DesignNumber),
    /// `track` or `vehicle`, the beginning of dotted keys.
    Section(String),
}

impl TryFrom<String> for Key {
    type Error = String;

    fn try_from(key: String) -> Result<Self, String> {
        if ["track", "vehicle"].contains(&key.as_str()) {
            return Ok(Self::Section(key));
        }
        if key.contains('.') {
            return DesignNumber::try_from(key).map(Self::Number);
        }
        Parameter::try_from(key).map(Self::Parameter).map_err(|unknown| {
            format!("{unknown}; and numbers of a track file such as vehicle.mass_kg")
        })
    }
}

/// A value under a dotted key.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number, [low, high] or { low, high, scale }")]
enum Nested {
    Range(Range),
    Section(BTreeMap<String, Nested>),
}

impl Nested {
    fn collect(self, key: String, into: &mut Vec<(DesignNumber, Range)>) -> Result<(), String> {
        match self {
            Self::Range(range) => {
                DesignNumber::try_from(key).map(|number| into.push((number, range)))
            }
            Self::Section(section) => section
                .into_iter()
                .try_for_each(|(name, nested)| nested.collect(format!("{key}.{name}"), into)),
        }
    }
}

impl<'de> Deserialize<'de> for Parameters {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Section)
    }
}

struct Section;

impl<'de> Visitor<'de> for Section {
    type Value = Parameters;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("values and ranges of parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Parameters, A::Error> {
        let mut parameters = Parameters::default();
        while let Some(key) = map.next_key()? {
            match key {
                Key::Parameter(parameter) => {
                    parameters.catalogue.insert(parameter, map.next_value()?);
                }
                Key::Number(number) => parameters.design.push((number, map.next_value()?)),
                Key::Section(key) => {
                    let nested: Nested = map.next_value()?;
                    nested.collect(key, &mut parameters.design).map_err(A::Error::custom)?;
                }
            }
        }
        // A quoted key and a dotted one can name the same number.
        let numbers = || parameters.design.iter().map(|(number, _)| number);
        if let Some(twice) = numbers().find(|it| numbers().filter(|other| other == it).count() > 1)
        {
            return Err(A::Error::custom(format!("duplicate key `{}`", twice.key())));
        }
        Ok(parameters)
    }
}

impl Parameters {
    /// The sampled parameter space and the values of the parameters that are not sampled.
    pub(super) fn sampled(
        &self,
        path: &str,
        track: &Track,
    ) -> Result<(ParameterSpace, ParameterSet), SpecError> {
        let mut axes = Vec::new();
        let mut fixed = track.nominal;
        for &parameter in Parameter::ALL {
            let linear = |low, high| Axis { parameter, low, high, scale: Scale::Linear };
            let given = self.catalogue.get(&parameter).copied();
            match given {
                None => axes.push(track.axis(parameter)),
                Some(Range::Between([low, high])) => axes.push(linear(low, high)),
                Some(Range::Scaled { low, high, scale }) => {
                    axes.push(Axis { parameter, low, high, scale });
                }
                Some(Range::Fixed(value)) => fixed[parameter] = value,
            }
            for value in given.map(Range::values).unwrap_or_default() {
                let key = format!("parameters.{parameter}");
                let checked = parameter.quantity().check(value);
                checked.map_err(|source| number(path, &key, source))?;
            }
        }
        let space = ParameterSpace::new(axes)
            .map_err(|source| SpecError::Space { path: path.to_owned(), source })?;
        Ok((space, fixed))
    }

    /// Sets the numbers of the design in an experiment: values, and axes.
    pub(super) fn set_design(&self, experiment: &mut Experiment) -> Result<(), ExperimentError> {
        for &(number, range) in &self.design {
            match range {
                Range::Fixed(value) => {
                    number.check(value)?;
                    number.set(&mut experiment.design, value);
                }
                Range::Between([low, high]) => {
                    let scale = Scale::Linear;
                    experiment.design_axes.push(DesignAxis { number, low, high, scale });
                }
                Range::Scaled { low, high, scale } => {
                    experiment.design_axes.push(DesignAxis { number, low, high, scale });
                }
            }
        }
        // The order in the file does not matter.
        experiment.design_axes.sort_by_key(|axis| axis.number.index());
        Ok(())
    }
}
