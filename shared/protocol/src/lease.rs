//! Messages with leased cases.

use crate::check::{BadMessage, bounded, duration, name};
use crate::farm;
use tracktwin_parameters::{Case, Parameter, ParameterSet};

/// Response to the request of a worker for cases.
#[derive(Clone, Debug, PartialEq)]
pub enum Lease {
    /// Cases to simulate.
    Cases(CaseLease),
    /// No case is available at present.
    NoneNow {
        /// Time in s after which to request cases again.
        retry_after_s: f64,
        /// Reason, if the worker itself causes this state.
        reason: Option<String>,
    },
}

/// Cases of one campaign under one lease.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseLease {
    /// The campaign.
    pub campaign: String,
    /// Experiment of the campaign, as canonical JSON.
    pub experiment_json: String,
    /// BLAKE3 of `experiment_json`, hexadecimal.
    pub experiment_hash: String,
    /// The cases.
    pub cases: Vec<LeasedCase>,
    /// The lease as W3C Trace Context. Empty if nothing is traced.
    pub traceparent: String,
}

/// A case and the epoch of its lease.
#[derive(Clone, Debug, PartialEq)]
pub struct LeasedCase {
    /// The case.
    pub case: Case,
    /// Number of leases that the case has had, from 1.
    pub epoch: u32,
}

/// Converts cases, given as (index, epoch), to messages.
pub fn held_to_messages(held: impl IntoIterator<Item = (u32, u32)>) -> Vec<farm::HeldCase> {
    held.into_iter().map(|(sobol_index, epoch)| farm::HeldCase { sobol_index, epoch }).collect()
}

/// Converts messages to cases, as (index, epoch).
///
/// # Errors
/// [`BadMessage::TooMany`] if there are more cases than a message may have.
pub fn held_from_messages(messages: Vec<farm::HeldCase>) -> Result<Vec<(u32, u32)>, BadMessage> {
    let held = bounded("cases", messages)?.into_iter();
    Ok(held.map(|held| (held.sobol_index, held.epoch)).collect())
}

impl From<Lease> for farm::LeaseResponse {
    fn from(lease: Lease) -> Self {
        match lease {
            Lease::NoneNow { retry_after_s, reason } => Self {
                status: farm::LeaseStatus::NoneNow.into(),
                retry_after_s,
                reason: reason.unwrap_or_default(),
                ..Self::default()
            },
            Lease::Cases(lease) => Self {
                status: farm::LeaseStatus::Cases.into(),
                campaign_id: lease.campaign,
                experiment_json: lease.experiment_json,
                experiment_hash: lease.experiment_hash,
                cases: lease.cases.into_iter().map(Into::into).collect(),
                traceparent: lease.traceparent,
                ..Self::default()
            },
        }
    }
}

impl From<LeasedCase> for farm::LeasedCase {
    fn from(LeasedCase { case, epoch }: LeasedCase) -> Self {
        let value = |(parameter, value): (Parameter, f64)| farm::ParameterValue {
            name: parameter.name().to_owned(),
            value,
        };
        Self {
            sobol_index: case.index,
            parameters: case.parameters.iter().map(value).collect(),
            surface_seed: case.surface_seed,
            parameter_hash: case.parameter_hash(),
            epoch,
        }
    }
}

impl TryFrom<farm::LeaseResponse> for Lease {
    type Error = BadMessage;

    fn try_from(message: farm::LeaseResponse) -> Result<Self, BadMessage> {
        match message.status() {
            farm::LeaseStatus::Unspecified => {
                Err(BadMessage::UnknownValue { field: "status", value: message.status })
            }
            farm::LeaseStatus::NoneNow => Ok(Self::NoneNow {
                retry_after_s: duration("retry_after_s", message.retry_after_s)?,
                reason: Some(message.reason).filter(|reason| !reason.is_empty()),
            }),
            farm::LeaseStatus::Cases => message.try_into().map(Self::Cases),
        }
    }
}

impl TryFrom<farm::LeaseResponse> for CaseLease {
    type Error = BadMessage;

    fn try_from(message: farm::LeaseResponse) -> Result<Self, BadMessage> {
        let hash = blake3::hash(message.experiment_json.as_bytes());
        if hash.to_hex().as_str() != message.experiment_hash {
            return Err(BadMessage::WrongHash { what: "the experiment".to_owned() });
        }
        Ok(Self {
            campaign: name("campaign_id", message.campaign_id)?,
            experiment_json: message.experiment_json,
            experiment_hash: name("experiment_hash", message.experiment_hash)?,
            cases: message.cases.into_iter().map(TryInto::try_into).collect::<Result<_, _>>()?,
            traceparent: message.traceparent,
        })
    }
}

impl TryFrom<farm::LeasedCase> for LeasedCase {
    type Error = BadMessage;

    fn try_from(message: farm::LeasedCase) -> Result<Self, BadMessage> {
        let index = message.sobol_index;
        let parameters = parameter_set(index, &message.parameters)?;
        let case = Case { index, parameters, surface_seed: message.surface_seed };
        if case.parameter_hash() != message.parameter_hash {
            return Err(BadMessage::WrongHash { what: format!("case {index}") });
        }
        Ok(Self { case, epoch: message.epoch })
    }
}

/// Checks the parameters of a case. A worker must reject an unknown parameter, because it would
/// otherwise store wrong results in the library.
fn parameter_set(index: u32, values: &[farm::ParameterValue]) -> Result<ParameterSet, BadMessage> {
    let mut set = ParameterSet::nominal();
    let mut counts = [0; Parameter::COUNT];
    for farm::ParameterValue { name, value } in values {
        let parameter = Parameter::from_name(name)
            .ok_or_else(|| BadMessage::UnknownParameter { index, name: name.clone() })?;
        if !value.is_finite() {
            return Err(BadMessage::NotANumber { field: parameter.name(), value: *value });
        }
        set[parameter] = *value;
        counts[parameter.index()] += 1;
    }
    match Parameter::ALL.iter().zip(counts).find(|&(_, count)| count != 1) {
        Some((parameter, count)) => {
            Err(BadMessage::ParameterCount { index, name: parameter.name(), count })
        }
        None => Ok(set),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CASES_MAX;
    use proptest::prelude::*;

    fn leased() -> LeasedCase {
        let case = Case { index: 3, parameters: ParameterSet::nominal(), surface_seed: 9 };
        LeasedCase { case, epoch: 2 }
    }

    fn refusal(change: impl FnOnce(&mut farm::LeasedCase)) -> BadMessage {
        let mut message = farm::LeasedCase::from(leased());
        change(&mut message);
        LeasedCase::try_from(message).unwrap_err()
    }

    #[test]
    fn a_case_with_an_unknown_parameter_is_refused() {
        let extra = farm::ParameterValue { name: "joint_dip_m".to_owned(), value: 1e-5 };
        let error = refusal(|message| message.parameters.push(extra));
        assert!(matches!(error, BadMessage::UnknownParameter { index: 3, .. }), "{error}");
    }

    #[test]
    fn a_case_that_lacks_or_repeats_a_parameter_is_refused() {
        let lacking = refusal(|message| message.parameters.truncate(5));
        assert!(matches!(lacking, BadMessage::ParameterCount { count: 0, .. }), "{lacking}");
        let twice = refusal(|message| message.parameters.push(message.parameters[0].clone()));
        assert!(matches!(twice, BadMessage::ParameterCount { count: 2, .. }), "{twice}");
    }

    #[test]
    fn a_case_whose_values_changed_on_the_way_is_refused() {
        let changed = refusal(|message| message.parameters[2].value *= 1.000_001);
        assert!(matches!(changed, BadMessage::WrongHash { .. }), "{changed}");
        let seed = refusal(|message| message.surface_seed += 1);
        assert!(matches!(seed, BadMessage::WrongHash { .. }), "{seed}");
        let nan = refusal(|message| message.parameters[2].value = f64::NAN);
        assert!(matches!(nan, BadMessage::NotANumber { .. }), "{nan}");
    }

    #[test]
    fn more_cases_than_a_message_may_hold_are_refused() {
        let held = |count| vec![farm::HeldCase { sobol_index: 1, epoch: 1 }; count];
        assert_eq!(held_from_messages(held(CASES_MAX)).unwrap().len(), CASES_MAX);
        let error = held_from_messages(held(CASES_MAX + 1)).unwrap_err();
        assert!(matches!(error, BadMessage::TooMany { field: "cases", .. }), "{error}");
    }

    #[test]
    fn an_experiment_that_changed_on_the_way_is_refused() {
        let lease = Lease::Cases(CaseLease {
            campaign: "c".to_owned(),
            experiment_json: "{}".to_owned(),
            experiment_hash: blake3::hash(b"{}").to_hex().to_string(),
            cases: vec![leased()],
            traceparent: String::new(),
        });
        let mut message = farm::LeaseResponse::from(lease.clone());
        assert_eq!(Lease::try_from(message.clone()), Ok(lease));
        message.experiment_json = "[]".to_owned();
        let error = Lease::try_from(message).unwrap_err();
        assert!(matches!(error, BadMessage::WrongHash { .. }), "{error}");
    }

    #[test]
    fn an_answer_without_status_is_refused() {
        let error = Lease::try_from(farm::LeaseResponse::default()).unwrap_err();
        assert_eq!(error, BadMessage::UnknownValue { field: "status", value: 0 });
    }

    proptest! {
        #[test]
        fn every_case_survives_the_way_to_the_worker(
            values in proptest::array::uniform6(1e-3..1e9_f64), index: u32, seed: u64, epoch: u32
        ) {
            let case = Case { index, parameters: ParameterSet::new(values), surface_seed: seed };
            let leased = LeasedCase { case, epoch };
            let message = farm::LeasedCase::from(leased.clone());
            prop_assert_eq!(LeasedCase::try_from(message).unwrap(), leased);
        }
    }
}
