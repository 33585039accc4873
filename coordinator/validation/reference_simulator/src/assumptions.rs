//! Assumptions of a simulation that can be chosen in more than one way: shapes of effects, damping of
//! steel, modes.
//!
//! This module contains the choices and their formulas. The data of a scene select among them.

use crate::TruthError;
use crate::scene::{not_negative, positive};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Modes of the rail to a span: the shortest wave is 42 mm long, its frequency some 40 kHz.
const MODES_PER_SPAN: usize = 6;
/// Modes to a span from which the rail is that of the band up to 4 kHz.
const MODES_PER_SPAN_MIN: usize = 4;
/// Damping of steel over critical damping: half of a structural loss factor of 0.2 %.
pub(crate) const STEEL_DAMPING_RATIO: f64 = 1e-3;
/// Largest wave number of a drifting corrugation over its mean, minus one, at its ends.
const DRIFT_MAX: f64 = 0.5;
/// Factor between the relaxation times of two branches and their mean.
const BRANCH_SPREAD: f64 = 3.0;
/// Width of a one-sided dip before and behind its joint, of the length `l`.
const ONE_SIDED: [f64; 2] = [0.1, 1.9];

/// Assumptions of the simulation of a scene. The default is that of the catalogue of extensions.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Assumptions {
    /// Number of modes of the rail per span.
    pub modes_per_span: usize,
    /// Damping ratio of every mode of rail and sleepers.
    pub steel_damping_ratio: f64,
    /// Dip of a rail joint.
    pub joint: JointDip,
    /// Hollow of a squat.
    pub squat: SquatHollow,
    /// Waves of a corrugation.
    pub corrugation: Waves,
    /// Ballast under a hanging sleeper.
    pub void: Void,
    /// Maxwell branches of a railpad that depends on frequency, 1 or 2.
    pub relaxation_branches: usize,
}

impl Default for Assumptions {
    fn default() -> Self {
        Self {
            modes_per_span: MODES_PER_SPAN,
            steel_damping_ratio: STEEL_DAMPING_RATIO,
            joint: JointDip::default(),
            squat: SquatHollow::default(),
            corrugation: Waves::default(),
            void: Void::default(),
            relaxation_branches: 1,
        }
    }
}

/// Shape of the dip of a joint of depth `d` and length `l`. All shapes have the area `2 d l`.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum JointDip {
    /// `d exp(-|s| / l)`.
    #[default]
    Exponential,
    /// `d (1 - s² / w²)` with `w = 1.5 l`.
    Parabola,
    /// `d (1 - |s| / w)` with `w = 2 l`.
    V,
    /// `d exp(-|s| / w)` with `w = 0.1 l` before the joint and `w = 1.9 l` behind it.
    OneSided,
}

impl JointDip {
    /// Depth at a distance behind the joint, over its greatest; both lengths in m.
    pub(crate) fn at(self, behind_m: f64, length_m: f64) -> f64 {
        match self {
            Self::Exponential => (-behind_m.abs() / length_m).exp(),
            Self::Parabola => (1.0 - (behind_m / (1.5 * length_m)).powi(2)).max(0.0),
            Self::V => (1.0 - behind_m.abs() / (2.0 * length_m)).max(0.0),
            Self::OneSided => {
                let width = ONE_SIDED[usize::from(behind_m >= 0.0)];
                (-behind_m.abs() / (width * length_m)).exp()
            }
        }
    }
}

/// Shape of the hollow of a squat of depth `d` and length `l`. Both shapes have the area `d l / 2`.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum SquatHollow {
    /// `d/2 (1 + cos 2 pi s / l)` within half the length on both sides.
    #[default]
    Cosine,
    /// `d exp(-4 pi (s / l)²)`.
    Gaussian,
}

impl SquatHollow {
    /// Depth at a distance from the middle in lengths, over its greatest.
    pub(crate) fn at(self, place: f64) -> f64 {
        match self {
            Self::Cosine if place.abs() < 0.5 => 0.5 * (1.0 + (TAU * place).cos()),
            Self::Cosine => 0.0,
            Self::Gaussian => (-2.0 * TAU * place * place).exp(),
        }
    }
}

/// Waves `sin p + h sin 2 p` whose wave number increases linearly over the stretch.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Waves {
    /// Difference of the wave numbers at end and start, divided by their mean.
    pub drift: f64,
    /// Ratio `h` of the amplitude of the second harmonic to that of the first.
    pub harmonic: f64,
}

impl Waves {
    /// Height at a place of a stretch over the amplitude, all lengths in m.
    pub(crate) fn at(self, x_m: f64, [from_m, to_m]: [f64; 2], wavelength_m: f64) -> f64 {
        // A stretch shorter than a wave has no room to drift.
        let length_m = (to_m - from_m).max(wavelength_m);
        let way = (x_m - from_m) / length_m;
        let ahead_m = 0.5 * self.drift * length_m * way * (way - 1.0);
        let phase = TAU * x_m / wavelength_m + TAU * ahead_m / wavelength_m;
        phase.sin() + self.harmonic * (2.0 * phase).sin()
    }
}

/// Ballast under a hanging sleeper.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Void {
    /// Share of the ballast damping that also acts while the gap is open, 0 to 1.
    pub damping_share: f64,
    /// Whether the gap is too deep to close.
    pub stays_open: bool,
}

impl Assumptions {
    /// Whether these are the usual ones.
    pub(crate) fn are_usual(&self) -> bool {
        *self == Self::default()
    }

    /// Ratios of stiffness and relaxation times in s of the branches of a railpad with one of this
    /// ratio and time; they add up to its ratio, and their times have its geometric mean.
    pub(crate) fn branches(&self, ratio: f64, time_s: f64) -> Vec<[f64; 2]> {
        if self.relaxation_branches == 2 {
            return [time_s / BRANCH_SPREAD, time_s * BRANCH_SPREAD]
                .map(|t| [0.5 * ratio, t])
                .into();
        }
        vec![[ratio, time_s]]
    }

    /// That each can be.
    pub(crate) fn check(&self) -> Result<(), TruthError> {
        positive("steel_damping_ratio", self.steel_damping_ratio)?;
        not_negative("corrugation.harmonic", self.corrugation.harmonic)?;
        not_negative("void.damping_share", self.void.damping_share)?;
        let modes = self.modes_per_span as f64;
        not_negative("modes_per_span - 4", modes - MODES_PER_SPAN_MIN as f64)?;
        positive("relaxation_branches", self.relaxation_branches as f64)?;
        for (field, value, most) in [
            ("relaxation_branches", self.relaxation_branches as f64, 2.0),
            ("corrugation.drift", self.corrugation.drift.abs(), DRIFT_MAX),
            ("corrugation.harmonic", self.corrugation.harmonic, 1.0),
            ("void.damping_share", self.void.damping_share, 1.0),
            ("steel_damping_ratio", self.steel_damping_ratio, 0.1),
        ] {
            if value > most {
                return Err(TruthError::TooLarge { field, value, most });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integral over 0.8 m around zero.
    fn area(height: impl Fn(f64) -> f64) -> f64 {
        let step = 1e-6;
        (-400_000..400_000).map(|index| step * height((f64::from(index) + 0.5) * step)).sum()
    }

    #[test]
    fn every_dip_is_its_formula_and_has_the_area_of_the_exponential() {
        let length = 0.02;
        for (dip, behind_m, exact) in [
            (JointDip::Exponential, -0.02, (-1.0_f64).exp()),
            (JointDip::Parabola, 0.015, 0.75),
            (JointDip::Parabola, -0.031, 0.0),
            (JointDip::V, -0.01, 0.75),
            (JointDip::V, 0.041, 0.0),
            (JointDip::OneSided, 0.038, (-1.0_f64).exp()),
            (JointDip::OneSided, -0.002, (-1.0_f64).exp()),
        ] {
            assert!((dip.at(behind_m, length) - exact).abs() < 1e-12, "{dip:?} {behind_m}");
            assert_eq!(dip.at(0.0, length), 1.0);
            let area = area(|s| dip.at(s, length));
            assert!((area / (2.0 * length) - 1.0).abs() < 2e-3, "{dip:?}: {area}");
        }
    }

    #[test]
    fn both_hollows_are_as_deep_and_as_large() {
        for hollow in [SquatHollow::Cosine, SquatHollow::Gaussian] {
            assert_eq!(hollow.at(0.0), 1.0);
            let area = area(|s| hollow.at(s / 0.02)) / 0.02;
            assert!((area - 0.5).abs() < 1e-3, "{hollow:?}: {area}");
        }
        assert_eq!(SquatHollow::Cosine.at(0.25), 0.5);
        assert!((SquatHollow::Gaussian.at(0.5) - (-std::f64::consts::PI).exp()).abs() < 1e-15);
    }

    #[test]
    fn drifting_waves_are_longer_at_the_begin_and_shorter_at_the_end_and_keep_their_count() {
        let (stretch, length) = ([1.0, 2.0], 0.01);
        let waves = Waves { drift: 0.2, harmonic: 0.0 };
        // Zeros upwards: so many a metre is the local wave number over a turn.
        let count = |from_m: f64, to_m: f64| {
            let at = |index: f64| waves.at(from_m + 1e-5 * index, stretch, length);
            let steps = ((to_m - from_m) / 1e-5) as usize;
            (0..steps).filter(|&n| at(n as f64) < 0.0 && at(n as f64 + 1.0) >= 0.0).count() as f64
        };
        assert!((count(1.0, 2.0) - 100.0).abs() <= 1.0);
        assert!((count(1.0, 1.25) - 25.0 * 0.925).abs() <= 1.0);
        assert!((count(1.75, 2.0) - 25.0 * 1.075).abs() <= 1.0);
        let with = Waves { drift: 0.0, harmonic: 0.3 };
        let place = 1.0 + length / 8.0;
        let exact = 0.5_f64.sqrt() + 0.3;
        assert!((with.at(place, stretch, length) - exact).abs() < 1e-9);
    }

    #[test]
    fn usual_waves_are_a_sine_to_the_bit() {
        for x_m in [1.001, 1.2345, 1.9] {
            let sine = (TAU * x_m / 8e-3).sin();
            assert_eq!(Waves::default().at(x_m, [1.0, 2.0], 8e-3), sine);
        }
    }

    #[test]
    fn branches_share_a_stiffness_around_one_time() {
        let two = Assumptions { relaxation_branches: 2, ..Assumptions::default() };
        let [[a, early], [b, late]] = two.branches(0.8, 3e-4)[..] else { panic!("not two") };
        assert_eq!(a + b, 0.8);
        assert!(((early * late).sqrt() / 3e-4 - 1.0).abs() < 1e-12 && early < late);
        assert_eq!(Assumptions::default().branches(0.8, 3e-4), [[0.8, 3e-4]]);
    }

    #[test]
    fn what_cannot_be_assumed_is_refused_by_its_name() {
        let refused = |change: fn(&mut Assumptions)| {
            let mut assumptions = Assumptions::default();
            change(&mut assumptions);
            assumptions.check().unwrap_err().to_string()
        };
        assert!(Assumptions::default().check().is_ok());
        assert!(refused(|it| it.modes_per_span = 3).contains("modes_per_span"));
        assert!(refused(|it| it.relaxation_branches = 3).contains("relaxation_branches"));
        assert!(refused(|it| it.void.damping_share = 1.5).contains("damping_share"));
        assert!(refused(|it| it.corrugation.drift = -0.9).contains("drift"));
        assert!(refused(|it| it.steel_damping_ratio = 0.0).contains("steel_damping_ratio"));
    }
}
