//! Inspection of a recording without a track model: measuring chain, wheel, impacts.
//!
//! Owns the order of the tests, how the false-alarm rate is shared among them, and the sentences.

mod findings;

use self::findings::{
    clipping_finding, comb_finding, corrugation_finding, flat_finding, gain_finding, hum_finding,
    impact_finding, offset_finding, order_finding, scale_finding,
};
use crate::chain::{Gain, LossOfContact, Offsets, PassDefect};
use crate::finding::{Finding, Place};
use crate::wheel::{Comb, Flat, Order};
use crate::{chain, impact, wheel};
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::POSITION_ERROR;

/// Probability of a false alarm on a recording without defects, all tests together.
pub const FALSE_ALARMS: f64 = 0.02;

/// Share of it that each of the nine kinds of test has.
const EACH_TEST: f64 = FALSE_ALARMS / 9.0;

/// Sleeper spacings around a place where the wheel's flat meets the rail in every pass: the signal
/// there is that of the flat.
const AROUND_BLOW: f64 = 0.4;

/// Result of an inspection.
#[derive(Clone, Debug, Default)]
pub struct Inspection {
    /// Findings: chain first, then wheel, then the rail's surface.
    pub findings: Vec<Finding>,
    /// Findings whose kind is not in the catalogue; see [`Inspection::forget`].
    pub nameless: Vec<Finding>,
    /// The wheel's flat with the places of its blows, if it has one.
    pub flat: Option<Flat>,
    /// Where the wheel loses contact with the rail, if it does: neither chain nor physics of the track, but
    /// no linear model holds there.
    pub loss_of_contact: Option<LossOfContact>,
    /// Passes that can't be used, and why.
    pub pass_defects: Vec<PassDefect>,
    /// Noise floor of each pass in (m/s2)2/Hz.
    pub noise_floors: Vec<Option<f64>>,
    /// Gains between passes at one speed.
    pub gains: Vec<Gain>,
    /// Offsets between passes at one speed.
    pub offsets: Vec<Offsets>,
    /// The comb of a wheel of unknown circumference, of the first pass that has one.
    pub comb: Option<Comb>,
}

impl Inspection {
    /// Takes from the findings the names that are not known.
    pub fn forget(&mut self, is_known: impl Fn(&str) -> bool) {
        let forgotten = self.findings.extract_if(.., |finding| !is_known(finding.physics));
        self.nameless.extend(forgotten);
    }

    /// Forgets what was found and where, without a word of it later.
    pub fn ignore(&mut self) {
        self.findings.clear();
        self.flat = None;
    }

    /// The defect that makes the recording unusable: a pass without a signal, or passes that are
    /// unrelated to each other or to those at other speeds, unless the odometers explain it.
    pub fn refusal(&self) -> Option<&PassDefect> {
        let silent = |defect: &&PassDefect| {
            matches!(defect, PassDefect::Dead { .. } | PassDefect::Noise { .. })
        };
        let unrelated_passes =
            |defect: &&PassDefect| matches!(defect, PassDefect::UnrelatedPasses { .. });
        let unrelated_speed =
            |defect: &&PassDefect| matches!(defect, PassDefect::UnrelatedSpeed { .. });
        let is_misplaced =
            self.findings.iter().any(|found| found.physics == POSITION_ERROR.physics);
        let is_noise =
            self.pass_defects.iter().filter(unrelated_passes).count() == self.offsets.len();
        let pass_defects = || self.pass_defects.iter();
        let noise = pass_defects().find(unrelated_passes).filter(|_| is_noise);
        let unrelated =
            noise.or_else(|| pass_defects().find(unrelated_speed)).filter(|_| !is_misplaced);
        pass_defects().find(silent).or(unrelated)
    }
}

/// Runs all tests of a recording that need no track model.
///
/// On a recording without defects a finding comes up at most with probability [`FALSE_ALARMS`].
pub fn inspect(recording: &Recording) -> Inspection {
    let unit = unit(recording);
    let gains = chain::gains(recording);
    let offsets = chain::offsets(recording);
    let (flat, on_surface) = surface(recording);
    let turn_m = flat.as_ref().map(|flat| flat.circumference_m.0);
    let clipping = chain::clipping(recording, EACH_TEST);
    let is_flight_known = chain::expected_m_s2(recording).is_some();
    let cut = clipping_finding(&clipping, recording.passes.len(), unit, is_flight_known);
    let mut findings: Vec<Finding> = cut.into_iter().collect();
    findings.extend(hum_finding(&chain::hum(recording, turn_m, EACH_TEST), unit));
    findings.extend(gains.iter().filter(|gain| gain.is_error(EACH_TEST)).map(gain_finding));
    let scale = chain::scale(recording).filter(|scale| scale.ln_p <= EACH_TEST.ln());
    findings.extend(scale.as_ref().map(scale_finding));
    let comb = unknown_wheel(recording);
    findings.extend(comb.as_ref().map(comb_finding));
    // Blows of a flat lie elsewhere in every pass: passes with them are not to be laid on each other.
    if flat.is_none() {
        let alarm = EACH_TEST.ln() - (offsets.len().max(1) as f64).ln();
        let unrelated = offsets.iter().filter(|pair| pair.ln_p() <= alarm);
        findings.extend(unrelated.map(offset_finding));
    }
    findings.extend(on_surface);
    let loss_of_contact = chain::loss_of_contact(recording);
    if let Some(lost) = &loss_of_contact {
        findings.retain(|finding| !is_landing(finding, lost));
    }
    Inspection {
        findings,
        nameless: Vec::new(),
        flat,
        loss_of_contact,
        pass_defects: chain::pass_defects(recording, &offsets),
        noise_floors: chain::noise_floors(recording),
        gains,
        offsets,
        comb,
    }
}

/// Whether a finding lies where the wheel is in the air or lands: the blow is the landing's.
///
/// What throws the wheel up lies before the stretch without contact.
fn is_landing(finding: &Finding, lost: &LossOfContact) -> bool {
    let Place::Stretch { from_m, to_m } = finding.place else { return false };
    let middle_m = 0.5 * (from_m + to_m);
    lost.x_m.iter().any(|&[from_m, to_m]| from_m < middle_m && middle_m <= to_m)
}

/// The comb of a wheel whose circumference the recording doesn't state.
fn unknown_wheel(recording: &Recording) -> Option<Comb> {
    if wheel::nominal_circumference_m(recording).is_some() {
        return None;
    }
    let alpha = EACH_TEST / recording.passes.len().max(1) as f64;
    recording.passes.iter().find_map(|pass| wheel::comb(pass, alpha))
}

/// Unit of the accelerations, as sentences have it.
fn unit(recording: &Recording) -> &'static str {
    if recording.gain_known() { "m/s2" } else { "in the unknown unit" }
}

/// Findings on wheel and rail surface.
fn surface(recording: &Recording) -> (Option<Flat>, Vec<Finding>) {
    let circumference = wheel::nominal_circumference_m(recording);
    let flat = circumference.and_then(|length| wheel::flat(recording, length, EACH_TEST));
    let reach = AROUND_BLOW * recording.spacing_m;
    let blows = flat.as_ref().map(|flat| common_places(&flat.blows_m, reach)).unwrap_or_default();
    let turn = flat.as_ref().map(|flat| flat.circumference_m.0);
    let mut orders = circumference
        .map(|length| wheel::out_of_round(recording, turn.unwrap_or(length), EACH_TEST))
        .unwrap_or_default();
    if let Some(flat) = &flat {
        orders.retain(|order| is_longer_than(order, flat));
    }
    let mut findings: Vec<Finding> = flat.iter().map(flat_finding).collect();
    findings.extend(order_finding(&orders));
    findings.extend(
        impact::impacts(recording, EACH_TEST, &blows)
            .iter()
            .map(|impact| impact_finding(impact, &recording.passes)),
    );
    // Lines of an uneven wheel are not the rail's.
    let known = turn.or(circumference.filter(|_| !orders.is_empty()));
    let waves = impact::corrugation(recording, EACH_TEST, known);
    findings.extend(waves.as_ref().map(corrugation_finding));
    (flat, findings)
}

/// Whether an order's waves are too long to be the flat's own harmonics: four of its lengths.
fn is_longer_than(order: &Order, flat: &Flat) -> bool {
    let length = flat.shape.as_ref().map_or(0.0, |shape| shape.length_m.0);
    flat.circumference_m.0 / order.number as f64 > 4.0 * length
}

/// Stretches around the first pass's blows that every other pass has a blow in too.
fn common_places(blows_m: &[Vec<f64>], reach_m: f64) -> Vec<[f64; 2]> {
    let Some((first, others)) = blows_m.split_first() else { return Vec::new() };
    let met =
        |x: f64| others.iter().all(|pass| pass.iter().any(|other| (other - x).abs() < reach_m));
    first.iter().filter(|x| met(**x)).map(|&x| [x - reach_m, x + reach_m]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::{Rolled, independent};

    /// Names that the passes of a recording give.
    fn names(recording: &Recording) -> Vec<&'static str> {
        let inspection = inspect(recording);
        assert!(inspection.pass_defects.is_empty(), "{:?}", inspection.pass_defects);
        inspection.findings.iter().map(|finding| finding.physics).collect()
    }

    #[test]
    fn a_recording_without_defects_of_surface_wheel_or_chain_gives_no_name() {
        // One without left-out physics, one whose sleepers hang, one with a resonance of the sensor:
        // the others are looked at in a longer run.
        for recording in ["dev-01", "dev-04", "dev-08"].into_iter().flat_map(independent) {
            let names = names(&recording);
            assert!(names.is_empty(), "{}: {names:?}", recording.name);
        }
    }

    #[test]
    fn the_wheel_bouncing_on_the_track_is_no_wave_where_there_is_one_speed() {
        for (recording, speed_km_h) in [("dev-01", 7.0), ("dev-10", 13.0)] {
            for mut recording in independent(recording) {
                recording.passes.retain(|pass| pass.speed_km_h.total_cmp(&speed_km_h).is_eq());
                assert_eq!(inspect(&recording).findings, [], "{}", recording.name);
            }
        }
    }

    #[test]
    fn a_dip_waves_and_a_flat_are_named_and_nothing_else() {
        for (recording, expected) in
            [("dev-02", "rail_joint"), ("dev-06", "corrugation"), ("dev-09", "wheel_flat")]
        {
            for recording in independent(recording) {
                assert_eq!(names(&recording), [expected], "{}", recording.name);
            }
        }
    }

    #[test]
    fn speeds_that_share_no_surface_are_refused() {
        let mut recording = Rolled::faultless(6).recording();
        assert_eq!(inspect(&recording).refusal(), None);
        let elsewhere = Rolled::faultless(7).recording().passes.split_off(2);
        recording.passes.splice(2.., elsewhere);
        let inspection = inspect(&recording);
        assert!(
            matches!(inspection.refusal(), Some(PassDefect::UnrelatedSpeed { .. })),
            "{:?}",
            inspection.pass_defects
        );
    }

    #[test]
    #[ignore = "takes two minutes"]
    fn of_a_hundred_faultless_recordings_few_raise_an_alarm() {
        let alarms = (0..100).filter(|&seed| {
            let mut recording = Rolled::faultless(1000 + seed).recording();
            let radius = Rolled::CIRCUMFERENCE_M / std::f64::consts::TAU;
            let wheel = serde_json::json!({"radius_m": radius});
            recording.nominal.insert("wheel".to_owned(), wheel);
            let found = inspect(&recording).findings;
            for finding in &found {
                println!("seed {seed}: {} {:e}", finding.physics, finding.p_value);
            }
            !found.is_empty()
        });
        // Two are expected at most; more than seven have a probability below 0.1 %.
        assert!(alarms.count() <= 7);
    }
}
