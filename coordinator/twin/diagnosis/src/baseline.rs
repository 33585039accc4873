//! The re-tuned baseline: all parameters that are free before the diagnosis reports left-out physics.
//!
//! Ballast, railpad and irregularity level are free at every sleeper, and railpads differ a little in damping. The
//! spectrum of the surface and the gain of every speed are free. The frequency response of the sensor is flat to two
//! per cent. The ends of the track and the supports beyond the section are unknown. The diagnosis compares every
//! extension with this baseline.

use crate::knots::{KNOT_DISTANCE, knots, shares};
use crate::quantity::{Common, Own, Quantity};
use crate::section::Section;
use crate::variation::{Exception, SupportChange, Variation};
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
    /// Variation of each quantity of [`Own`] along the track.
    pub variation: [Variation; 3],
    /// Sleepers that differ from their neighbours by more than `variation`.
    pub exceptions: Vec<Exception>,
    /// Changes of the ballast stiffness along the track in addition to `variation`.
    pub support_changes: Vec<SupportChange>,
    /// Standard deviation of the logarithm of a sleeper's railpad damping over the common one.
    pub railpad_damping_deviation: f64,
    /// Mean of each quantity of [`Common`].
    common: [Mean; 3],
    /// Standard deviation of the exponent of the surface's spectrum.
    slope_deviation: f64,
    /// Standard deviation of the sensor's power response, in nats at each knot.
    pub response_deviation: f64,
}

/// Prior of the mean over all sleepers of a quantity's logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Expected value of the logarithm.
    pub log: f64,
    /// Standard deviation of the logarithm.
    pub deviation: f64,
}

impl Mean {
    fn of(prior: &Prior, parameter: Parameter) -> Self {
        Self { log: prior.median[parameter].ln(), deviation: prior.log_deviation(parameter) }
    }
}

/// Prior of logarithms: standard deviations, and lengths in sleepers or of `ln kappa`.
mod prior {
    /// Variation along the track if it is not estimated from the recording.
    pub(super) const VARIATION: [super::Variation; 3] = [
        super::Variation { smooth: 0.35, length: 3.0, independent: 0.15 },
        super::Variation { smooth: 0.35, length: 3.0, independent: 0.2 },
        super::Variation { smooth: 0.15, length: 3.0, independent: 0.2 },
    ];
    /// Standard deviation of an exception from its neighbours.
    pub(super) const EXCEPTION: f64 = 1.0;
    /// Standard deviation of a change of the ballast stiffness: a factor of two in either direction.
    pub(super) const SUPPORT_CHANGE: f64 = std::f64::consts::LN_2;
    /// Deviation of the surface spectrum from eq. B.6, and its correlation length in `ln kappa`.
    pub(super) const SPECTRUM: f64 = 0.5;
    pub(super) const SPECTRUM_LENGTH: f64 = 0.7;
    /// Damping of a sleeper's railpad relative to that of all, before it is estimated from the recording.
    pub(super) const RAILPAD_DAMPING: f64 = 0.1;
    /// Gain of the passes at one speed relative to the others.
    pub(super) const GAIN: f64 = 0.05;
    /// Power response of the sensor at a frequency, 0.2 dB: accelerometers are flat to 2 % in amplitude,
    /// and a finite-element model has the same accuracy.
    pub(super) const RESPONSE: f64 = 0.046;
    /// The same on a line, 0.5 dB: models of lines differ by up to 1 dB at single bands (docs/accuracy.md), and
    /// sleepers do not stand at exactly equal distances.
    pub(super) const RESPONSE_OF_LINE: f64 = 0.115;
}

/// Possible distances of the end of the track in spans; their effects are free in the fit.
pub(crate) const ENDS_SPANS: [usize; 7] = [7, 8, 9, 10, 11, 13, 24];

/// Number of sleepers beyond either end of the section with free supports; the last of them represents all
/// further ones.
const OUTER: usize = 3;

/// Stiffness of railpad or ballast of a sleeper beyond the section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Outer {
    /// Index relative to the first compared sleeper.
    pub(crate) sleeper: isize,
    /// Whether all sleepers further out have the same stiffness.
    pub(crate) is_last: bool,
    /// Whether the stiffness is that of the railpad; otherwise that of the ballast.
    pub(crate) is_railpad: bool,
}

impl Unknowns {
    /// Makes the unknowns of a section for `speeds` speeds, surface wave numbers in a range in rad/m, and
    /// bands with centres in a range in Hz.
    pub fn new(
        section: &Section,
        speeds: usize,
        wave_numbers: Range<f64>,
        frequencies_hz: Range<f64>,
    ) -> Self {
        let (knots, response_knots) = (knots(wave_numbers), knots(frequencies_hz));
        let known = &section.track.prior;
        Self {
            sleepers: section.sleepers(),
            speeds,
            knots,
            response_knots,
            mean: Own::ALL.map(|quantity| Mean::of(known, quantity.parameter())),
            common: Common::ALL.map(|quantity| Mean::of(known, quantity.parameter())),
            slope_deviation: known.slope_deviation,
            variation: prior::VARIATION,
            railpad_damping_deviation: prior::RAILPAD_DAMPING,
            exceptions: Vec::new(),
            support_changes: Vec::new(),
            response_deviation: if section.is_v_track() {
                prior::RESPONSE
            } else {
                prior::RESPONSE_OF_LINE
            },
        }
    }

    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.railpad_damping().end
    }

    /// Indices of a quantity at all sleepers, in the order of the sleepers.
    pub fn own(&self, quantity: Own) -> Range<usize> {
        let first = quantity as usize * self.sleepers;
        first..first + self.sleepers
    }

    /// Index of a quantity at one sleeper.
    pub fn at(&self, quantity: Own, sleeper: usize) -> usize {
        self.own(quantity).start + sleeper
    }

    /// Indices of the ballast stiffness of each sleeper.
    pub fn ballast(&self) -> Range<usize> {
        self.own(Own::BallastStiffness)
    }

    /// Indices of the railpad stiffness of each sleeper.
    pub fn railpad(&self) -> Range<usize> {
        self.own(Own::RailpadStiffness)
    }

    /// Indices of the irregularity level at each sleeper.
    pub fn level(&self) -> Range<usize> {
        self.own(Own::Level)
    }

    /// Indices of the quantities that all sleepers share.
    pub fn global(&self) -> Range<usize> {
        let first = Own::ALL.len() * self.sleepers;
        first..first + Common::ALL.len()
    }

    /// Index of a quantity that all sleepers share.
    pub fn common(&self, quantity: Common) -> usize {
        self.global().start + quantity as usize
    }

    /// Index of a quantity at one sleeper, either its own or a common one.
    pub(crate) fn of(&self, quantity: Quantity, sleeper: usize) -> usize {
        match quantity {
            Quantity::Own(quantity) => self.at(quantity, sleeper),
            Quantity::Common(quantity) => self.common(quantity),
        }
    }

    /// Indices of the ratio of the surface spectrum to eq. B.6, at the knots.
    pub fn spectrum(&self) -> Range<usize> {
        self.global().end..self.global().end + self.knots.len()
    }

    /// Indices of the power gain of the passes at each speed.
    pub fn gains(&self) -> Range<usize> {
        self.spectrum().end..self.spectrum().end + self.speeds
    }

    /// Index of the power gain of the passes at one speed.
    pub fn gain(&self, speed: usize) -> usize {
        self.gains().start + speed
    }

    /// Indices of the power response of the sensor, at the knots.
    pub fn response(&self) -> Range<usize> {
        self.gains().end..self.gains().end + self.response_knots.len()
    }

    /// Indices of the weights of the possible ends of the track.
    pub fn ends(&self) -> Range<usize> {
        self.response().end..self.response().end + ENDS_SPANS.len()
    }

    /// Indices of the log ratio of stiffness between sleepers beyond the section and its first or last
    /// sleeper.
    pub fn outer(&self) -> Range<usize> {
        self.ends().end..self.ends().end + self.outer_supports().len()
    }

    /// Indices of the log ratio of each sleeper's railpad damping to the common one.
    pub fn railpad_damping(&self) -> Range<usize> {
        self.outer().end..self.outer().end + self.sleepers
    }

    /// Indices of all unknowns beyond the section.
    pub fn beyond(&self) -> Range<usize> {
        self.ends().start..self.outer().end
    }

    /// Meaning of each unknown of [`Unknowns::outer`].
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

    /// A copy of the values of a problem, with the unknowns of the baseline at their prior mean.
    pub(crate) fn with_typical(&self, values: &DVector<f64>) -> DVector<f64> {
        let mut typical = values.clone();
        typical.rows_mut(0, self.count()).copy_from(&self.typical());
        typical
    }

    /// Prior standard deviation of each unknown, without exceptions and support changes.
    pub fn prior_deviations(&self) -> DVector<f64> {
        self.covariance().diagonal().map(f64::sqrt)
    }

    /// Change of all unknowns by a support change whose amplitude is one standard deviation of its prior.
    pub fn along_change(&self, change: SupportChange) -> DVector<f64> {
        let mut direction = DVector::zeros(self.count());
        for (sleeper, index) in self.ballast().enumerate() {
            direction[index] = prior::SUPPORT_CHANGE * change.share(sleeper);
        }
        direction
    }

    /// Change of all unknowns by an exception of one standard deviation of its prior.
    pub fn along_exception(&self, Exception { field, sleeper }: Exception) -> DVector<f64> {
        let mut direction = DVector::zeros(self.count());
        direction[self.at(field, sleeper)] = prior::EXCEPTION;
        direction
    }

    /// Inverse of the prior covariance, with exceptions and support changes.
    pub fn precision(&self) -> DMatrix<f64> {
        let mut covariance = self.covariance();
        let changes = self.support_changes.iter().map(|&change| self.along_change(change));
        let exceptions = self.exceptions.iter().map(|&exception| self.along_exception(exception));
        for direction in changes.chain(exceptions) {
            covariance.ger(1.0, &direction, &direction, 1.0);
        }
        Cholesky::new(covariance).expect("a prior with a white part is positive definite").inverse()
    }

    /// Prior covariance of all unknowns, without exceptions and support changes.
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
        for index in self.railpad_damping() {
            covariance[(index, index)] = self.railpad_damping_deviation.powi(2);
        }
        // One of the ends is there, each as probable as the others.
        for index in self.ends() {
            covariance[(index, index)] = 1.0 / ENDS_SPANS.len() as f64;
        }
        covariance
    }

    /// Adds the sleepers beyond the section. They vary as the compared ones do: the difference from the
    /// first or last sleeper has the prior of the same quantity between the two.
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

    /// Support of one compared sleeper.
    pub fn support(&self, values: &DVector<f64>, sleeper: usize) -> Support {
        let own = |quantity| values[self.at(quantity, sleeper)].exp();
        let common = |quantity| values[self.common(quantity)].exp();
        Support {
            railpad_stiffness: own(Own::RailpadStiffness),
            railpad_damping: common(Common::RailpadDamping)
                * values[self.railpad_damping().start + sleeper].exp(),
            ballast_stiffness: own(Own::BallastStiffness),
            ballast_damping: common(Common::BallastDamping),
            sleeper_bending_stiffness: common(Common::SleeperBendingStiffness),
        }
    }

    /// Indices of the spectrum knots on both sides of a wave number in rad/m, with interpolation weights.
    pub fn spectrum_shares(&self, wave_number_rad_m: f64) -> [(usize, f64); 2] {
        shares(&self.knots, wave_number_rad_m, self.spectrum().start)
    }

    /// Indices of the response knots on both sides of a frequency in Hz, with interpolation weights.
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
