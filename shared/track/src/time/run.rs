//! Definition and record of a pass.

use crate::model::{Surface, TrackModel};

/// Time in s over which the irregularity increases from zero at the start, to avoid a step under the
/// wheel.
const RAMP_S: f64 = 2e-3;

/// One run of the wheel over the track at constant speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// Speed in m/s.
    pub speed_m_s: f64,
    /// Start position of the wheel in m. The wheel starts in static equilibrium.
    pub start_m: f64,
    /// End position of the wheel in m.
    pub end_m: f64,
    /// Time step in s.
    pub time_step_s: f64,
    /// Whether the contact includes the local flexibility inside the loaded rail element.
    ///
    /// Without this flexibility the scheme is that of the paper, and the mesh acts as a false roughness
    /// of the rail.
    pub local_flexibility: bool,
}

/// What a pass records: a sample at the start and one after every time step.
#[derive(Clone, Debug, PartialEq)]
pub struct PassRecord {
    /// Time between samples in s.
    pub time_step_s: f64,
    /// Position of the first sample in m.
    pub start_m: f64,
    /// Speed in m/s.
    pub speed_m_s: f64,
    /// Axle-box acceleration, that of the wheel, in m/s2, positive downwards.
    pub acceleration_m_s2: Vec<f64>,
    /// Contact force in N, positive in compression.
    pub contact_force_n: Vec<f64>,
}

impl PassRecord {
    /// Position of the wheel in m at sample `index`.
    pub fn position_m(&self, index: usize) -> f64 {
        self.start_m + index as f64 * self.speed_m_s * self.time_step_s
    }

    /// Share of the samples from `first` on, 0 to 1, at which the wheel does not touch the rail: the contact
    /// force is zero. 0 where there are no samples.
    pub fn contact_loss_share(&self, first: usize) -> f64 {
        let forces = self.contact_force_n.get(first..).unwrap_or_default();
        let lost = forces.iter().filter(|&&force_n| force_n <= 0.0).count();
        lost as f64 / forces.len().max(1) as f64
    }
}

/// Why a pass cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PassError {
    /// A wheel leaves the track, or speed, distance or time step are not positive.
    #[error(
        "a pass from {} to {} m at {} m/s exceeds the track of {length_m} m with at least \
             one wheel",
        pass.start_m,
        pass.end_m,
        pass.speed_m_s
    )]
    Pass {
        /// The pass.
        pass: Pass,
        /// Length of the track in m.
        length_m: f64,
    },
    /// The stiffness or inertia matrix is not positive definite: a part of the track is unsupported.
    #[error("the stiffness matrix of the track is not positive definite (unsupported track?)")]
    Unstable,
    /// The force laws of the track have no equilibrium under the standing vehicle that an iteration finds.
    #[error(
        "no equilibrium was found under the vehicle at {position_m} m: too many sleepers hang over gaps, or railpads \
         cannot carry the load; take fewer sleepers or smaller gaps"
    )]
    NoEquilibrium {
        /// Position of the first wheel in m.
        position_m: f64,
    },
    /// The contact force became NaN or infinite.
    #[error("the contact force is not a number at {position_m} m")]
    NotFinite {
        /// Position of the wheel in m.
        position_m: f64,
    },
    /// The number of surfaces differs from the number of track models.
    #[error("{models} tracks need {models} surfaces, not {surfaces}")]
    Surfaces {
        /// Number of given track models.
        models: usize,
        /// Number of given surfaces.
        surfaces: usize,
    },
}

impl Pass {
    /// Number of time steps: as many as fit between start and end.
    pub fn steps(&self) -> usize {
        let steps = (self.end_m - self.start_m) / (self.speed_m_s * self.time_step_s);
        // A millionth of a step may be missing by rounding.
        (steps + 1e-6).floor() as usize
    }

    /// Position of the wheel in m after `step` time steps.
    pub fn position_m(&self, step: usize) -> f64 {
        self.start_m + self.speed_m_s * self.time_step_s * step as f64
    }

    /// Height in m of the surface under the wheel after `step` time steps, with the profiles of
    /// extensions. A ramp of [`RAMP_S`] starts from the height at the first sample.
    pub(super) fn height_m(&self, model: &TrackModel, surface: &Surface, step: usize) -> f64 {
        let height = |x_m: f64| surface.height(x_m) + model.felt_profile_m(x_m);
        self.eased_in(step, height)
    }

    /// Height in m under a further wheel, `ahead_m` ahead of the first. A further wheel is round.
    pub(super) fn further_height_m(
        &self,
        model: &TrackModel,
        surface: &Surface,
        step: usize,
        ahead_m: f64,
    ) -> f64 {
        let height =
            |x_m: f64| surface.height(x_m + ahead_m) + model.felt_rail_profile_m(x_m + ahead_m);
        self.eased_in(step, height)
    }

    /// The heights under the first wheel at the start and after every step.
    pub(super) fn heights_m(&self, model: &TrackModel, surface: &Surface) -> Vec<f64> {
        let height = |x_m: f64| surface.height(x_m) + model.felt_profile_m(x_m);
        let first = height(self.start_m);
        (0..=self.steps()).map(|step| self.eased(step, first, height)).collect()
    }

    fn eased_in(&self, step: usize, height: impl Fn(f64) -> f64) -> f64 {
        self.eased(step, height(self.start_m), height)
    }

    fn eased(&self, step: usize, first: f64, height: impl Fn(f64) -> f64) -> f64 {
        let time = (self.time_step_s * step as f64 / RAMP_S).min(1.0);
        let ramp = time * time * (3.0 - 2.0 * time);
        first + ramp * (height(self.position_m(step)) - first)
    }

    /// Checks that the pass lies on the track and goes forward.
    pub(super) fn check(&self, model: &TrackModel) -> Result<(), PassError> {
        let length_m = model.layout().length_m();
        let wheels = [0.0].into_iter().chain(model.vehicle().further_wheels_m.iter().copied());
        let on_track = |ahead: f64| 0.0 <= self.start_m + ahead && self.end_m + ahead <= length_m;
        let forward = self.speed_m_s > 0.0 && self.time_step_s > 0.0 && self.speed_m_s.is_finite();
        if forward && self.start_m < self.end_m && wheels.into_iter().all(on_track) {
            Ok(())
        } else {
            Err(PassError::Pass { pass: self.clone(), length_m })
        }
    }
}

impl PassRecord {
    pub(super) fn start(pass: &Pass, load_n: f64) -> Self {
        let samples = pass.steps() + 1;
        let mut record = Self {
            time_step_s: pass.time_step_s,
            start_m: pass.start_m,
            speed_m_s: pass.speed_m_s,
            acceleration_m_s2: Vec::with_capacity(samples),
            contact_force_n: Vec::with_capacity(samples),
        };
        record.push(0.0, load_n);
        record
    }

    pub(super) fn push(&mut self, acceleration_m_s2: f64, contact_force_n: f64) {
        self.acceleration_m_s2.push(acceleration_m_s2);
        self.contact_force_n.push(contact_force_n);
    }
}
