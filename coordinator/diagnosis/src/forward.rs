//! Mean log powers that a track model predicts, without any time simulation.
//!
//! The wheel at `x` is excited by the surface through the quasi-static transfer
//! `|H| = 1 / (m |1/k_H + alpha_r(x, x) + alpha_w|)`; the mean power in a band over a sleeper is
//! the surface's spectrum times `|H|^2`, averaged over band and window (mismatch design, eq. 2, 3).

use crate::bands::Bands;
use crate::baseline::Unknowns;
use crate::section::Section;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_track::extension::Extension;
use tracktwin_track::frequency::{RailReceptances, support_stiffness};
use tracktwin_track::model::{HertzContact, ModelError, Roughness, TrackModel};

/// Relative step by which stiffnesses are varied for derivatives.
const STEP: f64 = 1e-4;

/// Sleepers on either side whose supports are felt in a sleeper's window.
const NEIGHBOURS: usize = 9;

/// Predicts the log powers over a section: `[sleeper][speed][band]`, one after the other.
#[derive(Clone, Debug)]
pub struct Forward {
    /// The stretch of track.
    pub section: Section,
    /// The bands.
    pub bands: Bands,
    /// Speeds in m/s.
    pub speeds_m_s: Vec<f64>,
    /// What a baseline leaves free.
    pub unknowns: Unknowns,
    /// One-sided power spectral density in m2/s3 of the sensor's noise at each speed.
    pub noise_density: Vec<f64>,
    /// `[speed][sleeper][band]`: the nodes of the rail that are seen.
    windows: Vec<Vec<Vec<Vec<(usize, f64)>>>>,
    /// Spectrum of the surface at level one in m2/Hz at each speed and line.
    surface: Vec<Vec<f64>>,
}

/// A prediction and its derivatives by the baseline's unknowns.
pub struct Linearised {
    /// Predicted log powers.
    pub log_power: DVector<f64>,
    /// A row for each of them, a column for each unknown.
    pub jacobian: DMatrix<f64>,
}

/// Irregularity to acceleration, squared, at all lines and nodes.
struct Transfer {
    /// `|H|^2` in 1/s4, `[line][node]`.
    power: Vec<Vec<f64>>,
    /// `1 / (1/k_H + alpha_r + alpha_w)` in N/m, `[line][node]`.
    stiffness: Vec<Vec<Complex64>>,
    /// `alpha_r` from the rail seats, if asked for.
    from_seats: Vec<Vec<Vec<Complex64>>>,
}

impl Forward {
    /// A predictor for these speeds in km/h with the sensor's noise densities.
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
        let unknowns = Unknowns::new(&section, speeds_m_s.len(), wave_numbers);
        let windows = speeds_m_s.iter().map(|&v| section.all_weights(v, &bands)).collect();
        // A density per rad/m becomes one per Hz at this speed.
        let density = |v: f64, hz: f64| Roughness::new(1.0).density(TAU * hz / v) * TAU / v;
        let surface =
            speeds_m_s.iter().map(|&v| lines.iter().map(|&hz| density(v, hz)).collect()).collect();
        Self { section, bands, speeds_m_s, unknowns, noise_density, windows, surface }
    }

    /// How many log powers there are.
    pub fn count(&self) -> usize {
        self.section.sleepers * self.per_sleeper()
    }

    /// Log powers of one sleeper.
    pub fn per_sleeper(&self) -> usize {
        self.speeds_m_s.len() * self.bands.count()
    }

    /// Log powers of a baseline with extensions.
    ///
    /// # Errors
    /// [`ModelError`] when values and extensions make no track.
    pub fn log_power(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<DVector<f64>, ModelError> {
        let transfer = self.transfer(values, extensions, false)?;
        let mut all = DVector::zeros(self.count());
        self.fill(&mut all, |sleeper, speed, band| {
            let power = self.power(&transfer, values, sleeper, speed, band);
            (power + self.noise(speed, band)).ln()
        });
        Ok(all)
    }

    /// Log powers of a baseline with extensions, and their derivatives by the baseline's unknowns.
    ///
    /// # Errors
    /// As [`Forward::log_power`].
    pub fn linearised(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<Linearised, ModelError> {
        let transfer = self.transfer(values, extensions, true)?;
        let variations = self.variations(values)?;
        let mut log_power = DVector::zeros(self.count());
        let mut jacobian = DMatrix::zeros(self.count(), self.unknowns.count());
        let rows: Vec<_> = (0..self.count())
            .into_par_iter()
            .map(|row| self.row(&transfer, &variations, values, row))
            .collect();
        for (row, (value, derivatives)) in rows.into_iter().enumerate() {
            log_power[row] = value;
            for (column, derivative) in derivatives {
                jacobian[(row, column)] += derivative;
            }
        }
        Ok(Linearised { log_power, jacobian })
    }

    /// Sleeper, speed and band of a row.
    pub fn place(&self, row: usize) -> (usize, usize, usize) {
        let (sleeper, rest) = (row / self.per_sleeper(), row % self.per_sleeper());
        (sleeper, rest / self.bands.count(), rest % self.bands.count())
    }

    fn fill(&self, all: &mut DVector<f64>, value: impl Fn(usize, usize, usize) -> f64 + Sync) {
        all.as_mut_slice().par_iter_mut().enumerate().for_each(|(row, entry)| {
            let (sleeper, speed, band) = self.place(row);
            *entry = value(sleeper, speed, band);
        });
    }

    fn transfer(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
        from_seats: bool,
    ) -> Result<Transfer, ModelError> {
        let design = &self.section.design;
        let supports = self.unknowns.supports(&self.section, values);
        let model = TrackModel::build(design, &self.section.mesh(), &supports, extensions)?;
        let lines = self.bands.lines_hz();
        let receptances = RailReceptances::new(&model, lines, from_seats);
        let (mass, load) = (design.wheel.mass_kg, design.wheel.load_n);
        let contact = HertzContact::new(design);
        // Slope of the Hertzian law at the static load.
        let hertz = 1.5 * load / contact.approach(load);
        let stiffness: Vec<Vec<Complex64>> = lines
            .iter()
            .zip(&receptances.direct)
            .map(|(&hz, direct)| {
                let wheel = -1.0 / (mass * (TAU * hz).powi(2));
                direct.iter().map(|rail| (1.0 / hertz + wheel + rail).inv()).collect()
            })
            .collect();
        let power = stiffness
            .iter()
            .map(|line| line.iter().map(|k| k.norm_sqr() / mass.powi(2)).collect())
            .collect();
        Ok(Transfer { power, stiffness, from_seats: receptances.from_seats })
    }

    /// Derivatives of each compared support's dynamic stiffness by the logarithms of `k_b`, `k_p`,
    /// `EI_s`, `c_p` and `c_b`: `[sleeper][parameter][line]`.
    fn variations(&self, values: &DVector<f64>) -> Result<Vec<[Vec<Complex64>; 5]>, ModelError> {
        let lines = self.bands.lines_hz();
        let stiffness = |support| {
            let elements = Section::sleeper_elements();
            support_stiffness(&self.section.design, elements, &support, lines)
        };
        (0..self.section.sleepers)
            .into_par_iter()
            .map(|sleeper| {
                let support = self.unknowns.support(values, sleeper);
                let plain = stiffness(support)?;
                let mut varied = [support; 5];
                varied[0].ballast_stiffness *= 1.0 + STEP;
                varied[1].railpad_stiffness *= 1.0 + STEP;
                varied[2].sleeper_bending_stiffness *= 1.0 + STEP;
                varied[3].railpad_damping *= 1.0 + STEP;
                varied[4].ballast_damping *= 1.0 + STEP;
                let mut derivatives = [const { Vec::new() }; 5];
                for (derivative, support) in derivatives.iter_mut().zip(varied) {
                    let changed = stiffness(support)?;
                    *derivative = changed.iter().zip(&plain).map(|(a, b)| (a - b) / STEP).collect();
                }
                Ok(derivatives)
            })
            .collect()
    }

    fn noise(&self, speed: usize, band: usize) -> f64 {
        let bandwidth: f64 = self.bands.weights(band).iter().map(|&(_, weight)| weight).sum();
        bandwidth * self.noise_density[speed]
    }

    /// Density of the surface at a line, at level one with the baseline's spectrum, times the
    /// line's weight.
    fn excitation(&self, values: &DVector<f64>, speed: usize, line: usize) -> f64 {
        let wave_number = TAU * self.bands.lines_hz()[line] / self.speeds_m_s[speed];
        let shares = self.unknowns.spectrum_shares(wave_number);
        let shape: f64 = shares.iter().map(|&(knot, share)| share * values[knot]).sum();
        self.surface[speed][line] * shape.exp()
    }

    /// Power of the surface's excitation in m2/s4.
    fn power(
        &self,
        transfer: &Transfer,
        values: &DVector<f64>,
        sleeper: usize,
        speed: usize,
        band: usize,
    ) -> f64 {
        let window = &self.windows[speed][sleeper][band];
        let lines = self.bands.weights(band).iter().map(|&(line, weight)| {
            let power = &transfer.power[line];
            let seen: f64 = window.iter().map(|&(node, share)| share * power[node]).sum();
            weight * self.excitation(values, speed, line) * seen
        });
        lines.sum::<f64>() * self.scale(values, sleeper, speed)
    }

    /// Level at the sleeper and gain of the speed.
    fn scale(&self, values: &DVector<f64>, sleeper: usize, speed: usize) -> f64 {
        let unknowns = &self.unknowns;
        (values[unknowns.level().start + sleeper] + values[unknowns.gains().start + speed]).exp()
    }

    /// One predicted log power and its derivatives.
    fn row(
        &self,
        transfer: &Transfer,
        variations: &[[Vec<Complex64>; 5]],
        values: &DVector<f64>,
        row: usize,
    ) -> (f64, Vec<(usize, f64)>) {
        let (sleeper, speed, band) = self.place(row);
        let unknowns = &self.unknowns;
        let window = &self.windows[speed][sleeper][band];
        let scale = self.scale(values, sleeper, speed);
        let near = self.near(sleeper);
        let mut supports = vec![[0.0; 5]; near.len()];
        let mut spectrum = Vec::new();
        let mut power = 0.0;
        for &(line, weight) in self.bands.weights(band) {
            let weight = scale * weight * self.excitation(values, speed, line);
            let seen: f64 =
                window.iter().map(|&(node, share)| share * transfer.power[line][node]).sum();
            power += weight * seen;
            let wave_number = TAU * self.bands.lines_hz()[line] / self.speeds_m_s[speed];
            for (knot, share) in unknowns.spectrum_shares(wave_number) {
                spectrum.push((knot, share * weight * seen));
            }
            for (sums, &(in_track, compared)) in supports.iter_mut().zip(&near) {
                // d alpha = -alpha_seat^2 dZ, d |H|^2 = -2 |H|^2 Re(k d alpha).
                let column = &transfer.from_seats[line][in_track];
                let felt: Complex64 = window
                    .iter()
                    .map(|&(node, share)| {
                        let power = share * transfer.power[line][node];
                        2.0 * power * transfer.stiffness[line][node] * column[node] * column[node]
                    })
                    .sum();
                for (sum, variation) in sums.iter_mut().zip(&variations[compared]) {
                    *sum += weight * (felt * variation[line]).re;
                }
            }
        }
        let total = power + self.noise(speed, band);
        let mut derivatives: Vec<_> =
            spectrum.into_iter().map(|(knot, sum)| (knot, sum / total)).collect();
        derivatives.push((unknowns.level().start + sleeper, power / total));
        derivatives.push((unknowns.gains().start + speed, power / total));
        let global = unknowns.global().start;
        for (sums, (_, compared)) in supports.iter().zip(near) {
            let columns = [
                unknowns.ballast().start + compared,
                unknowns.railpad().start + compared,
                global,
                global + 1,
                global + 2,
            ];
            derivatives.extend(columns.into_iter().zip(sums.iter().map(|sum| sum / total)));
        }
        (total.ln(), derivatives)
    }

    /// Sleepers of the track near a compared one: number in the track, and the compared one whose
    /// values it has.
    fn near(&self, sleeper: usize) -> Vec<(usize, usize)> {
        let middle = Section::in_track(sleeper);
        self.section
            .compared()
            .enumerate()
            .filter(|(in_track, _)| in_track.abs_diff(middle) <= NEIGHBOURS)
            .collect()
    }
}
