//! Kind, place and strength of hidden effects on V-Track, in the ranges of the catalogue at its scale.
//!
//! Strengths have a log-uniform distribution (ranges: docs/extensions.md). Some effects are therefore
//! too weak to be detected. The scores state the strength of each effect.

use crate::class::Class;
use crate::known::kind;
use crate::line_effect;
use crate::site::Site;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::Distribution;
use rand_distr::uniform::{SampleUniform, Uniform};
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::{Hidden, Scene};

/// One effect, with a place and a strength that are drawn.
pub(crate) type Effect = fn(&mut Draw<'_>) -> Hidden;

/// Every effect that a trial of V-Track hides.
const EFFECTS: [Effect; 22] = [
    rail_joint,
    squat,
    corrugation,
    wheel_flat,
    wheel_out_of_round,
    fastening_clamp,
    missing_railpad,
    sleeper_bolt,
    hanging_sleeper,
    subgrade_layer,
    flexible_axle_box,
    frequency_dependent_railpad,
    rail_cross_section,
    sensor_mount_resonance,
    clipping,
    gain_error,
    position_error,
    electrical_hum,
    rail_absorber,
    cracked_sleeper,
    linked_sleepers,
    wheel_mode,
];

/// The effects that a class can hide on a track. The catalogue of the diagnosis determines which effects it
/// contains, and which of them are faults of the measuring chain.
pub(crate) fn of(preset: Preset, class: Class) -> Vec<Effect> {
    let all: &[Effect] = match preset {
        Preset::VTrack => &EFFECTS,
        _ => &line_effect::EFFECTS,
    };
    all.iter().copied().filter(|effect| belongs(&any(preset, *effect), class)).collect()
}

fn belongs(hidden: &Hidden, class: Class) -> bool {
    let kind = kind(hidden);
    match class {
        Class::Control => false,
        Class::Artefact => kind.is_some_and(|kind| kind.measuring_chain),
        Class::Single | Class::Double => kind.is_some_and(|kind| !kind.measuring_chain),
        Class::Unknown => kind.is_none(),
    }
}

/// The effect somewhere on a track, of some strength.
pub(crate) fn any(preset: Preset, effect: Effect) -> Hidden {
    let site = match preset {
        Preset::VTrack => Site::RIG,
        _ => Site::of(&Scene::typical_line(preset, 0)),
    };
    effect(&mut Draw { level: 1.0, site, rng: &mut ChaCha8Rng::seed_from_u64(0) })
}

/// What a place and a strength are drawn with.
pub(crate) struct Draw<'a> {
    /// Irregularity level of the surface.
    pub(crate) level: f64,
    pub(crate) site: Site,
    pub(crate) rng: &'a mut ChaCha8Rng,
}

impl Draw<'_> {
    /// Evenly between two values, the second one out.
    pub(crate) fn uniform<T: SampleUniform + PartialOrd>(&mut self, from: T, to: T) -> T {
        Uniform::new(from, to).expect("ranges here are not empty").sample(self.rng)
    }

    /// Evenly in the logarithm.
    fn log_uniform(&mut self, from: f64, to: f64) -> f64 {
        self.uniform(from.ln(), to.ln()).exp()
    }

    /// Evenly within a range.
    pub(crate) fn within(&mut self, [from, to]: [f64; 2]) -> f64 {
        self.uniform(from, to)
    }

    /// Evenly in the logarithm within a range.
    pub(crate) fn log_within(&mut self, [from, to]: [f64; 2]) -> f64 {
        self.log_uniform(from, to)
    }

    /// A point of the rail.
    pub(crate) fn point(&mut self) -> [f64; 2] {
        let range_m = self.site.range_m();
        [self.within(range_m); 2]
    }

    /// Up to so many neighbouring sleepers.
    pub(crate) fn some(&mut self, most: usize) -> Vec<usize> {
        let [from, to] = self.site.sleepers;
        let count = self.uniform(1, most + 1);
        let first = self.uniform(from, to + 2 - count);
        (first..first + count).collect()
    }
}

/// All sleepers that are recorded well.
fn all() -> Vec<usize> {
    (0..39).collect()
}

fn rail_joint(draw: &mut Draw<'_>) -> Hidden {
    Hidden::RailJoint {
        x_m: draw.point(),
        dip_m: draw.log_uniform(2e-5, 2e-4),
        length_m: draw.log_uniform(1e-2, 3e-2),
        bending_factor: draw.uniform(0.15, 0.6),
        bending_length_m: draw.log_uniform(2e-2, 5e-2),
    }
}

fn squat(draw: &mut Draw<'_>) -> Hidden {
    Hidden::Squat {
        x_m: draw.point(),
        depth_m: draw.log_uniform(5e-6, 6e-5),
        length_m: draw.log_uniform(3e-3, 1e-2),
    }
}

fn corrugation(draw: &mut Draw<'_>) -> Hidden {
    let from_m = draw.uniform(1.0, 2.5);
    Hidden::Corrugation {
        x_m: [from_m, from_m + draw.uniform(0.5, 1.5)],
        wavelength_m: draw.log_uniform(4e-3, 1.2e-2),
        amplitude_m: draw.log_uniform(2e-7, 2e-6),
    }
}

fn wheel_flat(draw: &mut Draw<'_>) -> Hidden {
    Hidden::WheelFlat { length_m: draw.log_uniform(1.5e-3, 6e-3) }
}

fn wheel_out_of_round(draw: &mut Draw<'_>) -> Hidden {
    Hidden::WheelOutOfRound {
        order: draw.uniform(5, 41),
        amplitude_m: draw.log_uniform(2e-7, 5e-6),
    }
}

fn fastening_clamp(draw: &mut Draw<'_>) -> Hidden {
    let [from, to] = draw.site.sleepers;
    let every = draw.uniform(3, 5);
    let first = draw.uniform(from, from + every);
    Hidden::FasteningClamp {
        sleepers: (first..=to).step_by(every).collect(),
        vertical_n_per_m: draw.log_uniform(3e7, 1.5e8),
        rotational_n_m_per_rad: draw.log_uniform(3e4, 3e5),
    }
}

fn missing_railpad(draw: &mut Draw<'_>) -> Hidden {
    Hidden::MissingRailpad { sleepers: draw.some(1), stiffness_n_per_m: draw.log_uniform(5e6, 2e7) }
}

fn sleeper_bolt(draw: &mut Draw<'_>) -> Hidden {
    let sleepers = if draw.uniform(0, 2) == 0 { all() } else { draw.some(3) };
    Hidden::SleeperBolt { sleepers, stiffness_n_per_m: draw.log_uniform(5e6, 5e7) }
}

fn hanging_sleeper(draw: &mut Draw<'_>) -> Hidden {
    Hidden::HangingSleeper { sleepers: draw.some(2), gap_m: draw.log_uniform(5e-5, 4e-4) }
}

fn subgrade_layer(draw: &mut Draw<'_>) -> Hidden {
    Hidden::SubgradeLayer {
        sleepers: (draw.uniform(0, 2) == 0).then(|| draw.some(3)),
        mass_kg: draw.log_uniform(0.5, 4.0),
        stiffness_n_per_m: draw.log_uniform(1e7, 1e8),
        damping_n_s_per_m: draw.log_uniform(5e2, 2e3),
    }
}

fn flexible_axle_box(draw: &mut Draw<'_>) -> Hidden {
    Hidden::FlexibleAxleBox {
        mass_kg: draw.log_uniform(2.0, 1.5e1),
        stiffness_n_per_m: draw.log_uniform(5e7, 8e8),
        damping_n_s_per_m: draw.log_uniform(1e3, 4e3),
    }
}

fn frequency_dependent_railpad(draw: &mut Draw<'_>) -> Hidden {
    Hidden::FrequencyDependentRailpad {
        stiffness_ratio: draw.log_uniform(0.3, 3.0),
        relaxation_time_s: draw.log_uniform(3e-5, 1e-3),
    }
}

fn rail_cross_section(draw: &mut Draw<'_>) -> Hidden {
    Hidden::RailCrossSection {
        frequency_hz: draw.log_uniform(6e3, 1.4e4),
        stiffness_n_per_m: draw.log_uniform(5e8, 3e9),
        loss_factor: draw.log_uniform(5e-2, 2e-1),
    }
}

fn sensor_mount_resonance(draw: &mut Draw<'_>) -> Hidden {
    Hidden::SensorMountResonance {
        frequency_hz: draw.log_uniform(2e3, 7e3),
        damping_ratio: draw.log_uniform(2e-2, 1e-1),
    }
}

fn clipping(draw: &mut Draw<'_>) -> Hidden {
    // Crests at 13 km/h reach 8 m/s2 on a surface of level one.
    Hidden::Clipping { limit_m_s2: draw.level.sqrt() * draw.log_uniform(1.5, 6.0) }
}

fn gain_error(draw: &mut Draw<'_>) -> Hidden {
    Hidden::GainError {
        factor: if draw.uniform(0, 2) == 0 { 1.0 / 1.3 } else { 1.3 },
        pass: Some(draw.uniform(0, 6)),
    }
}

fn position_error(draw: &mut Draw<'_>) -> Hidden {
    Hidden::PositionError {
        offset_m: draw.log_uniform(2e-2, 6e-2),
        scale: draw.uniform(-0.01, 0.01),
        pass: Some(draw.uniform(0, 6)),
    }
}

fn electrical_hum(draw: &mut Draw<'_>) -> Hidden {
    Hidden::ElectricalHum {
        frequency_hz: 50.0 * draw.uniform(1.0, 4.0_f64).floor(),
        amplitude_m_s2: draw.log_uniform(0.2, 3.0),
    }
}

fn rail_absorber(draw: &mut Draw<'_>) -> Hidden {
    Hidden::RailAbsorber {
        x_m: draw.point(),
        mass_kg: draw.log_uniform(0.2, 1.5),
        frequency_hz: draw.log_uniform(3e2, 2.5e3),
        damping_ratio: draw.log_uniform(2e-2, 1e-1),
    }
}

fn cracked_sleeper(draw: &mut Draw<'_>) -> Hidden {
    Hidden::CrackedSleeper { sleepers: draw.some(2), bending_factor: draw.log_uniform(1e-2, 0.2) }
}

fn linked_sleepers(draw: &mut Draw<'_>) -> Hidden {
    let [from, to] = draw.site.sleepers;
    let first = draw.uniform(from, to);
    Hidden::LinkedSleepers {
        sleepers: [first, first + 1],
        stiffness_n_per_m: draw.log_uniform(1e7, 2e8),
    }
}

fn wheel_mode(draw: &mut Draw<'_>) -> Hidden {
    Hidden::WheelMode {
        frequency_hz: draw.log_uniform(1.5e3, 4.5e3),
        mass_kg: draw.log_uniform(1.0, 4.0),
        damping_ratio: draw.log_uniform(5e-3, 5e-2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use tracktwin_track::extension::Kind;

    /// Kinds that the second simulator does not have.
    const NEVER_HIDDEN: [&str; 4] =
        ["roughness_spectrum", "contact_patch_filter", "second_wheel", "support_variation"];

    /// Kinds in the catalogue that passes under one load cannot separate.
    const NOT_ASKED: [&str; 1] = ["load_dependent_railpad"];

    #[test]
    fn every_kind_of_the_catalogue_is_hidden_or_listed_as_never_hidden() {
        let any = |effect| any(Preset::VTrack, effect).physics();
        let hidden: BTreeSet<_> = EFFECTS.into_iter().map(any).collect();
        assert_eq!(hidden.len(), EFFECTS.len(), "an effect stands twice");
        for kind in Kind::all() {
            let is_listed = NEVER_HIDDEN.iter().chain(&NOT_ASKED).any(|it| *it == kind.physics);
            assert!(hidden.contains(kind.physics) != is_listed, "{}", kind.physics);
        }
    }
}
