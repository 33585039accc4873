//! What a recording says where no name fits: an unknown dynamic stiffness under rail seats, between
//! two of them or at the wheel.
//!
//! Whatever a sleeper, its railpad or its ballast have that the model lacks acts on the rail as an
//! additional dynamic stiffness at the rail seat, free in every frequency; whatever links two
//! sleepers, between their seats; whatever the vehicle has, at the wheel. Its trace is linear in
//! that stiffness, so that the evidence for it has a closed form (mismatch design, eq. 9).

use crate::behaviour::{Behaviour, Seen};
use crate::calibration::{Calibration, CalibrationError, Problem};
use crate::section::Section;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

/// Bumps over the logarithm of the frequency that the stiffness is made of.
const BUMPS: usize = 14;

/// Prior deviations of a bump's height over the track's own stiffness there.
const SCALES: [f64; 3] = [0.1, 0.3, 1.0];

/// Prior correlations of neighbouring bumps: of a resonance none, of a spring or a mass much.
const CORRELATIONS: [f64; 2] = [0.0, 0.9];

/// Longest period of a pattern of sleepers, in sleepers.
const EVERY_MAX: usize = 5;

/// Where an unknown dynamic stiffness acts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortPlace {
    /// Under the rail seats of these compared sleepers, the same under each: one, two neighbours,
    /// every second to fifth, or all.
    Seats(Vec<usize>),
    /// Between the rail seats of two neighbours.
    Between([usize; 2]),
    /// Between wheel and ground.
    Wheel,
}

impl PortPlace {
    /// What a diagnosis calls it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Seats(_) => "rail_seat",
            Self::Between(_) => "between_rail_seats",
            Self::Wheel => "wheel",
        }
    }
}

/// Evidence for an unknown dynamic stiffness.
#[derive(Clone, Debug)]
pub struct Port {
    /// Where it acts.
    pub place: PortPlace,
    /// Logarithm of the evidence against the model without it, in nats.
    pub log_evidence: f64,
    /// What the dynamic stiffness behaves like; none if like no element.
    pub behaviour: Option<Behaviour>,
    /// Its trace: whitened change of the log powers.
    pub change: DVector<f64>,
}

/// What recordings of a calibrated track are searched with for an unknown dynamic stiffness.
pub struct PortScan {
    filters: Vec<Filter>,
    centres_hz: Vec<f64>,
}

/// All that the evidence at one place needs of the track.
struct Filter {
    place: PortPlace,
    /// Change of the whitened log powers by each bump's two parts: `[row][2 × bump + part]`.
    columns: DMatrix<f64>,
    /// The baseline's part in them: what it is multiplied with for a residual's projection.
    imitated: DMatrix<f64>,
    /// Square of the columns less the baseline's part.
    square: DMatrix<f64>,
    /// Receptance in m/N that the bumps' heights are in parts of, mean over each bump.
    receptance: Vec<Complex64>,
    /// What the bumps' heights may be beforehand, each with their posterior precision, factored.
    priors: Vec<(Prior, Cholesky<f64, Dyn>)>,
}

/// Normal prior of the bumps' heights.
struct Prior {
    precision: DMatrix<f64>,
    /// Half the logarithm of the precision's determinant.
    half_ln_determinant: f64,
}

impl Prior {
    /// All pairs of [`SCALES`] and [`CORRELATIONS`].
    fn all() -> Vec<Self> {
        let of_scale = |scale| CORRELATIONS.map(|correlation| Self::new(scale, correlation));
        SCALES.into_iter().flat_map(of_scale).collect()
    }

    /// Real and imaginary parts that are each an autoregressive process over the bumps.
    fn new(scale: f64, correlation: f64) -> Self {
        let innovation = 1.0 - correlation * correlation;
        let weight = 1.0 / (scale * scale * innovation);
        let ends = |bump: usize| bump == 0 || bump == BUMPS - 1;
        let precision = DMatrix::from_fn(2 * BUMPS, 2 * BUMPS, |i, j| match i.abs_diff(j) {
            0 if ends(i / 2) => weight,
            0 => weight * (1.0 + correlation * correlation),
            2 => -weight * correlation,
            _ => 0.0,
        });
        let half_ln_determinant =
            -((2 * BUMPS) as f64 * scale.ln() + (BUMPS - 1) as f64 * innovation.ln());
        Self { precision, half_ln_determinant }
    }
}

impl PortScan {
    /// Works out the traces on a calibrated track.
    ///
    /// # Errors
    /// [`CalibrationError`] when the calibrated track makes no model.
    pub fn new(problem: &Problem<'_>, current: &Calibration) -> Result<Self, CalibrationError> {
        Self::of(problem, current, |_| true)
    }

    /// The same for one place.
    ///
    /// # Errors
    /// As [`PortScan::new`].
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
        let (forward, observation) = (problem.forward, problem.observation);
        let extensions = problem.extensions(&current.values)?;
        let lines = forward.bands.lines_hz();
        let (from, to) = (lines[0].ln(), lines[lines.len() - 1].ln());
        let width = (to - from) / (BUMPS - 1) as f64;
        let centres: Vec<f64> = (0..BUMPS).map(|bump| from + width * bump as f64).collect();
        let bump = |centre: f64, hz: f64| (1.0 - ((hz.ln() - centre) / width).abs()).max(0.0);
        let shapes: Vec<Vec<Complex64>> = centres
            .iter()
            .flat_map(|&centre| {
                let shape: Vec<f64> = lines.iter().map(|&hz| bump(centre, hz)).collect();
                [Complex64::ONE, Complex64::I]
                    .map(|part| shape.iter().map(|height| part * height).collect())
            })
            .collect();
        let columns = forward.port_columns(&current.values, &extensions, &shapes)?;
        let whiten =
            |columns: DMatrix<f64>| observation.fitted_rows(&observation.whiten_matrix(&columns));
        // The mean over each bump; every second shape is its real part.
        let smooth = |receptance: &[Complex64]| -> Vec<Complex64> {
            let mean = |shape: &Vec<Complex64>| {
                let weighted = shape.iter().zip(receptance).map(|(weight, value)| weight * value);
                weighted.sum::<Complex64>() / shape.iter().sum::<Complex64>()
            };
            shapes.iter().step_by(2).map(mean).collect()
        };
        let at_seat = |compared: usize| {
            let magnitudes = &columns.seat_receptances[forward.section.in_track(compared)];
            smooth(&magnitudes.iter().map(|&magnitude| magnitude.into()).collect::<Vec<_>>())
        };
        let seats: Vec<DMatrix<f64>> = columns.seats.into_iter().map(whiten).collect();
        let together = |(compared, in_track): (Vec<usize>, Vec<usize>)| {
            let columns = in_track.iter().map(|&sleeper| &seats[sleeper]).sum();
            let receptance = at_seat(compared[0]);
            (PortPlace::Seats(compared), columns, receptance)
        };
        let mut places: Vec<(PortPlace, DMatrix<f64>, Vec<Complex64>)> =
            seats_together(&forward.section).into_iter().map(together).collect();
        let between = columns.between.into_iter().enumerate();
        places.extend(between.map(|(first, columns)| {
            (PortPlace::Between([first, first + 1]), whiten(columns), at_seat(first + 1))
        }));
        places.push((PortPlace::Wheel, whiten(columns.wheel), smooth(&columns.wheel_receptance)));
        places.retain(|(place, ..)| is_one(place));
        let filter =
            |(place, columns, receptance)| Filter::new(place, columns, receptance, current);
        let filters = places.into_par_iter().filter_map(filter).collect();
        Ok(Self { filters, centres_hz: centres.into_iter().map(f64::exp).collect() })
    }

    /// The best port for a whitened residual; `felt` is its product with the baseline's
    /// derivatives.
    pub fn best(&self, residual: &DVector<f64>, felt: &DVector<f64>) -> Option<Port> {
        self.best_where(residual, felt, |_| true)
    }

    /// The best of some places.
    pub fn best_where(
        &self,
        residual: &DVector<f64>,
        felt: &DVector<f64>,
        is_one: impl Fn(&PortPlace) -> bool + Sync,
    ) -> Option<Port> {
        let filters = self.filters.par_iter().filter(|filter| is_one(&filter.place));
        let found: Vec<_> =
            filters.map(|filter| (filter, filter.evidence(residual, felt))).collect();
        let best = found.into_iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let (filter, (log_evidence, heights)) = best?;
        Some(Port {
            place: filter.place.clone(),
            log_evidence,
            behaviour: filter.behaviour(residual, felt, &heights, &self.centres_hz),
            change: &filter.columns * heights,
        })
    }
}

/// Sleepers under which something unknown may be the same: the compared ones, and the same and others
/// by their numbers in the whole track. A pattern ends with the compared sleepers, or goes on.
fn seats_together(section: &Section) -> Vec<(Vec<usize>, Vec<usize>)> {
    let count = section.sleepers;
    let single = (0..count).map(|sleeper| vec![sleeper]);
    let pairs = (1..count).map(|sleeper| vec![sleeper - 1, sleeper]);
    // A pattern is one where it comes back twice.
    let steps = (1..=EVERY_MAX).filter(|step| 3 * step <= count);
    let patterns = steps.flat_map(|step| (0..step).map(move |first| (first, step)));
    let of_step = |(first, step): (usize, usize)| (first..count).step_by(step).collect();
    let here = single.chain(pairs).chain(patterns.clone().map(of_step)).map(|compared| {
        let in_track = compared.iter().map(|&sleeper| section.in_track(sleeper)).collect();
        (compared, in_track)
    });
    let beyond = patterns.map(|(first, step)| {
        let begins = section.in_track(first) % step;
        (of_step((first, step)), (begins..section.spans() - 1).step_by(step).collect())
    });
    here.chain(beyond).collect()
}

impl Filter {
    /// None where a precision is not positive definite.
    fn new(
        place: PortPlace,
        columns: DMatrix<f64>,
        receptance: Vec<Complex64>,
        current: &Calibration,
    ) -> Option<Self> {
        // What the baseline imitates is taken out of columns and residual.
        let shared = current.jacobian.tr_mul(&columns);
        let imitated = current.precision.solve(&shared);
        let square = columns.tr_mul(&columns) - shared.tr_mul(&imitated);
        let posterior = |prior: Prior| {
            let precision = Cholesky::new(&square + &prior.precision)?;
            Some((prior, precision))
        };
        let priors = Prior::all().into_iter().map(posterior).collect::<Option<_>>()?;
        Some(Self { place, columns, imitated, square, receptance, priors })
    }

    /// What something with these heights behaves like.
    fn behaviour(
        &self,
        residual: &DVector<f64>,
        felt: &DVector<f64>,
        heights: &DVector<f64>,
        centres_hz: &[f64],
    ) -> Option<Behaviour> {
        let along = &self.along(residual, felt);
        let Self { square, receptance, .. } = self;
        Seen { along, square, receptance, centres_hz }.behaviour(0.5 * along.dot(heights))
    }

    /// Slope of the log likelihood with the bumps' heights.
    fn along(&self, residual: &DVector<f64>, felt: &DVector<f64>) -> DVector<f64> {
        self.columns.tr_mul(residual) - self.imitated.tr_mul(felt)
    }

    /// Log evidence averaged over the priors, and the bumps' most probable heights.
    fn evidence(&self, residual: &DVector<f64>, felt: &DVector<f64>) -> (f64, DVector<f64>) {
        let along = self.along(residual, felt);
        let of_prior = |(prior, precision): &(Prior, Cholesky<f64, Dyn>)| {
            let heights = precision.solve(&along);
            let log_evidence = 0.5 * along.dot(&heights) - 0.5 * precision.ln_determinant()
                + prior.half_ln_determinant;
            (log_evidence, heights)
        };
        let mut all: Vec<_> = self.priors.iter().map(of_prior).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let highest = all[all.len() - 1].0;
        let sum: f64 = all.iter().map(|(evidence, _)| (evidence - highest).exp()).sum();
        let (_, heights) = all.swap_remove(self.priors.len() - 1);
        (highest + (sum / self.priors.len() as f64).ln(), heights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn a_prior_is_that_of_heights_that_hang_together() {
        let (scale, correlation) = (0.3, 0.9);
        let Prior { precision, half_ln_determinant } = Prior::new(scale, correlation);
        let covariance = DMatrix::from_fn(2 * BUMPS, 2 * BUMPS, |i, j| {
            let apart = (i / 2).abs_diff(j / 2) as f64;
            if i % 2 == j % 2 { scale * scale * correlation.powf(apart) } else { 0.0 }
        });
        let identity = DMatrix::<f64>::identity(2 * BUMPS, 2 * BUMPS);
        assert!((&precision * &covariance - identity).amax() < 1e-10);
        let half = 0.5 * Cholesky::new(precision).unwrap().ln_determinant();
        assert!((half_ln_determinant - half).abs() < 1e-9, "{half_ln_determinant} {half}");
    }

    #[test]
    fn a_pattern_ends_with_the_section_or_goes_on_through_the_track() {
        let section = Section::new(TrackDesign::v_track(), 7, 1.0);
        let all = seats_together(&section);
        let last = section.spans() - 1;
        let in_track = |first: usize| first + section.in_track(0);
        let of = |compared: &[usize]| -> Vec<&[usize]> {
            let those = all.iter().filter(|(known, _)| known == compared);
            those.map(|(_, in_track)| &in_track[..]).collect()
        };
        assert_eq!(of(&[3]), [[in_track(3)]]);
        assert_eq!(of(&[3, 4]), [[in_track(3), in_track(4)]]);
        let every: Vec<usize> = (0..last).collect();
        assert_eq!(of(&[0, 1, 2, 3, 4, 5, 6]), [&every[in_track(0)..=in_track(6)], &every[..]]);
        let second = of(&[1, 3, 5]);
        assert_eq!(second[0], [1, 3, 5].map(in_track));
        assert_eq!(second[1].len(), every[in_track(1) % 2..].iter().step_by(2).count());
        assert!(second[0].iter().all(|sleeper| second[1].contains(sleeper)));
        // A third would come but once or twice.
        assert!(of(&[0, 3, 6]).is_empty());
    }
}
