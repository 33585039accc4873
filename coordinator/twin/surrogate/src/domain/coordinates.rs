//! Linear coordinates of the features of a window, in which the random surface causes independent
//! deviations of variance one.

use super::discrepancy::discrepancy;
use super::lack_of_fit::lack_of_fit;
use crate::cholesky::Cholesky;
use crate::polynomial::Polynomial;
use crate::{Error, TrainingSet};
use faer::{Mat, MatRef, Side};

/// Highest total degree of the polynomial in the parameters.
const DEGREE_MAX: usize = 3;
/// Bins that are averaged into a band, the finest first.
const BAND_BINS: [usize; 5] = [4, 8, 16, 32, 64];
/// Entries per band value below which bands are made wider.
const ENTRIES_PER_BAND: usize = 4;
/// Shrinkage: share of the mean variance over all bands that is added to the variance of every band.
const SHRINKAGE: f64 = 0.02;

/// Map from features to coordinates, and prediction of the coordinates from the parameters.
///
/// Bands of ln-power are regressed on the parameters. The axes are scaled by the residuals of the
/// regression. The first directions carry the effect of the parameters, as in Fisher's discriminant
/// analysis; the expectation is zero in all other directions. A rotation of the coordinates then makes the
/// discrepancy between simulators independent too.
pub(super) struct Coordinates {
    speeds: usize,
    bins: usize,
    band_bins: usize,
    offset: Vec<f64>,
    /// Band values x d.
    projection: Mat<f64>,
    /// Variances of the systematic error of a track, the same for all its windows: discrepancy between
    /// simulators plus lack of fit of the polynomial; d values.
    pub(super) discrepancy: Vec<f64>,
    pub(super) polynomial: Polynomial,
    /// Regression coefficients in the leading directions, which the parameters affect: coefficients x
    /// leading.
    coefficients: Mat<f64>,
    /// From the leading directions to coordinates: leading x d.
    pub(super) from_leading: Mat<f64>,
    /// `(B' B)⁻¹` of the regression, coefficients x coefficients.
    inverse_normal: Mat<f64>,
}

impl Coordinates {
    /// Fits the coordinates to the given entries of a library.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] when entries are too few or a parameter is constant;
    /// [`Error::NoEigenvalues`].
    pub(super) fn of(
        set: &TrainingSet,
        speeds: &[usize],
        entries: &[usize],
    ) -> Result<Self, Error> {
        let bins = set.frequencies_hz.len();
        let band_bins = band_bins(set, speeds.len());
        let features = set.features(entries, speeds, &(0..bins));
        let bands = bands(features.as_ref(), bins, band_bins);
        let offset: Vec<f64> =
            bands.col_iter().map(|c| c.iter().sum::<f64>() / entries.len() as f64).collect();
        let centred = Mat::from_fn(bands.nrows(), bands.ncols(), |i, j| bands[(i, j)] - offset[j]);
        let parameters = set.values(entries);
        let polynomial = Polynomial::of(parameters.as_ref(), DEGREE_MAX);
        let basis = polynomial.basis(polynomial.unit(parameters.as_ref()).as_ref());
        let normal = Cholesky::new(basis.transpose() * &basis)?;
        let inverse_normal = normal.solve(Mat::identity(basis.ncols(), basis.ncols()).as_ref());
        let coefficients = normal.solve((basis.transpose() * &centred).as_ref());
        let expected = &basis * &coefficients;
        let whitening = whitening(&centred, &expected, basis.ncols())?;
        let between = discrepancy(&band_frequencies(&set.frequencies_hz, band_bins), speeds.len());
        let between = whitening.projection.transpose() * between * &whitening.projection;
        let size = between.nrows();
        let eigen =
            between.self_adjoint_eigen(Side::Lower).map_err(|_| Error::NoEigenvalues { size })?;
        let turned = eigen.U().to_owned();
        let leading = whitening.leading;
        let coefficients = coefficients * whitening.projection.subcols(0, leading);
        let projection = &whitening.projection * &turned;
        let from_leading = turned.subrows(0, leading).to_owned();
        let residuals = centred * &projection - &basis * &coefficients * &from_leading;
        let unit = polynomial.unit(parameters.as_ref());
        let lack_of_fit = lack_of_fit(&residuals, &unit, basis.ncols());
        let simulators = eigen.S().column_vector().iter().map(|value| value.max(0.0));
        Ok(Self {
            speeds: speeds.len(),
            bins,
            band_bins,
            offset,
            projection,
            discrepancy: simulators.zip(lack_of_fit).map(|(a, b)| a + b).collect(),
            polynomial,
            coefficients,
            from_leading,
            inverse_normal,
        })
    }

    /// Coordinates (t x d) of features (t x (speeds * bins)).
    pub(super) fn apply(&self, features: MatRef<'_, f64>) -> Mat<f64> {
        let bands = bands(features, self.bins, self.band_bins);
        Mat::from_fn(bands.nrows(), bands.ncols(), |i, j| bands[(i, j)] - self.offset[j])
            * &self.projection
    }

    /// Number of features of a window: speeds times bins.
    pub(super) fn features(&self) -> usize {
        self.speeds * self.bins
    }

    /// Expected coordinates at mapped parameters, with linear extrapolation beyond their ranges.
    pub(super) fn expected(&self, unit: &[f64]) -> Vec<f64> {
        let leading = self.expected_leading(unit);
        let row = MatRef::from_row_major_slice(&leading, 1, leading.len());
        (row * &self.from_leading).row(0).iter().copied().collect()
    }

    /// Expected coordinates at mapped parameters in the leading directions only; the expectation is zero in
    /// all other directions.
    pub(super) fn expected_leading(&self, unit: &[f64]) -> Vec<f64> {
        let inside = inside(unit);
        let mut mean: Vec<f64> =
            (self.basis(&inside) * &self.coefficients).row(0).iter().copied().collect();
        if inside != unit {
            let slopes = self.slopes(unit);
            for (axis, (value, inside)) in unit.iter().zip(&inside).enumerate() {
                let slopes = slopes.row(axis);
                mean.iter_mut()
                    .zip(slopes.iter())
                    .for_each(|(m, slope)| *m += (value - inside) * slope);
            }
        }
        mean
    }

    /// Derivatives of the leading directions by the mapped parameters, p x leading.
    pub(super) fn slopes(&self, unit: &[f64]) -> Mat<f64> {
        self.polynomial.slopes(&inside(unit)) * &self.coefficients
    }

    /// Variance of the expectation, the same in every coordinate: the leverage of the regression at `unit`.
    pub(super) fn variance(&self, unit: &[f64]) -> f64 {
        let basis = self.basis(&inside(unit));
        (&basis * &self.inverse_normal * basis.transpose())[(0, 0)]
    }

    fn basis(&self, inside: &[f64]) -> Mat<f64> {
        self.polynomial.basis(MatRef::from_row_major_slice(inside, 1, inside.len()))
    }
}

/// Mapped parameters, clamped to their ranges.
fn inside(unit: &[f64]) -> Vec<f64> {
    unit.iter().map(|value| value.clamp(-1.0, 1.0)).collect()
}

/// Number of bins per band: the narrowest bands whose covariance half of the library's entries can
/// determine.
fn band_bins(set: &TrainingSet, speeds: usize) -> usize {
    let values = |band: usize| speeds * set.frequencies_hz.len().div_ceil(band);
    BAND_BINS
        .into_iter()
        .find(|&band| 2 * ENTRIES_PER_BAND * values(band) <= set.entries())
        .unwrap_or(BAND_BINS[BAND_BINS.len() - 1])
}

/// Directions in which the residuals have variance one, sorted by the effect of the parameters, largest
/// first.
struct Whitening {
    projection: Mat<f64>,
    /// Number of directions in which the parameters have a larger effect than chance.
    leading: usize,
}

fn whitening(
    centred: &Mat<f64>,
    expected: &Mat<f64>,
    coefficients: usize,
) -> Result<Whitening, Error> {
    let (n, d) = (centred.nrows(), centred.ncols());
    let residual = centred - expected;
    let freedom = n.saturating_sub(coefficients).max(1) as f64;
    let mut scatter = residual.transpose() * &residual * faer::Scale(1.0 / freedom);
    let mean = (0..d).map(|i| scatter[(i, i)]).sum::<f64>() / d as f64;
    (0..d).for_each(|i| scatter[(i, i)] += SHRINKAGE * mean);
    let factor = Cholesky::new(scatter)?;
    let moved = expected.transpose() * expected * faer::Scale(1.0 / n as f64);
    let moved = factor.half_solve(factor.half_solve(moved).transpose().to_owned());
    let eigen =
        moved.self_adjoint_eigen(Side::Lower).map_err(|_| Error::NoEigenvalues { size: d })?;
    let descending = Mat::from_fn(d, d, |i, j| eigen.U()[(i, d - 1 - j)]);
    // What a regression on nothing but noise would have at most (Marchenko & Pastur 1967).
    let chance =
        coefficients as f64 / n as f64 * (1.0 + (d as f64 / coefficients as f64).sqrt()).powi(2);
    let leading = eigen.S().column_vector().iter().filter(|&&value| value > chance).count();
    let projection = factor.other_half_solve(descending);
    Ok(Whitening { projection, leading: leading.max(1) })
}

/// Means over neighbouring bins, with the speeds one after the other; the last band of a speed may be
/// narrower.
fn bands(features: MatRef<'_, f64>, bins: usize, band_bins: usize) -> Mat<f64> {
    let per_speed = bins.div_ceil(band_bins);
    let speeds = features.ncols() / bins;
    Mat::from_fn(features.nrows(), speeds * per_speed, |i, j| {
        let (speed, band) = (j / per_speed, j % per_speed);
        let range = band * band_bins..((band + 1) * band_bins).min(bins);
        let width = range.len() as f64;
        range.map(|bin| features[(i, speed * bins + bin)]).sum::<f64>() / width
    })
}

/// Geometric middle of every band in Hz.
fn band_frequencies(frequencies_hz: &[f64], band_bins: usize) -> Vec<f64> {
    let middle = |band: &[f64]| {
        (band.iter().map(|frequency| frequency.ln()).sum::<f64>() / band.len() as f64).exp()
    };
    frequencies_hz.chunks(band_bins).map(middle).collect()
}
