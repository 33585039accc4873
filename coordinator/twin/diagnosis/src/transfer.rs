//! From the surface under the wheel to the acceleration that is recorded.

use crate::further_wheels::FurtherWheels;
use crate::profile::Shape;
use crate::section::{Section, Window};
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;
use tracktwin_track::frequency::{KnownRail, RailReceptances, SeatReceptances, StateReceptances};
use tracktwin_track::model::{HertzContact, TrackModel};

/// What a track with its extensions makes of the surface, at all lines of the spectrum and all
/// nodes of its rail.
pub(crate) struct Transfer {
    /// Recorded acceleration over height of the surface, squared, in 1/s4: `[line][node]`.
    pub(crate) power: Vec<Vec<f64>>,
    /// Dynamic stiffness of contact, rail and vehicle in series in N/m: `[line][node]`.
    pub(crate) stiffness: Vec<Vec<Complex64>>,
    /// Root of that by which a change of the dynamic stiffness at a rail seat changes the power at a
    /// node near it: the square's and its product's real part, `[line][sleeper]`. Empty unless asked for.
    by_seats: Vec<Vec<SeatReceptances>>,
    /// Receptance of the wheel in m/N at each line.
    wheel_receptance: Vec<Complex64>,
    /// The shape that extensions give the rail, if they do.
    pub(crate) rail: Option<Shape>,
    /// The shape of the wheel in each pass, `[speed][pass]`; empty for a round one.
    pub(crate) wheel: Vec<Vec<Shape>>,
    /// The shape of the rail under each further wheel where the first stands, with the wheel's number.
    pub(crate) rail_elsewhere: Vec<(usize, Shape)>,
    /// What the further wheels do.
    further_wheels: Arc<FurtherWheels>,
    /// Direct receptances of the rail in m/N: `[line][node]`.
    direct: Arc<Vec<Vec<Complex64>>>,
    model: TrackModel,
    /// What the receptances of tracks that differ a little follow from, and up to how many nodes from
    /// what differs; none until [`Transfer::with_known_rail`].
    known_rail: Option<Arc<(KnownRail, usize)>>,
    /// Receptances in each state that force laws give the track, if they do.
    by_state: Option<Arc<StateReceptances>>,
}

impl Transfer {
    /// Works it out for a model at these lines in Hz, with what derivatives need so many nodes on either
    /// side of each rail seat, if `reach` says so.
    pub(crate) fn new(model: TrackModel, lines_hz: &[f64], reach: Option<usize>) -> Self {
        let RailReceptances { direct, from_seats, by_state } =
            RailReceptances::new(&model, lines_hz, reach);
        let on_rail = Self::on_rail(model, lines_hz, Arc::new(direct), None);
        Self { by_state, ..on_rail }.with_seats(from_seats)
    }

    /// With receptances from the rail seats in m/N, `[line][sleeper]`.
    ///
    /// `d alpha = -alpha_seat^2 dZ`, hence `d |H|^2 = 2 |H|^2 Re(k alpha_seat^2 dZ)`; between two
    /// seats it is the difference of their receptances.
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

    /// The same, from which [`Transfer::with_model`] is quick: what extensions at a place change is felt up
    /// to `reach` nodes from it.
    pub(crate) fn with_known_rail(mut self, lines_hz: &[f64], reach: usize) -> Self {
        self.known_rail = Some(Arc::new((KnownRail::new(&self.model, lines_hz), reach)));
        self
    }

    /// The same for the model with further extensions at the same lines, which change little: what a further
    /// wheel does stays. Where they change no matrix and add no force law, as the shape of the rail or the
    /// sensor, the rail's receptances stay too.
    pub(crate) fn with_model(&self, model: TrackModel, lines_hz: &[f64]) -> Self {
        let adds_law = model.force_laws().len() != self.model.force_laws().len();
        let has_wheels = model.vehicle().further_wheels_m == self.model.vehicle().further_wheels_m;
        let further = has_wheels.then(|| Arc::clone(&self.further_wheels));
        let direct = if !adds_law && model.matrices() == self.model.matrices() {
            Arc::clone(&self.direct)
        } else {
            Arc::new(match self.known_rail.as_deref() {
                Some((known, reach)) => known.direct_of(&model, *reach),
                None => RailReceptances::new(&model, lines_hz, None).direct,
            })
        };
        Self::on_rail(model, lines_hz, direct, further)
    }

    /// The same where force laws take hold as they do in a model that differs little, and that may differ in
    /// nothing else if `alike`; none where there is no law, or where they take hold in another way.
    pub(crate) fn with_laws_of(
        &self,
        model: TrackModel,
        lines_hz: &[f64],
        alike: bool,
    ) -> Option<Self> {
        let direct = self.by_state.as_ref()?.direct_where(&model, alike)?;
        let further = Some(Arc::clone(&self.further_wheels));
        Some(Self::on_rail(model, lines_hz, Arc::new(direct), further))
    }

    /// Source: docs/diagnosis.md, eq. 2, 3: `|H| = |a/F| / |1/k_H + alpha_r + alpha_w|`.
    fn on_rail(
        model: TrackModel,
        lines_hz: &[f64],
        direct: Arc<Vec<Vec<Complex64>>>,
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
            Arc::new(FurtherWheels::new(&model, lines_hz, hertz, &direct, &stiffness))
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
            rail: None,
            wheel,
            rail_elsewhere: Vec::new(),
            further_wheels,
            direct,
            model,
            known_rail: None,
            by_state: None,
        }
    }

    /// What the further wheels do.
    pub(crate) const fn further_wheels(&self) -> &Arc<FurtherWheels> {
        &self.further_wheels
    }

    /// The same with the shapes of rail and wheel over a section; in its passes the wheel begins a
    /// turn at these places in m: `[speed][pass]`.
    pub(crate) fn with_shapes(mut self, section: &Section, starts_m: &[Vec<f64>]) -> Self {
        let model = &self.model;
        let of_pass =
            |start_m: &f64| Shape::new(section, |x_m| model.wheel_profile_m(x_m - start_m));
        let of_speed = |starts: &Vec<f64>| starts.iter().map(of_pass).collect();
        let wheel = starts_m.iter().map(of_speed).collect::<Option<_>>().unwrap_or_default();
        self.rail = Shape::new(section, |x_m| model.profile_m(x_m));
        let distances_m = model.vehicle().further_wheels_m.iter().enumerate();
        let under = |(wheel, distance_m): (usize, &f64)| {
            Some((wheel, Shape::new(section, |x_m| model.profile_m(x_m + distance_m))?))
        };
        self.rail_elsewhere = distances_m.filter_map(under).collect();
        self.wheel = wheel;
        self
    }

    /// By what extensions multiply the surface's spectral density at a wave number in rad/m.
    pub(crate) fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        self.model.roughness_gain(wave_number_rad_m)
    }

    /// Roots of that by which a change of the dynamic stiffness under a sleeper's rail seat changes the
    /// power at these nodes near it.
    pub(crate) fn by_seat(&self, line: usize, sleeper: usize, nodes: Range<usize>) -> &[Complex64] {
        self.by_seats[line][sleeper].at(nodes)
    }

    /// Sensitivity of a window's mean power to a change of the dynamic stiffness under a sleeper's
    /// rail seat: the real part of the product.
    pub(crate) fn sensitivity(&self, window: &Window, line: usize, sleeper: usize) -> Complex64 {
        let by_seat = self.by_seat(line, sleeper, window.nodes());
        window.shares.iter().zip(by_seat).map(|(share, root)| share * root * root).sum()
    }

    /// The same for a dynamic stiffness between two sleepers' rail seats.
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

    /// Magnitude of the rail's direct receptance at a node in m/N.
    pub(crate) fn receptance(&self, line: usize, node: usize) -> f64 {
        self.direct[line][node].norm()
    }

    /// Receptance of the wheel in m/N.
    pub(crate) fn wheel_receptance(&self, line: usize) -> Complex64 {
        self.wheel_receptance[line]
    }

    /// By what a change of the dynamic stiffness between wheel and ground, in parts of the wheel's
    /// own, changes a window's mean power: its product's real part.
    ///
    /// `d alpha_w = -alpha_w^2 dZ` changes the series stiffness `k` and what the sensor feels of a
    /// force, hence `d |H|^2 = -2 |H|^2 Re((1 - k alpha_w) alpha_w dZ)`.
    pub(crate) fn sensitivity_at_wheel(&self, window: &Window, line: usize) -> Complex64 {
        let (power, stiffness) = (&self.power[line], &self.stiffness[line]);
        let wheel = self.wheel_receptance[line];
        let at = |(node, share): (usize, &f64)| {
            -2.0 * share * power[node] * (1.0 - stiffness[node] * wheel)
        };
        window.nodes().zip(&window.shares).map(at).sum::<Complex64>() * wheel / wheel.norm()
    }

    /// Mean of the power over a window's nodes at a line.
    pub(crate) fn mean_power(&self, window: &Window, line: usize) -> f64 {
        window.mean(&self.power[line], 0)
    }
}

/// Slope of the Hertzian law at the static load, in N/m.
fn hertz(model: &TrackModel) -> f64 {
    HertzContact::new(model.design()).stiffness(model.design().wheel.load_n)
}

#[cfg(test)]
mod tests;
