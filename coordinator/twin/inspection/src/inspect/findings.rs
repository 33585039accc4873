//! Conversion of test results to findings, with a sentence each.

use crate::along::by_speed;
use crate::chain::{Clipping, Gain, Hum, Offsets, Scale};
use crate::finding::{Finding, Place};
use crate::impact::{Corrugation, Form, Impact, Shape};
use crate::wheel::{Comb, Flat, Order};
use std::collections::BTreeMap;
use tracktwin_number::{self as number, ratio, rounded};
use tracktwin_signal::recording::Pass;
use tracktwin_track::extension::{
    CLIPPING, CORRUGATION, ELECTRICAL_HUM, GAIN_ERROR, Kind, POSITION_ERROR, RAIL_JOINT, SQUAT,
    WHEEL_FLAT, WHEEL_OUT_OF_ROUND,
};

/// Smallest advantage of one form over the other, in nats, that identifies the form of an impact.
const FORM_LEAD: f64 = 3.0;

pub(super) fn clipping_finding(
    passes: &[Clipping],
    recorded: usize,
    unit: &str,
    is_flight_known: bool,
) -> Option<Finding> {
    // On the side towards the rail alone, loss of contact has the same effect.
    let may_fly = !is_flight_known && passes.iter().all(|pass| pass.level_m_s2 > 0.0);
    let or = if may_fly {
        "; or the wheel lost contact there: give nominal.wheel.load_N and mass_kg to \
             distinguish"
    } else {
        ""
    };
    let worst = passes.iter().min_by(|a, b| a.ln_p.total_cmp(&b.ln_p))?;
    let limit = passes.iter().map(|pass| pass.level_m_s2.abs()).fold(f64::MAX, f64::min);
    Some(Finding {
        physics: CLIPPING.physics,
        p_value: number::probability(worst.ln_p),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("limit_m_s2", (limit, 0.01 * limit))]),
        evidence: format!(
            "{} of {} passes are clipped: in pass {}, {} crests end within 1 % of {} {unit} \
                 ({:.2} % of the samples){or}",
            passes.len(),
            recorded,
            worst.pass + 1,
            worst.crests,
            rounded(worst.level_m_s2, 3),
            1e2 * worst.share
        ),
    })
}

pub(super) fn hum_finding(lines: &[Hum], unit: &str) -> Option<Finding> {
    let first = lines.first()?;
    let names: Vec<String> = lines
        .iter()
        .map(|l| format!("{:.1} Hz ({} {unit})", l.frequency_hz, rounded(l.amplitude_m_s2.0, 2)))
        .collect();
    Some(Finding {
        physics: ELECTRICAL_HUM.physics,
        p_value: number::probability(first.ln_p),
        place: Place::Everywhere,
        parameters: BTreeMap::from([
            ("frequency_Hz", (first.frequency_hz, 0.1)),
            ("amplitude_m_s2", first.amplitude_m_s2),
        ]),
        evidence: format!(
            "lines at frequencies of the mains, {} times above their neighbours in the passes or in \
                 their differences: {}",
            ratio(first.ratio),
            names.join(", ")
        ),
    })
}

pub(super) fn gain_finding(gain: &Gain) -> Finding {
    let (level, deviation) = gain.level.mean_db;
    let factor = 10f64.powf(level / 20.0);
    let which = if gain.passes > 2 {
        ""
    } else {
        " (or the other one deviates; a third pass would distinguish)"
    };
    Finding {
        physics: GAIN_ERROR.physics,
        p_value: number::probability(gain.level.ln_p),
        place: Place::Everywhere,
        // A decibel is a factor of e^0.115 in amplitude.
        parameters: BTreeMap::from([("factor", (factor, 0.115 * deviation * factor))]),
        evidence: format!(
            "pass {} is {level:+.2} dB (sd {deviation:.2}) from the others at its speed{which}, alike within {:.2} dB in three bands",
            gain.pass + 1,
            gain.level.spread_db
        ),
    }
}

pub(super) fn offset_finding(pair: &Offsets) -> Finding {
    let (offset, scale) = pair.line();
    let (offset_mm, greatest_mm) = (1e3 * offset, 1e3 * pair.greatest_m());
    Finding {
        physics: POSITION_ERROR.physics,
        p_value: number::probability(pair.ln_p()),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("offset_m", (offset, 1e-3)), ("scale", (scale, 1e-3))]),
        evidence: format!(
            "the odometers of passes {} and {} differ by up to {greatest_mm:.1} mm over the \
                 same surface ({offset_mm:+.1} mm in the middle, {:+.2} %); {:.0} mm are usual",
            pair.passes[0] + 1,
            pair.passes[1] + 1,
            1e2 * scale,
            1e3 * pair.usual_m()
        ),
    }
}

pub(super) fn scale_finding(scale: &Scale) -> Finding {
    let (factor, deviation) = scale.scale;
    Finding {
        physics: POSITION_ERROR.physics,
        p_value: number::probability(scale.ln_p),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("scale", scale.scale)]),
        evidence: format!(
            "at {} speeds alike, positions advance {:+.2} % (sd {:.2}) from the stated speeds; {:.1} % are usual",
            scale.speeds,
            1e2 * factor,
            1e2 * deviation,
            1e2 * scale.usual
        ),
    }
}

pub(super) fn flat_finding(flat: &Flat) -> Finding {
    let (turn, deviation) = flat.circumference_m;
    let mut parameters = BTreeMap::new();
    if let Some(shape) = &flat.shape {
        parameters.insert("length_m", shape.length_m);
        parameters.insert("depth_m", shape.depth_m);
    }
    Finding {
        physics: WHEEL_FLAT.physics,
        p_value: number::probability(flat.ln_p),
        place: Place::Everywhere,
        parameters,
        evidence: format!(
            "one impact per revolution in every pass, {turn:.4} m (sd {deviation:.4}) apart, {} \
                 times above its surroundings",
            ratio(flat.power_ratio)
        ),
    }
}

pub(super) fn order_finding(orders: &[Order]) -> Option<Finding> {
    let first = orders.iter().min_by(|a, b| a.ln_p.total_cmp(&b.ln_p))?;
    let names: Vec<String> = orders.iter().map(|order| order.number.to_string()).collect();
    let or = if first.turns {
        ""
    } else {
        "; passes at one speed do not differ by it more than by the surface, so that it may be corrugation of the whole rail"
    };
    Some(Finding {
        physics: WHEEL_OUT_OF_ROUND.physics,
        p_value: number::probability(first.ln_p),
        place: Place::Everywhere,
        parameters: BTreeMap::from([
            ("order", (first.number as f64, 0.0)),
            ("amplitude_m", first.amplitude_m),
        ]),
        evidence: format!(
            "lines at wheel orders: order {}; order {} is {} times above the level between orders{or}",
            names.join(", "),
            first.number,
            ratio(first.ratio)
        ),
    })
}

pub(super) fn comb_finding(comb: &Comb) -> Finding {
    let (turn, deviation) = comb.circumference_m;
    let held_out = &comb.held_out;
    Finding {
        physics: WHEEL_OUT_OF_ROUND.physics,
        p_value: number::probability(comb.ln_p),
        place: Place::Everywhere,
        parameters: BTreeMap::from([("circumference_m", comb.circumference_m)]),
        evidence: format!(
            "a comb of wheel orders at multiples of {:.3} Hz, a circumference of {turn:.3} m \
                 (sd {deviation:.3}); in {} withheld blocks it explains {:.0} % of the variance in \
                 {:.0} to {:.0} Hz ({:.0} % by chance) and predicts {} better than a smooth \
                 spectrum, by {:.1} nats per block",
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

/// Description of the passes that contain an impact.
fn who(passes: &[Pass]) -> &'static str {
    match (passes.len(), by_speed(passes).len()) {
        (1, _) => "the only pass",
        (_, 1) => "every pass",
        _ => "every pass at every speed",
    }
}

/// Length over which the dip of a joint with the exponent 2 falls to 1/e, over that of the hollow that has
/// the same depth at the same distance.
const ROUNDED_DIP: f64 = 0.2925;

/// Exponent of a rounded dip.
const ROUNDED: f64 = 2.0;

/// Half the square of a length's distance from the middle of a kind's range, in half widths of the range and
/// in logarithms, and the logarithm of the half width: minus its log prior density.
fn surprise(kind: &Kind, length_m: f64, length_ratio: f64) -> f64 {
    let Some(parameter) = kind.parameter("length_m") else { return f64::INFINITY };
    let [low, high] = parameter.range(length_ratio).map(f64::ln);
    let half_width = 0.5 * (high - low);
    0.5 * ((length_m.ln() - 0.5 * (low + high)) / half_width).powi(2) + half_width.ln()
}

/// Depth of the dip of a joint and its standard deviation in m. A joint also bends more easily, which adds
/// power as a dip does, and passes alone do not separate the two: the dip has any share of the depth.
fn dip_m((depth_m, deviation_m): (f64, f64)) -> (f64, f64) {
    (depth_m, deviation_m.max(depth_m))
}

/// Kind of the shape at an impact, and its parameters. A kink is a joint. A hollow is a squat or the rounded
/// dip of a joint: the kind in whose range its length lies, or which it is nearer to.
fn impact_kind(
    shape: &Shape,
    length_ratio: f64,
) -> (&'static Kind, BTreeMap<&'static str, (f64, f64)>) {
    let (length, deviation) = shape.length_m;
    if shape.form == Form::Dip {
        let dip = [("length_m", shape.length_m), ("dip_m", dip_m(shape.depth_m))];
        return (RAIL_JOINT, BTreeMap::from(dip));
    }
    let as_dip_m = ROUNDED_DIP * length;
    if surprise(SQUAT, length, length_ratio) <= surprise(RAIL_JOINT, as_dip_m, length_ratio) {
        let hollow = [("length_m", shape.length_m), ("depth_m", shape.depth_m)];
        return (SQUAT, BTreeMap::from(hollow));
    }
    let dip = [
        ("length_m", (as_dip_m, ROUNDED_DIP * deviation)),
        ("dip_m", dip_m(shape.depth_m)),
        ("dip_exponent", (ROUNDED, 0.0)),
    ];
    (RAIL_JOINT, BTreeMap::from(dip))
}

/// Finding of an impact on a track whose lengths are `length_ratio` times those of V-Track.
pub(super) fn impact_finding(impact: &Impact, passes: &[Pass], length_ratio: f64) -> Finding {
    let (x, deviation) = impact.x_m;
    let shape = impact.shape.as_ref();
    let (kind, parameters) =
        shape.map_or((RAIL_JOINT, BTreeMap::new()), |shape| impact_kind(shape, length_ratio));
    let form = shape.map_or_else(String::new, |shape| {
        let (mine, other) = match shape.form {
            Form::Hollow => ("a hollow", "a kink"),
            Form::Dip => ("a kink", "a hollow"),
        };
        let sure = if shape.lead < FORM_LEAD { "hardly " } else { "" };
        let is_long = shape.form == Form::Hollow && kind.physics == RAIL_JOINT.physics;
        let length_mm = 1e3 * shape.length_m.0;
        let long = if is_long {
            format!(", {length_mm:.0} mm long: too long for a squat")
        } else {
            String::new()
        };
        format!(
            "; its spectrum is {sure}more like {mine} than {other} (by {:.1} nats){long}",
            shape.lead
        )
    });
    // Three standard deviations, and 10 mm for the length of the defect itself.
    let reach = 3.0 * deviation.max(3e-3);
    Finding {
        physics: kind.physics,
        p_value: number::probability(impact.ln_p),
        place: Place::Stretch { from_m: x - reach, to_m: x + reach },
        parameters,
        evidence: format!(
            "at {x:.4} m (sd {deviation:.4}) {} is {} times above its surroundings{form}",
            who(passes),
            ratio(impact.power_ratio)
        ),
    }
}

pub(super) fn corrugation_finding(waves: &Corrugation) -> Finding {
    let [from_m, to_m] = waves.stretch_m;
    Finding {
        physics: CORRUGATION.physics,
        p_value: number::probability(waves.ln_p),
        place: Place::Stretch { from_m, to_m },
        parameters: BTreeMap::from([
            ("wavelength_m", waves.wavelength_m),
            ("amplitude_m", waves.amplitude_m),
        ]),
        evidence: format!(
            "waves of {:.2} mm from {from_m:.2} to {to_m:.2} m, {} times above the surface's at \
                 every speed",
            1e3 * waves.wavelength_m.0,
            ratio(waves.ratio)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hollow(length_m: f64) -> Shape {
        Shape {
            form: Form::Hollow,
            length_m: (length_m, 1e-3),
            depth_m: (5e-5, 1e-5),
            slope_rad: 0.0,
            lead: 10.0,
        }
    }

    #[test]
    fn a_hollow_as_long_as_the_dip_of_a_joint_is_one_at_either_scale() {
        for (length_m, length_ratio, physics) in [
            (5e-3, 1.0, "squat"),
            (1e-2, 1.0, "squat"),
            (3e-2, 1.0, "rail_joint"),
            (3e-2, 4.8, "squat"),
            (6e-2, 4.8, "squat"),
            (0.4, 4.8, "rail_joint"),
        ] {
            let (kind, parameters) = impact_kind(&hollow(length_m), length_ratio);
            assert_eq!(kind.physics, physics, "{length_m} m, {length_ratio}");
            assert!(parameters.keys().all(|name| kind.parameter(name).is_some()));
            // The power of a joint is that of its dip and of its bending.
            let depth = parameters.get("dip_m").or(parameters.get("depth_m")).unwrap();
            let expected = if physics == "rail_joint" { 5e-5 } else { 1e-5 };
            assert_eq!(depth.1, expected, "{physics}");
        }
    }

    #[test]
    fn a_rounded_dip_has_the_flanks_of_its_hollow() {
        // Where the hollow has 1/e of its depth.
        let share = 0.5 * (1.0 + (std::f64::consts::TAU * ROUNDED_DIP).cos());
        assert!((share - (-1.0_f64).exp()).abs() < 1e-3, "{share}");
    }
}
