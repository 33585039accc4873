//! Inspection of a recording without a track model: measuring chain, wheel, impacts.
//!
//! This module defines the order of the tests, distributes the false-alarm rate among them, and writes the
//! sentences.

mod findings;

use self::findings::{
    clipping_finding, comb_finding, corrugation_finding, flat_finding, gain_finding, hum_finding,
    impact_finding, offset_finding, order_finding, scale_finding,
};
use crate::along::by_speed;
use crate::chain::{Gain, Hum, LossOfContact, Offsets, PassDefect};
use crate::finding::{Finding, Place};
use crate::wheel::{Comb, Flat, Order};
use crate::{chain, impact, wheel};
use std::borrow::Cow;
use tracktwin_signal::recording::Recording;
use tracktwin_track::extension::POSITION_ERROR;

/// False-alarm rate of all tests together, for a recording without defects.
pub const FALSE_ALARMS: f64 = 0.02;

/// False-alarm rate of each of the ten kinds of test.
const EACH_TEST: f64 = FALSE_ALARMS / 10.0;

/// Distance in sleeper spacings around a position at which the wheel's flat hits the rail in every pass;
/// the flat dominates the signal there.
const AROUND_BLOW: f64 = 0.4;

/// Result of an inspection.
#[derive(Clone, Debug, Default)]
pub struct Inspection {
    /// Findings in this order: measuring chain, wheel, rail surface.
    pub findings: Vec<Finding>,
    /// Findings of kinds that are not in the catalogue; see [`Inspection::forget`].
    pub nameless: Vec<Finding>,
    /// The flat of the wheel with the positions of its blows, if there is one.
    pub flat: Option<Flat>,
    /// Orders of an out-of-round wheel.
    pub orders: Vec<Order>,
    /// Contact loss between wheel and rail, if there is any. It is neither a fault of the chain nor physics
    /// of the track, but no linear model is valid there.
    pub loss_of_contact: Option<LossOfContact>,
    /// Defects of unusable passes.
    pub pass_defects: Vec<PassDefect>,
    /// Noise floor of each pass in (m/s2)2/Hz; `None` if a pass is too short or constant.
    pub noise_floors: Vec<Option<f64>>,
    /// Lines of the mains in the recording.
    pub hum: Vec<Hum>,
    /// Gains between passes at one speed.
    pub gains: Vec<Gain>,
    /// Offsets between passes at one speed.
    pub offsets: Vec<Offsets>,
    /// Passes that cannot be compared with a track, because their positions differ from those of another pass
    /// at their speed. Empty if fewer than two speeds would be left.
    pub misplaced: Vec<usize>,
    /// Passes that cannot be compared with a track, because their gain differs from that of another pass at their
    /// speed. Empty if fewer than two speeds would be left.
    pub of_other_gain: Vec<usize>,
    /// The comb of wheel orders for a wheel of unknown circumference, from the first pass with a comb.
    pub comb: Option<Comb>,
}

impl Inspection {
    /// Moves the findings whose kind is not in the catalogue (`is_known` is false) to `nameless`.
    pub fn forget(&mut self, is_known: impl Fn(&str) -> bool) {
        let forgotten = self.findings.extract_if(.., |finding| !is_known(finding.physics));
        self.nameless.extend(forgotten);
    }

    /// Removes all findings, the flat and the orders; the result does not mention them.
    pub fn ignore(&mut self) {
        self.findings.clear();
        self.flat = None;
        self.orders.clear();
    }

    /// The recording without the lines of the mains, which no track model contains.
    pub fn without_hum<'a>(&self, recording: &'a Recording) -> Cow<'a, Recording> {
        if self.hum.is_empty() {
            Cow::Borrowed(recording)
        } else {
            Cow::Owned(chain::without_hum(recording, &self.hum))
        }
    }

    /// Passes that cannot be compared with a track.
    pub fn not_compared(&self) -> Vec<usize> {
        [&self.misplaced[..], &self.of_other_gain].concat()
    }

    /// The recording without the passes that cannot be compared with a track.
    pub fn comparable(&self, recording: &Recording) -> Recording {
        let not_compared = self.not_compared();
        let passes = recording.passes.iter().enumerate();
        let passes = passes.filter(|(pass, _)| !not_compared.contains(pass));
        Recording { passes: passes.map(|(_, pass)| pass.clone()).collect(), ..recording.clone() }
    }

    /// Notes on the passes that are not compared with the track.
    pub fn notes_on_not_compared(&self, recording: &Recording) -> Vec<String> {
        let file = |&pass: &usize| &*recording.passes[pass].file;
        let note = |(passes, differs): (&Vec<usize>, &str)| {
            let files: Vec<&str> = passes.iter().map(file).collect();
            (!files.is_empty()).then(|| {
                format!(
                    "{}: not compared with the track, because their {differs} of another pass at the same \
                     speed.",
                    files.join(", ")
                )
            })
        };
        let of_position = (&self.misplaced, "positions differ from those");
        let of_gain = (&self.of_other_gain, "gain differs from that");
        [of_position, of_gain].into_iter().filter_map(note).collect()
    }

    /// The defect that makes the whole recording unusable, if any: a pass without a signal, or passes that
    /// are unrelated to each other or to those at other speeds, unless a position error was found.
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
/// For a recording without defects, the probability of any finding is at most [`FALSE_ALARMS`].
pub fn inspect(recording: &Recording) -> Inspection {
    let unit = unit(recording);
    let gains = chain::gains(recording);
    let offsets = chain::offsets(recording);
    let (flat, orders, on_surface) = surface(recording);
    let turn_m = flat.as_ref().map(|flat| flat.circumference_m.0);
    let clipping = chain::clipping(recording, EACH_TEST);
    let is_flight_known = chain::expected_m_s2(recording).is_some();
    let cut = clipping_finding(&clipping, recording.passes.len(), unit, is_flight_known);
    let mut findings: Vec<Finding> = cut.into_iter().collect();
    let hum = chain::hum(recording, turn_m, EACH_TEST);
    findings.extend(hum_finding(&hum, unit));
    findings.extend(gains.iter().filter(|gain| gain.is_error(EACH_TEST)).map(gain_finding));
    let scale = chain::scale(recording).filter(|scale| scale.ln_p <= EACH_TEST.ln());
    findings.extend(scale.as_ref().map(scale_finding));
    let comb = unknown_wheel(recording);
    findings.extend(comb.as_ref().map(comb_finding));
    let pass_defects = chain::pass_defects(recording, &offsets);
    // Blows of a flat lie elsewhere in every pass, and clipped crests are alike: passes with them are not to be laid
    // on each other.
    let alarm = EACH_TEST.ln() - (offsets.len().max(1) as f64).ln();
    let is_comparable = |pair: &Offsets| flat.is_none() && !is_saturated(pair, &pass_defects);
    let is_error = |pair: &Offsets| is_comparable(pair) && pair.ln_p() <= alarm;
    findings.extend(offsets.iter().filter(|pair| is_error(pair)).map(offset_finding));
    let misplaced = chain::misplaced(&offsets, is_error);
    let misplaced = if leaves_speeds(recording, &misplaced) { misplaced } else { Vec::new() };
    let mut of_other_gain =
        chain::of_other_gain(recording, &gains, |gain| gain.is_error(EACH_TEST));
    of_other_gain.retain(|pass| !misplaced.contains(pass));
    if !leaves_speeds(recording, &[&misplaced[..], &of_other_gain].concat()) {
        of_other_gain.clear();
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
        orders,
        loss_of_contact,
        pass_defects,
        noise_floors: chain::noise_floors(recording),
        hum,
        gains,
        offsets,
        misplaced,
        of_other_gain,
        comb,
    }
}

/// Whether one of two passes is saturated.
fn is_saturated(pair: &Offsets, pass_defects: &[PassDefect]) -> bool {
    pass_defects.iter().any(
        |defect| matches!(defect, PassDefect::Saturated { pass, .. } if pair.passes.contains(pass)),
    )
}

/// Whether two speeds are left without these passes; one of a recording at one speed.
fn leaves_speeds(recording: &Recording, passes: &[usize]) -> bool {
    let speeds = by_speed(&recording.passes);
    let is_left = |speed: &&Vec<usize>| speed.iter().any(|pass| !passes.contains(pass));
    speeds.iter().filter(is_left).count() >= speeds.len().min(2)
}

/// Whether a finding lies on a stretch without contact or at its end, where the landing of the wheel causes
/// a blow.
///
/// A defect that lifts the wheel lies before the stretch without contact.
fn is_landing(finding: &Finding, lost: &LossOfContact) -> bool {
    let Place::Stretch { from_m, to_m } = finding.place else { return false };
    let middle_m = 0.5 * (from_m + to_m);
    lost.x_m.iter().any(|&[from_m, to_m]| from_m < middle_m && middle_m <= to_m)
}

/// The comb of wheel orders, if the recording does not state the circumference.
fn unknown_wheel(recording: &Recording) -> Option<Comb> {
    if wheel::nominal_circumference_m(recording).is_some() {
        return None;
    }
    let alpha = EACH_TEST / recording.passes.len().max(1) as f64;
    recording
        .passes
        .iter()
        .find_map(|pass| wheel::comb(pass, recording.spacing_m, wheel::CIRCUMFERENCES_M, alpha))
}

/// Unit of the accelerations in sentences.
fn unit(recording: &Recording) -> &'static str {
    if recording.gain_known() { "m/s2" } else { "in the unknown unit" }
}

/// Flat and orders of the wheel, and findings on wheel and rail surface.
fn surface(recording: &Recording) -> (Option<Flat>, Vec<Order>, Vec<Finding>) {
    let circumference = wheel::nominal_circumference_m(recording);
    let flat = circumference.and_then(|length| wheel::flat(recording, length, EACH_TEST));
    let reach = AROUND_BLOW * recording.spacing_m;
    let speeds = by_speed(&recording.passes);
    let common = |flat: &Flat| common_places(&flat.blows_m, &speeds, reach);
    let blows = flat.as_ref().map(common).unwrap_or_default();
    let turn = flat.as_ref().map(|flat| flat.circumference_m.0);
    let mut orders = circumference
        .map(|length| wheel::out_of_round(recording, turn.unwrap_or(length), EACH_TEST))
        .unwrap_or_default();
    if let Some(flat) = &flat {
        orders.retain(|order| is_longer_than(order, flat));
    }
    let mut findings: Vec<Finding> = flat.iter().map(flat_finding).collect();
    findings.extend(order_finding(&orders));
    let length_ratio = recording.stated_track().track.design.length_ratio();
    findings.extend(
        impact::impacts(recording, EACH_TEST, &blows)
            .iter()
            .map(|impact| impact_finding(impact, &recording.passes, length_ratio)),
    );
    // Lines of an uneven wheel are not the rail's.
    let known = turn.or(circumference.filter(|_| !orders.is_empty()));
    let waves = impact::corrugation(recording, EACH_TEST, known);
    findings.extend(waves.as_ref().map(corrugation_finding));
    (flat, orders, findings)
}

/// Whether the waves of an order are longer than four lengths of the flat, and thus no harmonics of the
/// flat.
fn is_longer_than(order: &Order, flat: &Flat) -> bool {
    let length = flat.shape.as_ref().map_or(0.0, |shape| shape.length_m.0);
    flat.circumference_m.0 / order.number as f64 > 4.0 * length
}

/// Stretches `[from, to]` in m around blows that occur at one place at every speed, in one pass or more: an
/// impact of the rail is looked for in the mean power of the passes at a speed. `speeds` are the indices of
/// their passes.
fn common_places(blows_m: &[Vec<f64>], speeds: &[Vec<usize>], reach_m: f64) -> Vec<[f64; 2]> {
    let Some((first, others)) = speeds.split_first() else { return Vec::new() };
    let blows_at = |speed: &Vec<usize>| -> Vec<f64> {
        speed.iter().flat_map(|&pass| blows_m[pass].iter().copied()).collect()
    };
    let others: Vec<Vec<f64>> = others.iter().map(blows_at).collect();
    let met =
        |x: f64| others.iter().all(|speed| speed.iter().any(|other| (other - x).abs() < reach_m));
    let common = blows_at(first).into_iter().filter(|x| met(*x));
    common.map(|x| [x - reach_m, x + reach_m]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::{Chain, Rolled, independent};
    use tracktwin_track::extension::CLIPPING;

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
    fn passes_that_are_mostly_clipped_are_not_laid_on_each_other() {
        let shift = |pass: usize, position_m: &mut [f64]| {
            if pass == 1 {
                for x_m in position_m {
                    *x_m += 0.016;
                }
            }
        };
        let shifted = |pass: usize, _: &mut [f64], position_m: &mut [f64]| shift(pass, position_m);
        let clipped = |pass: usize, samples: &mut [f64], position_m: &mut [f64]| {
            shift(pass, position_m);
            let mean_square = samples.iter().map(|it| it * it).sum::<f64>() / samples.len() as f64;
            let limit = 0.3 * mean_square.sqrt();
            for sample in samples {
                *sample = sample.clamp(-limit, limit);
            }
        };
        let finds = |chain: &Chain<'_>, physics: &str| {
            let recording = Rolled { chain, ..Rolled::faultless(6) }.recording();
            inspect(&recording).findings.iter().any(|finding| finding.physics == physics)
        };
        assert!(finds(&shifted, POSITION_ERROR.physics));
        assert!(finds(&clipped, CLIPPING.physics) && !finds(&clipped, POSITION_ERROR.physics));
    }

    #[test]
    fn a_place_is_common_if_some_pass_of_every_speed_has_a_blow_there() {
        let blows_m = [vec![0.5, 0.9], vec![0.7], vec![0.71, 1.1], vec![0.3]];
        let of = |speeds: &[Vec<usize>]| common_places(&blows_m, speeds, 0.02);
        let found = of(&[vec![0, 1], vec![2, 3]]);
        assert_eq!(found.len(), 1);
        assert!(found[0][0] < 0.7 && 0.7 < found[0][1], "{found:?}");
        assert!(of(&[vec![0], vec![1], vec![2]]).is_empty());
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
