//! Domain check: tests whether a track of the library can produce the observed features.
//!
//! The check builds a forward emulator from the library. The expected features are a polynomial in the
//! parameters; the residuals of the polynomial give the random variation of one window. The check fits the
//! parameters to the observed features within the ranges of the library. Features are outside the library
//! if the residual of the best fit is larger than the residuals of the library's own cases, or if it
//! becomes much smaller when one parameter may exceed one end of its range.

mod coordinates;
mod discrepancy;
mod fit;
mod lack_of_fit;
mod null;

use crate::{Error, TrainingSet};
use coordinates::Coordinates;
use faer::{ColRef, Mat, MatRef};
use fit::{BoundedFit, Bounds, Problem};
use null::Null;
use parking_lot::Mutex;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::HashMap;
use tracktwin_parameters::Parameter;

/// An end of a parameter's range that the fit exceeds, and the fit beyond this end.
type Push = ((usize, Side), BoundedFit);

/// Number of library entries, the nearest ones, from which a fit starts.
const STARTS: usize = 3;
/// A search beyond an end may start from entries whose mapped parameter (-1 to 1) exceeds this value
/// towards the end.
const NEAR_END: f64 = 0.6;
/// Largest distance of a parameter beyond an end, as a share of half its range.
const REACH: f64 = 2.0;
/// An end is reported only if the fit beyond it leaves at most this share of the chi-square in excess of
/// the limit.
const LEFT_MOST: f64 = 0.5;
/// Start of a search beyond an end, as a share of half the range.
const FIRST_STEP: f64 = 0.2;
/// A fit lies at an end if its distance from the end is below this share of half the range.
const AT_END: f64 = 0.02;
/// Share by which the limit of the gain is raised for a single window: its deviations have longer tails
/// than a normal distribution.
const TAILS: f64 = 0.5;

/// An end of a parameter's range in the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The lowest value.
    Low,
    /// The highest value.
    High,
}

/// An end of a parameter range of the library that the features exceed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Beyond {
    /// The parameter.
    pub parameter: Parameter,
    /// The end of its range that the features exceed.
    pub side: Side,
}

/// Result of the domain check of one feature vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Chi-square of the best fit inside the library, divided by its limit; above 1 the features are
    /// outside the library.
    pub misfit: f64,
    /// The end that the features exceed, if a fit beyond it is better by more than chance.
    pub beyond: Option<Beyond>,
}

impl Judgement {
    /// Whether the features are outside the library.
    pub fn is_outside(&self) -> bool {
        self.misfit > 1.0 || self.beyond.is_some()
    }
}

/// The set of features that the tracks of a library can produce at given speeds.
pub struct Domain {
    coordinates: Coordinates,
    null: Null,
    varied: Vec<Parameter>,
    /// Coordinates of the entries, d x n: those of an entry lie next to each other.
    entries: Mat<f64>,
    /// Mapped parameters of the entries, n x p.
    unit: Mat<f64>,
    /// Limits of chi-square computed so far, by number of windows and bits of the probability.
    limits: Mutex<HashMap<(usize, u64), f64>>,
}

impl Domain {
    /// Builds the domain of a library at these `speeds` (indices into the speeds of `set`).
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the set has too few entries or a parameter is constant;
    /// [`Error::NoEigenvalues`] if an eigenvalue iteration does not converge.
    pub fn of(set: &TrainingSet, speeds: &[usize]) -> Result<Self, Error> {
        let all: Vec<usize> = (0..set.entries()).collect();
        let coordinates = Coordinates::of(set, speeds, &all)?;
        let features = set.features(&all, speeds, &(0..set.frequencies_hz.len()));
        Ok(Self {
            null: Null::of(set, speeds)?,
            varied: set.varied.clone(),
            entries: coordinates.apply(features.as_ref()).transpose().to_owned(),
            unit: coordinates.polynomial.unit(set.values(&all).as_ref()),
            coordinates,
            limits: Mutex::default(),
        })
    }

    /// Coordinates of the ln-powers of a window (speeds * bins numbers, the speeds one after the other).
    ///
    /// # Errors
    /// [`Error::Shape`] if `log_power` has another length.
    pub fn coordinates(&self, log_power: &[f64]) -> Result<Vec<f64>, Error> {
        let (expected, found) = (self.coordinates.features(), log_power.len());
        if expected != found {
            return Err(Error::Shape { what: "observed bins", expected, found });
        }
        let row = MatRef::from_row_major_slice(log_power, 1, found);
        Ok(self.coordinates.apply(row).row(0).iter().copied().collect())
    }

    /// Tests the mean coordinates of `windows` windows of one track. The false-alarm rate for a track of
    /// the library is about `probability`.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if a coordinate is not finite.
    pub fn judge(
        &self,
        mean: &[f64],
        windows: usize,
        probability: f64,
    ) -> Result<Judgement, Error> {
        let limit = self.limit(windows, 0.5 * probability);
        let bounds = Bounds::library(self.varied.len());
        let apart = self.apart(mean);
        let (problem, best) = self.inside(mean, windows, &bounds, &apart)?;
        let misfit = best.chi_square / limit;
        // Few tracks of a library lie at an end, so that ends share no probability.
        let needed = gain_needed(probability, windows);
        let nowhere = (misfit > 1.0).then_some(apart.as_slice());
        let further = self.push(&problem, &bounds, &best, nowhere)?;
        // An end that leaves most of what is too much is no explanation.
        let left = limit + LEFT_MOST * (best.chi_square - limit).max(0.0);
        let explains =
            |fit: &BoundedFit| best.chi_square - fit.chi_square > needed && fit.chi_square < left;
        let beyond = further
            .filter(|(_, fit)| explains(fit))
            .map(|((axis, side), _)| Beyond { parameter: self.varied[axis], side });
        Ok(Judgement { misfit, beyond })
    }

    fn limit(&self, windows: usize, probability: f64) -> f64 {
        let mut limits = self.limits.lock();
        let key = (windows, probability.to_bits());
        *limits.entry(key).or_insert_with(|| self.null.limit(windows, probability))
    }

    /// The best fit inside the library, and the least-squares problem with the precisions at this fit.
    fn inside(
        &self,
        mean: &[f64],
        windows: usize,
        bounds: &Bounds,
        apart: &[f64],
    ) -> Result<(Problem<'_>, BoundedFit), Error> {
        let coefficients = self.coordinates.polynomial.coefficients();
        let typical = coefficients as f64 / self.entries.ncols() as f64;
        let problem = self.problem(mean, windows, typical);
        let mut best: Option<BoundedFit> = None;
        for start in self.nearest(apart, STARTS, |_| true) {
            let fit = problem.solve(bounds, &start)?;
            if best.as_ref().is_none_or(|best| fit.chi_square < best.chi_square) {
                best = Some(fit);
            }
        }
        let at = best.map_or_else(|| vec![0.0; self.varied.len()], |fit| fit.unit);
        let problem = self.problem(mean, windows, self.coordinates.variance(&at));
        let fit = problem.solve(bounds, &at)?;
        Ok((problem, fit))
    }

    fn problem(&self, observed: &[f64], windows: usize, emulator: f64) -> Problem<'_> {
        let scatter = 1.0 / windows as f64 + emulator;
        let between = self.coordinates.discrepancy.iter();
        let precision: Vec<f64> = between.map(|between| 1.0 / (scatter + between)).collect();
        Problem::new(&self.coordinates, observed, &precision)
    }

    /// Squared distance of every entry from the observed coordinates, by what their differences vary.
    fn apart(&self, observed: &[f64]) -> Vec<f64> {
        let weight: Vec<f64> =
            self.coordinates.discrepancy.iter().map(|between| 1.0 / (1.0 + between)).collect();
        let to = |entry: ColRef<'_, f64>| -> f64 {
            let terms = entry.iter().zip(observed).zip(&weight);
            terms.map(|((a, b), weight)| weight * (a - b).powi(2)).sum()
        };
        self.entries.col_iter().map(to).collect()
    }

    /// Mapped parameters of the `count` entries that are nearest by their distances, among the entries for
    /// which `counts` is true.
    fn nearest(
        &self,
        apart: &[f64],
        count: usize,
        counts: impl Fn(usize) -> bool,
    ) -> Vec<Vec<f64>> {
        let of = apart.iter().enumerate().filter(|(entry, _)| counts(*entry));
        let mut near: Vec<(f64, usize)> = of.map(|(entry, &apart)| (apart, entry)).collect();
        if count < near.len() {
            near.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0));
            near.truncate(count);
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        near.iter().map(|&(_, entry)| self.unit.row(entry).iter().copied().collect()).collect()
    }

    /// The end beyond which chi-square is smallest, with the fit there. The search covers the ends at which
    /// the best fit lies, or all ends if nothing inside the library fits; `nowhere` then holds the distances
    /// of the entries.
    fn push(
        &self,
        problem: &Problem<'_>,
        bounds: &Bounds,
        best: &BoundedFit,
        nowhere: Option<&[f64]>,
    ) -> Result<Option<Push>, Error> {
        let mut found: Option<Push> = None;
        for axis in 0..self.varied.len() {
            for side in [Side::Low, Side::High] {
                if nowhere.is_none() && towards(side, best.unit[axis]) < 1.0 - AT_END {
                    continue;
                }
                let mut starts = vec![best.unit.clone()];
                if let Some(apart) = nowhere {
                    let near = |entry| towards(side, self.unit[(entry, axis)]) > NEAR_END;
                    starts.extend(self.nearest(apart, 1, near));
                }
                for start in starts {
                    let (further, start) = beyond(bounds, &start, axis, side);
                    let fit = problem.solve(&further, &start)?;
                    if found.as_ref().is_none_or(|(_, least)| fit.chi_square < least.chi_square) {
                        found = Some(((axis, side), fit));
                    }
                }
            }
        }
        Ok(found)
    }
}

/// A mapped parameter with the sign that makes `side` positive.
fn towards(side: Side, unit: f64) -> f64 {
    match side {
        Side::Low => -unit,
        Side::High => unit,
    }
}

/// Bounds that keep one parameter beyond an end, and a start within these bounds.
fn beyond(bounds: &Bounds, unit: &[f64], axis: usize, side: Side) -> (Bounds, Vec<f64>) {
    let (mut further, mut start) = (bounds.clone(), unit.to_vec());
    match side {
        Side::Low => {
            (further.low[axis], further.high[axis]) = (-1.0 - REACH, -1.0);
            start[axis] = -1.0 - FIRST_STEP;
        }
        Side::High => {
            (further.low[axis], further.high[axis]) = (1.0, 1.0 + REACH);
            start[axis] = 1.0 + FIRST_STEP;
        }
    }
    (further, start)
}

/// Reduction of chi-square that is needed when an end is opened, so that a track at that end is flagged
/// with this `probability`. Half of the chi-square distribution of one degree of freedom lies at zero,
/// because the parameter may move in one direction only.
fn gain_needed(probability: f64, windows: usize) -> f64 {
    let one = ChiSquared::new(1.0).expect("one degree of freedom");
    let tails = 1.0 + TAILS / (windows as f64).sqrt();
    tails * one.inverse_cdf(1.0 - 2.0 * probability)
}
