//! What the passes tell before any model of the track: chain, wheel, impacts, in one sweep.
//!
//! Owns the order of the tests, how the false-alarm rate is shared among them, and the sentences.

use crate::chain::{Gain, Hum, Offsets, Scale, Trouble};
use crate::finding::{Finding, Place};
use crate::impact::{Corrugation, Form, Impact};
use crate::wheel::{Comb, Flat, Order};
use crate::{chain, impact, wheel};
use std::collections::BTreeMap;
use tracktwin_signal::recording::Recording;

/// Probability of a false alarm on a recording without defects, all tests together.
pub const FALSE_ALARMS: f64 = 0.02;

/// Share of it that each of the nine kinds of test has.
const EACH_TEST: f64 = FALSE_ALARMS / 9.0;

/// Lead of one form over the other, in nats, below which an impact may be either.
const FORM_LEAD: f64 = 3.0;

/// Sleeper spacings around a place where the wheel's flat meets the rail in every pass: what is
/// heard there is the flat and its ringing.
const AROUND_BLOW: f64 = 0.4;

/// What the passes tell by themselves.
#[derive(Clone, Debug)]
pub struct FirstLook {
    /// What was found: chain first, then wheel, then the rail's surface.
    pub findings: Vec<Finding>,
    /// What was found too, but has a name that the catalogue lacks; see [`FirstLook::forget`].
    pub nameless: Vec<Finding>,
    /// The wheel's flat with the places of its blows, if it has one.
    pub flat: Option<Flat>,
    /// Passes that can't be used, and why.
    pub troubles: Vec<Trouble>,
    /// Noise floor of each pass in (m/s2)2/Hz.
    pub noise_floors: Vec<Option<f64>>,
    /// Gains between passes at one speed.
    pub gains: Vec<Gain>,
    /// Offsets between passes at one speed.
    pub offsets: Vec<Offsets>,
    /// The comb of a wheel of unknown circumference, of the first pass that has one.
    pub comb: Option<Comb>,
}

impl FirstLook {
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

    /// What keeps everybody from saying anything of the track: a pass without a signal, or passes
    /// that nowhere repeat each other, unless their odometers are to blame.
    pub fn refusal(&self) -> Option<&Trouble> {
        let dead = |trouble: &&Trouble| matches!(trouble, Trouble::Dead { .. });
        let unlike = |trouble: &&Trouble| matches!(trouble, Trouble::Unlike { .. });
        let is_misplaced = self.findings.iter().any(|found| found.physics == "position_error");
        let is_noise = self.troubles.iter().filter(unlike).count() == self.offsets.len();
        let noise = self.troubles.iter().find(unlike).filter(|_| is_noise && !is_misplaced);
        self.troubles.iter().find(dead).or(noise)
    }
}

/// Tests a recording for everything that its passes show without a model of the track.
///
/// On a recording without defects a finding comes up at most with probability [`FALSE_ALARMS`].
pub fn first_look(recording: &Recording) -> FirstLook {
    let gains = chain::gains(recording);
    let offsets = chain::offsets(recording);
    let mut findings: Vec<Finding> = clipped(recording).into_iter().collect();
    findings.extend(hum_finding(&chain::hum(recording, EACH_TEST)));
    findings.extend(gains.iter().filter(|gain| gain.is_error(EACH_TEST)).map(gain_finding));
    let scale = chain::scale(recording).filter(|scale| scale.ln_p <= EACH_TEST.ln());
    findings.extend(scale.as_ref().map(scale_finding));
    let comb = unknown_wheel(recording);
    findings.extend(comb.as_ref().map(comb_finding));
    let (flat, on_surface) = surface(recording);
    // Blows of a flat lie elsewhere in every pass: passes with them are not to be laid on each other.
    if flat.is_none() {
        let alarm = EACH_TEST.ln() - (offsets.len().max(1) as f64).ln();
        let apart = offsets.iter().filter(|pair| pair.ln_p() <= alarm);
        findings.extend(apart.map(offset_finding));
    }
    findings.extend(on_surface);
    FirstLook {
        findings,
        nameless: Vec::new(),
        flat,
        troubles: chain::troubles(recording, &offsets),
        noise_floors: chain::noise_floors(recording),
        gains,
        offsets,
        comb,
    }
}

/// The comb of a wheel whose circumference the recording doesn't state.
fn unknown_wheel(recording: &Recording) -> Option<Comb> {
    if wheel::nominal_circumference_m(recording).is_some() {
        return None;
    }
    let alpha = EACH_TEST / recording.passes.len().max(1) as f64;
    recording.passes.iter().find_map(|pass| wheel::comb(pass, alpha))
}

/// What wheel and rail surface show.
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
            .map(|impact| impact_finding(impact, recording.passes.len())),
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

fn clipped(recording: &Recording) -> Option<Finding> {
    let passes = chain::clipping(recording, EACH_TEST);
    let worst = passes.iter().min_by(|a, b| a.ln_p.total_cmp(&b.ln_p))?;
    let limit = passes.iter().map(|pass| pass.level_m_s2.abs()).fold(f64::MAX, f64::min);
    Some(Finding {
        physics: "clipping",
        p_value: worst.ln_p.exp(),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("limit_m_s2", (limit, 0.01 * limit))]),
        evidence: format!(
            "{} of {} passes are cut off: in pass {}, {} crests end within 1 % of {:.3} m/s2 ({:.2} % of the samples)",
            passes.len(),
            recording.passes.len(),
            worst.pass + 1,
            worst.crests,
            worst.level_m_s2,
            1e2 * worst.share
        ),
    })
}

fn hum_finding(lines: &[Hum]) -> Option<Finding> {
    let first = lines.first()?;
    let names: Vec<String> = lines
        .iter()
        .map(|l| format!("{:.1} Hz ({:.3} m/s2)", l.frequency_hz, l.amplitude_m_s2.0))
        .collect();
    Some(Finding {
        physics: "electrical_hum",
        p_value: first.ln_p.exp(),
        place: Place::Everywhere,
        parameters: BTreeMap::from([
            ("frequency_Hz", (first.frequency_hz, 0.1)),
            ("amplitude_m_s2", first.amplitude_m_s2),
        ]),
        evidence: format!(
            "lines at frequencies of the mains at every speed, {:.0} times above their neighbours: {}",
            first.ratio,
            names.join(", ")
        ),
    })
}

fn gain_finding(gain: &Gain) -> Finding {
    let (level, deviation) = gain.gain_db;
    let factor = 10f64.powf(level / 20.0);
    let which = if gain.passes > 2 { "" } else { " (or the other one is off; a third would tell)" };
    Finding {
        physics: "gain_error",
        p_value: gain.ln_p.exp(),
        place: Place::Everywhere,
        // A decibel is a factor of e^0.115 in amplitude.
        parameters: BTreeMap::from([("factor", (factor, 0.115 * deviation * factor))]),
        evidence: format!(
            "pass {} is {level:+.2} dB (sd {deviation:.2}) from the others at its speed{which}, alike within {:.2} dB in three bands",
            gain.pass + 1,
            gain.spread_db
        ),
    }
}

fn offset_finding(pair: &Offsets) -> Finding {
    let (offset, scale) = pair.line();
    let (offset_mm, greatest_mm) = (1e3 * offset, 1e3 * pair.greatest_m());
    Finding {
        physics: "position_error",
        p_value: pair.ln_p().exp(),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("offset_m", (offset, 1e-3)), ("scale", (scale, 1e-3))]),
        evidence: format!(
            "the odometers of passes {} and {} differ by up to {greatest_mm:.1} mm over the same surface ({offset_mm:+.1} mm in the middle, {:+.2} %); 6 mm are usual",
            pair.passes[0] + 1,
            pair.passes[1] + 1,
            1e2 * scale
        ),
    }
}

fn scale_finding(scale: &Scale) -> Finding {
    let (factor, deviation) = scale.scale;
    Finding {
        physics: "position_error",
        p_value: scale.ln_p.exp(),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("scale", scale.scale)]),
        evidence: format!(
            "at {} speeds alike, positions advance {:+.2} % (sd {:.2}) from the stated speeds; 0.3 % are usual",
            scale.speeds,
            1e2 * factor,
            1e2 * deviation
        ),
    }
}

fn flat_finding(flat: &Flat) -> Finding {
    let (turn, deviation) = flat.circumference_m;
    let mut parameters = BTreeMap::new();
    if let Some(shape) = &flat.shape {
        parameters.insert("length_m", shape.length_m);
        parameters.insert("depth_m", shape.depth_m);
    }
    Finding {
        physics: "wheel_flat",
        p_value: flat.ln_p.exp(),
        place: Place::Everywhere,
        parameters,
        evidence: format!(
            "one blow a turn in every pass, {turn:.4} m (sd {deviation:.4}) apart and {:.0} times louder than what is around them",
            flat.power_ratio
        ),
    }
}

fn order_finding(orders: &[Order]) -> Option<Finding> {
    let first = orders.iter().min_by(|a, b| a.ln_p.total_cmp(&b.ln_p))?;
    let names: Vec<String> = orders.iter().map(|order| order.number.to_string()).collect();
    Some(Finding {
        physics: "wheel_out_of_round",
        p_value: first.ln_p.exp(),
        place: Place::Everywhere,
        parameters: BTreeMap::from([
            ("order", (first.number as f64, 0.0)),
            ("amplitude_m", first.amplitude_m),
        ]),
        evidence: format!(
            "lines at whole waves to a turn of the wheel at every speed: order {}; order {} is {:.0} times above what lies between orders",
            names.join(", "),
            first.number,
            first.ratio
        ),
    })
}

fn comb_finding(comb: &Comb) -> Finding {
    let (turn, deviation) = comb.circumference_m;
    let held_out = &comb.held_out;
    Finding {
        physics: "wheel_out_of_round",
        p_value: comb.ln_p.exp(),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("circumference_m", comb.circumference_m)]),
        evidence: format!(
            "a comb of wheel orders at multiples of {:.3} Hz, a circumference of {turn:.3} m (sd {deviation:.3}); of {} blocks that nothing was fitted on it explains {:.0} % of the variance in {:.0} to {:.0} Hz ({:.0} % by chance) and predicts {} better than a smooth spectrum does, by {:.1} nats a block",
            comb.fundamental_hz,
            held_out.blocks,
            1e2 * held_out.explained,
            comb.band_hz[0],
            comb.band_hz[1],
            1e2 * held_out.by_chance,
            held_out.better,
            held_out.gain_nats
        ),
    }
}

fn impact_finding(impact: &Impact, passes: usize) -> Finding {
    let (x, deviation) = impact.x_m;
    let physics = match &impact.shape {
        Some(shape) if shape.form == Form::Hollow => "squat",
        _ => "rail_joint",
    };
    let mut parameters = BTreeMap::new();
    let mut form = String::new();
    if let Some(shape) = &impact.shape {
        let depth = if shape.form == Form::Hollow { "depth_m" } else { "dip_m" };
        parameters.insert("length_m", shape.length_m);
        parameters.insert(depth, shape.depth_m);
        let (mine, other) = match shape.form {
            Form::Hollow => ("a hollow", "a kink"),
            Form::Dip => ("a kink", "a hollow"),
        };
        let sure = if shape.lead < FORM_LEAD { "hardly " } else { "" };
        form = format!(
            "; its spectrum is {sure}more like {mine} than {other} (by {:.1} nats)",
            shape.lead
        );
    }
    let who = if passes > 1 { "every pass at every speed" } else { "the only pass" };
    // Three standard deviations, and 10 mm for the length of the defect itself.
    let reach = 3.0 * deviation.max(3e-3);
    Finding {
        physics,
        p_value: impact.ln_p.exp(),
        place: Place::Stretch { from_m: x - reach, to_m: x + reach },
        parameters,
        evidence: format!(
            "at {x:.4} m (sd {deviation:.4}) {who} is {:.0} times louder than around it{form}",
            impact.power_ratio
        ),
    }
}

fn corrugation_finding(waves: &Corrugation) -> Finding {
    let [from_m, to_m] = waves.stretch_m;
    Finding {
        physics: "corrugation",
        p_value: waves.ln_p.exp(),
        place: Place::Stretch { from_m, to_m },
        parameters: BTreeMap::from([
            ("wavelength_m", waves.wavelength_m),
            ("amplitude_m", waves.amplitude_m),
        ]),
        evidence: format!(
            "waves of {:.2} mm from {from_m:.2} to {to_m:.2} m, {:.0} times above the surface's own at every speed",
            1e3 * waves.wavelength_m.0,
            waves.ratio
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::{Rolled, shared};

    /// Names that the passes of a shared recording give.
    fn names(recording: &str) -> Option<Vec<&'static str>> {
        let look = first_look(&shared(recording)?);
        assert!(look.troubles.is_empty(), "{:?}", look.troubles);
        Some(look.findings.iter().map(|finding| finding.physics).collect())
    }

    #[test]
    fn a_recording_without_defects_of_surface_wheel_or_chain_gives_no_name() {
        // One without left-out physics, one whose sleepers hang, one with a resonance of the sensor:
        // the others are looked at in a longer run.
        for recording in ["dev-01", "dev-04", "dev-08"] {
            let Some(names) = names(recording) else { return };
            assert!(names.is_empty(), "{recording}: {names:?}");
        }
    }

    #[test]
    fn a_dip_waves_and_a_flat_are_named_and_nothing_else() {
        for (recording, expected) in
            [("dev-02", "rail_joint"), ("dev-06", "corrugation"), ("dev-09", "wheel_flat")]
        {
            let Some(names) = names(recording) else { return };
            assert_eq!(names, [expected], "{recording}");
        }
    }

    #[test]
    #[ignore = "takes two minutes"]
    fn of_a_hundred_faultless_recordings_few_raise_an_alarm() {
        let alarms = (0..100).filter(|&seed| {
            let mut recording = Rolled::faultless(1000 + seed).recording();
            let radius = Rolled::CIRCUMFERENCE_M / std::f64::consts::TAU;
            let wheel = serde_json::json!({"radius_m": radius});
            recording.nominal.insert("wheel".to_owned(), wheel);
            let found = first_look(&recording).findings;
            for finding in &found {
                println!("seed {seed}: {} {:e}", finding.physics, finding.p_value);
            }
            !found.is_empty()
        });
        // Two are expected at most; more than seven have a probability below 0.1 %.
        assert!(alarms.count() <= 7);
    }
}
