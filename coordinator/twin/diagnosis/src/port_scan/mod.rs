//! Port scan: test for an unknown dynamic stiffness under rail seats, between two of them or at the
//! wheel.
//!
//! Left-out physics of a sleeper, its railpad or its ballast acts on the rail as an additional dynamic
//! stiffness at the rail seat, which is free at every frequency. A link between two sleepers acts between
//! their seats, and physics of the vehicle acts at the wheel. The signature is linear in this stiffness;
//! the evidence therefore has a closed form (docs/diagnosis.md, eq. 13).

mod bumps;
mod filter;
mod place;
mod prior;

use self::bumps::Bumps;
use self::filter::{Filter, Trace};
pub use self::place::PortPlace;
use self::place::seats_together;
use crate::behaviour::Behaviour;
use crate::calibration::{Calibration, CalibrationError, Problem};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Evidence for an unknown dynamic stiffness at one port.
#[derive(Clone, Debug)]
pub struct UnknownElement {
    /// Port at which it acts.
    pub place: PortPlace,
    /// Log ratio of the evidence to the model without it, in nats.
    pub log_evidence: f64,
    /// Element that the dynamic stiffness resembles, if any.
    pub behaviour: Option<Behaviour>,
    /// Signature: whitened change of the log powers.
    pub change: DVector<f64>,
}

/// Filters that search recordings of a calibrated track for an unknown dynamic stiffness.
pub struct PortScan {
    filters: Vec<Filter>,
    centres_hz: Vec<f64>,
}

impl PortScan {
    /// Computes the signatures for a calibrated track.
    ///
    /// # Errors
    /// [`CalibrationError`] if no model exists for the calibrated values.
    pub fn new(problem: &Problem<'_>, current: &Calibration) -> Result<Self, CalibrationError> {
        Self::of(problem, current, |_| true)
    }

    /// As [`PortScan::new`], for one port.
    ///
    /// # Errors
    /// The errors of [`PortScan::new`].
    pub fn at(
        place: &PortPlace,
        problem: &Problem<'_>,
        current: &Calibration,
    ) -> Result<Self, CalibrationError> {
        Self::of(problem, current, |known| known == place)
    }

    fn of(
        problem: &Problem<'_>,
        current: &Calibration,
        is_one: impl Fn(&PortPlace) -> bool,
    ) -> Result<Self, CalibrationError> {
        let bumps = Bumps::over(problem.forward.bands.lines_hz());
        let mut traces = traces(problem, current, &bumps)?;
        traces.retain(|trace| is_one(&trace.place));
        let jacobian_transposed = current.jacobian.transpose();
        let filter = |trace| Filter::new(trace, current, &jacobian_transposed);
        let filters = traces.into_par_iter().filter_map(filter).collect();
        Ok(Self { filters, centres_hz: bumps.centres_hz })
    }

    /// The best port for a whitened residual. `projected_gradient` is the product of the residual with the
    /// baseline's derivatives.
    pub fn best(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
    ) -> Option<UnknownElement> {
        self.best_where(residual, projected_gradient, |_| true)
    }

    /// As [`PortScan::best`], among the ports for which `is_one` is true.
    pub fn best_where(
        &self,
        residual: &DVector<f64>,
        projected_gradient: &DVector<f64>,
        is_one: impl Fn(&PortPlace) -> bool + Sync,
    ) -> Option<UnknownElement> {
        let filters = self.filters.par_iter().filter(|filter| is_one(&filter.trace.place));
        let found: Vec<_> =
            filters.map(|filter| (filter, filter.evidence(residual, projected_gradient))).collect();
        let best = found.into_iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let (filter, (log_evidence, heights)) = best?;
        Some(UnknownElement {
            place: filter.trace.place.clone(),
            log_evidence,
            behaviour: filter.behaviour(residual, projected_gradient, &heights, &self.centres_hz),
            change: &filter.trace.columns * heights,
        })
    }
}

/// Signatures of the basis functions at every port.
fn traces(
    problem: &Problem<'_>,
    current: &Calibration,
    bumps: &Bumps,
) -> Result<Vec<Trace>, CalibrationError> {
    let (section, observation) = (&problem.forward.section, problem.observation);
    let extensions = problem.extensions(&current.values)?;
    let columns = problem.forward.port_columns(&current.values, &extensions, &bumps.shapes)?;
    let whiten =
        |columns: DMatrix<f64>| observation.fitted_rows(&observation.whiten_matrix(&columns));
    let at_seat =
        |compared: usize| bumps.mean(&columns.seat_receptances[section.in_track(compared)]);
    let seats: Vec<DMatrix<f64>> = columns.seats.into_iter().map(whiten).collect();
    let together = |(compared, in_track): (Vec<usize>, Vec<usize>)| Trace {
        columns: in_track.iter().map(|&sleeper| &seats[sleeper]).sum(),
        receptance: at_seat(compared[0]),
        place: PortPlace::Seats(compared),
    };
    let mut all: Vec<Trace> = seats_together(section).into_iter().map(together).collect();
    all.extend(columns.between.into_iter().enumerate().map(|(first, columns)| Trace {
        place: PortPlace::Between([first, first + 1]),
        columns: whiten(columns),
        receptance: at_seat(first + 1),
    }));
    all.push(Trace {
        place: PortPlace::Wheel,
        columns: whiten(columns.wheel),
        receptance: bumps.mean(&columns.wheel_receptance),
    });
    Ok(all)
}
