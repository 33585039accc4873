//! Quantities that are the same in every case of a campaign: sections, masses, spacing, load.

use serde::{Deserialize, Serialize};

/// Sleeper spacing of V-Track in m (paper, Table D1).
const V_TRACK_SPACING_M: f64 = 0.125;

/// Cross-section and material of a beam.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeamSection {
    /// Cross-section area `A` in m2.
    pub area_m2: f64,
    /// Second moment of area `I` in m4.
    pub second_moment_m4: f64,
    /// Young's modulus `E` in Pa.
    pub youngs_modulus_pa: f64,
    /// Density in kg/m3.
    pub density_kg_m3: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Timoshenko shear coefficient `kappa`.
    pub shear_coefficient: f64,
}

impl BeamSection {
    /// Bending stiffness `E I` in N m2.
    pub fn bending_stiffness(&self) -> f64 {
        self.youngs_modulus_pa * self.second_moment_m4
    }

    /// Shear stiffness `kappa G A` in N, with `G = E / (2 (1 + nu))`.
    pub fn shear_stiffness(&self) -> f64 {
        let shear_modulus = self.youngs_modulus_pa / (2.0 * (1.0 + self.poisson));
        self.shear_coefficient * shear_modulus * self.area_m2
    }

    /// Mass per length `rho A` in kg/m.
    pub fn mass_per_length(&self) -> f64 {
        self.density_kg_m3 * self.area_m2
    }

    /// Rotary inertia per length `rho I` in kg m.
    pub fn rotary_inertia_per_length(&self) -> f64 {
        self.density_kg_m3 * self.second_moment_m4
    }
}

/// The sleepers: half of each, from the track's symmetry plane to its free end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SleeperDesign {
    /// Distance between neighbouring sleepers in m.
    pub spacing_m: f64,
    /// Length of a half sleeper in m.
    pub half_length_m: f64,
    /// Distance of the rail seat from the symmetry plane in m. The symmetry plane holds the rotation.
    pub rail_seat_m: f64,
    /// Section of the sleeper, with the nominal bending stiffness. The parameter `EI_s` scales bending
    /// and shear stiffness.
    pub section: BeamSection,
}

/// The wheel: a rigid unsprung mass under a constant load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wheel {
    /// Unsprung mass in kg.
    pub mass_kg: f64,
    /// Vertical load in N, including the weight of the wheel.
    pub load_n: f64,
    /// Rolling radius in m.
    pub radius_m: f64,
    /// Positions of further wheels of the same mass and load on the same rail, in m ahead of this wheel.
    /// Negative: behind.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_wheels_m: Vec<f64>,
}

/// All properties of wheel and track except those of [`crate::Parameter`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackDesign {
    /// The rail.
    pub rail: BeamSection,
    /// Stiffness-proportional damping of the rail in s (`C = beta K`).
    pub rail_damping_s: f64,
    /// The sleepers.
    pub sleeper: SleeperDesign,
    /// Lateral radius of the railhead in m, for the Hertzian contact (paper, eq. B.5).
    pub railhead_radius_m: f64,
    /// The wheel.
    pub wheel: Wheel,
    /// Whether the contact patch averages the irregularity over its length.
    #[serde(default, skip_serializing_if = "is_false")]
    pub contact_patch_filter: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_false(value: &bool) -> bool {
    !*value
}

impl TrackDesign {
    /// The downscaled test rig V-Track (paper, Table D1; rail S7).
    pub fn v_track() -> Self {
        let steel = BeamSection {
            area_m2: 8.65e-4,
            second_moment_m4: 5.15e-7,
            youngs_modulus_pa: 210e9,
            density_kg_m3: 7800.0,
            poisson: 0.3,
            shear_coefficient: 0.34,
        };
        Self {
            rail: steel.clone(),
            rail_damping_s: 1e-7,
            sleeper: SleeperDesign {
                spacing_m: V_TRACK_SPACING_M,
                half_length_m: 0.24,
                rail_seat_m: 0.0,
                section: BeamSection {
                    area_m2: 6e-4,
                    second_moment_m4: 1.125e-8,
                    shear_coefficient: 5.0 / 6.0,
                    ..steel
                },
            },
            railhead_radius_m: 0.06,
            wheel: Wheel {
                mass_kg: 44.0,
                load_n: 4500.0,
                radius_m: 0.065,
                further_wheels_m: Vec::new(),
            },
            contact_patch_filter: false,
        }
    }

    /// The track with every length multiplied by `ratio`, at equal stress and equal strain.
    ///
    /// Areas, forces and loads scale with the square of `ratio`, masses with its cube and second moments
    /// of area with its fourth power. Time, and therefore stiffness-proportional damping, scales with
    /// `ratio`. With `ratio` 5 these are the scale factors of Table D1 of the paper.
    #[must_use]
    pub fn enlarged(&self, ratio: f64) -> Self {
        let section = |section: &BeamSection| BeamSection {
            area_m2: section.area_m2 * ratio.powi(2),
            second_moment_m4: section.second_moment_m4 * ratio.powi(4),
            ..section.clone()
        };
        Self {
            rail: section(&self.rail),
            rail_damping_s: self.rail_damping_s * ratio,
            sleeper: SleeperDesign {
                spacing_m: self.sleeper.spacing_m * ratio,
                half_length_m: self.sleeper.half_length_m * ratio,
                rail_seat_m: self.sleeper.rail_seat_m * ratio,
                section: section(&self.sleeper.section),
            },
            railhead_radius_m: self.railhead_radius_m * ratio,
            wheel: Wheel {
                mass_kg: self.wheel.mass_kg * ratio.powi(3),
                load_n: self.wheel.load_n * ratio.powi(2),
                radius_m: self.wheel.radius_m * ratio,
                further_wheels_m: self.wheel.further_wheels_m.iter().map(|m| m * ratio).collect(),
            },
            contact_patch_filter: self.contact_patch_filter,
        }
    }

    /// Ratio of the sleeper spacing to that of V-Track: the length scale of the track.
    pub fn length_ratio(&self) -> f64 {
        self.sleeper.spacing_m / V_TRACK_SPACING_M
    }

    /// Mass of one half sleeper in kg.
    pub fn sleeper_mass(&self) -> f64 {
        self.sleeper.section.mass_per_length() * self.sleeper.half_length_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_sleeper_of_v_track_weighs_what_table_d1_says() {
        assert!((TrackDesign::v_track().sleeper_mass() - 1.12).abs() < 0.01);
    }

    #[test]
    fn five_times_v_track_has_the_scale_factors_of_table_d1() {
        let small = TrackDesign::v_track();
        let large = small.enlarged(5.0);
        let ratio = |a: f64, b: f64| (b / a).round();
        assert_eq!(ratio(small.sleeper_mass(), large.sleeper_mass()), 125.0);
        assert_eq!(ratio(small.sleeper.spacing_m, large.sleeper.spacing_m), 5.0);
        let stiffness = |d: &TrackDesign| d.rail.bending_stiffness() / d.sleeper.spacing_m.powi(3);
        assert_eq!(ratio(stiffness(&small), stiffness(&large)), 5.0);
    }
}
