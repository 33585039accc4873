//! `NAME[@SLEEPERS]=VALUE`: value of a parameter at all sleepers or some.

use anyhow::anyhow;
use std::ops::RangeInclusive;
use std::str::FromStr;
use tracktwin_parameters::{Parameter, ParameterSet, QuantityError};

/// Value of a parameter, and the sleepers to which it applies.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::commands) struct Setting {
    pub(in crate::commands) parameter: Parameter,
    pub(in crate::commands) value: f64,
    /// Numbers of the sleepers; all sleepers if `None`.
    pub(in crate::commands) sleepers: Option<RangeInclusive<usize>>,
}

/// Errors of a setting.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(in crate::commands) enum SettingError {
    #[error("write NAME=VALUE, NAME@SN12=VALUE or NAME@SN12-SN15=VALUE")]
    Form,
    #[error("{0}")]
    Parameter(String),
    #[error(transparent)]
    Value(#[from] QuantityError),
    #[error("`{0}` is not a sleeper or range; write SN12 or SN12-SN15")]
    Sleepers(String),
    #[error("the irregularity applies to the whole surface, not to single sleepers")]
    Local,
}

impl FromStr for Setting {
    type Err = SettingError;

    fn from_str(text: &str) -> Result<Self, SettingError> {
        let (target, value) = text.split_once('=').ok_or(SettingError::Form)?;
        let (name, place) = match target.split_once('@') {
            Some((name, place)) => (name, Some(place)),
            None => (target, None),
        };
        let parameter = Parameter::try_from(name.to_owned()).map_err(SettingError::Parameter)?;
        let value = parameter.quantity().parse(value)?;
        let sleepers = place.map(range).transpose()?;
        if sleepers.is_some() && parameter == Parameter::IrregularityLevel {
            return Err(SettingError::Local);
        }
        Ok(Self { parameter, value, sleepers })
    }
}

fn range(text: &str) -> Result<RangeInclusive<usize>, SettingError> {
    let wrong = || SettingError::Sleepers(text.to_owned());
    let number = |id: &str| id.strip_prefix("SN").unwrap_or(id).parse::<usize>().ok();
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let range = number(first).ok_or_else(wrong)?..=number(last).ok_or_else(wrong)?;
    if range.is_empty() { Err(wrong()) } else { Ok(range) }
}

impl Setting {
    /// The parameter set of sleeper `number` with this setting, if it applies there.
    pub(in crate::commands) fn apply(&self, set: ParameterSet, number: usize) -> ParameterSet {
        if self.sleepers.as_ref().is_none_or(|sleepers| sleepers.contains(&number)) {
            set.with(self.parameter, self.value)
        } else {
            set
        }
    }
}

/// Checks that the sleepers of all settings exist on a track with `count` sleepers.
pub(in crate::commands) fn check_sleepers(
    settings: &[Setting],
    count: usize,
) -> Result<(), anyhow::Error> {
    let ends = settings.iter().filter_map(|setting| Some(*setting.sleepers.as_ref()?.end()));
    match ends.max().filter(|&last| last >= count) {
        None => Ok(()),
        Some(last) => {
            Err(anyhow!("--set: SN{last} does not exist; the last sleeper is SN{}", count - 1))
        }
    }
}

/// Checks that no setting names sleepers, for commands whose track has the same parameters everywhere.
pub(in crate::commands) fn check_whole_track(settings: &[Setting]) -> Result<(), anyhow::Error> {
    if settings.iter().any(|setting| setting.sleepers.is_some()) {
        return Err(anyhow!("--set: the value applies to the whole track; remove the sleepers"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleepers_that_do_not_exist_are_refused() {
        let settings = |texts: &[&str]| -> Vec<Setting> {
            texts.iter().map(|text| text.parse().unwrap()).collect()
        };
        let some = settings(&["railpad_stiffness_N_m=9e7", "railpad_stiffness_N_m@SN9-SN12=9e7"]);
        assert!(check_sleepers(&some, 13).is_ok());
        let error = check_sleepers(&some, 12).unwrap_err().to_string();
        assert_eq!(error, "--set: SN12 does not exist; the last sleeper is SN11");
        assert!(check_whole_track(&some[..1]).is_ok());
        let error = check_whole_track(&some).unwrap_err().to_string();
        assert!(error.contains("remove the sleepers"), "{error}");
    }

    #[test]
    fn a_value_holds_everywhere_or_where_it_says() {
        let everywhere: Setting = "railpad_stiffness_N_m=9e7".parse().unwrap();
        let set = everywhere.apply(ParameterSet::nominal(), 3);
        assert_eq!(set[Parameter::RailpadStiffness], 9e7);

        let some: Setting = "ballast_stiffness_N_m@SN12-SN14=4e6".parse().unwrap();
        let stiffness =
            |number| some.apply(ParameterSet::nominal(), number)[Parameter::BallastStiffness];
        assert_eq!(stiffness(12), 4e6);
        assert_eq!(stiffness(14), 4e6);
        assert_eq!(stiffness(15), Parameter::BallastStiffness.nominal());
    }

    #[test]
    fn what_cannot_be_is_refused_with_the_reason() {
        let refused = |text: &str| text.parse::<Setting>().unwrap_err().to_string();
        assert!(refused("railpad_stiffness_N_m").contains("NAME=VALUE"));
        assert!(refused("pad=1").contains("railpad_stiffness_N_m"));
        assert!(refused("railpad_stiffness_N_m=soft").contains("`soft`"));
        assert!(refused("railpad_stiffness_N_m=-1").contains("10000 to"));
        assert!(refused("railpad_stiffness_N_m=150").contains("did you mean"));
        assert!(refused("railpad_stiffness_N_m@SN9-SN3=1e8").contains("SN9-SN3"));
        assert!(refused("irregularity_level@SN3=1").contains("whole surface"));
    }
}
