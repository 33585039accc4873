//! Kind, place and strength of hidden effects on a line.
//!
//! Sizes come from publications on lines, not from the ranges of the catalogue. Strengths have a log-uniform
//! distribution. Some effects are therefore too weak to be detected. Lines have no clamps of the rig and no
//! bolts; resonances of the cross-section of a 60E1 rail (4 to 6 kHz for its foot, Thompson 2009) lie above the
//! frequencies that are compared.

use crate::effect::{Draw, Effect};
use std::f64::consts::TAU;
use tracktwin_reference_simulator::Hidden;

/// Every effect that a trial hides on a line.
pub(crate) const EFFECTS: [Effect; 18] = [
    rail_joint,
    squat,
    corrugation,
    wheel_flat,
    wheel_out_of_round,
    missing_railpad,
    hanging_sleeper,
    subgrade_layer,
    flexible_axle_box,
    frequency_dependent_railpad,
    sensor_mount_resonance,
    clipping,
    gain_error,
    position_error,
    electrical_hum,
    rail_absorber,
    cracked_sleeper,
    wheel_mode,
];

/// Passes of a line's recording.
const PASSES: usize = 6;

/// A dipped insulated joint, or a weld. Dips of joints are 0.5 to 2 mm on a metre, of welds 0.1 to 0.5 mm
/// (Steenbergen and Esveld 2006, Proc. `IMechE` F 220); insulated joints have 30 to 80 % of the rail's bending
/// stiffness over their plates (Kerr and Cox 1999, Int. J. Mech. Sci. 41), welds nearly all of it.
fn rail_joint(draw: &mut Draw<'_>) -> Hidden {
    let is_weld = draw.uniform(0, 2) == 0;
    let (dip_m, bending) =
        if is_weld { ([1e-4, 5e-4], [0.9, 1.0]) } else { ([2e-4, 1.5e-3], [0.3, 0.8]) };
    Hidden::RailJoint {
        x_m: draw.point(),
        dip_m: draw.log_within(dip_m),
        length_m: draw.log_within([0.05, 0.2]),
        bending_factor: draw.within(bending),
        bending_length_m: draw.log_within([0.1, 0.4]),
    }
}

/// Light to severe squats: 20 to 60 mm long, 0.05 to 0.5 mm deep (Molodova, Li, Nunez and Dollevoet 2014, IEEE
/// Trans. Intell. Transp. Syst. 15).
fn squat(draw: &mut Draw<'_>) -> Hidden {
    Hidden::Squat {
        x_m: draw.point(),
        depth_m: draw.log_within([5e-5, 5e-4]),
        length_m: draw.log_within([2e-2, 6e-2]),
    }
}

/// Wavelengths of 30 to 300 mm; amplitudes of 0.1 to 1 mm a metre of wavelength, so 4 to 40 um at 40 mm (Grassie
/// 2009, Proc. `IMechE` F 223).
fn corrugation(draw: &mut Draw<'_>) -> Hidden {
    let [first_m, last_m] = draw.site.range_m();
    let length_m = draw.within([4.0, 10.0]).min(last_m - first_m - 1.0);
    let from_m = draw.within([first_m, last_m - length_m]);
    let wavelength_m = draw.log_within([0.03, 0.3]);
    Hidden::Corrugation {
        x_m: [from_m, from_m + length_m],
        wavelength_m,
        amplitude_m: wavelength_m * draw.log_within([1e-4, 1e-3]),
    }
}

/// Flats of 15 to 60 mm: 60 mm is the limit of the General Contract of Use for Wagons for large wheels.
fn wheel_flat(draw: &mut Draw<'_>) -> Hidden {
    Hidden::WheelFlat { length_m: draw.log_within([1.5e-2, 6e-2]) }
}

/// Orders 6 to 30 (Nielsen and Johansson 2000, Proc. `IMechE` F 214; polygonal wheels: Tao, Wen, Jin and
/// Yang 2020, Railway Eng. Science 28).
fn wheel_out_of_round(draw: &mut Draw<'_>) -> Hidden {
    Hidden::WheelOutOfRound {
        order: draw.uniform(6, 31),
        amplitude_m: draw.log_within([3e-6, 5e-5]),
    }
}

/// A worn-out, displaced or lost pad: 4 to 40 % of the track's stiffness is left.
fn missing_railpad(draw: &mut Draw<'_>) -> Hidden {
    let stiffness_n_per_m = draw.site.railpad_n_m * draw.log_within([0.04, 0.4]);
    Hidden::MissingRailpad { sleepers: draw.some(1), stiffness_n_per_m }
}

/// Gaps of 0.2 to 2 mm under up to three sleepers (Lundqvist and Dahlberg 2005, Proc. `IMechE` F 219: to 1 mm).
fn hanging_sleeper(draw: &mut Draw<'_>) -> Hidden {
    Hidden::HangingSleeper { sleepers: draw.some(3), gap_m: draw.log_within([2e-4, 2e-3]) }
}

/// Moving ballast on a subgrade (Zhai, Wang and Lin 2004, J. Sound Vib. 270: 531 kg a half sleeper on 78 MN/m and
/// 31 kN s/m), under up to six sleepers or under all.
fn subgrade_layer(draw: &mut Draw<'_>) -> Hidden {
    Hidden::SubgradeLayer {
        sleepers: (draw.uniform(0, 2) == 0).then(|| draw.some(6)),
        mass_kg: draw.log_within([200.0, 700.0]),
        stiffness_n_per_m: draw.log_within([5e7, 2.5e8]),
        damping_n_s_per_m: draw.log_within([3e4, 1.5e5]),
    }
}

/// A box of 60 to 200 kg on rubber between it and the wheelset, or on a soft bracket: 100 to 800 Hz.
fn flexible_axle_box(draw: &mut Draw<'_>) -> Hidden {
    let mass_kg = draw.log_within([60.0, 200.0]);
    let omega = TAU * draw.log_within([100.0, 800.0]);
    let damping_ratio = draw.log_within([0.02, 0.1]);
    Hidden::FlexibleAxleBox {
        mass_kg,
        stiffness_n_per_m: mass_kg * omega * omega,
        damping_n_s_per_m: 2.0 * damping_ratio * mass_kg * omega,
    }
}

/// Rubber stiffens by 1.3 to 3 from some 10 Hz to 1 kHz (Fenander 1997, Proc. `IMechE` F 211).
fn frequency_dependent_railpad(draw: &mut Draw<'_>) -> Hidden {
    Hidden::FrequencyDependentRailpad {
        stiffness_ratio: draw.log_within([0.3, 2.0]),
        relaxation_time_s: draw.log_within([1e-4, 2e-3]),
    }
}

/// A magnet or a bracket under the sensor resonates at 1.5 to 6 kHz.
fn sensor_mount_resonance(draw: &mut Draw<'_>) -> Hidden {
    Hidden::SensorMountResonance {
        frequency_hz: draw.log_within([1.5e3, 6e3]),
        damping_ratio: draw.log_within([2e-2, 1e-1]),
    }
}

/// A range that is too small: 15 to 70 % of the largest acceleration at 80 km/h, which is some
/// [`CREST_M_S2`] on a surface of level one and grows with the root of the level.
fn clipping(draw: &mut Draw<'_>) -> Hidden {
    let crest_m_s2 = CREST_M_S2 * draw.level.sqrt();
    Hidden::Clipping { limit_m_s2: crest_m_s2 * draw.log_within([0.15, 0.7]) }
}

/// Largest acceleration at 80 km/h in m/s2 on a surface of level one.
const CREST_M_S2: f64 = 150.0;

fn gain_error(draw: &mut Draw<'_>) -> Hidden {
    Hidden::GainError {
        factor: if draw.uniform(0, 2) == 0 { 1.0 / 1.3 } else { 1.3 },
        pass: Some(draw.uniform(0, PASSES)),
    }
}

/// Slip of the odometer, or a wheel diameter that is wrong by 1 % at most.
fn position_error(draw: &mut Draw<'_>) -> Hidden {
    Hidden::PositionError {
        offset_m: draw.log_within([0.1, 0.3]),
        scale: draw.within([-0.01, 0.01]),
        pass: Some(draw.uniform(0, PASSES)),
    }
}

/// Harmonics of 50 Hz.
fn electrical_hum(draw: &mut Draw<'_>) -> Hidden {
    Hidden::ElectricalHum {
        frequency_hz: 50.0 * draw.uniform(1.0, 4.0_f64).floor(),
        amplitude_m_s2: draw.log_within([0.3, 5.0]),
    }
}

/// Tuned rail dampers: 5 to 20 kg a span, 0.4 to 1.5 kHz (Thompson, Jones, Waters and Farrington 2007, Applied
/// Acoustics 68).
fn rail_absorber(draw: &mut Draw<'_>) -> Hidden {
    Hidden::RailAbsorber {
        x_m: draw.point(),
        mass_kg: draw.log_within([5.0, 40.0]),
        frequency_hz: draw.log_within([2e2, 1.5e3]),
        damping_ratio: draw.log_within([2e-2, 1e-1]),
    }
}

/// Concrete that is cracked through at the rail seat.
fn cracked_sleeper(draw: &mut Draw<'_>) -> Hidden {
    Hidden::CrackedSleeper { sleepers: draw.some(2), bending_factor: draw.log_within([1e-2, 0.2]) }
}

/// Modes of a wheelset and its wheels that move the tread radially: bending of the axle at 60 to 150 Hz is left
/// out; radial modes of the wheel are at 0.4 to 3 kHz (Thompson 2009).
fn wheel_mode(draw: &mut Draw<'_>) -> Hidden {
    Hidden::WheelMode {
        frequency_hz: draw.log_within([4e2, 3e3]),
        mass_kg: draw.log_within([60.0, 300.0]),
        damping_ratio: draw.log_within([2e-3, 2e-2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::any;
    use std::collections::BTreeSet;
    use tracktwin_parameters::Preset;
    use tracktwin_track::extension::Kind;

    /// Kinds that the second simulator does not have, that one load cannot separate, and that lines do not have.
    const NEVER_HIDDEN: [&str; 8] = [
        "roughness_spectrum",
        "contact_patch_filter",
        "second_wheel",
        "support_variation",
        "load_dependent_railpad",
        "fastening_clamp",
        "sleeper_bolt",
        "rail_cross_section",
    ];

    #[test]
    fn every_kind_of_the_catalogue_is_hidden_on_a_line_or_listed_as_never_hidden() {
        let any = |effect| any(Preset::Concrete60E1, effect).physics();
        let hidden: BTreeSet<_> = EFFECTS.into_iter().map(any).collect();
        assert_eq!(hidden.len(), EFFECTS.len(), "an effect stands twice");
        for kind in Kind::all() {
            let is_listed = NEVER_HIDDEN.contains(&kind.physics);
            assert!(hidden.contains(kind.physics) != is_listed, "{}", kind.physics);
        }
    }
}
