//! The re-tuned baseline: all parameters that are free before the diagnosis reports left-out physics.
//!
//! Ballast, railpad and irregularity level are free at every sleeper. The spectrum of the surface and the
//! gain of every speed are free. The frequency response of the sensor is flat to two per cent. The ends of
//! the track and the supports beyond the section are unknown. The diagnosis compares every extension with
//! this baseline.

use crate::quantity::{Common, Own, Quantity};
use crate::section::Section;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::ops::Range;
use tracktwin_parameters::{Parameter, Prior};
use tracktwin_track::model::Support;

/// The free parameters of a baseline, as logarithms, and their indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknowns {
    sleepers: usize,
    speeds: usize,
    /// Logarithms of the wave numbers in rad/m at which the surface's spectrum is free.
    knots: Vec<f64>,
    /// Logarithms of the frequencies in Hz at which the sensor's response is free.
    response_knots: Vec<f64>,
    /// Mean over all sleepers of each quantity of [`Own`].
    pub mean: [Mean; 3],
    /// How each quantity of [`Own`] varies along the track.
    pub variation: [Variation; 3],
    /// Sleepers that differ from their neighbours by more than `variation`.
    pub exceptions: Vec<Exception>,
    /// Each quantity of [`Common`].
    common: [Mean; 3],
    /// Standard deviation of the exponent of the surface's spectrum.
    slope_deviation: f64,
    /// Standard deviation of the sensor's response to power, in nats at each knot.
    pub response_deviation: f64,
}

/// What is known of the mean over all sleepers of a quantity's logarithm before anything is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Expected value of the logarithm.
    pub log: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

impl Mean {
    fn of(prior: &Prior, parameter: Parameter) -> Self {
        Self { log: prior.median[parameter].ln(), deviation: prior.log_deviation(parameter) }
    }
}

/// How the logarithm of a quantity varies along the track, about its mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// Standard deviation of the smooth part.
    pub smooth: f64,
    /// Length of the smooth part's Gaussian correlation, in sleepers.
    pub length: f64,
    /// Standard deviation of the part that is independent from sleeper to sleeper.
    pub independent: f64,
}

/// A sleeper of which one quantity lies far from its neighbours'.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exception {
    /// The quantity.
    pub field: Own,
    /// Number of the sleeper among those compared.
    pub sleeper: usize,
}

/// Distance of knots in the logarithm of the wave number or of the frequency.
const KNOT_DISTANCE: f64 = 0.35;

/// Prior of logarithms: standard deviations, and lengths in sleepers or of `ln kappa`.
mod prior {
    /// Variation along the track where it is not learned from the recording.
    pub(super) const VARIATION: [super::Variation; 3] = [
        super::Variation { smooth: 0.35, length: 3.0, independent: 0.15 },
        super::Variation { smooth: 0.35, length: 3.0, independent: 0.2 },
        super::Variation { smooth: 0.15, length: 3.0, independent: 0.2 },
    ];
    /// Deviation of an exception from its neighbours.
    pub(super) const EXCEPTION: f64 = 1.0;
    /// Spectrum of the surface about eq. B.6, and its length in `ln kappa`.
    pub(super) const SPECTRUM: f64 = 0.5;
    pub(super) const SPECTRUM_LENGTH: f64 = 0.7;
    /// Gain of a speed's passes against the others'.
    pub(super) const GAIN: f64 = 0.05;
    /// What the sensor makes of power at a frequency, 0.2 dB: accelerometers are flat to 2 % in
    /// amplitude, and so is a finite-element model.
    pub(super) const RESPONSE: f64 = 0.046;
}

/// Distances in spans at which the track may end: what that changes is free to be any of them.
pub(crate) const ENDS_SPANS: [usize; 7] = [7, 8, 9, 10, 11, 13, 24];

/// Sleepers beyond either end of the section whose support is free; the last of them represents all
/// further ones.
const OUTER: usize = 3;

/// Stiffness of railpad or ballast of a sleeper beyond the section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Outer {
    /// Its number, counted from the first sleeper compared.
    pub(crate) sleeper: isize,
    /// Whether those further out have the same.
    pub(crate) is_last: bool,
    /// Whether it is the railpad's; else the ballast's.
    pub(crate) is_railpad: bool,
}

impl Unknowns {
    /// For a section, a number of speeds, surfaces with wave numbers in a range in rad/m, and bands
    /// with centres in a range in Hz.
    pub fn new(
        section: &Section,
        speeds: usize,
        wave_numbers: Range<f64>,
        frequencies_hz: Range<f64>,
    ) -> Self {
        let (knots, response_knots) = (knots(wave_numbers), knots(frequencies_hz));
        let known = &section.track.prior;
        Self {
            sleepers: section.sleepers,
            speeds,
            knots,
            response_knots,
            mean: Own::ALL.map(|quantity| Mean::of(known, quantity.parameter())),
            common: Common::ALL.map(|quantity| Mean::of(known, quantity.parameter())),
            slope_deviation: known.slope_deviation,
            variation: prior::VARIATION,
            exceptions: Vec::new(),
            response_deviation: prior::RESPONSE,
        }
    }

    /// How many unknowns there are.
    pub fn count(&self) -> usize {
        self.outer().end
    }

    /// A quantity of all sleepers, one after the other.
    pub fn own(&self, quantity: Own) -> Range<usize> {
        let first = quantity as usize * self.sleepers;
        first..first + self.sleepers
    }

    /// A quantity of one sleeper.
    pub fn at(&self, quantity: Own, sleeper: usize) -> usize {
        self.own(quantity).start + sleeper
    }

    /// Ballast stiffness of each sleeper.
    pub fn ballast(&self) -> Range<usize> {
        self.own(Own::BallastStiffness)
    }

    /// Railpad stiffness of each sleeper.
    pub fn railpad(&self) -> Range<usize> {
        self.own(Own::RailpadStiffness)
    }

    /// Irregularity level at each sleeper.
    pub fn level(&self) -> Range<usize> {
        self.own(Own::Level)
    }

    /// What is common to all sleepers.
    pub fn global(&self) -> Range<usize> {
        let first = Own::ALL.len() * self.sleepers;
        first..first + Common::ALL.len()
    }

    /// A quantity that is common to all sleepers.
    pub fn common(&self, quantity: Common) -> usize {
        self.global().start + quantity as usize
    }

    /// A quantity of one sleeper, its own or that of all.
    pub(crate) fn of(&self, quantity: Quantity, sleeper: usize) -> usize {
        match quantity {
            Quantity::Own(quantity) => self.at(quantity, sleeper),
            Quantity::Common(quantity) => self.common(quantity),
        }
    }

    /// The surface's spectrum against eq. B.6, at its knots.
    pub fn spectrum(&self) -> Range<usize> {
        self.global().end..self.global().end + self.knots.len()
    }

    /// The power gain of each speed's passes.
    pub fn gains(&self) -> Range<usize> {
        self.spectrum().end..self.spectrum().end + self.speeds
    }

    /// The power gain of one speed's passes.
    pub fn gain(&self, speed: usize) -> usize {
        self.gains().start + speed
    }

    /// The response of the sensor to power, at its knots.
    pub fn response(&self) -> Range<usize> {
        self.gains().end..self.gains().end + self.response_knots.len()
    }

    /// Weights of the changes due to each possible end of the track.
    pub fn ends(&self) -> Range<usize> {
        self.response().end..self.response().end + ENDS_SPANS.len()
    }

    /// How much stiffer sleepers beyond the section are held than its first or last one.
    pub fn outer(&self) -> Range<usize> {
        self.ends().end..self.ends().end + self.outer_supports().len()
    }

    /// All that lies beyond the section.
    pub fn beyond(&self) -> Range<usize> {
        self.ends().start..self.outer().end
    }

    /// What each unknown of [`Unknowns::outer`] is.
    pub(crate) fn outer_supports(&self) -> Vec<Outer> {
        let (sleepers, outer) = (self.sleepers.cast_signed(), OUTER.cast_signed());
        let beyond = || (-outer..0).chain(sleepers..sleepers + outer);
        let held = |is_railpad| {
            beyond().map(move |sleeper| {
                let is_last = sleeper == -outer || sleeper == sleepers + outer - 1;
                Outer { sleeper, is_last, is_railpad }
            })
        };
        held(false).chain(held(true)).collect()
    }

    /// The prior mean of all unknowns.
    pub fn typical(&self) -> DVector<f64> {
        let mut values = DVector::zeros(self.count());
        for quantity in Own::ALL {
            let Mean { log, .. } = self.mean[quantity as usize];
            values.rows_mut(self.own(quantity).start, self.sleepers).fill(log);
        }
        for quantity in Common::ALL {
            values[self.common(quantity)] = self.common[quantity as usize].log;
        }
        values
    }

    /// These values of a problem with the baseline's unknowns at the prior mean.
    pub(crate) fn with_typical(&self, values: &DVector<f64>) -> DVector<f64> {
        let mut typical = values.clone();
        typical.rows_mut(0, self.count()).copy_from(&self.typical());
        typical
    }

    /// Standard deviation of each unknown's prior, without exceptions.
    pub fn prior_deviations(&self) -> DVector<f64> {
        self.covariance().diagonal().map(f64::sqrt)
    }

    /// Inverse of the prior covariance.
    pub fn precision(&self) -> DMatrix<f64> {
        let mut covariance = self.covariance();
        for &Exception { field, sleeper } in &self.exceptions {
            let index = self.at(field, sleeper);
            covariance[(index, index)] += prior::EXCEPTION.powi(2);
        }
        Cholesky::new(covariance).expect("a prior with a white part is positive definite").inverse()
    }

    /// Prior covariance of all unknowns, without exceptions.
    fn covariance(&self) -> DMatrix<f64> {
        let mut covariance = DMatrix::zeros(self.count(), self.count());
        for field in Own::ALL {
            for (i, row) in (0..).zip(self.own(field)) {
                for (j, column) in (0..).zip(self.own(field)) {
                    covariance[(row, column)] = self.along(field, i, j);
                }
            }
        }
        self.add_outer(&mut covariance);
        for (index, Mean { deviation, .. }) in self.global().zip(self.common) {
            covariance[(index, index)] = deviation.powi(2);
        }
        let middle = 0.5 * (self.spectrum().start + self.spectrum().end - 1) as f64;
        let from_middle = |knot: usize| KNOT_DISTANCE * (knot as f64 - middle);
        let slope_variance = self.slope_deviation.powi(2);
        for i in self.spectrum() {
            for j in self.spectrum() {
                let distance = KNOT_DISTANCE * (i as f64 - j as f64) / prior::SPECTRUM_LENGTH;
                let sloped = slope_variance * from_middle(i) * from_middle(j);
                let about = prior::SPECTRUM.powi(2) * (-0.5 * distance.powi(2)).exp();
                covariance[(i, j)] = about + sloped;
            }
            // Regularises the inverse for close knots.
            covariance[(i, i)] += (0.05 * prior::SPECTRUM).powi(2);
        }
        for index in self.gains() {
            covariance[(index, index)] = prior::GAIN.powi(2);
        }
        for index in self.response() {
            covariance[(index, index)] = self.response_deviation.powi(2);
        }
        // One of the ends is there, each as probable as the others.
        for index in self.ends() {
            covariance[(index, index)] = 1.0 / ENDS_SPANS.len() as f64;
        }
        covariance
    }

    /// The sleepers beyond vary as those compared do: a difference from the first or last one is what
    /// the same field has between the two.
    fn add_outer(&self, covariance: &mut DMatrix<f64>) {
        let last = self.sleepers.cast_signed() - 1;
        let outer: Vec<(usize, Outer)> = self.outer().zip(self.outer_supports()).collect();
        for &(row, Outer { sleeper, is_railpad, .. }) in &outer {
            let field = if is_railpad { Own::RailpadStiffness } else { Own::BallastStiffness };
            let end = sleeper.clamp(0, last);
            let with =
                |other: isize| self.along(field, sleeper, other) - self.along(field, end, other);
            for (other, column) in (0..).zip(self.own(field)) {
                covariance[(row, column)] = with(other);
                covariance[(column, row)] = with(other);
            }
            for &(column, other) in outer.iter().filter(|(_, it)| it.is_railpad == is_railpad) {
                let other_end = other.sleeper.clamp(0, last);
                covariance[(row, column)] = with(other.sleeper) - with(other_end);
            }
        }
    }

    /// Supports of all sleepers of the section's track.
    pub fn supports(&self, section: &Section, values: &DVector<f64>) -> Vec<Support> {
        section.compared().map(|sleeper| self.support(values, sleeper)).collect()
    }

    /// Support of one of the compared sleepers.
    pub fn support(&self, values: &DVector<f64>, sleeper: usize) -> Support {
        let own = |quantity| values[self.at(quantity, sleeper)].exp();
        let common = |quantity| values[self.common(quantity)].exp();
        Support {
            railpad_stiffness: own(Own::RailpadStiffness),
            railpad_damping: common(Common::RailpadDamping),
            ballast_stiffness: own(Own::BallastStiffness),
            ballast_damping: common(Common::BallastDamping),
            sleeper_bending_stiffness: common(Common::SleeperBendingStiffness),
        }
    }

    /// Knots on both sides of a wave number in rad/m, with their shares.
    pub fn spectrum_shares(&self, wave_number_rad_m: f64) -> [(usize, f64); 2] {
        shares(&self.knots, wave_number_rad_m, self.spectrum().start)
    }

    /// Knots of the sensor's response on both sides of a frequency, with their shares.
    pub fn response_shares(&self, frequency_hz: f64) -> [(usize, f64); 2] {
        shares(&self.response_knots, frequency_hz, self.response().start)
    }

    /// Prior covariance of a quantity between two sleepers.
    fn along(&self, field: Own, i: isize, j: isize) -> f64 {
        let Variation { smooth, length, independent } = self.variation[field as usize];
        let distance = (i - j) as f64 / length;
        let together = smooth.powi(2) * (-0.5 * distance.powi(2)).exp();
        let own = if i == j { independent.powi(2) } else { 0.0 };
        self.mean[field as usize].deviation.powi(2) + together + own
    }
}

/// Knots that cover a range, in logarithms.
fn knots(range: Range<f64>) -> Vec<f64> {
    let (from, to) = (range.start.ln(), range.end.ln());
    let count = ((to - from) / KNOT_DISTANCE).ceil() as usize + 1;
    (0..count).map(|knot| from + KNOT_DISTANCE * knot as f64).collect()
}

/// Knots on both sides of a value, counted from the unknown `first`, with their shares.
fn shares(knots: &[f64], value: f64, first: usize) -> [(usize, f64); 2] {
    let last = knots.len() - 1;
    let place = ((value.ln() - knots[0]) / KNOT_DISTANCE).clamp(0.0, last as f64);
    let left = (place.floor() as usize).min(last - 1);
    let share = place - left as f64;
    [(first + left, 1.0 - share), (first + left + 1, share)]
}
