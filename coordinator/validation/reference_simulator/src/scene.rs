//! A scene: track, passes, measuring chain and hidden effects. The scene determines the recording
//! completely.
//!
//! This module contains the data and their checks. The module `typical` draws random scenes.

use crate::TruthError;
use crate::assumptions::Assumptions;
use crate::hidden::Hidden;
use crate::nuisances::Nuisances;
use serde::{Deserialize, Serialize};
use tracktwin_parameters::{Preset, TrackDesign};

/// Least distance in spans of what is recorded from the track's ends: room for the run-in.
const END_SPANS: f64 = 4.0;

/// A track with its passes and hidden effects.
///
/// The same scene gives the same recording, to the bit on one machine.
#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Rail, sleepers and vehicle.
    #[serde(default, skip_serializing_if = "is_v_track")]
    pub preset: Preset,
    /// Number of spans of the track; one is as long as the sleeper spacing of the preset.
    pub spans: usize,
    /// Seed of the surface, of the differences between passes and of the noise.
    pub seed: u64,
    /// Level of the irregularity in 1e-4 m2 rad/m (eq. B.6).
    pub irregularity_level: f64,
    /// Rails with a rougher surface. Everywhere else the surface has the level `irregularity_level`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rough_rails: Vec<RoughRail>,
    /// All sleepers, `spans - 1` of them. Sleeper `i`, from 0, is at `(i + 1)` spacings.
    pub sleepers: Vec<SleeperTruth>,
    /// Damping of each railpad in N s/m.
    #[serde(rename = "railpad_damping_N_s_m")]
    pub railpad_damping_n_s_m: f64,
    /// Damping of the ballast under each half sleeper in N s/m.
    #[serde(rename = "ballast_damping_N_s_m")]
    pub ballast_damping_n_s_m: f64,
    /// The passes, in the order of the recording.
    pub passes: Vec<PassPlan>,
    /// Start and end of the recorded stretch in m.
    pub recorded_m: [f64; 2],
    /// Hidden effects.
    #[serde(default)]
    pub left_out: Vec<Hidden>,
    /// Measuring chain.
    pub chain: Chain,
    /// Assumptions on effects, steel and modes.
    #[serde(default, skip_serializing_if = "Assumptions::are_usual")]
    pub assumptions: Assumptions,
    /// Nuisances, which are not hidden effects.
    #[serde(default, skip_serializing_if = "Nuisances::are_none")]
    pub nuisances: Nuisances,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_v_track(preset: &Preset) -> bool {
    *preset == Preset::VTrack
}

/// One sleeper with its railpad and its ballast.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SleeperTruth {
    /// Stiffness `k_p` of the railpad in N/m.
    #[serde(rename = "railpad_stiffness_N_m")]
    pub railpad_stiffness_n_m: f64,
    /// Stiffness `k_b` of the ballast under the half sleeper in N/m.
    #[serde(rename = "ballast_stiffness_N_m")]
    pub ballast_stiffness_n_m: f64,
    /// Bending stiffness `EI_s` of the sleeper in N m2.
    #[serde(rename = "sleeper_EI_N_m2")]
    pub sleeper_ei_n_m2: f64,
}

/// A stretch of the rail with a rougher surface.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RoughRail {
    /// Start and end of the stretch in m.
    pub x_m: [f64; 2],
    /// Ratio of the power of all waves to that of the level of the scene.
    pub level_factor: f64,
    /// Ratio of the power of waves from 0.9 to 5.2 mm to that of eq. B.6 at the level of this rail, at
    /// least 1. At 13 km/h these waves give frequencies from 700 to 4000 Hz (paper, section 5.1 and Fig.
    /// 21).
    pub band_factor: f64,
}

/// One run of the wheel over the track.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PassPlan {
    /// Nominal speed in km/h, which the recording states. The true speed differs slightly.
    pub speed_km_h: f64,
}

/// The measuring chain without its faults.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Chain {
    /// Standard deviation of the white noise in m/s2.
    pub noise_m_s2: f64,
    /// Resolution of the recorded accelerations in m/s2. 0: no rounding.
    pub step_m_s2: f64,
    /// Largest error of the odometer in m.
    pub wander_m: f64,
    /// Standard deviation of the ratio of true to nominal speed.
    pub speed_deviation: f64,
    /// Share of the power of the surface that differs from pass to pass, 0 to 1.
    pub unrepeated: f64,
}

impl Default for Chain {
    /// A measuring chain with carefully installed accelerometer and odometer.
    fn default() -> Self {
        Self {
            noise_m_s2: 0.05,
            step_m_s2: 0.005,
            wander_m: 3e-3,
            speed_deviation: 1e-3,
            unrepeated: 0.05,
        }
    }
}

impl Chain {
    /// An ideal measuring chain: no noise, rounding or odometer error, and equal passes.
    pub const fn ideal() -> Self {
        Self {
            noise_m_s2: 0.0,
            step_m_s2: 0.0,
            wander_m: 0.0,
            speed_deviation: 0.0,
            unrepeated: 0.0,
        }
    }
}

impl Scene {
    /// V-Track with equal sleepers, without hidden effects, and with an ideal measuring chain.
    pub fn uniform(spans: usize, sleeper: SleeperTruth) -> Self {
        let preset = Preset::VTrack;
        let spacing_m = preset.design().sleeper.spacing_m;
        let length_m = spans as f64 * spacing_m;
        Self {
            preset,
            spans,
            seed: 1,
            irregularity_level: 3.0,
            rough_rails: Vec::new(),
            sleepers: vec![sleeper; spans.saturating_sub(1)],
            railpad_damping_n_s_m: 6e3,
            ballast_damping_n_s_m: 900.0,
            passes: vec![PassPlan { speed_km_h: 13.0 }],
            recorded_m: [6.0 * spacing_m, length_m - 6.0 * spacing_m],
            left_out: Vec::new(),
            chain: Chain::ideal(),
            assumptions: Assumptions::default(),
            nuisances: Nuisances::default(),
        }
    }

    /// Sections, masses, spacing and load.
    pub fn design(&self) -> TrackDesign {
        self.preset.design()
    }

    /// Distance of the sleepers in m.
    pub fn spacing_m(&self) -> f64 {
        self.design().sleeper.spacing_m
    }

    /// Length of the track in m.
    pub fn length_m(&self) -> f64 {
        self.spans as f64 * self.spacing_m()
    }

    /// Checks that all numbers are in their ranges and all places are on the track.
    ///
    /// # Errors
    /// [`TruthError`] names the invalid field.
    pub fn check(&self) -> Result<(), TruthError> {
        let length_m = self.length_m();
        if self.sleepers.len() + 1 != self.spans {
            return Err(TruthError::Sleepers { given: self.sleepers.len(), spans: self.spans });
        }
        let [from_m, to_m] = self.recorded_m;
        let spacing_m = self.spacing_m();
        let end_m = END_SPANS * spacing_m;
        if !(end_m <= from_m && from_m + spacing_m <= to_m && to_m <= length_m - end_m) {
            return Err(TruthError::Recorded { from_m, to_m, end_m, length_m });
        }
        if self.passes.is_empty() {
            return Err(TruthError::NoPasses);
        }
        for sleeper in &self.sleepers {
            positive("railpad_stiffness_N_m", sleeper.railpad_stiffness_n_m)?;
            positive("ballast_stiffness_N_m", sleeper.ballast_stiffness_n_m)?;
            positive("sleeper_EI_N_m2", sleeper.sleeper_ei_n_m2)?;
        }
        for pass in &self.passes {
            positive("speed_km_h", pass.speed_km_h)?;
        }
        positive("railpad_damping_N_s_m", self.railpad_damping_n_s_m)?;
        positive("ballast_damping_N_s_m", self.ballast_damping_n_s_m)?;
        not_negative("irregularity_level", self.irregularity_level)?;
        for rail in &self.rough_rails {
            positive("rough_rails.level_factor", rail.level_factor)?;
            not_negative("rough_rails.band_factor - 1", rail.band_factor - 1.0)?;
            positive("rough_rails.x_m[1] - x_m[0]", rail.x_m[1] - rail.x_m[0])?;
        }
        self.chain.check()?;
        self.assumptions.check()?;
        self.nuisances.check()?;
        self.left_out.iter().try_for_each(|hidden| self.check_place(hidden))
    }

    fn check_place(&self, hidden: &Hidden) -> Result<(), TruthError> {
        let on_track = |number: &usize| *number < self.sleepers.len();
        let sleepers = hidden.sleepers().is_none_or(|sleepers| sleepers.iter().all(on_track));
        let place = hidden
            .place(self.spacing_m())
            .is_none_or(|[from_m, to_m]| 0.0 < from_m && from_m <= to_m && to_m < self.length_m());
        if sleepers && place {
            return Ok(());
        }
        let length_m = self.length_m();
        let count = self.sleepers.len();
        Err(TruthError::Place { physics: hidden.physics(), length_m, sleepers: count })
    }
}

impl Chain {
    fn check(&self) -> Result<(), TruthError> {
        not_negative("noise_m_s2", self.noise_m_s2)?;
        not_negative("step_m_s2", self.step_m_s2)?;
        not_negative("wander_m", self.wander_m)?;
        not_negative("speed_deviation", self.speed_deviation)?;
        not_negative("unrepeated", self.unrepeated)?;
        // With more, positions would run backwards somewhere, or the speed change its sign.
        for (field, value, most) in [
            ("wander_m", self.wander_m, 0.05),
            ("speed_deviation", self.speed_deviation, 0.01),
            ("unrepeated", self.unrepeated, 1.0),
        ] {
            if value > most {
                return Err(TruthError::TooLarge { field, value, most });
            }
        }
        Ok(())
    }
}

pub(crate) fn positive(field: &'static str, value: f64) -> Result<(), TruthError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(TruthError::Value { field, value, form: "a positive number" })
}

pub(crate) fn not_negative(field: &'static str, value: f64) -> Result<(), TruthError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(TruthError::Value { field, value, form: "a number from 0 up" })
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// The middle of Table D1.
    pub(crate) const NOMINAL: SleeperTruth = SleeperTruth {
        railpad_stiffness_n_m: 1.5e8,
        ballast_stiffness_n_m: 1.2e7,
        sleeper_ei_n_m2: 5000.0,
    };
}

#[cfg(test)]
mod tests {
    use super::testing::NOMINAL;
    use super::*;

    #[test]
    fn a_scene_survives_its_file() {
        let scene = Scene::uniform(20, NOMINAL);
        let text = serde_json::to_string(&scene).unwrap();
        assert_eq!(serde_json::from_str::<Scene>(&text).unwrap(), scene);
        // A scene of an earlier program is the same file.
        for later in ["preset", "assumptions", "nuisances"] {
            assert!(!text.contains(later), "{text}");
        }
        let assumptions = Assumptions { modes_per_span: 8, ..Assumptions::default() };
        let nuisances = Nuisances { contact_factor: 1.01, ..Nuisances::default() };
        let other = Scene { assumptions, nuisances, ..scene };
        let text = serde_json::to_string(&other).unwrap();
        assert_eq!(serde_json::from_str::<Scene>(&text).unwrap(), other);
    }

    #[test]
    fn what_cannot_be_is_refused_by_its_name() {
        let refused = |change: fn(&mut Scene)| {
            let mut scene = Scene::uniform(20, NOMINAL);
            change(&mut scene);
            scene.check().unwrap_err().to_string()
        };
        assert!(refused(|scene| scene.sleepers[3].sleeper_ei_n_m2 = -1.0).contains("sleeper_EI"));
        assert!(refused(|scene| scene.spans = 25).contains("25 spans"));
        assert!(refused(|scene| scene.passes.clear()).contains("pass"));
        assert!(refused(|scene| scene.recorded_m[1] = 2.4).contains("2.4"));
        assert!(refused(|scene| scene.chain.wander_m = 0.2).contains("wander_m"));
        assert!(
            refused(|scene| {
                let bolt = Hidden::SleeperBolt { sleepers: vec![19], stiffness_n_per_m: 1e7 };
                scene.left_out.push(bolt);
            })
            .contains("sleeper_bolt")
        );
        assert!(
            refused(|scene| {
                let smoother = RoughRail { x_m: [1.0, 2.0], level_factor: 1.0, band_factor: 0.5 };
                scene.rough_rails.push(smoother);
            })
            .contains("band_factor")
        );
        assert!(Scene::uniform(20, NOMINAL).check().is_ok());
    }
}
