//! Which effects are hidden, where, and how strong: ranges of the catalogue at V-Track scale.
//!
//! Strengths are drawn evenly in their logarithm (ranges: docs/extensions.md), so that some are
//! too weak for anybody to see: the scores say how strong each was.

use crate::draw::Class;
use rand_chacha::ChaCha8Rng;
use rand_distr::Distribution;
use rand_distr::uniform::{SampleUniform, Uniform};
use tracktwin_reference_simulator::Hidden;

/// Spacing of the sleepers in m.
const SPACING_M: f64 = 0.125;

/// Sleepers at which something may be hidden: inside what is recorded by two spans or more.
const SLEEPERS: [usize; 2] = [8, 30];

/// One effect whose place and strength are to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    RailJoint,
    Squat,
    Corrugation,
    WheelFlat,
    WheelOutOfRound,
    FasteningClamp,
    MissingRailpad,
    SleeperBolt,
    HangingSleeper,
    SubgradeLayer,
    FlexibleAxleBox,
    FrequencyDependentRailpad,
    RailCrossSection,
    SensorMountResonance,
    Clipping,
    GainError,
    PositionError,
    ElectricalHum,
    RailAbsorber,
    CrackedSleeper,
    LinkedSleepers,
    WheelMode,
}

const CATALOGUE: [Effect; 13] = [
    Effect::RailJoint,
    Effect::Squat,
    Effect::Corrugation,
    Effect::WheelFlat,
    Effect::WheelOutOfRound,
    Effect::FasteningClamp,
    Effect::MissingRailpad,
    Effect::SleeperBolt,
    Effect::HangingSleeper,
    Effect::SubgradeLayer,
    Effect::FlexibleAxleBox,
    Effect::FrequencyDependentRailpad,
    Effect::RailCrossSection,
];

const ARTEFACTS: [Effect; 5] = [
    Effect::SensorMountResonance,
    Effect::Clipping,
    Effect::GainError,
    Effect::PositionError,
    Effect::ElectricalHum,
];

const UNKNOWN: [Effect; 4] =
    [Effect::RailAbsorber, Effect::CrackedSleeper, Effect::LinkedSleepers, Effect::WheelMode];

/// What may be hidden in a class.
pub(crate) fn of(class: Class) -> Vec<Effect> {
    match class {
        Class::Control => Vec::new(),
        Class::Artefact => ARTEFACTS.to_vec(),
        Class::Single | Class::Double => CATALOGUE.to_vec(),
        Class::Unknown => UNKNOWN.to_vec(),
    }
}

impl Effect {
    /// With a place and a strength, on a surface of this irregularity level.
    pub(crate) fn draw(self, level: f64, rng: &mut ChaCha8Rng) -> Hidden {
        match self {
            Self::RailJoint
            | Self::Squat
            | Self::Corrugation
            | Self::WheelFlat
            | Self::WheelOutOfRound => self.geometry(rng),
            Self::FasteningClamp
            | Self::MissingRailpad
            | Self::SleeperBolt
            | Self::HangingSleeper
            | Self::SubgradeLayer => self.support(rng),
            Self::FlexibleAxleBox | Self::FrequencyDependentRailpad | Self::RailCrossSection => {
                self.everywhere(rng)
            }
            Self::SensorMountResonance
            | Self::Clipping
            | Self::GainError
            | Self::PositionError
            | Self::ElectricalHum => self.chain(level, rng),
            Self::RailAbsorber | Self::CrackedSleeper | Self::LinkedSleepers | Self::WheelMode => {
                self.unknown(rng)
            }
        }
    }

    fn geometry(self, rng: &mut ChaCha8Rng) -> Hidden {
        match self {
            Self::RailJoint => Hidden::RailJoint {
                x_m: point(rng),
                dip_m: strong(rng, 2e-5, 2e-4),
                length_m: strong(rng, 1e-2, 3e-2),
                bending_factor: even(rng, 0.15, 0.6),
                bending_length_m: strong(rng, 2e-2, 5e-2),
            },
            Self::Squat => Hidden::Squat {
                x_m: point(rng),
                depth_m: strong(rng, 5e-6, 6e-5),
                length_m: strong(rng, 3e-3, 1e-2),
            },
            Self::Corrugation => {
                let from_m = even(rng, 1.0, 2.5);
                Hidden::Corrugation {
                    x_m: [from_m, from_m + even(rng, 0.5, 1.5)],
                    wavelength_m: strong(rng, 4e-3, 1.2e-2),
                    amplitude_m: strong(rng, 2e-7, 2e-6),
                }
            }
            Self::WheelFlat => Hidden::WheelFlat { length_m: strong(rng, 1.5e-3, 6e-3) },
            _ => Hidden::WheelOutOfRound {
                order: even(rng, 5, 41),
                amplitude_m: strong(rng, 2e-7, 5e-6),
            },
        }
    }

    fn support(self, rng: &mut ChaCha8Rng) -> Hidden {
        match self {
            Self::FasteningClamp => {
                let every = even(rng, 3, 5);
                let first = even(rng, SLEEPERS[0], SLEEPERS[0] + every);
                Hidden::FasteningClamp {
                    sleepers: (first..=SLEEPERS[1]).step_by(every).collect(),
                    vertical_n_per_m: strong(rng, 3e7, 1.5e8),
                    rotational_n_m_per_rad: strong(rng, 3e4, 3e5),
                }
            }
            Self::MissingRailpad => Hidden::MissingRailpad {
                sleepers: some(rng, 1),
                stiffness_n_per_m: strong(rng, 5e6, 2e7),
            },
            Self::SleeperBolt => {
                let sleepers = if even(rng, 0, 2) == 0 { all() } else { some(rng, 3) };
                Hidden::SleeperBolt { sleepers, stiffness_n_per_m: strong(rng, 5e6, 5e7) }
            }
            Self::HangingSleeper => {
                Hidden::HangingSleeper { sleepers: some(rng, 2), gap_m: strong(rng, 5e-5, 4e-4) }
            }
            _ => Hidden::SubgradeLayer {
                sleepers: (even(rng, 0, 2) == 0).then(|| some(rng, 3)),
                mass_kg: strong(rng, 0.5, 4.0),
                stiffness_n_per_m: strong(rng, 1e7, 1e8),
                damping_n_s_per_m: strong(rng, 5e2, 2e3),
            },
        }
    }

    fn everywhere(self, rng: &mut ChaCha8Rng) -> Hidden {
        match self {
            Self::FlexibleAxleBox => Hidden::FlexibleAxleBox {
                mass_kg: strong(rng, 2.0, 1.5e1),
                stiffness_n_per_m: strong(rng, 5e7, 8e8),
                damping_n_s_per_m: strong(rng, 1e3, 4e3),
            },
            Self::FrequencyDependentRailpad => Hidden::FrequencyDependentRailpad {
                stiffness_ratio: strong(rng, 0.3, 3.0),
                relaxation_time_s: strong(rng, 3e-5, 1e-3),
            },
            _ => Hidden::RailCrossSection {
                frequency_hz: strong(rng, 6e3, 1.4e4),
                stiffness_n_per_m: strong(rng, 5e8, 3e9),
                loss_factor: strong(rng, 5e-2, 2e-1),
            },
        }
    }

    fn chain(self, level: f64, rng: &mut ChaCha8Rng) -> Hidden {
        match self {
            Self::SensorMountResonance => Hidden::SensorMountResonance {
                frequency_hz: strong(rng, 2e3, 7e3),
                damping_ratio: strong(rng, 2e-2, 1e-1),
            },
            // Crests at 13 km/h reach 8 m/s2 on a surface of level one.
            Self::Clipping => Hidden::Clipping { limit_m_s2: level * strong(rng, 1.5, 6.0) },
            Self::GainError => Hidden::GainError {
                factor: if even(rng, 0, 2) == 0 { 1.0 / 1.3 } else { 1.3 },
                pass: Some(even(rng, 0, 6)),
            },
            Self::PositionError => Hidden::PositionError {
                offset_m: strong(rng, 2e-2, 6e-2),
                scale: even(rng, -0.01, 0.01),
                pass: Some(even(rng, 0, 6)),
            },
            _ => Hidden::ElectricalHum {
                frequency_hz: 50.0 * even(rng, 1.0, 4.0_f64).floor(),
                amplitude_m_s2: strong(rng, 0.2, 3.0),
            },
        }
    }

    fn unknown(self, rng: &mut ChaCha8Rng) -> Hidden {
        match self {
            Self::RailAbsorber => Hidden::RailAbsorber {
                x_m: point(rng),
                mass_kg: strong(rng, 0.2, 1.5),
                frequency_hz: strong(rng, 3e2, 2.5e3),
                damping_ratio: strong(rng, 2e-2, 1e-1),
            },
            Self::CrackedSleeper => Hidden::CrackedSleeper {
                sleepers: some(rng, 2),
                bending_factor: strong(rng, 1e-2, 0.2),
            },
            Self::LinkedSleepers => {
                let first = even(rng, SLEEPERS[0], SLEEPERS[1]);
                Hidden::LinkedSleepers {
                    sleepers: [first, first + 1],
                    stiffness_n_per_m: strong(rng, 1e7, 2e8),
                }
            }
            _ => Hidden::WheelMode {
                frequency_hz: strong(rng, 1.5e3, 4.5e3),
                mass_kg: strong(rng, 1.0, 4.0),
                damping_ratio: strong(rng, 5e-3, 5e-2),
            },
        }
    }
}

/// Evenly between two values, the second one out.
fn even<T: SampleUniform + PartialOrd>(rng: &mut ChaCha8Rng, from: T, to: T) -> T {
    Uniform::new(from, to).expect("ranges here are not empty").sample(rng)
}

/// Evenly in the logarithm.
fn strong(rng: &mut ChaCha8Rng, from: f64, to: f64) -> f64 {
    even(rng, from.ln(), to.ln()).exp()
}

/// A point of the rail.
fn point(rng: &mut ChaCha8Rng) -> [f64; 2] {
    let x_m = |sleeper: usize| (sleeper + 1) as f64 * SPACING_M;
    [even(rng, x_m(SLEEPERS[0]), x_m(SLEEPERS[1])); 2]
}

/// Up to so many neighbouring sleepers.
fn some(rng: &mut ChaCha8Rng, most: usize) -> Vec<usize> {
    let count = even(rng, 1, most + 1);
    let first = even(rng, SLEEPERS[0], SLEEPERS[1] + 2 - count);
    (first..first + count).collect()
}

/// All sleepers that are recorded well.
fn all() -> Vec<usize> {
    (0..39).collect()
}
