//! From the surface under the wheel to the acceleration that is recorded.

use crate::profile::Shape;
use crate::section::{Section, Window};
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_track::frequency::{RailReceptances, receptances_ahead, shares};
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
    /// By what the further wheels multiply the power: `[line][node]`; empty for a single wheel.
    by_further_wheels: Arc<Vec<Vec<f64>>>,
    /// Direct receptances of the rail in m/N: `[line][node]`.
    direct: Arc<Vec<Vec<Complex64>>>,
    model: TrackModel,
}

impl Transfer {
    /// Works it out for a model at these lines in Hz, with what derivatives need if `from_seats`.
    /// `by_further_wheels` is what the design's further wheels do, if that is known.
    pub(crate) fn new(
        model: TrackModel,
        lines_hz: &[f64],
        from_seats: bool,
        by_further_wheels: Option<&Arc<Vec<Vec<f64>>>>,
    ) -> Self {
        let RailReceptances { direct, from_seats } =
            RailReceptances::new(&model, lines_hz, from_seats);
        let has_wheels = model.vehicle().further_wheels_m == model.design().wheel.further_wheels_m;
        let known = by_further_wheels.filter(|_| has_wheels).map(Arc::clone);
        Self::on_rail(model, lines_hz, Arc::new(direct), known).with_seats(from_seats)
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

    /// The same for the model with further extensions at the same lines, which change little: what a further
    /// wheel does stays. Where they change no matrix and add no force law, as the shape of the rail or the
    /// sensor, the rail's receptances stay too.
    pub(crate) fn with_model(&self, model: TrackModel, lines_hz: &[f64]) -> Self {
        let adds_law = model.force_laws().len() != self.model.force_laws().len();
        let has_wheels = model.vehicle().further_wheels_m == self.model.vehicle().further_wheels_m;
        let by_further = has_wheels.then(|| Arc::clone(&self.by_further_wheels));
        let direct = if !adds_law && model.matrices() == self.model.matrices() {
            Arc::clone(&self.direct)
        } else {
            Arc::new(RailReceptances::new(&model, lines_hz, false).direct)
        };
        Self::on_rail(model, lines_hz, direct, by_further)
    }

    /// Source: docs/diagnosis.md, eq. 2, 3: `|H| = |a/F| / |1/k_H + alpha_r + alpha_w|`.
    fn on_rail(
        model: TrackModel,
        lines_hz: &[f64],
        direct: Arc<Vec<Vec<Complex64>>>,
        by_further: Option<Arc<Vec<Vec<f64>>>>,
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
        let by_further_wheels = by_further
            .unwrap_or_else(|| Arc::new(by_further_wheels(&model, lines_hz, &direct, &stiffness)));
        for (power, gain) in power.iter_mut().flatten().zip(by_further_wheels.iter().flatten()) {
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
            by_further_wheels,
            direct,
            model,
        }
    }

    /// What the further wheels multiply the power by, `[line][node]`.
    pub(crate) const fn by_further_wheels(&self) -> &Arc<Vec<Vec<f64>>> {
        &self.by_further_wheels
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

    /// Sensitivity of a window's mean power to a change of the dynamic stiffness under a sleeper's
    /// rail seat: the real part of the product.
    pub(crate) fn sensitivity(&self, window: &Window, line: usize, sleeper: usize) -> Complex64 {
        let by_seat = &self.by_seats[line][sleeper][window.nodes()];
        window.shares.iter().zip(by_seat).map(|(share, root)| share * root * root).sum()
    }

    /// The same for a dynamic stiffness between two sleepers' rail seats.
    pub(crate) fn sensitivity_between(
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

/// By what all further wheels multiply the power, `[line][node]`; empty where there is none.
fn by_further_wheels(
    model: &TrackModel,
    lines_hz: &[f64],
    direct: &[Vec<Complex64>],
    stiffness: &[Vec<Complex64>],
) -> Vec<Vec<f64>> {
    let distances_m = model.vehicle().further_wheels_m.iter();
    let each = distances_m
        .map(|&distance_m| by_further_wheel(model, lines_hz, direct, stiffness, distance_m));
    let product = |mut all: Vec<Vec<f64>>, gains: Vec<Vec<f64>>| {
        for (all, gain) in all.iter_mut().flatten().zip(gains.into_iter().flatten()) {
            *all *= gain;
        }
        all
    };
    each.reduce(product).unwrap_or_default()
}

/// By what a rigid wheel of the same mass and load, so far ahead, multiplies the power that a rough
/// surface gives the first: `[line][node]`.
///
/// With `a_1` and `a_2` what gives way at each contact and `b` the rail between them, the forces are
/// `F = -A^-1 r`, `A = [[a_1, b], [b, a_2]]`, so that
/// `|F_1|^2 = (|a_2|^2 + |b|^2) / |a_1 a_2 - b^2|^2 S`: what the wheels meet at one time is the same surface
/// a distance apart, whose phase turns many times within a band. Several further wheels are taken one
/// by one.
/// Source: T. X. Wu and D. J. Thompson, Vehicle System Dynamics 34 (2001).
fn by_further_wheel(
    model: &TrackModel,
    lines_hz: &[f64],
    direct: &[Vec<Complex64>],
    stiffness: &[Vec<Complex64>],
    distance_m: f64,
) -> Vec<Vec<f64>> {
    let between = receptances_ahead(model, lines_hz, distance_m);
    let nodes_m = model.layout().rail_nodes_m();
    let there: Vec<_> = nodes_m.iter().map(|x_m| shares(nodes_m, x_m + distance_m)).collect();
    let hertz = hertz(model);
    let of_line = |line: usize| {
        let omega = TAU * lines_hz[line];
        let wheel = 1.0 / hertz - 1.0 / (model.vehicle().wheel.mass_kg * omega * omega);
        let of_node = |(node, there): (usize, &Vec<(usize, f64)>)| {
            if there.is_empty() {
                return 1.0;
            }
            let rail: Complex64 =
                there.iter().map(|&(other, share)| share * direct[line][other]).sum();
            let (first, second) = (stiffness[line][node].inv(), wheel + rail);
            let between = between[line][node];
            first.norm_sqr() * (second.norm_sqr() + between.norm_sqr())
                / (first * second - between * between).norm_sqr()
        };
        there.iter().enumerate().map(of_node).collect()
    };
    (0..lines_hz.len()).map(of_line).collect()
}

/// Slope of the Hertzian law at the static load, in N/m.
fn hertz(model: &TrackModel) -> f64 {
    HertzContact::new(model.design()).stiffness(model.design().wheel.load_n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::FftPlanner;
    use std::ops::Range;
    use tracktwin_parameters::{ParameterSet, TrackDesign};
    use tracktwin_track::extension::ExtensionInstance;
    use tracktwin_track::model::{Mesh, Roughness, Support};
    use tracktwin_track::time::{Pass, passes};

    const SPANS: usize = 24;

    fn track(extension: Option<ExtensionInstance>) -> TrackModel {
        let design = TrackDesign::v_track();
        let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
        let extensions = extension.map(|extension| extension.build(&design, SPANS).unwrap());
        let mesh = Mesh::uniform(SPANS, 8, 8);
        TrackModel::build(&design, &mesh, &supports, &Vec::from_iter(extensions)).unwrap()
    }

    fn second_wheel(distance_m: f64) -> ExtensionInstance {
        ExtensionInstance::new("second_wheel").with("distance_m", distance_m)
    }

    /// Powers in third-octave bands over a stretch, mean of this number of passes.
    fn powers(
        model: &TrackModel,
        centres_hz: &[f64],
        [start_m, end_m]: [f64; 2],
        surfaces: u64,
    ) -> Vec<f64> {
        let pass =
            Pass { speed_m_s: 2.8, start_m, end_m, time_step_s: 2e-5, local_flexibility: true };
        let surfaces: Vec<_> =
            (1..=surfaces).map(|seed| model.surface(&Roughness::new(1.0), seed)).collect();
        let records = passes(&vec![model.clone(); surfaces.len()], &pass, &surfaces).unwrap();
        let mut powers = vec![0.0; centres_hz.len()];
        for record in records {
            // What rings after the start is left out.
            let values = &record.acceleration_m_s2[5000..];
            let turn = |index: usize| TAU * index as f64 / values.len() as f64;
            let mut spectrum: Vec<Complex64> = values
                .iter()
                .enumerate()
                .map(|(index, value)| Complex64::from(value * (1.0 - turn(index).cos())))
                .collect();
            FftPlanner::new().plan_fft_forward(spectrum.len()).process(&mut spectrum);
            let hz = |line: usize| line as f64 / (values.len() as f64 * pass.time_step_s);
            for (power, centre) in powers.iter_mut().zip(centres_hz) {
                let inside = |line: &usize| (hz(*line) / centre).log2().abs() < 1.0 / 6.0;
                *power += (1..values.len() / 2)
                    .filter(inside)
                    .map(|line| spectrum[line].norm_sqr())
                    .sum::<f64>();
            }
        }
        powers
    }

    /// Centres of bands of a third of an octave.
    fn thirds_hz(first_hz: f64, count: i32) -> Vec<f64> {
        (0..count).map(|k| first_hz * 2_f64.powf(f64::from(k) / 3.0)).collect()
    }

    /// By how much powers in bands over some nodes are expected to differ, in dB, with the window
    /// that a spectrum of the stretch has.
    fn expected_db(models: [TrackModel; 2], centres_hz: &[f64], seen: Range<usize>) -> Vec<f64> {
        let lines_hz: Vec<f64> = centres_hz
            .iter()
            .flat_map(|hz| (0..8).map(move |k| hz * 2_f64.powf((f64::from(k) - 3.5) / 24.0)))
            .collect();
        let [alone, with] = models.map(|model| Transfer::new(model, &lines_hz, false, None).power);
        let turn = |index: usize| TAU * (index as f64 + 0.5) / seen.len() as f64;
        let share = |index: usize| (1.0 - turn(index).cos()).powi(2);
        let of_line = |line: &Vec<f64>| -> f64 {
            line[seen.clone()].iter().enumerate().map(|(index, power)| share(index) * power).sum()
        };
        let sum = |power: &[Vec<f64>]| -> f64 { power.iter().map(of_line).sum() };
        let bands = with.chunks(8).zip(alone.chunks(8));
        bands.map(|(with, alone)| 10.0 * (sum(with) / sum(alone)).log10()).collect()
    }

    fn ratios_db(with: Vec<f64>, alone: Vec<f64>) -> Vec<f64> {
        with.into_iter().zip(alone).map(|(with, alone)| 10.0 * (with / alone).log10()).collect()
    }

    fn rms_difference(one: &[f64], other: &[f64]) -> f64 {
        let square = |(one, other): (&f64, &f64)| (one - other).powi(2);
        (one.iter().zip(other).map(square).sum::<f64>() / one.len() as f64).sqrt()
    }

    #[test]
    fn a_second_wheel_changes_the_power_as_in_time() {
        let centres_hz = thirds_hz(250.0, 10);
        let [alone, with] = [None, Some(second_wheel(0.3))].map(track);
        let in_time = |model| powers(model, &centres_hz, [0.5, 2.0], 8);
        let in_time = ratios_db(in_time(&with), in_time(&alone));
        let expected = expected_db([alone, with], &centres_hz, 6 * 8..16 * 8);
        assert!(expected.iter().any(|change| change.abs() > 6.0), "{expected:?}");
        // Eight surfaces leave some tenths of a decibel to chance in each band.
        assert!(rms_difference(&in_time, &expected) < 0.5, "{in_time:?} {expected:?}");
    }

    #[test]
    fn a_gap_that_closes_under_a_near_wheel_changes_the_power_as_in_time() {
        let centres_hz = thirds_hz(315.0, 6);
        let gap = |gap_m: f64| {
            Some(ExtensionInstance::new("hanging_sleeper").on([11]).with("gap_m", gap_m))
        };
        let [alone, closing, open] = [None, gap(1.6e-4), gap(4e-3)].map(track);
        let in_time = |model| powers(model, &centres_hz, [0.92, 1.8], 3);
        let in_time = ratios_db(in_time(&closing), in_time(&alone));
        let [closing, open] =
            [closing, open].map(|with| expected_db([alone.clone(), with], &centres_hz, 77..116));
        // Three passes over six spans, in which the ballast is struck twice.
        assert!(rms_difference(&in_time, &open) > 5.0, "{in_time:?} {open:?}");
        assert!(rms_difference(&in_time, &closing) < 1.5, "{in_time:?} {closing:?}");
    }

    #[test]
    fn a_wheel_beyond_the_rail_changes_nothing() {
        let lines_hz = [500.0, 2000.0];
        let [alone, with] = [None, Some(second_wheel(10.0))]
            .map(|e| Transfer::new(track(e), &lines_hz, false, None).power);
        assert_eq!(alone, with);
    }
}
