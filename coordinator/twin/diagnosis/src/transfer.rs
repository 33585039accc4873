//! Transfer from the surface under the wheel to the recorded acceleration.

use crate::further_wheels::FurtherWheels;
use crate::profile::{Shape, Tone, WheelTurns};
use crate::section::{Section, Window};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;
use tracktwin_track::frequency::{
    KnownRail, RailReceptances, SeatReceptances, StateReceptances, receptances_ahead,
};
use tracktwin_track::model::{HertzContact, TrackModel};

/// Transfer of a track with its extensions, at all spectral lines and all rail nodes.
pub(crate) struct Transfer {
    /// Squared ratio of recorded acceleration to surface height in 1/s4: `[line][node]`.
    pub(crate) power: Vec<Vec<f64>>,
    /// Dynamic stiffness of contact, rail and vehicle in series in N/m: `[line][node]`.
    pub(crate) stiffness: Vec<Vec<Complex64>>,
    /// Square roots of the sensitivities of the power at a node to the dynamic stiffness at a nearby rail
    /// seat, `[line][sleeper]`. The change of the power is the real part of the squared root times the
    /// change of stiffness. Empty unless requested.
    by_seats: Vec<Vec<SeatReceptances>>,
    /// Receptance of the wheel in m/N at each line.
    wheel_receptance: Vec<Complex64>,
    /// Shapes that extensions give the rail.
    pub(crate) rail: Vec<Shape>,
    /// Shape of the wheel in each pass, `[speed][pass]`; empty for a round wheel.
    pub(crate) wheel: Vec<Vec<Shape>>,
    /// Index of each further wheel, and the shape of the rail under it as a function of the first wheel's
    /// position.
    pub(crate) rail_elsewhere: Vec<(usize, Shape)>,
    /// Effect of the further wheels.
    further_wheels: Arc<FurtherWheels>,
    /// Direct receptances of the rail in m/N: `[line][node]`.
    direct: Arc<Vec<Vec<Complex64>>>,
    model: TrackModel,
    /// Data from which the receptances of slightly different tracks follow, and the reach of a difference
    /// in nodes; `None` before [`Transfer::with_known_rail`].
    known_rail: Option<Arc<(KnownRail, usize)>>,
    /// Receptances in each state of the force laws, if there are any.
    by_state: Option<Arc<StateReceptances>>,
}

impl Transfer {
    /// Computes the transfer of a model at these lines in Hz. With `reach` it includes the data for
    /// derivatives, for `reach` nodes on either side of each rail seat.
    pub(crate) fn new(model: TrackModel, lines_hz: &[f64], reach: Option<usize>) -> Self {
        let RailReceptances { direct, from_seats, by_state } =
            RailReceptances::new(&model, lines_hz, reach);
        let on_rail = Self::on_rail(model, lines_hz, Arc::new(direct), None, None);
        Self { by_state, ..on_rail }.with_seats(from_seats)
    }

    /// Adds receptances from the rail seats in m/N, `[line][sleeper]`.
    ///
    /// `d alpha = -alpha_seat^2 dZ`, hence `d |H|^2 = 2 |H|^2 Re(k alpha_seat^2 dZ)`. For a stiffness
    /// between two seats, `alpha_seat` is the difference of their receptances.
    fn with_seats(self, mut from_seats: Vec<Vec<SeatReceptances>>) -> Self {
        for (line, seats) in from_seats.iter_mut().enumerate() {
            let nodes = self.power[line].iter().zip(&self.stiffness[line]);
            let roots: Vec<Complex64> = nodes.map(|(power, k)| (2.0 * power * k).sqrt()).collect();
            for seat in seats {
                for (receptance, root) in seat.values.iter_mut().zip(&roots[seat.first..]) {
                    *receptance *= root;
                }
            }
        }
        Self { by_seats: from_seats, ..self }
    }

    /// Adds the data that make [`Transfer::with_model`] fast. A local change of the track has an effect up
    /// to `reach` nodes from its position.
    pub(crate) fn with_known_rail(mut self, lines_hz: &[f64], reach: usize) -> Self {
        self.known_rail = Some(Arc::new((KnownRail::new(&self.model, lines_hz), reach)));
        self
    }

    /// Transfer of the model with further extensions that change little, at the same lines. The effect of
    /// the further wheels is reused. The receptances of the rail are reused if the extensions change no
    /// matrix and add no force law, as for a shape of the rail or a sensor.
    pub(crate) fn with_model(&self, model: TrackModel, lines_hz: &[f64]) -> Self {
        let adds_law = model.force_laws().len() != self.model.force_laws().len();
        let has_wheels = model.vehicle().further_wheels_m == self.model.vehicle().further_wheels_m;
        let further = has_wheels.then(|| Arc::clone(&self.further_wheels));
        let known = self.known_rail.as_deref();
        if !adds_law && model.matrices() == self.model.matrices() {
            let (direct, known) = (Arc::clone(&self.direct), known.map(|(known, _)| known));
            return Self::on_rail(model, lines_hz, direct, known, further);
        }
        let direct = match known {
            Some((known, reach)) => known.direct_of(&model, *reach),
            None => RailReceptances::new(&model, lines_hz, None).direct,
        };
        Self::on_rail(model, lines_hz, Arc::new(direct), None, further)
    }

    /// Transfer with the force laws active as in a slightly different model; with `alike` the model may
    /// differ in nothing else. `None` if there is no force law, or if the laws are active in a state that
    /// is not stored.
    pub(crate) fn with_laws_of(
        &self,
        model: TrackModel,
        lines_hz: &[f64],
        alike: bool,
    ) -> Option<Self> {
        let direct = self.by_state.as_ref()?.direct_where(&model, alike)?;
        let further = Some(Arc::clone(&self.further_wheels));
        Some(Self::on_rail(model, lines_hz, Arc::new(direct), None, further))
    }

    /// Transfer with these receptances of the rail. `known` is the same rail, if it was solved before;
    /// `further` is the effect of the further wheels, if it is known.
    ///
    /// Source: docs/diagnosis.md, eq. 2, 3: `|H| = |a/F| / |1/k_H + alpha_r + alpha_w|`.
    fn on_rail(
        model: TrackModel,
        lines_hz: &[f64],
        direct: Arc<Vec<Vec<Complex64>>>,
        known: Option<&KnownRail>,
        further: Option<Arc<FurtherWheels>>,
    ) -> Self {
        let hertz = hertz(&model);
        let wheel_receptance: Vec<Complex64> =
            lines_hz.iter().map(|&hz| model.vehicle().receptance(TAU * hz)).collect();
        let of_line = |(wheel, direct): (&Complex64, &Vec<Complex64>)| {
            let vehicle = 1.0 / hertz + wheel;
            direct.iter().map(|rail| (vehicle + rail).inv()).collect()
        };
        let stiffness: Vec<Vec<Complex64>> =
            wheel_receptance.iter().zip(direct.iter()).map(of_line).collect();
        let power_of_line = |(&hz, line): (&f64, &Vec<Complex64>)| {
            let sensitivity =
                model.vehicle().acceleration_per_force(TAU * hz) * model.sensor_transfer(hz);
            line.iter().map(|k| k.norm_sqr() * sensitivity.norm_sqr()).collect()
        };
        let mut power: Vec<Vec<f64>> = lines_hz.iter().zip(&stiffness).map(power_of_line).collect();
        let further_wheels = further.unwrap_or_else(|| {
            let ahead = |distance_m| match known {
                Some(known) => known.ahead(distance_m),
                None => receptances_ahead(&model, lines_hz, distance_m),
            };
            Arc::new(FurtherWheels::new(&model, lines_hz, hertz, &direct, &stiffness, ahead))
        });
        for (power, gain) in power.iter_mut().flatten().zip(further_wheels.gains()) {
            *power *= gain;
        }
        let (by_seats, wheel) = (Vec::new(), Vec::new());
        Self {
            power,
            stiffness,
            by_seats,
            wheel_receptance,
            rail: Vec::new(),
            wheel,
            rail_elsewhere: Vec::new(),
            further_wheels,
            direct,
            model,
            known_rail: None,
            by_state: None,
        }
    }

    /// The track.
    pub(crate) const fn model(&self) -> &TrackModel {
        &self.model
    }

    /// Effect of the further wheels.
    pub(crate) const fn further_wheels(&self) -> &Arc<FurtherWheels> {
        &self.further_wheels
    }

    /// Adds the shapes of rail and wheel over a section.
    pub(crate) fn with_shapes(mut self, section: &Section, turns: &WheelTurns) -> Self {
        let model = &self.model;
        let rolled_m = |x_m: f64, start_m: f64| (x_m - start_m) / turns.circumference_ratio;
        let circumference_m = TAU * section.track.design.wheel.radius_m;
        let tones = Tone::of_wheel(circumference_m * turns.circumference_ratio, |turn| {
            model.wheel_profile_m(turn * circumference_m)
        });
        let of_pass = |&start_m: &f64| {
            if tones.is_empty() {
                Shape::new(section, None, |x_m| model.wheel_profile_m(rolled_m(x_m, start_m)))
            } else {
                Some(Shape::of_tones(section, &tones))
            }
        };
        let of_speed = |starts: &Vec<f64>| starts.iter().map(of_pass).collect();
        let wheel = turns.starts_m.iter().map(of_speed).collect::<Option<_>>().unwrap_or_default();
        let ahead = |distance_m: f64| {
            let patch = model.contact_patch();
            let point = Shape::new(section, None, |x_m| model.point_profile_m(x_m + distance_m));
            let averaged = patch.and_then(|_| {
                Shape::new(section, patch, |x_m| model.averaged_profile_m(x_m + distance_m))
            });
            point.into_iter().chain(averaged)
        };
        self.rail = ahead(0.0).collect();
        let distances_m = model.vehicle().further_wheels_m.iter().enumerate();
        let under =
            |(wheel, &distance_m): (usize, &f64)| ahead(distance_m).map(move |it| (wheel, it));
        self.rail_elsewhere = distances_m.flat_map(under).collect();
        self.wheel = wheel;
        self
    }

    /// Factor of the extensions on the spectral density of the surface, at a wave number in rad/m.
    pub(crate) fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        self.model.roughness_gain(wave_number_rad_m)
    }

    /// Square roots of the sensitivities of the power at these nodes to the dynamic stiffness under a
    /// sleeper's rail seat.
    pub(crate) fn by_seat(&self, line: usize, sleeper: usize, nodes: Range<usize>) -> &[Complex64] {
        self.by_seats[line][sleeper].at(nodes)
    }

    /// Sensitivity of a window's mean power to the dynamic stiffness under a sleeper's rail seat. The
    /// change of the power is the real part of its product with the change of stiffness.
    pub(crate) fn sensitivity(&self, window: &Window, line: usize, sleeper: usize) -> Complex64 {
        let by_seat = self.by_seat(line, sleeper, window.nodes());
        window.shares.iter().zip(by_seat).map(|(share, root)| share * root * root).sum()
    }

    /// Sensitivity of a window's mean power to a dynamic stiffness between the rail seats of two sleepers.
    pub(crate) fn sensitivity_between(
        &self,
        window: &Window,
        line: usize,
        sleepers: [usize; 2],
    ) -> Complex64 {
        let [first, second] = sleepers.map(|sleeper| self.by_seat(line, sleeper, window.nodes()));
        let apart = first.iter().zip(second).map(|(first, second)| first - second);
        window.shares.iter().zip(apart).map(|(share, apart)| share * apart * apart).sum()
    }

    /// Magnitude of the direct receptance of the rail at a node in m/N.
    pub(crate) fn receptance(&self, line: usize, node: usize) -> f64 {
        self.direct[line][node].norm()
    }

    /// Magnitude of the receptance of the wheel in m/N.
    pub(crate) fn wheel_receptance(&self, line: usize) -> f64 {
        self.wheel_receptance[line].norm()
    }

    /// Sensitivity of a window's mean power to the dynamic stiffness between wheel and ground, relative to
    /// that of the wheel. The change of the power is the real part of its product with the relative change.
    ///
    /// `d alpha_w = -alpha_w^2 dZ` changes the series stiffness `k` and the sensor's response to a force,
    /// hence `d |H|^2 = -2 |H|^2 Re((1 - k alpha_w) alpha_w dZ)`.
    pub(crate) fn sensitivity_at_wheel(&self, window: &Window, line: usize) -> Complex64 {
        let (power, stiffness) = (&self.power[line], &self.stiffness[line]);
        let wheel = self.wheel_receptance[line];
        let at = |(node, share): (usize, &f64)| {
            -2.0 * share * power[node] * (1.0 - stiffness[node] * wheel)
        };
        window.nodes().zip(&window.shares).map(at).sum::<Complex64>() * wheel / wheel.norm()
    }

    /// Mean of the power over the nodes of a window at a line, in 1/s4.
    pub(crate) fn mean_power(&self, window: &Window, line: usize) -> f64 {
        window.mean(&self.power[line], 0)
    }
}

/// Derivative of the Hertzian force law at the static load, in N/m.
fn hertz(model: &TrackModel) -> f64 {
    HertzContact::new(model.design()).stiffness(model.design().wheel.load_n)
}

#[cfg(test)]
mod tests;
