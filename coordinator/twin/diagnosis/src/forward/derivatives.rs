//! Derivatives of the predicted log powers with respect to the baseline's unknowns and the dynamic
//! stiffness at a rail seat: exact in the receptances, without a new prediction for each unknown.

use super::supports::{NEIGHBOURS, SupportChanges, VARIED, Variation};
use super::{Forward, mean};
use crate::quantity::{Common, Own, Quantity};
use crate::section::Window;
use crate::transfer::Transfer;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_track::extension::Extension;
use tracktwin_track::frequency::seat_stiffness;
use tracktwin_track::model::{ModelError, Support, TrackModel};

/// Relative change of stiffnesses and damping for numerical derivatives.
const STEP: f64 = 1e-4;

/// Changes a value of a support by the factor 1 + [`STEP`].
type Vary = fn(&mut Support);

/// Varied values of a support: the unknown and the function that changes the value.
const VARIATIONS: [(Quantity, Vary); VARIED] = [
    (Quantity::Own(Own::BallastStiffness), |it| it.ballast_stiffness *= 1.0 + STEP),
    (Quantity::Own(Own::RailpadStiffness), |it| it.railpad_stiffness *= 1.0 + STEP),
    (Quantity::Common(Common::SleeperBendingStiffness), |it| {
        it.sleeper_bending_stiffness *= 1.0 + STEP;
    }),
    (Quantity::Common(Common::RailpadDamping), |it| it.railpad_damping *= 1.0 + STEP),
    (Quantity::Common(Common::BallastDamping), |it| it.ballast_damping *= 1.0 + STEP),
];

/// Place of the railpad's damping in [`VARIATIONS`]; each sleeper's own ratio varies it, too.
const RAILPAD_DAMPING: usize = 3;

/// A prediction with its derivatives with respect to the baseline's unknowns.
pub struct Linearised {
    /// Predicted log powers.
    pub log_power: DVector<f64>,
    /// Derivatives: one row per log power, one column per unknown.
    pub jacobian: DMatrix<f64>,
    /// The transfer from which the log powers are predicted.
    pub(crate) transfer: Transfer,
}

/// Changes of the log powers from unknown dynamic stiffnesses, relative to the existing stiffness: one row
/// per log power, one column per shape over the lines.
pub(crate) struct PortColumns {
    /// For a stiffness under the rail seat of each sleeper of the whole track.
    pub(crate) seats: Vec<DMatrix<f64>>,
    /// For a stiffness between the rail seats of each compared sleeper (except the first) and the one
    /// before it.
    pub(crate) between: Vec<DMatrix<f64>>,
    /// For a stiffness between wheel and ground.
    pub(crate) wheel: DMatrix<f64>,
    /// Magnitudes of the receptances in m/N to which the stiffnesses at the seats refer: `[sleeper of the
    /// whole track][line]`.
    pub(crate) seat_receptances: Vec<Vec<f64>>,
    /// Receptance of the wheel in m/N at each line.
    pub(crate) wheel_receptance: Vec<f64>,
}

/// State of a track from which derivatives are computed.
struct State {
    transfer: Transfer,
    /// Changes from `k_b`, `k_p`, `EI_s`, `c_p` and `c_b` of each support.
    supports: SupportChanges,
    /// Spectrum of the surface: `[speed][line]`.
    excitation: Vec<Vec<f64>>,
}

impl Forward {
    /// Log powers of a baseline with extensions, and their derivatives with respect to the baseline's
    /// unknowns.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub fn linearised(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<Linearised, ModelError> {
        let transfer = self.transfer(values, extensions, true)?;
        let variations = self.variations(transfer.model(), values, extensions)?;
        let excitation = self.excitation(&transfer, values);
        let supports = SupportChanges::new(self, &transfer, &variations, &excitation);
        let state = State { transfer, supports, excitation };
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
        Ok(Linearised { log_power, jacobian, transfer: state.transfer })
    }

    /// Changes of the log powers from dynamic stiffnesses that are added under each sleeper's rail seat,
    /// between the seats of compared neighbours, and between wheel and ground.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub(crate) fn port_columns(
        &self,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
        shapes: &[Vec<Complex64>],
    ) -> Result<PortColumns, ModelError> {
        let transfer = self.transfer(values, extensions, true)?;
        let excitation = self.excitation(&transfer, values);
        let shares: Vec<f64> =
            (0..self.count()).map(|row| self.share(&transfer, &excitation, values, row)).collect();
        let seat = |in_track: usize| {
            let seat_node = self.section.node_above(in_track);
            self.columns(&shares, &excitation, shapes, |seen_from, window, line| {
                let seen_from = self.section.in_track(seen_from);
                let sensitivity = || transfer.sensitivity(window, line, in_track);
                (seen_from.abs_diff(in_track) <= NEIGHBOURS)
                    .then(|| sensitivity() / transfer.receptance(line, seat_node))
            })
        };
        let between = |sleeper: usize| {
            let pair = [sleeper - 1, sleeper];
            let in_track = pair.map(|sleeper| self.section.in_track(sleeper));
            let seat_node = self.section.seat_node(sleeper);
            self.columns(&shares, &excitation, shapes, |seen_from, window, line| {
                let is_near = pair.iter().any(|sleeper| seen_from.abs_diff(*sleeper) <= NEIGHBOURS);
                let sensitivity = || transfer.sensitivity_between(window, line, in_track);
                is_near.then(|| sensitivity() / transfer.receptance(line, seat_node))
            })
        };
        let seats = (0..self.section.spans() - 1).into_par_iter().map(seat).collect();
        let between = (1..self.section.sleepers()).into_par_iter().map(between).collect();
        let wheel = self.columns(&shares, &excitation, shapes, |_, window, line| {
            Some(transfer.sensitivity_at_wheel(window, line))
        });
        let lines = 0..self.bands.lines_hz().len();
        let receptances = |in_track: usize| {
            let seat_node = self.section.node_above(in_track);
            lines.clone().map(|line| transfer.receptance(line, seat_node)).collect()
        };
        let seat_receptances = (0..self.section.spans() - 1).map(receptances).collect();
        let wheel_receptance = lines.map(|line| transfer.wheel_receptance(line)).collect();
        Ok(PortColumns { seats, between, wheel, seat_receptances, wheel_receptance })
    }

    /// Changes of the log powers from a stiffness with the given shapes. `sensitivity` is the change of the
    /// mean power over a sleeper's window at a line from a stiffness of relative size one; `None` if there
    /// is no effect.
    fn columns(
        &self,
        shares: &[f64],
        excitation: &[Vec<f64>],
        shapes: &[Vec<Complex64>],
        sensitivity: impl Fn(usize, &Window, usize) -> Option<Complex64>,
    ) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(self.count(), shapes.len());
        for (row, share) in shares.iter().enumerate() {
            let (sleeper, speed, band) = self.place(row);
            let window = &self.windows[speed][sleeper][band];
            for &(line, weight) in self.bands.weights(band) {
                let Some(sensitivity) = sensitivity(sleeper, window, line) else { break };
                let sensitivity = share * weight * excitation[speed][line] * sensitivity;
                for (shape, lines) in shapes.iter().enumerate() {
                    columns[(row, shape)] += (sensitivity * lines[line]).re;
                }
            }
        }
        columns
    }

    /// Factor that converts a change of the random power to a change of the log power of a row.
    fn share(
        &self,
        transfer: &Transfer,
        excitation: &[Vec<f64>],
        values: &DVector<f64>,
        row: usize,
    ) -> f64 {
        let (sleeper, speed, band) = self.place(row);
        let scale = self.scale(values, sleeper, speed);
        let power = scale * self.power(transfer, &excitation[speed], (sleeper, speed, band));
        let floor = power + self.noise(speed, band);
        let shapes = self.shape_powers(transfer, sleeper, speed, band);
        scale * mean(shapes, |shape| self.per_random_power([floor, shape], speed, band))
    }

    /// Derivatives of each sleeper's dynamic stiffness under the rail with respect to the logarithms of
    /// `k_b`, `k_p`, `EI_s`, `c_p` and `c_b`: `[parameter][line][sleeper of the track]`.
    ///
    /// They are computed on the model of these values with its extensions, which may be in series with a
    /// support.
    fn variations(
        &self,
        model: &TrackModel,
        values: &DVector<f64>,
        extensions: &[Arc<dyn Extension>],
    ) -> Result<[Variation; VARIED], ModelError> {
        let lines = self.bands.lines_hz();
        let supports = self.unknowns.supports(&self.section, values);
        let stiffness = |vary: fn(&mut Support)| {
            let mut varied = supports.clone();
            varied.iter_mut().for_each(vary);
            let mesh = self.section.mesh();
            let model = TrackModel::build(&self.section.track.design, &mesh, &varied, extensions)?;
            Ok(seat_stiffness(&model, lines))
        };
        let plain = seat_stiffness(model, lines);
        let derivative = |vary: fn(&mut Support)| {
            let mut changed = stiffness(vary)?;
            for (changed, plain) in changed.iter_mut().flatten().zip(plain.iter().flatten()) {
                *changed = (*changed - plain) / STEP;
            }
            Ok(changed)
        };
        let mut varied = std::array::from_fn(|_| Variation::new());
        for (variation, (_, vary)) in varied.iter_mut().zip(VARIATIONS) {
            *variation = derivative(vary)?;
        }
        Ok(varied)
    }

    /// One predicted log power and its derivatives.
    fn row(&self, state: &State, values: &DVector<f64>, row: usize) -> (f64, Vec<(usize, f64)>) {
        let State { transfer, supports, excitation } = state;
        let (sleeper, speed, band) = self.place(row);
        let unknowns = &self.unknowns;
        let window = &self.windows[speed][sleeper][band];
        let scale = self.scale(values, sleeper, speed);
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
        }
        let floor = power + self.noise(speed, band);
        let shapes = self.shape_powers(transfer, sleeper, speed, band);
        let beyond = unknowns
            .beyond()
            .enumerate()
            .map(|(column, index)| (index, self.beyond[(row, column)]));
        let log_power = self.response(values, band)
            + mean(shapes.clone(), |shape| self.mean_logarithm([floor, shape], speed, band))
            + beyond.clone().map(|(index, change)| values[index] * change).sum::<f64>();
        let per_power = mean(shapes, |shape| self.per_random_power([floor, shape], speed, band));
        let mut derivatives: Vec<_> =
            spectrum.into_iter().map(|(knot, sum)| (knot, sum * per_power)).collect();
        derivatives.push((unknowns.at(Own::Level, sleeper), power * per_power));
        derivatives.push((unknowns.gain(speed), power * per_power));
        derivatives.extend(beyond);
        derivatives.extend(unknowns.response_shares(self.bands.centres_hz()[band]));
        for (in_track, compared) in self.near(sleeper) {
            let columns = VARIATIONS.map(|(quantity, _)| unknowns.of(quantity, compared));
            let changes = supports.at(in_track, sleeper, row % self.per_sleeper());
            let changes = changes.map(|change| scale * change * per_power);
            derivatives.extend(columns.into_iter().zip(changes));
            let damping = unknowns.railpad_damping().start + compared;
            derivatives.push((damping, changes[RAILPAD_DAMPING]));
        }
        (log_power, derivatives)
    }

    /// Sleepers of the track near a compared one, as pairs: index in the track, and index of the compared
    /// sleeper whose values it takes.
    fn near(&self, sleeper: usize) -> Vec<(usize, usize)> {
        let middle = self.section.in_track(sleeper);
        self.section
            .compared()
            .enumerate()
            .filter(|(in_track, _)| in_track.abs_diff(middle) <= NEIGHBOURS)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::section::Section;
    use std::f64::consts::TAU;
    use tracktwin_parameters::TrackDesign;
    use tracktwin_track::element::SpringDamper;
    use tracktwin_track::model::Assembly;

    fn forward(design: TrackDesign) -> Forward {
        let section = Section::new(design, 3, 1.0);
        Forward::new(section, Bands::new(200.0, 3000.0), &[10.0], vec![0.0])
    }

    #[test]
    fn a_stiffness_at_the_wheel_that_is_mass_changes_levels_as_a_heavier_wheel_does() {
        let design = TrackDesign::v_track();
        let plain = forward(design.clone());
        let values = plain.unknowns.typical();
        let transfer = plain.transfer(&values, &[], false).unwrap();
        let of_mass = |(line, hz): (usize, &f64)| {
            let stiffness = -(TAU * hz).powi(2) * design.wheel.mass_kg;
            Complex64::from(stiffness * transfer.wheel_receptance(line))
        };
        let mass = plain.bands.lines_hz().iter().enumerate().map(of_mass).collect();
        let columns = plain.port_columns(&values, &[], &[mass]).unwrap().wheel;
        let share = 1e-4;
        let mut heavier = design;
        heavier.wheel.mass_kg *= 1.0 + share;
        let [heavier, plain] =
            [forward(heavier), plain].map(|forward| forward.log_power(&values, &[]).unwrap());
        let expected = (heavier - plain) / share;
        let error = (columns.column(0) - &expected).amax() / expected.amax();
        // The second order of a share of 1e-4.
        assert!(error < 2e-3, "{error}");
    }

    /// A spring between the rail seats of two sleepers of the track.
    #[derive(Debug)]
    struct Link([usize; 2], f64);

    impl Extension for Link {
        fn assemble(&self, assembly: &mut Assembly) {
            let layout = assembly.layout();
            let [one, other] = self.0.map(|sleeper| {
                layout.rail_port(layout.rail_nodes_m()[layout.sleepers()[sleeper].rail_node])
            });
            let spring = SpringDamper { stiffness: self.1, damping: 0.0 };
            assembly.add_spring_damper(&one.minus(&other), spring);
        }
    }

    #[test]
    fn a_stiffness_between_two_seats_changes_levels_as_a_spring_between_them_does() {
        let forward = forward(TrackDesign::v_track());
        let values = forward.unknowns.typical();
        let transfer = forward.transfer(&values, &[], true).unwrap();
        let node = forward.section.seat_node(1);
        let lines = 0..forward.bands.lines_hz().len();
        // One newton in a metre, in parts of the track's own stiffness.
        let unit = lines.map(|line| transfer.receptance(line, node).into()).collect();
        let columns = forward.port_columns(&values, &[], &[unit]).unwrap().between;
        let pair = [0, 1].map(|sleeper| forward.section.in_track(sleeper));
        let stiffness = 1e3;
        let link: Arc<dyn Extension> = Arc::new(Link(pair, stiffness));
        let [linked, plain] =
            [vec![link], Vec::new()].map(|links| forward.log_power(&values, &links).unwrap());
        let expected = (linked - plain) / stiffness;
        let error = (columns[0].column(0) - &expected).amax() / expected.amax();
        assert!(error < 2e-3, "{error}");
    }

    #[test]
    fn derivatives_are_the_differences_of_predictions() {
        let mut forward = forward(TrackDesign::v_track());
        let values = forward.unknowns.typical();
        forward.allow_beyond(&values).unwrap();
        let Linearised { log_power, jacobian, .. } = forward.linearised(&values, &[]).unwrap();
        assert!((forward.log_power(&values, &[]).unwrap() - log_power).amax() < 1e-9);
        let step = 1e-4;
        // The outer sleepers stand for all beyond, of which only near ones are taken; so do those
        // that all sleepers share.
        let unknowns = &forward.unknowns;
        let supports =
            [Own::BallastStiffness, Own::RailpadStiffness].map(|quantity| unknowns.at(quantity, 1));
        let others = unknowns.level().chain(unknowns.spectrum().start..unknowns.outer().end);
        let damping = unknowns.railpad_damping().start + 1;
        for unknown in supports.into_iter().chain(others).chain([damping]) {
            let [below, above] = [-step, step].map(|change| {
                let mut varied = values.clone();
                varied[unknown] += change;
                forward.log_power(&varied, &[]).unwrap()
            });
            let difference = (above - below) / (2.0 * step);
            let error = (jacobian.column(unknown) - &difference).amax();
            // The second order of the step, and of that by which stiffnesses are varied.
            assert!(error < 2e-3 * difference.amax().max(1.0), "{unknown}: {error}");
        }
    }
}
