//! One pass: the wheels roll over the track.

use crate::contact::Contact;
use crate::defect::{Tread, smooth};
use crate::rail::Place;
use crate::random::{Random, Topic};
use crate::scale::Scale;
use crate::scheme::{NEW, STEP_S};
use crate::surface::Surface;
use crate::track::Track;
use crate::vehicle::Vehicle;
use tracktwin_reference_simulator::{Scene, TruthError};

/// Lowest and highest factor between true and stated speed.
const SPEED_FACTORS: [f64; 2] = [0.95, 1.05];

/// What a scene's passes have in common.
#[derive(Debug)]
pub(crate) struct Rig {
    /// At rest.
    pub(crate) track: Track,
    /// Wheels on the rail in the order of their places.
    pub(crate) wheels: Vec<RigWheel>,
    pub(crate) contact: Contact,
    /// Load of every wheel in N.
    pub(crate) load_n: f64,
    pub(crate) scale: Scale,
}

/// A wheel.
#[derive(Clone, Debug)]
pub(crate) struct RigWheel {
    /// Place ahead of the recorded wheel in m; 0 for the recorded one.
    pub(crate) ahead_m: f64,
    /// At rest.
    pub(crate) vehicle: Vehicle,
    pub(crate) tread: Tread,
}

/// What the recorded wheel did in a pass, one value a step.
#[derive(Clone, Debug)]
pub(crate) struct Ride {
    /// True position in m.
    pub(crate) position_m: Vec<f64>,
    /// Acceleration of the axle box in m/s2, downwards.
    pub(crate) acceleration_m_s2: Vec<f64>,
    /// First step that is recorded. Behind the last one are as many as the recorder's filter needs.
    pub(crate) first: usize,
}

/// Way of the recorded wheel in a pass.
struct Way {
    start_m: f64,
    speed_m_s: f64,
    /// Change of the speed from begin to end, of its mean.
    drift: f64,
    /// Whole way in m.
    whole_m: f64,
}

impl Way {
    /// Place at a step's end in m.
    fn at(&self, step: usize) -> f64 {
        let even_m = step as f64 * self.speed_m_s * STEP_S;
        self.start_m + even_m * (1.0 + 0.5 * self.drift * (even_m / self.whole_m - 1.0))
    }
}

/// A wheel in motion.
struct Rolling<'a> {
    of: &'a RigWheel,
    vehicle: Vehicle,
    /// Angle in rad at the start.
    angle: f64,
    /// Contact force in N at the end of the last step.
    last_n: f64,
}

impl Rig {
    /// Rolls the wheels over the scene in pass `pass`.
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
        let speed_m_s = scene.passes[pass].speed_km_h / 3.6 * factor;
        let angle = random.angle();
        let [from_m, to_m] = scene.recorded_m;
        // The first sample falls anywhere within a step.
        let start_m = from_m - self.scale.run_in_m - random.between(0.0, 1.0) * speed_m_s * STEP_S;
        let drift = self.scale.speed_drift;
        let drift = random.between(-drift, drift);
        let way = Way { start_m, speed_m_s, drift, whole_m: to_m - start_m };
        let mut angles = vec![angle; self.wheels.len()];
        for (angle, wheel) in angles.iter_mut().zip(&self.wheels) {
            if wheel.ahead_m != 0.0 {
                *angle = random.angle();
            }
        }
        let (mut track, mut wheels) = self.at_rest(start_m, &angles);
        let steps = ((to_m - start_m) / (speed_m_s * STEP_S)).ceil() as usize;
        let steps = steps + self.scale.steps_beyond();
        let mut ride = Ride {
            position_m: Vec::with_capacity(steps),
            acceleration_m_s2: Vec::with_capacity(steps),
            first: 0,
        };
        for step in 1..=steps {
            let x_m = way.at(step);
            let acceleration = self.step(&mut track, &mut wheels, surface, [start_m, x_m]);
            if !acceleration.is_finite() {
                return Err(TruthError::Diverged { position_m: x_m });
            }
            ride.first += usize::from(x_m < from_m);
            ride.position_m.push(x_m);
            ride.acceleration_m_s2.push(acceleration);
        }
        Ok(ride)
    }

    /// Track and wheels at rest, the recorded wheel at a place in m and the wheels at these angles.
    fn at_rest(&self, start_m: f64, angles: &[f64]) -> (Track, Vec<Rolling<'_>>) {
        let mut track = self.track.clone();
        let places: Vec<Place> =
            self.wheels.iter().map(|wheel| track.place(start_m + wheel.ahead_m)).collect();
        let rails_m = track.rest_under(&places, self.load_n);
        let approach_m = self.contact.approach_m(self.load_n);
        let wheels = self.wheels.iter().zip(rails_m).zip(angles);
        let rolling = wheels.map(|((of, rail_m), &angle)| {
            let mut vehicle = of.vehicle.clone();
            vehicle.rest_at(rail_m + approach_m);
            Rolling { of, vehicle, angle, last_n: self.load_n }
        });
        (track, rolling.collect())
    }

    /// One step of a pass that began with the recorded wheel at `start_m` and brings it to `x_m`. Returns the
    /// acceleration of its axle box in m/s2, downwards.
    fn step(
        &self,
        track: &mut Track,
        wheels: &mut [Rolling<'_>],
        surface: &Surface,
        [start_m, x_m]: [f64; 2],
    ) -> f64 {
        let way_m = x_m - start_m;
        let places: Vec<Place> =
            wheels.iter().map(|wheel| track.place(x_m + wheel.of.ahead_m)).collect();
        track.begin(&places);
        let force = |(wheel, place): (&mut Rolling<'_>, &Place)| {
            let ahead_m = wheel.of.ahead_m;
            let rough = surface.at(x_m + ahead_m) - surface.at(start_m + ahead_m);
            let tread = &wheel.of.tread;
            let depth_m = smooth(way_m / self.scale.fade_m)
                * (rough + tread.depth_m(wheel.angle + tread.turned(way_m)));
            let under = track.under(place);
            let [wheel_m, lift] = wheel.vehicle.begin();
            let known_n = (1.0 - NEW) * wheel.last_n;
            let reach = lift + under.compliance;
            let free_m = wheel_m - under.free_m - depth_m - reach * known_n;
            wheel.last_n = self.contact.force_n(free_m, NEW * reach + place.flexibility);
            NEW * wheel.last_n + known_n
        };
        let forces_n: Vec<f64> = wheels.iter_mut().zip(&places).map(force).collect();
        track.end(&places, &forces_n);
        let mut heard = 0.0;
        for (wheel, force_n) in wheels.iter_mut().zip(forces_n) {
            let acceleration = wheel.vehicle.end(force_n);
            if wheel.of.ahead_m == 0.0 {
                heard = acceleration;
            }
        }
        heard
    }
}
