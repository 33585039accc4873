//! From the surface under the wheel to the acceleration that is recorded.

use crate::profile::Shape;
use crate::section::{Section, Window};
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_track::frequency::RailReceptances;
use tracktwin_track::model::{HertzContact, TrackModel};

/// What a track with its extensions makes of the surface, at all lines of the spectrum and all
/// nodes of its rail.
pub(crate) struct Transfer {
    /// Recorded acceleration over height of the surface, squared, in 1/s4: `[line][node]`.
    pub(crate) power: Vec<Vec<f64>>,
    /// Dynamic stiffness of contact, rail and vehicle in series in N/m: `[line][node]`.
    pub(crate) stiffness: Vec<Vec<Complex64>>,
    /// Root of that by which a change of the dynamic stiffness at a rail seat changes the power at a
    /// node: the square's and its product's real part, `[line][sleeper][node]`. Empty unless asked for.
    by_seats: Vec<Vec<Vec<Complex64>>>,
    /// Receptance of the wheel in m/N at each line.
    wheel_receptance: Vec<Complex64>,
    /// The shape that extensions give the rail, if they do.
    pub(crate) rail: Option<Shape>,
    /// The shape of the wheel in each pass, `[speed][pass]`; empty for a round one.
    pub(crate) wheel: Vec<Vec<Shape>>,
    /// Direct receptances of the rail in m/N: `[line][node]`.
    direct: Arc<Vec<Vec<Complex64>>>,
    model: TrackModel,
}

impl Transfer {
    /// Works it out for a model at these lines in Hz, with what derivatives need if `from_seats`.
    pub(crate) fn new(model: TrackModel, lines_hz: &[f64], from_seats: bool) -> Self {
        let RailReceptances { direct, from_seats } =
            RailReceptances::new(&model, lines_hz, from_seats);
        Self::on_rail(model, lines_hz, Arc::new(direct)).with_seats(from_seats)
    }

    /// With receptances from the rail seats in m/N, `[line][sleeper][node]`.
    ///
    /// `d alpha = -alpha_seat^2 dZ`, hence `d |H|^2 = 2 |H|^2 Re(k alpha_seat^2 dZ)`; between two
    /// seats it is the difference of their receptances.
    fn with_seats(self, mut from_seats: Vec<Vec<Vec<Complex64>>>) -> Self {
        for (line, columns) in from_seats.iter_mut().enumerate() {
            let nodes = self.power[line].iter().zip(&self.stiffness[line]);
            let roots: Vec<Complex64> = nodes.map(|(power, k)| (2.0 * power * k).sqrt()).collect();
            for column in columns {
                for (receptance, root) in column.iter_mut().zip(&roots) {
                    *receptance *= root;
                }
            }
        }
        Self { by_seats: from_seats, ..self }
    }

    /// The same for another model at the same lines. Where it differs in no matrix, as by the shape
    /// of the rail or by the sensor, the rail's receptances stay.
    pub(crate) fn with_model(&self, model: TrackModel, lines_hz: &[f64]) -> Self {
        if model.matrices() == self.model.matrices() {
            Self::on_rail(model, lines_hz, Arc::clone(&self.direct))
        } else {
            Self::new(model, lines_hz, false)
        }
    }

    /// Source: mismatch design, eq. 2: `|H| = |a/F| / |1/k_H + alpha_r + alpha_w|`.
    fn on_rail(model: TrackModel, lines_hz: &[f64], direct: Arc<Vec<Vec<Complex64>>>) -> Self {
        let load = model.design().wheel.load_n;
        let contact = HertzContact::new(model.design());
        // Slope of the Hertzian law at the static load.
        let hertz = 1.5 * load / contact.approach(load);
        let wheel_receptance: Vec<Complex64> =
            lines_hz.iter().map(|&hz| model.vehicle().receptance(TAU * hz)).collect();
        let of_line = |(wheel, direct): (&Complex64, &Vec<Complex64>)| {
            let vehicle = 1.0 / hertz + wheel;
            direct.iter().map(|rail| (vehicle + rail).inv()).collect()
        };
        let stiffness: Vec<Vec<Complex64>> =
            wheel_receptance.iter().zip(direct.iter()).map(of_line).collect();
        let power_of_line = |(&hz, line): (&f64, &Vec<Complex64>)| {
            let felt = model.vehicle().acceleration_per_force(TAU * hz) * model.sensor_transfer(hz);
            line.iter().map(|k| k.norm_sqr() * felt.norm_sqr()).collect()
        };
        let power = lines_hz.iter().zip(&stiffness).map(power_of_line).collect();
        let (by_seats, wheel) = (Vec::new(), Vec::new());
        Self { power, stiffness, by_seats, wheel_receptance, rail: None, wheel, direct, model }
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
        self.wheel = wheel;
        self
    }

    /// By what extensions multiply the surface's spectral density at a wave number in rad/m.
    pub(crate) fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        self.model.roughness_gain(wave_number_rad_m)
    }

    /// Roots of that by which a change of the dynamic stiffness under a sleeper's rail seat changes the
    /// power at each node.
    pub(crate) fn by_seat(&self, line: usize, sleeper: usize) -> &[Complex64] {
        &self.by_seats[line][sleeper]
    }

    /// By what a change of the dynamic stiffness under a sleeper's rail seat changes a window's mean
    /// power: its product's real part.
    pub(crate) fn felt(&self, window: &Window, line: usize, sleeper: usize) -> Complex64 {
        let by_seat = &self.by_seats[line][sleeper][window.nodes()];
        window.shares.iter().zip(by_seat).map(|(share, root)| share * root * root).sum()
    }

    /// The same for a dynamic stiffness between two sleepers' rail seats.
    pub(crate) fn felt_between(
        &self,
        window: &Window,
        line: usize,
        sleepers: [usize; 2],
    ) -> Complex64 {
        let [first, second] = sleepers.map(|sleeper| &self.by_seats[line][sleeper][window.nodes()]);
        let apart = first.iter().zip(second).map(|(first, second)| first - second);
        window.shares.iter().zip(apart).map(|(share, apart)| share * apart * apart).sum()
    }

    /// Magnitude of the rail's direct receptance at a node in m/N.
    pub(crate) fn receptance(&self, line: usize, node: usize) -> f64 {
        self.direct[line][node].norm()
    }

    /// By what a change of the dynamic stiffness between wheel and ground, in parts of the wheel's
    /// own, changes a window's mean power: its product's real part.
    ///
    /// `d alpha_w = -alpha_w^2 dZ` changes the series stiffness `k` and what the sensor feels of a
    /// force, hence `d |H|^2 = -2 |H|^2 Re((1 - k alpha_w) alpha_w dZ)`.
    pub(crate) fn felt_at_wheel(&self, window: &Window, line: usize) -> Complex64 {
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
