//! Mean log powers that a track model predicts, without a time simulation.
//!
//! The surface excites the wheel at position `x` through the quasi-static transfer `|H| = 1 / (m |1/k_H +
//! alpha_r(x, x) + alpha_w|)`. The mean power in a band over a sleeper is the surface spectrum times
//! `|H|^2`, averaged over band and window (docs/diagnosis.md, eq. 3, 4).

mod beyond;
mod derivatives;
mod supports;

pub use derivatives::Linearised;

use self::supports::NEIGHBOURS;
use crate::bands::Bands;
use crate::baseline::Unknowns;
use crate::profile::{Shape, WheelTurns};
use crate::quantity::Own;
use crate::section::{Section, Window};
use crate::transfer::Transfer;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;
use tracktwin_track::extension::Extension;
use tracktwin_track::model::{ModelError, Roughness, TrackModel};

/// Mean logarithm of the power of one complex Gaussian amplitude over the logarithm of its mean: Euler's constant. No
/// window has a lower one.
const LOG_BIAS_MIN: f64 = -0.577_215_664_901_532_9;

/// Forward model: predicts the log powers of a section as one vector in the order `[sleeper][speed][band]`.
#[derive(Clone, Debug)]
pub struct Forward {
    /// The compared stretch of track.
    pub section: Section,
    /// The bands.
    pub bands: Bands,
    /// Speeds in m/s.
    pub speeds_m_s: Vec<f64>,
    /// Unknowns of the baseline.
    pub unknowns: Unknowns,
    /// One-sided power spectral density of the sensor noise in m2/s3 at each speed.
    pub noise_density: Vec<f64>,
    /// Turns of the wheel in every pass.
    pub wheel_turns: WheelTurns,
    /// Mean logarithm of a random power over the logarithm of its mean, `[speed][band]`: the part of the null
    /// model's offset that the power of a shape does not have. Zero before [`Forward::expect_offset`].
    log_bias: Vec<f64>,
    /// Changes of the log powers from the track beyond the compared sleepers, one column for each unknown
    /// of [`Unknowns::beyond`]; zero before [`Forward::allow_beyond`].
    beyond: DMatrix<f64>,
    /// Rail nodes that contribute to each window, `[speed][sleeper][band]`.
    windows: Vec<Vec<Vec<Window>>>,
    /// Spectrum of the surface at level one in m2/Hz, `[speed][line]`.
    surface: Vec<Vec<f64>>,
}

impl Forward {
    /// A forward model for these speeds in km/h, with noise densities in m2/s3, one per speed.
    pub fn new(
        section: Section,
        bands: Bands,
        speeds_km_h: &[f64],
        noise_density: Vec<f64>,
    ) -> Self {
        let speeds_m_s: Vec<f64> = speeds_km_h.iter().map(|speed| speed / 3.6).collect();
        let lines = bands.lines_hz();
        let slowest = speeds_m_s.iter().copied().fold(f64::INFINITY, f64::min);
        let fastest = speeds_m_s.iter().copied().fold(0.0, f64::max);
        let wave_numbers = TAU * bands.centres_hz()[0] / fastest
            ..TAU * bands.centres_hz()[bands.count() - 1] / slowest;
        let frequencies_hz = bands.centres_hz()[0]..bands.centres_hz()[bands.count() - 1];
        let unknowns = Unknowns::new(&section, speeds_m_s.len(), wave_numbers, frequencies_hz);
        let windows = speeds_m_s.iter().map(|&v| section.windows(v, &bands)).collect();
        // A density per rad/m becomes one per Hz at this speed.
        let surface = Roughness::between(1.0, section.track.wavelengths_m);
        let density = |v: f64, hz: f64| surface.density(TAU * hz / v) * TAU / v;
        let surface =
            speeds_m_s.iter().map(|&v| lines.iter().map(|&hz| density(v, hz)).collect()).collect();
        let wheel_turns = WheelTurns::default();
        let log_bias = vec![0.0; speeds_m_s.len() * bands.count()];
        let rows = section.sleepers() * log_bias.len();
        let beyond = DMatrix::zeros(rows, unknowns.beyond().len());
        Self {
            section,
            bands,
            speeds_m_s,
            unknowns,
            noise_density,
            wheel_turns,
            log_bias,
            beyond,
            windows,
            surface,
        }
    }

    /// The same model for a track that ends `spans_beyond` spans beyond the compared sleepers.
    #[must_use]
    pub fn with_ends(&self, spans_beyond: usize) -> Self {
        let section = Section { spans_beyond, ..self.section.clone() };
        let speeds: Vec<f64> = self.speeds_m_s.iter().map(|speed| 3.6 * speed).collect();
        let ended = Self::new(section, self.bands.clone(), &speeds, self.noise_density.clone());
        Self { log_bias: self.log_bias.clone(), ..ended }
    }

    /// Makes predictions of shapes agree with data from which the null model's offset is subtracted. The mean logarithm
    /// of a random power is lower than the logarithm of its mean; that of a shape's power is not. `offset` has one value
    /// per speed and band.
    pub fn expect_offset(&mut self, offset: &DVector<f64>) {
        self.log_bias = offset.iter().map(|offset| offset.clamp(LOG_BIAS_MIN, 0.0)).collect();
    }

    /// Number of log powers.
    pub fn count(&self) -> usize {
        self.section.sleepers() * self.per_sleeper()
    }

    /// Number of log powers per sleeper.
    pub fn per_sleeper(&self) -> usize {
        self.speeds_m_s.len() * self.bands.count()
    }

    /// Predicts the log powers of a baseline with extensions.
    ///
    /// # Errors
    /// [`ModelError`] if no track model exists for values and extensions.
    pub fn log_power(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<DVector<f64>, ModelError> {
        Ok(self.levels(&self.transfer(values, extensions, false)?, values))
    }

    /// Log powers from a transfer.
    pub(crate) fn levels(&self, transfer: &Transfer, values: &DVector<f64>) -> DVector<f64> {
        self.levels_at(transfer, values, 0..self.section.sleepers())
    }

    /// Log powers from a transfer at a range of sleepers.
    pub(crate) fn levels_at(
        &self,
        transfer: &Transfer,
        values: &DVector<f64>,
        sleepers: Range<usize>,
    ) -> DVector<f64> {
        let excitation = self.excitation(transfer, values);
        let first = sleepers.start * self.per_sleeper();
        let mut all = DVector::zeros(sleepers.len() * self.per_sleeper());
        self.fill(&mut all, first, |sleeper, speed, band| {
            let scale = self.scale(values, sleeper, speed);
            let power = scale * self.power(transfer, &excitation[speed], (sleeper, speed, band));
            let floor = power + self.noise(speed, band);
            let shapes = self.shape_powers(transfer, sleeper, speed, band);
            let logarithm = |shape| self.mean_logarithm([floor, shape], speed, band);
            self.response(values, band) + mean(shapes, logarithm)
        });
        let beyond = self.unknowns.beyond();
        let changes = self.beyond.rows(first, all.len());
        all + changes * values.rows(beyond.start, beyond.len())
    }

    /// Transfer of a baseline with extensions, computed from a `known` transfer of the same baseline. The
    /// further extensions should change little.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub(crate) fn transfer_beside(
        &self,
        known: &Transfer,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<Transfer, ModelError> {
        let transfer = known.with_model(self.model(values, extensions)?, self.bands.lines_hz());
        Ok(transfer.with_shapes(&self.section, &self.wheel_turns))
    }

    /// Log powers with the force laws active as for the varied values, and everything else as for the given
    /// values. `None` if the transfer does not contain this state or, with `alike`, if the tracks differ in
    /// anything else.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub(crate) fn with_laws_of(
        &self,
        known: &Transfer,
        [values, varied]: [&DVector<f64>; 2],
        extensions: &[Arc<dyn Extension>],
        alike: bool,
    ) -> Result<Option<DVector<f64>>, ModelError> {
        let model = self.model(varied, extensions)?;
        let transfer = known.with_laws_of(model, self.bands.lines_hz(), alike);
        let with_shapes = |it: Transfer| it.with_shapes(&self.section, &self.wheel_turns);
        Ok(transfer.map(with_shapes).map(|transfer| self.levels(&transfer, values)))
    }

    /// Indices of sleeper, speed and band of a row.
    pub fn place(&self, row: usize) -> (usize, usize, usize) {
        let (sleeper, rest) = (row / self.per_sleeper(), row % self.per_sleeper());
        (sleeper, rest / self.bands.count(), rest % self.bands.count())
    }

    /// Fills the rows, which begin with the row `first`.
    fn fill(
        &self,
        rows: &mut DVector<f64>,
        first: usize,
        value: impl Fn(usize, usize, usize) -> f64 + Sync,
    ) {
        rows.as_mut_slice().par_iter_mut().enumerate().for_each(|(row, entry)| {
            let (sleeper, speed, band) = self.place(first + row);
            *entry = value(sleeper, speed, band);
        });
    }

    /// Transfer of a baseline with extensions; `from_seats` adds the data for derivatives.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub(crate) fn transfer(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
        from_seats: bool,
    ) -> Result<Transfer, ModelError> {
        let model = self.model(values, extensions)?;
        let reach = from_seats.then(|| self.reach_nodes());
        let transfer = Transfer::new(model, self.bands.lines_hz(), reach);
        Ok(transfer.with_shapes(&self.section, &self.wheel_turns))
    }

    /// Transfer that makes [`Forward::transfer_beside`] fast.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub(crate) fn transfer_to_vary(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<Transfer, ModelError> {
        let transfer = self.transfer(values, extensions, false)?;
        Ok(transfer.with_known_rail(self.bands.lines_hz(), self.reach_nodes()))
    }

    /// Compared sleepers that an effect on a stretch affects, under any wheel of the track description. The
    /// stretch is in spacings from the first compared sleeper.
    pub(crate) fn felt_at(&self, [from, to]: [f64; 2]) -> Range<usize> {
        let reach = NEIGHBOURS as f64 + self.section.furthest_wheel();
        let count = self.section.sleepers();
        let first = (from - reach).floor().max(0.0) as usize;
        let end = ((to + reach).ceil().max(0.0) as usize + 1).min(count);
        first.min(end)..end
    }

    /// Number of nodes on either side of a rail seat, up to the last node in the window of a sleeper that
    /// the seat affects.
    fn reach_nodes(&self) -> usize {
        let windows = self.windows.iter().flatten().flatten();
        let widest = windows.map(|window| window.shares.len()).max().unwrap_or(0);
        (NEIGHBOURS + 1) * self.section.node_above(0) + widest
    }

    fn model(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<TrackModel, ModelError> {
        let supports = self.unknowns.supports(&self.section, values);
        TrackModel::build(&self.section.track.design, &self.section.mesh(), &supports, extensions)
    }

    fn noise(&self, speed: usize, band: usize) -> f64 {
        let bandwidth: f64 = self.bands.weights(band).iter().map(|&(_, weight)| weight).sum();
        bandwidth * self.noise_density[speed]
    }

    /// Power in m2/s4 from the shapes of rail and wheel, one value per pass; a single value if it is the
    /// same in all passes.
    fn shape_powers(
        &self,
        transfer: &Transfer,
        sleeper: usize,
        speed: usize,
        band: usize,
    ) -> Vec<f64> {
        let wheel = transfer.wheel.get(speed).map_or(&[][..], Vec::as_slice);
        if transfer.rail.is_empty() && transfer.rail_elsewhere.is_empty() && wheel.is_empty() {
            return vec![0.0];
        }
        let weights = self.bands.weights(band);
        let window = &self.windows[speed][sleeper][band];
        let powers: Vec<_> =
            weights.iter().map(|&(line, _)| transfer.mean_power(window, line)).collect();
        let speed_m_s = self.speeds_m_s[speed];
        let seat_node = self.section.seat_node(sleeper);
        let power = |shape: &Shape, share: &dyn Fn(usize) -> f64| {
            let lines = weights.iter().zip(&powers);
            let of_line = |(&(line, weight), power): (&(usize, f64), &f64)| {
                let frequency_hz = self.bands.lines_hz()[line];
                share(line) * weight * power * shape.density(sleeper, speed_m_s, frequency_hz)
            };
            lines.map(of_line).sum::<f64>()
        };
        let further = transfer.further_wheels();
        let own = |line: usize| further.own_share(line, seat_node);
        let power_elsewhere = |(wheel, shape): &(usize, Shape)| {
            power(shape, &|line| further.share(*wheel, line, seat_node))
        };
        let rail = transfer.rail.iter().map(|shape| power(shape, &own)).sum::<f64>()
            + transfer.rail_elsewhere.iter().map(power_elsewhere).sum::<f64>();
        if wheel.is_empty() {
            return vec![rail];
        }
        wheel.iter().map(|wheel| rail + power(wheel, &own)).collect()
    }

    /// Mean logarithm of a random power plus the power of a shape, less the offset of the null model. With the share
    /// s of the shape the random part of the logarithm is lower by the factor 1 - s²: for one complex Gaussian amplitude
    /// beside a constant one, to within 0.05 of the largest bias.
    fn mean_logarithm(&self, [random, shape]: [f64; 2], speed: usize, band: usize) -> f64 {
        let share = shape / (random + shape);
        (random + shape).ln() - self.log_bias(speed, band) * share * share
    }

    /// Derivative of [`Forward::mean_logarithm`] with respect to the random power.
    fn per_random_power(&self, [random, shape]: [f64; 2], speed: usize, band: usize) -> f64 {
        let share = shape / (random + shape);
        (1.0 + 2.0 * self.log_bias(speed, band) * share * share) / (random + shape)
    }

    fn log_bias(&self, speed: usize, band: usize) -> f64 {
        self.log_bias[speed * self.bands.count() + band]
    }

    /// Power spectral density of the surface in m2/Hz, at level one with the baseline's spectrum:
    /// `[speed][line]`.
    pub(crate) fn excitation(&self, transfer: &Transfer, values: &DVector<f64>) -> Vec<Vec<f64>> {
        let of_line = |speed_m_s: f64, (&hz, &surface): (&f64, &f64)| {
            let wave_number = TAU * hz / speed_m_s;
            let shares = self.unknowns.spectrum_shares(wave_number);
            let shape: f64 = shares.iter().map(|&(knot, share)| share * values[knot]).sum();
            surface * shape.exp() * transfer.roughness_gain(wave_number)
        };
        let of_speed = |(&speed_m_s, surface): (&f64, &Vec<f64>)| {
            let lines = self.bands.lines_hz().iter().zip(surface);
            lines.map(|line| of_line(speed_m_s, line)).collect()
        };
        self.speeds_m_s.iter().zip(&self.surface).map(of_speed).collect()
    }

    /// Power in m2/s4 of the excitation of one speed in a band over a sleeper, at level one.
    fn power(
        &self,
        transfer: &Transfer,
        excitation: &[f64],
        (sleeper, speed, band): (usize, usize, usize),
    ) -> f64 {
        let window = &self.windows[speed][sleeper][band];
        let lines = self.bands.weights(band).iter();
        lines
            .map(|&(line, weight)| weight * excitation[line] * transfer.mean_power(window, line))
            .sum()
    }

    /// Logarithm of the sensor's power response in a band.
    fn response(&self, values: &DVector<f64>, band: usize) -> f64 {
        let shares = self.unknowns.response_shares(self.bands.centres_hz()[band]);
        shares.iter().map(|&(knot, share)| share * values[knot]).sum()
    }

    /// Product of the level at the sleeper and the gain of the speed.
    fn scale(&self, values: &DVector<f64>, sleeper: usize, speed: usize) -> f64 {
        let unknowns = &self.unknowns;
        (values[unknowns.at(Own::Level, sleeper)] + values[unknowns.gain(speed)]).exp()
    }
}

/// Mean of a function over some values.
fn mean(values: Vec<f64>, function: impl Fn(f64) -> f64) -> f64 {
    let count = values.len() as f64;
    values.into_iter().map(function).sum::<f64>() / count
}
