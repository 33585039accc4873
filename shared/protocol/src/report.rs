//! Messages with results.

use crate::check::{BadMessage, bounded, duration, finite, name, share};
use crate::{checksum, farm};
use farm::case_report::Outcome as OutcomeMessage;
use prost::bytes::Bytes;
use tracktwin_experiment::{Outcome, PassFeatures};
use tracktwin_signal::{Features, ThirdOctave};

/// Longest reason of a failure that is kept, in bytes; the rest is cut off.
const REASON_BYTES_MAX: usize = 2000;

/// Report of a worker on one case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseReport {
    /// Index of the case in the campaign.
    pub index: u32,
    /// Epoch of the lease under which the case was simulated.
    pub epoch: u32,
    /// Hash of the parameters and seed that were simulated.
    pub parameter_hash: String,
    /// Computing time at all speeds, in s.
    pub duration_s: f64,
    /// Outcome of the case.
    pub outcome: Outcome,
    /// [`checksum`] of index, parameters and outcome, computed by the worker.
    pub checksum: String,
}

/// Shape of the results of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Speeds in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Number of frequency bins.
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
            checksum: report.checksum,
        }
    }
}

impl From<PassFeatures> for farm::PassFeatures {
    fn from(PassFeatures { speed_km_h, features, contact_loss_share }: PassFeatures) -> Self {
        let Features { log_power, band_levels_db } = features;
        let (log_power, band_levels_db) = (as_bytes(&log_power), as_bytes(&band_levels_db));
        Self { speed_km_h, log_power, band_levels_db, contact_loss_share }
    }
}

impl CaseReport {
    /// The reports of a message, `None` for each report that was damaged in transmission; see
    /// [`CaseReport::checked`].
    ///
    /// # Errors
    /// [`BadMessage`] if there are too many reports, or if an undamaged report is invalid.
    pub fn all_checked(
        messages: Vec<farm::CaseReport>,
        shape: &Shape,
    ) -> Result<Vec<Option<Self>>, BadMessage> {
        let checked = |message| match Self::checked(message, shape) {
            Err(BadMessage::Damaged { .. }) => Ok(None),
            checked => checked.map(Some),
        };
        bounded("cases", messages)?.into_iter().map(checked).collect()
    }

    /// The report in a message. Its checksum must match, and it must have the shape of the experiment.
    ///
    /// # Errors
    /// [`BadMessage::Damaged`] if the report was damaged in transmission; another [`BadMessage`] if a
    /// value is missing, not finite, or of another shape.
    pub fn checked(message: farm::CaseReport, shape: &Shape) -> Result<Self, BadMessage> {
        let index = message.sobol_index;
        let damaged = BadMessage::Damaged { index };
        let report = Self::as_received(message).filter(Self::has_its_checksum).ok_or(damaged)?;
        let outcome = match report.outcome {
            Outcome::Finished(passes) => {
                check_passes(index, &passes, shape)?;
                Outcome::Finished(passes)
            }
            Outcome::Failed { reason } => Outcome::Failed { reason: in_one_line(reason) },
        };
        Ok(Self {
            parameter_hash: name("parameter_hash", report.parameter_hash)?,
            duration_s: duration("duration_s", report.duration_s)?,
            outcome,
            ..report
        })
    }

    /// The unchecked content of a message; `None` without an outcome.
    fn as_received(message: farm::CaseReport) -> Option<Self> {
        let outcome = match message.outcome? {
            OutcomeMessage::Failure(failure) => Outcome::Failed { reason: failure.reason },
            OutcomeMessage::Passes(passes) => {
                Outcome::Finished(passes.passes.into_iter().map(Into::into).collect())
            }
        };
        Some(Self {
            index: message.sobol_index,
            epoch: message.epoch,
            parameter_hash: message.parameter_hash,
            duration_s: message.duration_s,
            outcome,
            checksum: message.checksum,
        })
    }

    fn has_its_checksum(&self) -> bool {
        checksum(self.index, &self.parameter_hash, &self.outcome) == self.checksum
    }
}

impl From<farm::PassFeatures> for PassFeatures {
    fn from(message: farm::PassFeatures) -> Self {
        let features = Features {
            log_power: from_bytes(&message.log_power),
            band_levels_db: from_bytes(&message.band_levels_db),
        };
        let farm::PassFeatures { speed_km_h, contact_loss_share, .. } = message;
        Self { speed_km_h, features, contact_loss_share }
    }
}

fn check_passes(index: u32, passes: &[PassFeatures], shape: &Shape) -> Result<(), BadMessage> {
    let found: Vec<f64> = passes.iter().map(|pass| pass.speed_km_h).collect();
    if found != shape.speeds_km_h {
        return Err(BadMessage::WrongSpeeds { index, found, expected: shape.speeds_km_h.clone() });
    }
    for PassFeatures { features, contact_loss_share, .. } in passes {
        for (field, values, expected) in [
            ("log_power", &features.log_power, shape.bins),
            ("band_levels_db", &features.band_levels_db, ThirdOctave::COUNT),
        ] {
            if values.len() != expected {
                let found = values.len();
                return Err(BadMessage::WrongLength { index, field, found, expected });
            }
            finite(field, values)?;
        }
        contact_loss_share.map_or(Ok(0.0), |it| share("contact_loss_share", it))?;
    }
    Ok(())
}

/// Numbers in the encoding of a message.
fn as_bytes(numbers: &[f64]) -> Bytes {
    numbers.iter().map(|number| number.to_le_bytes()).collect::<Vec<_>>().into_flattened().into()
}

/// The numbers in the bytes of a message. An incomplete number at the end becomes NaN.
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
            contact_loss_share: (speed_km_h > 10.0).then_some(0.25),
        };
        with(Outcome::Finished(vec![pass(7.0), pass(13.0)]))
    }

    /// A report of an outcome, with its checksum.
    fn with(outcome: Outcome) -> CaseReport {
        CaseReport {
            index: 5,
            epoch: 1,
            parameter_hash: "ab".to_owned(),
            duration_s: 0.1,
            checksum: checksum(5, "ab", &outcome),
            outcome,
        }
    }

    /// Why a message is refused that its worker sent so.
    fn refusal(change: impl FnOnce(&mut farm::CaseReport)) -> BadMessage {
        let mut message = farm::CaseReport::from(report());
        change(&mut message);
        let sent = CaseReport::as_received(message.clone()).unwrap();
        message.checksum = checksum(sent.index, &sent.parameter_hash, &sent.outcome);
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
            #[prost(double, optional, tag = "4")]
            contact_loss_share: Option<f64>,
        }
        let message = passes(&mut report().into())[1].clone();
        let contract = Contract {
            speed_km_h: 13.0,
            log_power: vec![-1.0, 0.1, 2.0],
            band_levels_db: vec![13.0; ThirdOctave::COUNT],
            contact_loss_share: Some(0.25),
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
    fn a_share_of_time_that_cannot_be_is_refused() {
        for share in [f64::NAN, f64::INFINITY, -1e-9, 1.0 + 1e-9] {
            let error = refusal(|message| passes(message)[0].contact_loss_share = Some(share));
            let field = "contact_loss_share";
            assert!(
                matches!(error, BadMessage::NotAShare { field: it, .. } if it == field),
                "{error}"
            );
        }
    }

    #[test]
    fn every_bit_that_changes_a_result_on_its_way_is_noticed() {
        let sent = farm::CaseReport::from(report()).encode_to_vec();
        let (mut damaged, mut harmless, mut unreadable) = (0, 0, 0);
        for place in 0..8 * sent.len() {
            let mut bytes = sent.clone();
            bytes[place / 8] ^= 1 << (place % 8);
            let Ok(message) = farm::CaseReport::decode(&*bytes) else {
                unreadable += 1;
                continue;
            };
            match CaseReport::checked(message, &shape()) {
                Err(_) => damaged += 1,
                // What a checksum is not made of: which lease it was, and how long it took.
                Ok(CaseReport { epoch, duration_s, .. }) if (epoch, duration_s) != (1, 0.1) => {
                    harmless += 1;
                }
                Ok(received) => assert_eq!(received, report(), "bit {place}"),
            }
        }
        assert!(
            damaged > 3000 && unreadable > 0 && harmless < 150,
            "{damaged} {unreadable} {harmless}"
        );
    }

    #[test]
    fn a_damaged_report_spoils_no_other() {
        let mut messages: Vec<_> = [report(), report()].map(Into::into).into();
        passes(&mut messages[0])[0].speed_km_h = 8.0;
        let checked = CaseReport::all_checked(messages, &shape()).unwrap();
        assert_eq!(checked, [None, Some(report())]);
    }

    #[test]
    fn a_report_without_outcome_or_checksum_is_damaged() {
        for change in [(|message| message.outcome = None) as fn(&mut farm::CaseReport), |message| {
            message.checksum.clear();
        }] {
            let mut message = farm::CaseReport::from(report());
            change(&mut message);
            let error = CaseReport::checked(message, &shape()).unwrap_err();
            assert_eq!(error, BadMessage::Damaged { index: 5 });
        }
    }

    #[test]
    fn a_reason_is_one_line_that_is_not_endless() {
        let stored = |reason: String| {
            let report = with(Outcome::Failed { reason });
            CaseReport::checked(report.into(), &shape()).unwrap().outcome
        };
        assert_eq!(stored("ä".repeat(5000)), Outcome::Failed { reason: "ä".repeat(1000) });
        assert_eq!(stored("a\nb\0".to_owned()), Outcome::Failed { reason: "a b ".to_owned() });
    }
}
