//! Results on their way to the coordinator.

use crate::check::{BadMessage, bounded, duration, finite, name};
use crate::farm;
use farm::case_report::Outcome as OutcomeMessage;
use prost::bytes::Bytes;
use tracktwin_signal::{Features, ThirdOctave};

/// Longest reason of a failure that is kept, in bytes; the rest is cut off.
const REASON_BYTES_MAX: usize = 2000;

/// What became of a case.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Features, one pass a speed, by ascending speed.
    Finished(Vec<PassFeatures>),
    /// It cannot be simulated. That is a result, not an error of the farm.
    Failed {
        /// Why.
        reason: String,
    },
}

/// The features of one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassFeatures {
    /// Speed in km/h.
    pub speed_km_h: f64,
    /// The features.
    pub features: Features,
}

/// What a worker hands in for one case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseReport {
    /// Place in the campaign.
    pub index: u32,
    /// The lease under which it was simulated.
    pub epoch: u32,
    /// Hash of the parameters and seed that were simulated.
    pub parameter_hash: String,
    /// Computing time at all speeds together, in s.
    pub duration_s: f64,
    /// What became of it.
    pub outcome: Outcome,
}

/// The shape that an experiment gives to results.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Speeds in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Frequency bins.
    pub bins: usize,
}

impl From<CaseReport> for farm::CaseReport {
    fn from(report: CaseReport) -> Self {
        let outcome = match report.outcome {
            Outcome::Finished(passes) => OutcomeMessage::Passes(farm::Passes {
                passes: passes.into_iter().map(Into::into).collect(),
            }),
            Outcome::Failed { reason } => OutcomeMessage::Failure(farm::Failure { reason }),
        };
        Self {
            sobol_index: report.index,
            epoch: report.epoch,
            parameter_hash: report.parameter_hash,
            duration_s: report.duration_s,
            outcome: Some(outcome),
        }
    }
}

impl From<PassFeatures> for farm::PassFeatures {
    fn from(PassFeatures { speed_km_h, features }: PassFeatures) -> Self {
        let Features { log_power, band_levels_db } = features;
        let (log_power, band_levels_db) = (as_bytes(&log_power), as_bytes(&band_levels_db));
        Self { speed_km_h, log_power, band_levels_db }
    }
}

impl CaseReport {
    /// The reports of a message; see [`CaseReport::checked`].
    ///
    /// # Errors
    /// [`BadMessage`] when there are too many, or one is wrong.
    pub fn all_checked(
        messages: Vec<farm::CaseReport>,
        shape: &Shape,
    ) -> Result<Vec<Self>, BadMessage> {
        let messages = bounded("cases", messages)?;
        messages.into_iter().map(|message| Self::checked(message, shape)).collect()
    }

    /// The report in a message, which must have the shape of its experiment.
    ///
    /// # Errors
    /// [`BadMessage`] when something is missing, not finite, or of another shape.
    pub fn checked(message: farm::CaseReport, shape: &Shape) -> Result<Self, BadMessage> {
        let index = message.sobol_index;
        let outcome = match message.outcome {
            None => return Err(BadMessage::Missing { field: "outcome" }),
            Some(OutcomeMessage::Failure(failure)) => {
                Outcome::Failed { reason: in_one_line(failure.reason) }
            }
            Some(OutcomeMessage::Passes(passes)) => {
                Outcome::Finished(checked_passes(index, passes.passes, shape)?)
            }
        };
        Ok(Self {
            index,
            epoch: message.epoch,
            parameter_hash: name("parameter_hash", message.parameter_hash)?,
            duration_s: duration("duration_s", message.duration_s)?,
            outcome,
        })
    }
}

fn checked_passes(
    index: u32,
    messages: Vec<farm::PassFeatures>,
    shape: &Shape,
) -> Result<Vec<PassFeatures>, BadMessage> {
    let found: Vec<f64> = messages.iter().map(|pass| pass.speed_km_h).collect();
    if found != shape.speeds_km_h {
        return Err(BadMessage::WrongSpeeds { index, found, expected: shape.speeds_km_h.clone() });
    }
    let of_length = |field, bytes: &[u8], expected| {
        let values = from_bytes(bytes);
        match values.len() {
            found if found == expected => finite(field, values),
            found => Err(BadMessage::WrongLength { index, field, found, expected }),
        }
    };
    let pass = |message: farm::PassFeatures| {
        let log_power = of_length("log_power", &message.log_power, shape.bins)?;
        let levels = of_length("band_levels_db", &message.band_levels_db, ThirdOctave::COUNT)?;
        let features = Features { log_power, band_levels_db: levels };
        Ok(PassFeatures { speed_km_h: message.speed_km_h, features })
    };
    messages.into_iter().map(pass).collect()
}

/// Numbers as they lie in a message.
fn as_bytes(numbers: &[f64]) -> Bytes {
    numbers.iter().map(|number| number.to_le_bytes()).collect::<Vec<_>>().into_flattened().into()
}

/// The numbers that lie in a message; a piece at the end is not a number.
fn from_bytes(bytes: &[u8]) -> Vec<f64> {
    let (whole, piece) = bytes.as_chunks();
    let mut numbers: Vec<f64> = whole.iter().map(|number| f64::from_le_bytes(*number)).collect();
    numbers.extend((!piece.is_empty()).then_some(f64::NAN));
    numbers
}

/// In one line that is not endless, and that any database takes.
fn in_one_line(mut reason: String) -> String {
    if reason.is_empty() {
        return "no reason given".to_owned();
    }
    reason.truncate(reason.floor_char_boundary(REASON_BYTES_MAX));
    reason.replace(char::is_control, " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;

    fn shape() -> Shape {
        Shape { speeds_km_h: vec![7.0, 13.0], bins: 3 }
    }

    fn report() -> CaseReport {
        let pass = |speed_km_h| PassFeatures {
            speed_km_h,
            features: Features {
                log_power: vec![-1.0, 0.1, 2.0],
                band_levels_db: vec![speed_km_h; ThirdOctave::COUNT],
            },
        };
        CaseReport {
            index: 5,
            epoch: 1,
            parameter_hash: "ab".to_owned(),
            duration_s: 0.1,
            outcome: Outcome::Finished(vec![pass(7.0), pass(13.0)]),
        }
    }

    fn refusal(change: impl FnOnce(&mut farm::CaseReport)) -> BadMessage {
        let mut message = farm::CaseReport::from(report());
        change(&mut message);
        CaseReport::checked(message, &shape()).unwrap_err()
    }

    fn passes(message: &mut farm::CaseReport) -> &mut Vec<farm::PassFeatures> {
        match message.outcome.as_mut().unwrap() {
            OutcomeMessage::Passes(passes) => &mut passes.passes,
            OutcomeMessage::Failure(_) => panic!("the report is of a finished case"),
        }
    }

    #[test]
    fn a_report_survives_the_way_to_the_coordinator() {
        let back = CaseReport::checked(report().into(), &shape()).unwrap();
        assert_eq!(back, report());
    }

    #[test]
    fn numbers_lie_in_a_message_as_the_contract_says() {
        /// `PassFeatures` of farm.proto, to the letter.
        #[derive(Clone, PartialEq, prost::Message)]
        struct Contract {
            #[prost(double, tag = "1")]
            speed_km_h: f64,
            #[prost(double, repeated, tag = "2")]
            log_power: Vec<f64>,
            #[prost(double, repeated, tag = "3")]
            band_levels_db: Vec<f64>,
        }
        let message = passes(&mut report().into())[1].clone();
        let contract = Contract {
            speed_km_h: 13.0,
            log_power: vec![-1.0, 0.1, 2.0],
            band_levels_db: vec![13.0; ThirdOctave::COUNT],
        };
        assert_eq!(message.encode_to_vec(), contract.encode_to_vec());
        assert_eq!(farm::PassFeatures::decode(&*contract.encode_to_vec()), Ok(message));
    }

    #[test]
    fn features_that_are_not_finite_are_refused() {
        let error =
            refusal(|message| passes(message)[1].log_power = as_bytes(&[0.0, f64::NAN, 1.0]));
        assert!(matches!(error, BadMessage::NotANumber { field: "log_power", .. }), "{error}");
    }

    #[test]
    fn features_of_another_shape_are_refused() {
        let bins = refusal(|message| passes(message)[0].log_power = as_bytes(&[1.0; 4]));
        assert!(matches!(bins, BadMessage::WrongLength { field: "log_power", .. }), "{bins}");
        let piece = refusal(|message| {
            let log_power = &mut passes(message)[0].log_power;
            log_power.truncate(log_power.len() - 1);
        });
        assert!(matches!(piece, BadMessage::NotANumber { field: "log_power", .. }), "{piece}");
        let speeds = refusal(|message| passes(message).reverse());
        assert!(matches!(speeds, BadMessage::WrongSpeeds { index: 5, .. }), "{speeds}");
    }

    #[test]
    fn a_report_without_outcome_is_refused() {
        let error = refusal(|message| message.outcome = None);
        assert_eq!(error, BadMessage::Missing { field: "outcome" });
    }

    #[test]
    fn a_reason_is_one_line_that_is_not_endless() {
        let long =
            CaseReport { outcome: Outcome::Failed { reason: "ä".repeat(5000) }, ..report() };
        let back = CaseReport::checked(long.into(), &shape()).unwrap();
        assert_eq!(back.outcome, Outcome::Failed { reason: "ä".repeat(1000) });
        let report =
            CaseReport { outcome: Outcome::Failed { reason: "a\nb\0".to_owned() }, ..report() };
        let back = CaseReport::checked(report.into(), &shape()).unwrap();
        assert_eq!(back.outcome, Outcome::Failed { reason: "a b ".to_owned() });
    }
}
