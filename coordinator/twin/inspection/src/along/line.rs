//! Spectral lines on a stretch of track, each relative to its neighbouring bins.

use super::background::{hann, median};
use super::tail::ln_line_tail;
use num_complex::Complex64;
use std::ops::Range;
use tracktwin_signal::recording::Pass;

/// Number of bins per resolution cell: the transform is padded to twice its length.
const PADDING: usize = 2;

/// Resolution cells on either side of a line that belong to the line (Hann's main lobe).
pub(crate) const LOBE: f64 = 2.5;

/// Default distance of the farthest neighbours of a line on either side, in resolution cells.
const REACH: f64 = 18.0;

/// Half width, in resolution cells, of the stretch over which the shape of a background is a line.
const SHAPE: f64 = 18.0;

/// Number of bins that count as one independent value in the mean of the neighbours.
///
/// Padding, Hann window and the variance of a median give 6.2. The rule that the side with the higher power
/// counts makes large ratios rarer: in a million bins of noise, ratios of probability 1e-3 to 1e-5 follow
/// 4.7 or less.
const BINS_PER_NEIGHBOUR: f64 = 4.8;

/// Power of a spectral line relative to its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    /// Power divided by the mean power of the neighbours; one on average if there is no line.
    pub ratio: f64,
    /// Number of independent values of the neighbours.
    pub neighbours: f64,
    /// Mean power of the neighbours.
    pub beside: f64,
}

impl Line {
    /// `ln P` of a line with at least this ratio by chance.
    pub(crate) fn ln_tail(self) -> f64 {
        ln_line_tail(self.neighbours, self.ratio)
    }

    /// Power of the line.
    pub(crate) fn power(self) -> f64 {
        self.ratio * self.beside
    }

    /// Mean of the same line in several passes. The passes share their surface; the mean is therefore no
    /// more significant than one pass. `None` for an empty list.
    pub(crate) fn mean(lines: &[Self]) -> Option<Self> {
        let least = lines.iter().map(|line| line.neighbours).min_by(f64::total_cmp)?;
        let mean =
            |value: fn(&Self) -> f64| lines.iter().map(value).sum::<f64>() / lines.len() as f64;
        Some(Self {
            ratio: mean(|line| line.ratio),
            neighbours: least,
            beside: mean(|line| line.beside),
        })
    }
}

/// Quantity that gives the position of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ruler {
    /// The positions of the recording.
    Odometer,
    /// The time, with constant speed between the ends of the pass. This is better if the odometer error
    /// exceeds a fraction of the wavelength.
    Clock,
}

impl Ruler {
    pub(crate) const BOTH: [Self; 2] = [Self::Odometer, Self::Clock];
}

/// Index of a position in m among positions that do not decrease, interpolated or extrapolated.
pub(crate) fn index_at(positions_m: &[f64], x_m: f64) -> f64 {
    let last = positions_m.len() - 1;
    let after = positions_m.partition_point(|&place| place <= x_m).clamp(1, last);
    let (low, high) = (positions_m[after - 1], positions_m[after]);
    let part = if high > low { (x_m - low) / (high - low) } else { 0.0 };
    (after - 1) as f64 + part
}

/// Values of a pass at `points` equidistant positions from `from_m` (included) to `to_m` (excluded), in m.
pub(crate) fn on_even_places(
    pass: &Pass,
    values: &[Complex64],
    [from_m, to_m]: [f64; 2],
    points: usize,
    ruler: Ruler,
) -> Vec<Complex64> {
    let positions = &pass.position_m;
    let last = positions.len() - 1;
    let per_sample = (positions[last] - positions[0]) / last as f64;
    let index_of = |x: f64| match ruler {
        Ruler::Clock => (x - positions[0]) / per_sample,
        Ruler::Odometer => index_at(positions, x),
    };
    let step = (to_m - from_m) / points as f64;
    let value = |point: usize| {
        let index = index_of(from_m + point as f64 * step).clamp(0.0, last as f64);
        let low = (index.floor() as usize).min(last.saturating_sub(1));
        let part = index - low as f64;
        values[low] * (1.0 - part) + values[low + 1] * part
    };
    (0..points).map(value).collect()
}

/// Power spectrum of a stretch, by wave number or by frequency.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    step: f64,
    power: Vec<f64>,
    /// Number of transformed values.
    length: usize,
    /// Distance of the farthest neighbours on either side, in resolution cells.
    reach: f64,
    /// Expected power of each bin without lines, up to a factor.
    shape: Option<Vec<f64>>,
}

impl Spectrum {
    /// Spectrum of equidistant values (`step` apart) with a Hann window; the values may be analytic or
    /// real.
    pub(crate) fn new(values: &[Complex64], step: f64) -> Self {
        let length = values.len();
        let windowed = values.iter().enumerate().map(|(i, value)| value * hann(i, length));
        let mut lines: Vec<_> = windowed.collect();
        lines.resize(PADDING * length, Complex64::ZERO);
        tracktwin_fourier::forward(lines.len()).process(&mut lines);
        let power = lines[..=length * PADDING / 2].iter().map(Complex64::norm_sqr).collect();
        let step = 1.0 / (step * (PADDING * length) as f64);
        Self { step, power, length, reach: REACH, shape: None }
    }

    /// The same spectrum, with neighbours up to `reach` resolution cells from a line.
    pub(crate) fn reaching(self, reach: f64) -> Self {
        Self { reach, ..self }
    }

    /// The same spectrum, whose expected power without lines has the shape of these spectra of equal bins.
    pub(crate) fn like(self, others: &[Self]) -> Self {
        let mean = |bin: usize| others.iter().map(|other| other.power[bin]).sum::<f64>();
        let logarithms: Vec<f64> =
            (0..self.len()).map(|bin| mean(bin).max(f64::MIN_POSITIVE).ln()).collect();
        let half = (SHAPE * PADDING as f64) as usize;
        let shape = (0..self.len()).map(|bin| local_line(&logarithms, bin, half).exp());
        Self { shape: Some(shape.collect()), ..self }
    }

    /// Distance of the bins, in cycles per unit of `step`.
    pub(crate) const fn bin_width(&self) -> f64 {
        self.step
    }

    /// Number of bins.
    pub(crate) const fn len(&self) -> usize {
        self.power.len()
    }

    /// Index of the bin nearest to a wave number or frequency.
    pub(crate) fn bin(&self, place: f64) -> usize {
        ((place / self.step).round() as usize).min(self.power.len() - 1)
    }

    /// Amplitude of a tone in a real signal that has the power of this bin.
    pub(crate) fn amplitude(&self, bin: usize) -> f64 {
        // Half of it is at negative frequencies, and the mean of Hann is one half.
        4.0 * self.power[bin].sqrt() / self.length as f64
    }

    /// Power of a bin relative to the median power of its neighbours, scaled to a mean of one without a
    /// line. Neighbours are scaled to the power that is expected in the bin.
    ///
    /// The side with the higher power counts, because on the flank of a resonance the other side is no
    /// background. Bins for which `skip` is true do not count. `None` if both sides have too few
    /// neighbours.
    pub(crate) fn line(&self, bin: usize, skip: impl Fn(f64) -> bool) -> Option<Line> {
        let [near, far] = [LOBE, self.reach].map(|cells| (cells * PADDING as f64) as usize);
        let below = bin.saturating_sub(far).max(1)..bin.saturating_sub(near).max(1);
        let above = (bin + near + 1).min(self.len())..(bin + far + 1).min(self.len());
        let expected = |other: usize| self.shape.as_ref().map_or(1.0, |it| it[bin] / it[other]);
        let side = |bins: Range<usize>| {
            let powers: Vec<f64> = bins
                .filter(|&other| !skip(other as f64 * self.step))
                .map(|other| self.power[other] * expected(other))
                .collect();
            (powers.len() >= (far - near) / 4).then(|| (powers.len(), median(powers)))
        };
        let sides: Vec<_> = [side(below), side(above)].into_iter().flatten().collect();
        let mean = sides.iter().map(|(_, middle)| *middle).fold(0.0, f64::max) / 2f64.ln();
        let bins: usize = sides.iter().map(|(bins, _)| bins).sum();
        let neighbours = bins as f64 / BINS_PER_NEIGHBOUR;
        let ratio = self.power[bin] / mean;
        (mean > 0.0).then_some(Line { ratio, neighbours, beside: mean })
    }
}

/// Value at `place` of the line fitted to the values at most `half` from it, near ones with more weight.
fn local_line(values: &[f64], place: usize, half: usize) -> f64 {
    let range = place.saturating_sub(half)..(place + half + 1).min(values.len());
    let [mut w, mut wx, mut wxx, mut wy, mut wxy] = [0.0; 5];
    for index in range {
        let x = (index as f64 - place as f64) / (half + 1) as f64;
        let (weight, y) = ((1.0 - x.abs().powi(3)).powi(3), values[index]);
        (w, wx, wxx) = (w + weight, wx + weight * x, wxx + weight * x * x);
        (wy, wxy) = (wy + weight * y, wxy + weight * x * y);
    }
    let determinant = w * wxx - wx * wx;
    if determinant > 0.0 { (wxx * wy - wx * wxy) / determinant } else { wy / w }
}

/// Amplitude `a` of a tone from its power ratio. On a stretch of length `l`, in noise of one-sided density
/// `s`, the ratio of tone power to mean noise power is `a^2 l / (2 * 1.5 s)`.
///
/// The equivalent noise bandwidth of the Hann window is 1.5 cells.
pub(crate) fn amplitude(ratio: f64, density: f64, length: f64) -> f64 {
    (3.0 * density * (ratio - 1.0).max(0.0) / length).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::noise;
    use std::f64::consts::TAU;

    fn values(tone: f64) -> Vec<Complex64> {
        let line = |i: usize| tone * (TAU * 0.05 * i as f64).cos();
        noise(4, 4000).into_iter().enumerate().map(|(i, n)| (n + line(i)).into()).collect()
    }

    #[test]
    fn the_amplitude_of_a_tone_in_noise_comes_back() {
        let spectrum = Spectrum::new(&values(0.5), 1.0);
        let ratio = spectrum.line(spectrum.bin(0.05), |_| false).unwrap().ratio;
        // White noise of variance one has density 2 over half a cycle a sample. A line 250 times
        // above its neighbours is known to 1 / sqrt(2 * 250), their median to a quarter.
        let found = amplitude(ratio, 2.0, 4000.0);
        assert!((found / 0.5 - 1.0).abs() < 0.2, "{found}");
    }

    #[test]
    fn ratios_of_noise_exceed_a_level_no_more_often_than_their_tail_says() {
        let mut above = 0;
        let mut tried = 0;
        for seed in 0..20 {
            let noise: Vec<_> = noise(seed, 2000).into_iter().map(Complex64::from).collect();
            let spectrum = Spectrum::new(&noise, 1.0);
            for bin in (50..1950).step_by(4) {
                let line = spectrum.line(bin, |_| false).unwrap();
                above += usize::from(line.ln_tail() < 0.01f64.ln());
                tried += 1;
            }
        }
        let share = above as f64 / f64::from(tried);
        // The louder side makes the test careful: at most 1 %, and 0.1 % is one standard deviation.
        assert!((0.001..=0.012).contains(&share), "{share}");
    }

    #[test]
    fn a_line_without_neighbours_has_no_ratio() {
        let spectrum = Spectrum::new(&values(0.0), 1.0);
        assert!(spectrum.line(100, |_| true).is_none());
    }
}
