//! Prediction of a hammer test by the track model and the gain of the measurement: logarithms of
//! receptances, and their derivatives.

use crate::layout::Layout;
use crate::measured::PointReceptance;
use crate::unknowns::{Quantity, Unknowns};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use tracktwin_parameters::TrackDesign;
use tracktwin_track::frequency::{RailReceptances, SeatReceptances, seat_stiffness, shares};
use tracktwin_track::model::{Mesh, ModelError, Support, TrackModel};

/// Number of elements of a half sleeper.
const SLEEPER_ELEMENTS: usize = 6;
/// Number of rail nodes on either side of a rail seat that a change of its support affects: ten spans.
const REACH: usize = 80;
/// Step of the logarithm of a support value for numerical derivatives.
const STEP: f64 = 1e-4;

/// A hammer test and the track that is fitted to it.
pub(crate) struct Forward<'a> {
    design: &'a TrackDesign,
    layout: Layout,
    /// The fitted receptances.
    pub(crate) points: &'a [PointReceptance],
    /// All frequencies in Hz, ascending, and, for each point, the indices of its frequencies.
    frequencies_hz: Vec<f64>,
    places: Vec<Vec<usize>>,
}

/// Residuals of one point, with derivatives.
///
/// The rows hold the real parts at all frequencies, then the imaginary parts. A residual is the logarithm
/// of the ratio of measured to predicted receptance: its real part is the difference of the log magnitudes
/// in nats, its imaginary part is the difference of the phases in rad. The prediction contains the gain.
pub(crate) struct PointResidual {
    pub(crate) residual: DVector<f64>,
    /// Derivatives of the predicted logarithm, one column for each of `unknowns`.
    pub(crate) jacobian: DMatrix<f64>,
    pub(crate) unknowns: Vec<usize>,
}

impl<'a> Forward<'a> {
    pub(crate) fn new(
        design: &'a TrackDesign,
        layout: Layout,
        points: &'a [PointReceptance],
    ) -> Self {
        let mut frequencies_hz: Vec<f64> =
            points.iter().flat_map(|point| &point.frequencies_hz).copied().collect();
        frequencies_hz.sort_by(f64::total_cmp);
        frequencies_hz.dedup();
        let place = |hz: &f64| frequencies_hz.partition_point(|other| other < hz);
        let places =
            points.iter().map(|point| point.frequencies_hz.iter().map(place).collect()).collect();
        Self { design, layout, points, frequencies_hz, places }
    }

    pub(crate) const fn design(&self) -> &'a TrackDesign {
        self.design
    }

    pub(crate) const fn layout(&self) -> &Layout {
        &self.layout
    }

    fn model(&self, supports: &[Support]) -> Result<TrackModel, ModelError> {
        let mesh =
            Mesh { rail_elements: self.layout.rail_elements(), sleeper_elements: SLEEPER_ELEMENTS };
        TrackModel::build(self.design, &mesh, supports, &[])
    }

    fn supports(&self, unknowns: &Unknowns, values: &DVector<f64>) -> Vec<Support> {
        unknowns.supports(values, self.layout.spans() - 1, Layout::first_own())
    }

    /// Residuals without derivatives, one vector per point.
    pub(crate) fn residuals(
        &self,
        unknowns: &Unknowns,
        values: &DVector<f64>,
    ) -> Result<Vec<DVector<f64>>, ModelError> {
        let model = self.model(&self.supports(unknowns, values))?;
        let rail = RailReceptances::new(&model, &self.frequencies_hz, None);
        let nodes_m = model.layout().rail_nodes_m();
        let of = |(point, places): (&PointReceptance, &Vec<usize>)| {
            let nodes = shares(nodes_m, point.position_m - self.layout.origin_m());
            let predicted = |&place: &usize| direct(&rail.direct[place], &nodes);
            residual(point, values[Unknowns::GAIN], places.iter().map(predicted))
        };
        Ok(self.points.iter().zip(&self.places).map(of).collect())
    }

    /// Residuals and derivatives, one item per point.
    ///
    /// A change `dZ` of the dynamic stiffness at a rail seat changes a point receptance `a` by `-a_s^2 dZ`,
    /// where `a_s` is the receptance between seat and point. Mean values affect seats far from the point;
    /// the derivatives by the means are therefore numerical differences.
    pub(crate) fn linearised(
        &self,
        unknowns: &Unknowns,
        values: &DVector<f64>,
    ) -> Result<Vec<PointResidual>, ModelError> {
        let supports = self.supports(unknowns, values);
        let model = self.model(&supports)?;
        let variations = self.variations(&model, &supports)?;
        let rail = RailReceptances::new(&model, &self.frequencies_hz, Some(REACH));
        let nodes_m = model.layout().rail_nodes_m();
        let of = |(point, places): (&PointReceptance, &Vec<usize>)| {
            let nodes = shares(nodes_m, point.position_m - self.layout.origin_m());
            let log_gain = values[Unknowns::GAIN];
            Self::point(point, log_gain, places, &nodes, &rail, &variations, unknowns)
        };
        let mut all: Vec<PointResidual> = self.points.iter().zip(&self.places).map(of).collect();
        for mean in Quantity::ALL.map(Unknowns::mean) {
            let mut moved = values.clone();
            moved[mean] += STEP;
            for (point, moved) in all.iter_mut().zip(self.residuals(unknowns, &moved)?) {
                let derivative = (&point.residual - moved) / STEP;
                point.jacobian.set_column(mean, &derivative);
            }
        }
        Ok(all)
    }

    /// Derivatives of the dynamic stiffness of each support with respect to the logarithm of each quantity:
    /// `[quantity][frequency][sleeper]`.
    fn variations(
        &self,
        model: &TrackModel,
        supports: &[Support],
    ) -> Result<Vec<Vec<Vec<Complex64>>>, ModelError> {
        let plain = seat_stiffness(model, &self.frequencies_hz);
        let of = |quantity: Quantity| {
            let mut varied = supports.to_vec();
            for support in &mut varied {
                *quantity.of(support) *= STEP.exp();
            }
            let mut changed = seat_stiffness(&self.model(&varied)?, &self.frequencies_hz);
            for (changed, plain) in changed.iter_mut().flatten().zip(plain.iter().flatten()) {
                *changed = (*changed - plain) / STEP;
            }
            Ok(changed)
        };
        Quantity::ALL.into_iter().map(of).collect()
    }

    /// Residual and derivatives of a point. The columns of the shared unknowns have their indices.
    fn point(
        point: &PointReceptance,
        log_gain: f64,
        places: &[usize],
        nodes: &[(usize, f64)],
        rail: &RailReceptances,
        variations: &[Vec<Vec<Complex64>>],
        unknowns: &Unknowns,
    ) -> PointResidual {
        let seats = &rail.from_seats[0];
        let reaches = |seat: &SeatReceptances| {
            let inside = seat.first..seat.first + seat.values.len();
            nodes.iter().all(|(node, _)| inside.contains(node))
        };
        let near: Vec<usize> = (0..seats.len()).filter(|&it| reaches(&seats[it])).collect();
        let own =
            |seat: usize| seat.checked_sub(Layout::first_own()).filter(|it| *it < unknowns.own);
        let owners: Vec<usize> = near.iter().copied().filter_map(own).collect();
        let first_owner = owners.first().copied().unwrap_or_default();
        let columns: Vec<usize> = (0..Unknowns::SHARED)
            .chain(
                Quantity::ALL
                    .into_iter()
                    .flat_map(|of| owners.iter().map(move |&owner| unknowns.at(of, owner))),
            )
            .collect();
        let lines = places.len();
        let mut jacobian = DMatrix::zeros(2 * lines, columns.len());
        for (line, &place) in places.iter().enumerate() {
            let predicted = direct(&rail.direct[place], nodes);
            jacobian[(line, Unknowns::GAIN)] = 1.0;
            for &seat in &near {
                let receptances = &rail.from_seats[place][seat];
                // As the point receptance is taken between two nodes.
                let square = |&(node, share): &(usize, f64)| {
                    let between = receptances.values[node - receptances.first];
                    share * between * between
                };
                let factor = -nodes.iter().map(square).sum::<Complex64>() / predicted;
                for (quantity, variation) in variations.iter().enumerate() {
                    let derivative = factor * variation[place][seat];
                    let mut add = |column: usize| {
                        jacobian[(line, column)] += derivative.re;
                        jacobian[(lines + line, column)] += derivative.im;
                    };
                    add(quantity);
                    if let Some(owner) = own(seat) {
                        add(Unknowns::SHARED + quantity * owners.len() + owner - first_owner);
                    }
                }
            }
        }
        let predicted = places.iter().map(|&place| direct(&rail.direct[place], nodes));
        let residual = residual(point, log_gain, predicted);
        PointResidual { residual, jacobian, unknowns: columns }
    }
}

/// Direct receptance at a position between nodes, interpolated.
fn direct(line: &[Complex64], nodes: &[(usize, f64)]) -> Complex64 {
    nodes.iter().map(|&(node, share)| line[node] * share).sum()
}

fn residual(
    point: &PointReceptance,
    log_gain: f64,
    predicted: impl ExactSizeIterator<Item = Complex64>,
) -> DVector<f64> {
    let lines = predicted.len();
    let mut residual = DVector::zeros(2 * lines);
    for (line, (measured, predicted)) in point.values.iter().zip(predicted).enumerate() {
        let logarithm = (measured / predicted).ln();
        residual[line] = logarithm.re - log_gain;
        residual[lines + line] = logarithm.im;
    }
    residual
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::Prior;

    #[test]
    fn derivatives_are_differences() {
        let design = TrackDesign::v_track();
        let at = |position_m: f64| PointReceptance {
            position_m,
            frequencies_hz: vec![150.0, 320.0, 700.0, 1100.0, 2500.0],
            values: vec![Complex64::new(1e-8, -1e-8); 5],
            coherence: None,
            hits: None,
        };
        let points = [at(1.0), at(1.0625), at(1.17)];
        let struck = points.iter().map(|point| point.position_m);
        let layout = Layout::new(&design, 1.0, struck).unwrap();
        let forward = Forward::new(&design, layout, &points);
        let unknowns = Unknowns::new(&Prior::v_track(), forward.layout().own());
        let mut values = unknowns.start();
        values[Unknowns::GAIN] = 0.1;
        let linearised = forward.linearised(&unknowns, &values).unwrap();
        let step = 1e-4;
        let mut moved = vec![Unknowns::GAIN, Unknowns::mean(Quantity::RailpadDamping)];
        moved.extend(Quantity::ALL.map(|of| unknowns.at(of, 1)));
        moved.extend(
            [Quantity::BallastStiffness, Quantity::SleeperBendingStiffness].map(Unknowns::mean),
        );
        for unknown in moved {
            let mut other = values.clone();
            other[unknown] += step;
            let residuals = forward.residuals(&unknowns, &other).unwrap();
            for (residual, point) in residuals.iter().zip(&linearised) {
                let column = point.unknowns.iter().position(|it| *it == unknown).unwrap();
                let expected = (&point.residual - residual) / step;
                let error = (point.jacobian.column(column) - &expected).amax();
                // A difference's own error.
                assert!(error < 3e-4, "{unknown}: {error} {expected}");
            }
        }
    }
}
