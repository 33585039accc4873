//! Extensions on a command line: `NAME[@PLACE][:PARAMETER=VALUE,...]`.
//!
//! A place is a point (`2.43m`), a stretch (`2m-3m`), or sleepers: one (`SN18`), a range (`SN10-SN30`),
//! every fourth sleeper of a range (`SN10-SN30/4`), or a list of these (`SN10,SN14-SN16`).

use super::ExtensionInstance;
use std::collections::BTreeMap;
use std::str::FromStr;

/// Largest number of a sleeper, beyond every track, so that a wrong range does not fill the memory.
const LARGEST: usize = 1_000_000;

/// Why a text does not describe an extension.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InstanceTextError {
    /// The name is missing.
    #[error(
        "write NAME[@PLACE][:PARAMETER=VALUE,...], for example \
             `sleeper_bolt@SN8-SN31:stiffness_N_per_m=3e7`"
    )]
    Form,
    /// A parameter is not `NAME=NUMBER`.
    #[error("`{0}` is not a parameter; write NAME=NUMBER")]
    Parameter(String),
    /// A parameter occurs twice.
    #[error("duplicate parameter `{0}`")]
    Twice(String),
    /// The text of the place has none of the valid forms.
    #[error(
        "`{0}` is not a place; write `2.43m`, `2m-3m`, `SN18`, `SN10-SN30`, `SN10-SN30/4` \
             or several sleepers separated by commas"
    )]
    Place(String),
}

impl FromStr for ExtensionInstance {
    type Err = InstanceTextError;

    fn from_str(text: &str) -> Result<Self, InstanceTextError> {
        let (head, parameters) = text.split_once(':').unwrap_or((text, ""));
        let (physics, place) = match head.split_once('@') {
            Some((physics, place)) => (physics, Some(place)),
            None => (head, None),
        };
        if physics.is_empty() || physics.contains('=') {
            return Err(InstanceTextError::Form);
        }
        let mut instance = Self { parameters: values(parameters)?, ..Self::new(physics) };
        match place {
            None => {}
            Some(place) if place.contains("SN") => instance.sleepers = Some(sleepers(place)?),
            Some(place) => instance.x_m = Some(stretch(place)?),
        }
        Ok(instance)
    }
}

fn values(text: &str) -> Result<BTreeMap<String, f64>, InstanceTextError> {
    let mut values = BTreeMap::new();
    for part in text.split(',').filter(|part| !part.is_empty()) {
        let wrong = || InstanceTextError::Parameter(part.to_owned());
        let (name, value) = part.split_once('=').ok_or_else(wrong)?;
        let value = value.parse().map_err(|_| wrong())?;
        if values.insert(name.to_owned(), value).is_some() {
            return Err(InstanceTextError::Twice(name.to_owned()));
        }
    }
    Ok(values)
}

fn stretch(text: &str) -> Result<[f64; 2], InstanceTextError> {
    let metres = |end: &str| end.strip_suffix('m').unwrap_or(end).parse::<f64>();
    let (from, to) = text.split_once('-').unwrap_or((text, text));
    match (metres(from), metres(to)) {
        (Ok(from), Ok(to)) => Ok([from, to]),
        _ => Err(InstanceTextError::Place(text.to_owned())),
    }
}

fn sleepers(text: &str) -> Result<Vec<usize>, InstanceTextError> {
    let wrong = || InstanceTextError::Place(text.to_owned());
    let number = |id: &str| {
        let number = id.strip_prefix("SN").and_then(|digits| digits.parse::<usize>().ok());
        number.filter(|&number| number <= LARGEST)
    };
    let mut sleepers: Vec<usize> = Vec::new();
    for part in text.split(',') {
        let (range, step) = part.split_once('/').unwrap_or((part, "1"));
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let step = step.parse::<usize>().ok().filter(|&step| step > 0).ok_or_else(wrong)?;
        let range = number(first).ok_or_else(wrong)?..=number(last).ok_or_else(wrong)?;
        sleepers.extend(range.step_by(step));
    }
    if sleepers.is_empty() { Err(wrong()) } else { Ok(sleepers) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> ExtensionInstance {
        text.parse().unwrap()
    }

    #[test]
    fn a_name_a_place_and_values_make_an_extension() {
        let joint = ExtensionInstance::new("rail_joint").at([2.4375, 2.4375]);
        let joint = joint.with("dip_m", 8e-5).with("bending_factor", 0.15);
        assert_eq!(parsed("rail_joint@2.4375m:dip_m=8e-5,bending_factor=0.15"), joint);
        let waves = ExtensionInstance::new("corrugation").at([2.0, 3.0]);
        assert_eq!(parsed("corrugation@2m-3m"), waves);
        assert_eq!(parsed("second_wheel"), ExtensionInstance::new("second_wheel"));
    }

    #[test]
    fn sleepers_are_named_one_by_one_in_ranges_and_in_steps() {
        let sleepers = |place: &str| parsed(&format!("fastening_clamp@{place}")).sleepers.unwrap();
        assert_eq!(sleepers("SN18"), [18]);
        assert_eq!(sleepers("SN10-SN13"), [10, 11, 12, 13]);
        assert_eq!(sleepers("SN10-SN30/4"), [10, 14, 18, 22, 26, 30]);
        assert_eq!(sleepers("SN3,SN7-SN8"), [3, 7, 8]);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let refusal = |text: &str| text.parse::<ExtensionInstance>().unwrap_err().to_string();
        assert!(refusal("").contains("NAME[@PLACE]"));
        assert!(refusal("squat:depth_m").contains("`depth_m`"));
        assert!(refusal("squat:depth_m=deep").contains("`depth_m=deep`"));
        assert!(refusal("squat:depth_m=1,depth_m=2").contains("duplicate"));
        assert!(refusal("squat@here").contains("`here`"));
        assert!(refusal("sleeper_bolt@SN9-SN3").contains("`SN9-SN3`"));
        assert!(refusal("sleeper_bolt@SN1-SN99999999999").contains("is not a place"));
        assert!(refusal("sleeper_bolt@SN3-SN9/0").contains("SN10-SN30/4"));
    }
}
