//! One pass: the wheel rolls over the track.

use crate::contact::Contact;
use crate::defect::{Tread, smooth};
use crate::random::{Random, Topic};
use crate::scheme::{NEW, STEP_S};
use crate::surface::Surface;
use crate::track::Track;
use crate::vehicle::Vehicle;
use tracktwin_reference_simulator::{Scene, TruthError};

/// Distance in m before the recorded stretch.
const RUN_IN_M: f64 = 0.4;
/// Way in m over which the surface rises from a plane as the wheel sets off.
const FADE_M: f64 = 0.15;
/// Lowest and highest factor between true and stated speed.
const SPEED_FACTORS: [f64; 2] = [0.95, 1.05];

/// What a scene's passes have in common.
#[derive(Debug)]
pub(crate) struct Rig {
    /// At rest.
    pub(crate) track: Track,
    /// At rest.
    pub(crate) vehicle: Vehicle,
    pub(crate) contact: Contact,
    pub(crate) tread: Tread,
    pub(crate) load_n: f64,
}

/// What the wheel did in a pass, one value a step.
#[derive(Clone, Debug)]
pub(crate) struct Ride {
    /// True position in m.
    pub(crate) position_m: Vec<f64>,
    /// Acceleration of the axle box in m/s2, downwards.
    pub(crate) acceleration_m_s2: Vec<f64>,
    /// First step that is recorded.
    pub(crate) first: usize,
}

impl Rig {
    /// Rolls the wheel over the scene in pass `pass`.
    ///
    /// # Errors
    /// [`TruthError::Diverged`] if the motion becomes NaN or infinite.
    pub(crate) fn ride(
        &self,
        scene: &Scene,
        surface: &Surface,
        pass: usize,
    ) -> Result<Ride, TruthError> {
        let mut random = Random::new(scene.seed, Topic::Pass, pass);
        let [least, most] = SPEED_FACTORS;
        let factor = (1.0 + scene.chain.speed_deviation * random.normal()).clamp(least, most);
        let speed = scene.passes[pass].speed_km_h / 3.6 * factor;
        let angle = random.angle();
        let [from_m, to_m] = scene.recorded_m;
        // The first sample falls anywhere within a step.
        let start_m = from_m - RUN_IN_M - random.between(0.0, 1.0) * speed * STEP_S;

        let (mut track, mut vehicle) = (self.track.clone(), self.vehicle.clone());
        let rail_m = track.rest_under(start_m, self.load_n);
        let depth = |x_m: f64| {
            let way_m = x_m - start_m;
            let rough = surface.at(x_m) - surface.at(start_m);
            let tread = self.tread.depth_m(angle + self.tread.turned(way_m));
            smooth(way_m / FADE_M) * (rough + tread)
        };
        vehicle.rest_at(rail_m + self.contact.approach_m(self.load_n));

        let steps = ((to_m - start_m) / (speed * STEP_S)).ceil() as usize;
        let mut ride = Ride {
            position_m: Vec::with_capacity(steps),
            acceleration_m_s2: Vec::with_capacity(steps),
            first: 0,
        };
        let mut last_n = self.load_n;
        for step in 1..=steps {
            let x_m = start_m + step as f64 * speed * STEP_S;
            let place = track.place(x_m);
            let under = track.begin(&place);
            let [wheel_m, lift] = vehicle.begin();
            let known_n = (1.0 - NEW) * last_n;
            let reach = lift + under.compliance;
            let free_m = wheel_m - under.free_m - depth(x_m) - reach * known_n;
            last_n = self.contact.force_n(free_m, NEW * reach + place.flexibility);
            let mean_n = NEW * last_n + known_n;
            track.end(mean_n);
            let acceleration = vehicle.end(mean_n);
            if !acceleration.is_finite() {
                return Err(TruthError::Diverged { position_m: x_m });
            }
            ride.first += usize::from(x_m < from_m);
            ride.position_m.push(x_m);
            ride.acceleration_m_s2.push(acceleration);
        }
        Ok(ride)
    }
}
