//! Shapes of hidden defects on rail and wheel.
//!
//! This module computes the depth of the surface below its ideal in m, positive downwards.

use crate::random::{Random, Topic};
use std::f64::consts::{PI, TAU};
use tracktwin_reference_simulator::{Hidden, Scene};

/// Half length of a joint's dip over its length scale.
const JOINT_REACH: f64 = 2.5;
/// Standard deviation of a squat's hollow over its length: as wide at half its depth as a cosine.
const SQUAT_WIDTH: f64 = 0.212;
/// Relative drift of corrugation's wavelength, and waves over which it drifts to and fro.
const DRIFT: [f64; 2] = [0.03, 17.0];
/// Amplitude of corrugation's second harmonic over that of the first.
const HARMONIC: f64 = 0.2;
/// Waves over which corrugation begins and ends.
const FADE_WAVES: f64 = 2.0;
/// Amplitude of the order that comes with an out-of-round wheel's, one higher, over it.
const NEXT_ORDER: f64 = 0.1;

/// Depth of a hidden defect of the rail at `x_m`; `phase` in rad is where corrugation's drift begins.
pub(crate) fn rail_depth_m(hidden: &Hidden, phase: f64, x_m: f64) -> f64 {
    match *hidden {
        // Rail ends bent down: two parabolas that meet in a kink.
        Hidden::RailJoint { x_m: [at, _], dip_m, length_m, .. } => {
            let rest = (1.0 - (x_m - at).abs() / (JOINT_REACH * length_m)).max(0.0);
            dip_m * rest * rest
        }
        Hidden::Squat { x_m: [at, _], depth_m, length_m } => {
            let way = (x_m - at) / (SQUAT_WIDTH * length_m);
            depth_m * (-0.5 * way * way).exp()
        }
        Hidden::Corrugation { x_m: [from, to], wavelength_m, amplitude_m } => {
            let inside = (x_m - from).min(to - x_m) / (FADE_WAVES * wavelength_m);
            if inside <= 0.0 {
                return 0.0;
            }
            let fade = smooth(inside);
            let waves = (x_m - from) / wavelength_m;
            let [drift, period] = DRIFT;
            let angle = TAU * waves + drift * period * (TAU * waves / period + phase).sin();
            amplitude_m * fade * (angle.sin() + HARMONIC * (2.0 * angle).cos())
        }
        _ => 0.0,
    }
}

/// Where corrugation's drift begins, in rad.
pub(crate) fn drift_phase(scene: &Scene) -> f64 {
    Random::new(scene.seed, Topic::Drift, 0).angle()
}

/// From 0 to 1 along a cosine.
pub(crate) fn smooth(share: f64) -> f64 {
    0.5 - 0.5 * (PI * share.clamp(0.0, 1.0)).cos()
}

/// The tread: its depth below the rolling circle.
#[derive(Clone, Debug)]
pub(crate) struct Tread {
    radius_m: f64,
    /// Order, amplitude in m, phase in rad.
    orders: Vec<(f64, f64, f64)>,
    /// Lengths in m.
    flats: Vec<f64>,
}

impl Tread {
    /// Of a wheel with small waves `orders`, from the first order up, and hidden defects.
    pub(crate) fn new(left_out: &[Hidden], orders: &[[f64; 2]], radius_m: f64) -> Self {
        let small = (1..).zip(orders);
        let mut orders: Vec<_> =
            small.map(|(n, &[amplitude, phase])| (f64::from(n), amplitude, phase)).collect();
        let mut flats = Vec::new();
        for hidden in left_out {
            match *hidden {
                Hidden::WheelOutOfRound { order, amplitude_m } => {
                    let order = f64::from(order);
                    orders.push((order, amplitude_m, 0.0));
                    orders.push((order + 1.0, NEXT_ORDER * amplitude_m, 0.0));
                }
                Hidden::WheelFlat { length_m } => flats.push(length_m),
                _ => {}
            }
        }
        Self { radius_m, orders, flats }
    }

    /// Angle in rad by which the wheel turns on a way in m.
    pub(crate) fn turned(&self, way_m: f64) -> f64 {
        way_m / self.radius_m
    }

    /// Depth in m at an angle in rad; flats lie at 0.
    pub(crate) fn depth_m(&self, angle: f64) -> f64 {
        let orders = self.orders.iter();
        let waves =
            orders.map(|&(order, amplitude, phase)| amplitude * (order * angle + phase).cos());
        let way = (angle - TAU * (angle / TAU).round()) * self.radius_m;
        let flats = self.flats.iter().map(|&length| flat_m(way, length, self.radius_m));
        waves.sum::<f64>() + flats.sum::<f64>()
    }
}

/// A flat whose edges are worn round, deepest in its middle.
fn flat_m(way_m: f64, length_m: f64, radius_m: f64) -> f64 {
    let share = 2.0 * way_m / length_m;
    let inside = (1.0 - share * share).max(0.0);
    length_m * length_m / (16.0 * radius_m) * inside * inside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dips_are_as_deep_as_they_say_and_end() {
        let joint = Hidden::RailJoint {
            x_m: [2.0, 2.0],
            dip_m: 8e-5,
            length_m: 0.02,
            bending_factor: 0.2,
            bending_length_m: 0.025,
        };
        let squat = Hidden::Squat { x_m: [2.0, 2.0], depth_m: 1e-4, length_m: 0.03 };
        for (hidden, depth) in [(joint, 8e-5), (squat, 1e-4)] {
            assert!((rail_depth_m(&hidden, 0.0, 2.0) / depth - 1.0).abs() < 1e-12);
            assert!(rail_depth_m(&hidden, 0.0, 2.06) < 1e-8);
        }
        assert!((flat_m(0.0, 0.01, 0.065) - 1e-4 / 1.04).abs() < 1e-12);
        assert_eq!(flat_m(0.006, 0.01, 0.065), 0.0);
    }

    #[test]
    fn the_wavelength_of_corrugation_drifts_by_a_few_per_cent() {
        let waves = Hidden::Corrugation { x_m: [1.0, 2.0], wavelength_m: 0.01, amplitude_m: 1e-6 };
        let depth = |x: f64| rail_depth_m(&waves, 1.0, x);
        let grid = (0..500_000).map(|i| 1.0 + f64::from(i) * 2e-6);
        let crossings: Vec<f64> =
            grid.filter(|&x| depth(x) < 0.2e-6 && depth(x + 2e-6) >= 0.2e-6).collect();
        let lengths: Vec<f64> = crossings.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let inner = &lengths[3..lengths.len() - 3];
        let longest = inner.iter().copied().fold(0.0, f64::max);
        let shortest = inner.iter().copied().fold(1.0, f64::min);
        assert!((1.01e-2..1.05e-2).contains(&longest), "{longest}");
        assert!((0.95e-2..0.99e-2).contains(&shortest), "{shortest}");
    }
}
