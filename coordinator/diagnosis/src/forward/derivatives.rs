//! How predicted log powers change with the baseline's unknowns, and with whatever hangs under a
//! rail seat: exact in the receptances, without predicting anew for each unknown.

use super::{Forward, mean};
use crate::transfer::Transfer;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_track::extension::Extension;
use tracktwin_track::frequency::seat_stiffness;
use tracktwin_track::model::{ModelError, Support, TrackModel};

/// Relative step by which stiffnesses are varied for derivatives.
const STEP: f64 = 1e-4;

/// Sleepers on either side whose supports are felt in a sleeper's window.
const NEIGHBOURS: usize = 9;

/// Change of the dynamic stiffness at the rail seats: `[line][sleeper of the track]`.
type Variation = Vec<Vec<Complex64>>;

/// A prediction and its derivatives by the baseline's unknowns.
pub struct Linearised {
    /// Predicted log powers.
    pub log_power: DVector<f64>,
    /// A row for each of them, a column for each unknown.
    pub jacobian: DMatrix<f64>,
}

/// A track with what its derivatives are made of.
struct State {
    transfer: Transfer,
    /// By `k_b`, `k_p`, `EI_s`, `c_p` and `c_b`.
    variations: Vec<Variation>,
    /// Spectrum of the surface: `[speed][line]`.
    excitation: Vec<Vec<f64>>,
}

impl Forward {
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
        let variations = self.variations(values, extensions)?;
        let excitation = self.excitation(&transfer, values);
        let state = State { transfer, variations, excitation };
        let mut log_power = DVector::zeros(self.count());
        let mut jacobian = DMatrix::zeros(self.count(), self.unknowns.count());
        let rows: Vec<_> =
            (0..self.count()).into_par_iter().map(|row| self.row(&state, values, row)).collect();
        for (row, (value, derivatives)) in rows.into_iter().enumerate() {
            log_power[row] = value;
            for (column, derivative) in derivatives {
                jacobian[(row, column)] += derivative;
            }
        }
        Ok(Linearised { log_power, jacobian })
    }

    /// Changes of the log powers by dynamic stiffnesses added under each compared sleeper's rail
    /// seat: a matrix a sleeper, a column for each shape over the lines, in parts of the track's own
    /// stiffness there.
    ///
    /// # Errors
    /// As [`Forward::log_power`].
    pub(crate) fn port_columns(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
        shapes: &[Vec<Complex64>],
    ) -> Result<Vec<DMatrix<f64>>, ModelError> {
        let transfer = self.transfer(values, extensions, true)?;
        let excitation = self.excitation(&transfer, values);
        let of_sleeper = |sleeper: usize| {
            let in_track = self.section.in_track(sleeper);
            let seat_node = self.section.seat_node(sleeper);
            let mut columns = DMatrix::zeros(self.count(), shapes.len());
            for row in 0..self.count() {
                let (seen_from, speed, band) = self.place(row);
                if seen_from.abs_diff(sleeper) > NEIGHBOURS {
                    continue;
                }
                let window = &self.windows[speed][seen_from][band];
                let excitation = &excitation[speed];
                let scale = self.scale(values, seen_from, speed);
                let power = scale * self.power(&transfer, excitation, (seen_from, speed, band));
                let floor = power + self.noise(speed, band);
                let shapes_of_rail = self.shape_powers(&transfer, seen_from, speed, band);
                let share = scale * mean(shapes_of_rail, |shape| (floor + shape).recip());
                for &(line, weight) in self.bands.weights(band) {
                    let weight = share * weight * excitation[line];
                    let column = &transfer.from_seats[line][in_track];
                    let own = 1.0 / column[seat_node].norm();
                    let felt = weight * own * transfer.felt(window, line, column);
                    for (shape, lines) in shapes.iter().enumerate() {
                        columns[(row, shape)] += (felt * lines[line]).re;
                    }
                }
            }
            columns
        };
        Ok((0..self.section.sleepers).into_par_iter().map(of_sleeper).collect())
    }

    /// Derivatives of each sleeper's dynamic stiffness under the rail by the logarithms of `k_b`,
    /// `k_p`, `EI_s`, `c_p` and `c_b`: `[parameter][line][sleeper of the track]`.
    ///
    /// Taken from the model with its extensions, which may stand in series with a support.
    fn variations(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<Vec<Variation>, ModelError> {
        let lines = self.bands.lines_hz();
        let supports = self.unknowns.supports(&self.section, values);
        let stiffness = |vary: fn(&mut Support)| {
            let mut varied = supports.clone();
            varied.iter_mut().for_each(vary);
            let mesh = self.section.mesh();
            let model = TrackModel::build(&self.section.design, &mesh, &varied, extensions)?;
            Ok(seat_stiffness(&model, lines))
        };
        let plain = stiffness(|_| ())?;
        let derivative = |vary: fn(&mut Support)| {
            let mut changed = stiffness(vary)?;
            for (changed, plain) in changed.iter_mut().flatten().zip(plain.iter().flatten()) {
                *changed = (*changed - plain) / STEP;
            }
            Ok(changed)
        };
        let vary: [fn(&mut Support); 5] = [
            |support| support.ballast_stiffness *= 1.0 + STEP,
            |support| support.railpad_stiffness *= 1.0 + STEP,
            |support| support.sleeper_bending_stiffness *= 1.0 + STEP,
            |support| support.railpad_damping *= 1.0 + STEP,
            |support| support.ballast_damping *= 1.0 + STEP,
        ];
        vary.into_iter().map(derivative).collect()
    }

    /// One predicted log power and its derivatives.
    fn row(&self, state: &State, values: &DVector<f64>, row: usize) -> (f64, Vec<(usize, f64)>) {
        let State { transfer, variations, excitation } = state;
        let (sleeper, speed, band) = self.place(row);
        let unknowns = &self.unknowns;
        let window = &self.windows[speed][sleeper][band];
        let scale = self.scale(values, sleeper, speed);
        let near = self.near(sleeper);
        let mut supports = vec![[0.0; 5]; near.len()];
        let mut spectrum = Vec::new();
        let mut power = 0.0;
        for &(line, weight) in self.bands.weights(band) {
            let weight = scale * weight * excitation[speed][line];
            let seen = transfer.mean_power(window, line);
            power += weight * seen;
            let wave_number = TAU * self.bands.lines_hz()[line] / self.speeds_m_s[speed];
            for (knot, share) in unknowns.spectrum_shares(wave_number) {
                spectrum.push((knot, share * weight * seen));
            }
            for (sums, &(in_track, _)) in supports.iter_mut().zip(&near) {
                let column = &transfer.from_seats[line][in_track];
                let felt = transfer.felt(window, line, column);
                for (sum, variation) in sums.iter_mut().zip(variations) {
                    *sum += weight * (felt * variation[line][in_track]).re;
                }
            }
        }
        let floor = power + self.noise(speed, band);
        let shapes = self.shape_powers(transfer, sleeper, speed, band);
        let log_power = mean(shapes.clone(), |shape| (floor + shape).ln());
        // What a change of the random power is divided by.
        let total = 1.0 / mean(shapes, |shape| (floor + shape).recip());
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
        (log_power, derivatives)
    }

    /// Sleepers of the track near a compared one: number in the track, and the compared one whose
    /// values it has.
    fn near(&self, sleeper: usize) -> Vec<(usize, usize)> {
        let middle = self.section.in_track(sleeper);
        self.section
            .compared()
            .enumerate()
            .filter(|(in_track, _)| in_track.abs_diff(middle) <= NEIGHBOURS)
            .collect()
    }
}
