//! Inspection of a recording without a track model: measuring chain, wheel, impacts.
//!
//! This module defines the order of the tests, distributes the false-alarm rate among them, and writes the
//! sentences.

mod findings;
mod periodic;

use self::findings::{
    clipping_finding, comb_finding, corrugation_finding, flat_finding, gain_finding, hum_finding,
    impact_finding, offset_finding, order_finding, scale_finding,
};
use self::periodic::{Periodic, periodic};
use crate::along::{by_speed, separate_wavelengths};
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
    /// Lines at frequencies of the mains that may be orders of the wheel as well.
    pub hum_or_orders: Vec<Hum>,
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
    /// Passes that cannot be compared with a track, because their signal drops out. Empty if fewer than two speeds would
    /// be left.
    pub dropped_out: Vec<usize>,
    /// The comb of wheel orders at one speed, from the first pass with a comb.
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
        [&self.misplaced[..], &self.of_other_gain, &self.dropped_out].concat()
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
        let note = |(passes, reason): (&Vec<usize>, &str)| {
            let files: Vec<&str> = passes.iter().map(file).collect();
            (!files.is_empty()).then(|| {
                format!("{}: not compared with the track, because {reason}.", files.join(", "))
            })
        };
        let all = [
            (
                &self.misplaced,
                "their positions differ from those of another pass at the same speed",
            ),
            (&self.of_other_gain, "their gain differs from that of another pass at the same speed"),
            (&self.dropped_out, "the signal drops out"),
        ];
        all.into_iter().filter_map(note).collect()
    }

    /// What the passes leave open, a sentence each.
    pub fn doubts(&self) -> Vec<String> {
        let lines = self.hum_or_orders.iter().map(|line| format!("{:.1} Hz", line.frequency_hz));
        let lines: Vec<String> = lines.collect();
        let doubt = format!(
            "lines at {} may be orders of the wheel or hum of the mains: a pass at another speed would distinguish \
             them",
            lines.join(", ")
        );
        if lines.is_empty() { Vec::new() } else { vec![doubt] }
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
    let Periodic { flat, orders, on_surface, comb, hum, hum_or_orders } = periodic(recording);
    let clipping = chain::clipping(recording, EACH_TEST);
    let is_flight_known = chain::expected_m_s2(recording).is_some();
    let cut = clipping_finding(&clipping, recording.passes.len(), unit, is_flight_known);
    let mut findings: Vec<Finding> = cut.into_iter().collect();
    findings.extend(hum_finding(&hum, unit));
    findings.extend(gains.iter().filter(|gain| gain.is_error(EACH_TEST)).map(gain_finding));
    let scale = chain::scale(recording).filter(|scale| scale.ln_p <= EACH_TEST.ln());
    findings.extend(scale.as_ref().map(scale_finding));
    findings.extend(comb.as_ref().map(comb_finding));
    let pass_defects = chain::pass_defects(recording, &offsets);
    // Blows of a flat lie elsewhere in every pass, and clipped crests are alike: passes with them are not to be laid
    // on each other.
    let alarm = EACH_TEST.ln() - (offsets.len().max(1) as f64).ln();
    let is_comparable = |pair: &Offsets| flat.is_none() && !is_saturated(pair, &pass_defects);
    let is_error = |pair: &Offsets| is_comparable(pair) && pair.ln_p() <= alarm;
    findings.extend(offsets.iter().filter(|pair| is_error(pair)).map(offset_finding));
    let misplaced = chain::misplaced(&offsets, is_error);
    let of_other_gain = chain::of_other_gain(recording, &gains, |gain| gain.is_error(EACH_TEST));
    let drop_outs = drop_outs(recording, &pass_defects);
    let dropped_out = drop_outs.iter().map(|(pass, _)| *pass).collect();
    let [misplaced, of_other_gain, dropped_out] =
        that_leave_speeds(recording, [misplaced, of_other_gain, dropped_out]);
    findings.extend(on_surface);
    // The ends of a drop-out are no blows of the track.
    findings.retain(|finding| !is_within(finding, &drop_outs));
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
        hum_or_orders,
        gains,
        offsets,
        misplaced,
        of_other_gain,
        dropped_out,
        comb,
    }
}

/// Passes whose signal drops out, and the stretch in m, with a spacing on either side.
fn drop_outs(recording: &Recording, pass_defects: &[PassDefect]) -> Vec<(usize, [f64; 2])> {
    let stretch = |defect: &PassDefect| match *defect {
        PassDefect::DropOut { pass, from_m, duration_s } => {
            let to_m = from_m + duration_s * recording.passes[pass].mean_speed_m_s();
            Some((pass, [from_m - recording.spacing_m, to_m + recording.spacing_m]))
        }
        _ => None,
    };
    pass_defects.iter().filter_map(stretch).collect()
}

/// Middle of a finding in m, if it has a place.
fn middle_m(finding: &Finding) -> Option<f64> {
    match finding.place {
        Place::Stretch { from_m, to_m } => Some(0.5 * (from_m + to_m)),
        Place::Everywhere => None,
    }
}

/// Whether the middle of a finding lies in a stretch of a pass.
fn is_within(finding: &Finding, stretches_m: &[(usize, [f64; 2])]) -> bool {
    let Some(middle_m) = middle_m(finding) else { return false };
    stretches_m.iter().any(|&(_, [from_m, to_m])| (from_m..=to_m).contains(&middle_m))
}

/// Whether one of two passes is saturated.
fn is_saturated(pair: &Offsets, pass_defects: &[PassDefect]) -> bool {
    pass_defects.iter().any(
        |defect| matches!(defect, PassDefect::Saturated { pass, .. } if pair.passes.contains(pass)),
    )
}

/// Each list of passes without those of the lists before it; empty if too few speeds would be left without its passes.
fn that_leave_speeds<const N: usize>(
    recording: &Recording,
    lists: [Vec<usize>; N],
) -> [Vec<usize>; N] {
    let mut all: Vec<usize> = Vec::new();
    lists.map(|mut list| {
        list.retain(|pass| !all.contains(pass));
        if !leaves_speeds(recording, &[&all[..], &list].concat()) {
            return Vec::new();
        }
        all.extend(&list);
        list
    })
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
    let Some(middle_m) = middle_m(finding) else { return false };
    lost.x_m.iter().any(|&[from_m, to_m]| from_m < middle_m && middle_m <= to_m)
}

/// The comb of wheel orders: of any circumference, or at one speed near the stated one if nothing `else_unknown` is known
/// of the wheel.
fn comb_of_wheel(recording: &Recording, else_unknown: bool) -> Option<Comb> {
    let near =
        |stated_m: f64| [1.0 - wheel::TOLERANCE, 1.0 + wheel::TOLERANCE].map(|it| it * stated_m);
    let stated_m = wheel::nominal_circumference_m(recording);
    let is_searched = else_unknown && !separate_wavelengths(&recording.speeds_km_h());
    if stated_m.is_some() && !is_searched {
        return None;
    }
    let circumferences_m = stated_m.map_or(wheel::CIRCUMFERENCES_M, near);
    let alpha = EACH_TEST / recording.passes.len().max(1) as f64;
    let comb = |pass| wheel::comb(pass, recording.spacing_m, circumferences_m, alpha);
    recording.passes.iter().find_map(comb)
}

/// Lines of the mains that may be orders of the wheel, and the others. The wheel is that of the comb; else that of the flat
/// or, at one speed, the stated one.
fn separate_orders(
    recording: &Recording,
    comb: Option<&Comb>,
    flat: Option<&Flat>,
    hum: Vec<Hum>,
) -> (Vec<Hum>, Vec<Hum>) {
    let is_one_speed = by_speed(&recording.passes).len() == 1;
    let stated_m = wheel::nominal_circumference_m(recording).filter(|_| is_one_speed);
    let stated_m = stated_m.map(|length_m| (length_m, 0.5 * wheel::TOLERANCE * length_m));
    let wheels_m = match comb {
        Some(comb) => vec![comb.circumference_m],
        None => flat.map(|flat| flat.circumference_m).into_iter().chain(stated_m).collect(),
    };
    hum.into_iter().partition(|line| {
        let may_be = |&turn_m| chain::may_be_order(recording, line.frequency_hz, turn_m);
        wheels_m.iter().any(may_be)
    })
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

/// Stretches `[from, to]` in m within reach of a blow at every speed, in one pass or more: an impact of the rail is
/// looked for in the mean power of the passes at a speed. `speeds` are the indices of their passes.
fn common_places(blows_m: &[Vec<f64>], speeds: &[Vec<usize>], reach_m: f64) -> Vec<[f64; 2]> {
    let around = |speed: &Vec<usize>| -> Vec<[f64; 2]> {
        let blows = speed.iter().flat_map(|&pass| blows_m[pass].iter());
        blows.map(|blow| [blow - reach_m, blow + reach_m]).collect()
    };
    let in_both = |known: Vec<[f64; 2]>, further: Vec<[f64; 2]>| {
        let pairs = known.iter().flat_map(|one| further.iter().map(move |other| (one, other)));
        let overlaps = pairs.map(|(one, other)| [one[0].max(other[0]), one[1].min(other[1])]);
        overlaps.filter(|[from_m, to_m]| from_m < to_m).collect()
    };
    speeds.iter().map(around).reduce(in_both).unwrap_or_default()
}

#[cfg(test)]
mod tests;
