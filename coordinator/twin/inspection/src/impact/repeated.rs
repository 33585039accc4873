//! Power in short cells along the track for every pass, with tail probabilities.

use crate::along::{Background, Energy, by_speed, ln_ratio_tail, median, whitened};
use std::ops::Range;
use tracktwin_number::NORMAL_QUARTILE;
use tracktwin_signal::recording::{Pass, Recording};

/// Frequency range of a blow in Hz. In this range the power of the surface itself varies little along the
/// track, and the contact rings.
const BLOW_HZ: [f64; 2] = [700.0, 5000.0];
/// Wave numbers in cycles per sleeper spacing of a hollow of 2 to 10 mm on V-Track, 10 to 48 mm on a line; its
/// frequencies are proportional to the speed.
const HOLLOW_PER_SPACING: [f64; 2] = [12.5, 125.0];
/// The same of a hollow of 5 to 15 mm on V-Track, 25 to 70 mm on a line.
const LONG_HOLLOW_PER_SPACING: [f64; 2] = [6.0, 40.0];
/// Lowest frequency in Hz of a hollow; below it the ringing of the track is longer than the passage of the
/// wheel.
const HOLLOW_LOW_HZ: f64 = 200.0;
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// Smallest ratio of power to noise floor of a usable frequency.
const AUDIBLE: f64 = 4.0;
/// Width of a cell as a share of the sleeper spacing: 10 mm for a spacing of 125 mm, the length of a squat
/// and of the ringing after it.
const CELL_SHARE: f64 = 0.08;
/// Smallest product of a cell's duration and bandwidth; below it the power is mostly random.
const PRODUCT_MIN: f64 = 6.0;
/// Number of steps per cell: neighbouring cells overlap by half.
const STEPS: usize = 2;
/// Variance of a median over that of a mean of as many normal variables.
const MEDIAN_VARIANCE: f64 = std::f64::consts::FRAC_PI_2;
/// Number of bays on either side, and smallest number of all, that tell what is usual at one place of a bay.
const BAYS: f64 = 20.0;
const BAYS_MIN: usize = 8;
/// Distance on either side, in sleeper spacings, over which the normal power of a cell is determined.
const NEAR_SPACINGS: f64 = 1.5;

/// Kind of impact in a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ImpactKind {
    /// Impacts with the same frequencies at all speeds: kinks, edges and ringing.
    Blows,
    /// Impacts with the same wavelengths at all speeds: hollows, which have little power at low speed.
    Hollows,
    /// The same for longer hollows.
    LongHollows,
}

impl ImpactKind {
    pub(crate) const ALL: [Self; 3] = [Self::Blows, Self::Hollows, Self::LongHollows];

    /// The frequency band in Hz for a pass over sleepers of this spacing; `None` if it is empty.
    pub(crate) fn band(
        self,
        pass: &Pass,
        background: &Background,
        spacing_m: f64,
    ) -> Option<[f64; 2]> {
        let hollow_hz = |waves: [f64; 2]| {
            let [low, high] = waves.map(|waves| waves * pass.mean_speed_m_s() / spacing_m);
            [low.max(HOLLOW_LOW_HZ), high]
        };
        let [low, high] = match self {
            Self::Blows => BLOW_HZ,
            Self::Hollows => hollow_hz(HOLLOW_PER_SPACING),
            Self::LongHollows => hollow_hz(LONG_HOLLOW_PER_SPACING),
        };
        let top = HIGH_SHARE * pass.signal.sample_rate_hz();
        let audible = background.audible_hz(AUDIBLE).max(2.0 * low);
        let (low, high) = (low.min(0.5 * top), high.min(top).min(audible));
        (high > 1.3 * low).then_some([low, high])
    }
}

/// Cells of one speed: power relative to the normal power there, as mean of the passes at this speed.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    /// Position of the middle of the first cell in m.
    pub first_m: f64,
    /// Distance between the middles of neighbouring cells in m.
    pub step_m: f64,
    /// Width of a cell in m.
    pub width_m: f64,
    /// Power of every cell relative to the median around it.
    pub ratio: Vec<f64>,
    /// Shapes of the gamma distributions of a power and of the median around it, whose ratio the ratios are without
    /// impacts.
    pub shapes: [f64; 2],
    /// Indices of the averaged passes.
    pub passes: Vec<usize>,
}

impl Cells {
    /// Position of the middle of a cell in m.
    pub(crate) fn place_m(&self, cell: usize) -> f64 {
        self.first_m + cell as f64 * self.step_m
    }

    /// `ln P` of a cell's power without an impact.
    pub(crate) fn ln_tail(&self, cell: usize) -> f64 {
        ln_ratio_tail(self.shapes, self.ratio[cell])
    }
}

/// The cells of every speed (of every pass if `each`), at common positions.
///
/// Empty if a pass has too little power above the lowest frequency of the impacts.
pub(crate) fn cells(recording: &Recording, kind: ImpactKind, each: bool) -> Vec<Cells> {
    let passes = &recording.passes;
    let groups =
        if each { (0..passes.len()).map(|index| vec![index]).collect() } else { by_speed(passes) };
    let Some(width_m) = width(recording, kind) else { return Vec::new() };
    let from = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
    let ends = passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
    // The fading ends of a pass and half a cell stay out.
    let room = 2.5 * width_m;
    let (first_m, last_m) = (from + room, ends.fold(f64::MAX, f64::min) - room);
    let step_m = width_m / STEPS as f64;
    if last_m < first_m + 8.0 * width_m {
        return Vec::new();
    }
    let count = ((last_m - first_m) / step_m) as usize + 1;
    let spacing_m = recording.spacing_m;
    let near = ((NEAR_SPACINGS * spacing_m / step_m).round() as usize).max(8);
    let grid = Grid { kind, spacing_m, first_m, step_m, width_m, count, near };
    groups.into_iter().filter_map(|group| grid.cells(passes, group)).collect()
}

/// The width of a cell in m, wide enough for the fastest pass; `None` if there is no signal.
fn width(recording: &Recording, kind: ImpactKind) -> Option<f64> {
    let mut width = CELL_SHARE * recording.spacing_m;
    for pass in &recording.passes {
        let [low, high] = kind.band(pass, &Background::of(&pass.signal)?, recording.spacing_m)?;
        width = width.max(PRODUCT_MIN * pass.mean_speed_m_s() / (high - low));
    }
    (width < 0.5 * recording.spacing_m).then_some(width)
}

struct Grid {
    kind: ImpactKind,
    spacing_m: f64,
    first_m: f64,
    step_m: f64,
    width_m: f64,
    count: usize,
    near: usize,
}

impl Grid {
    fn cells(&self, passes: &[Pass], group: Vec<usize>) -> Option<Cells> {
        let mut ratio = vec![0.0; self.count];
        for &index in &group {
            let power = self.powers(&passes[index])?;
            for (cell, sum) in ratio.iter_mut().enumerate() {
                let normal = median(power[self.around(cell)].to_vec());
                *sum += power[cell] / normal.max(f64::MIN_POSITIVE) / group.len() as f64;
            }
        }
        self.remove_usual_profile(&mut ratio);
        let shapes = self.shapes(shape(&ratio)?);
        // The median of a gamma variable lies below its mean (Wilson and Hilferty).
        let median_over_mean = (1.0 - 1.0 / (9.0 * shapes[0])).powi(3);
        for value in &mut ratio {
            *value *= median_over_mean;
        }
        let Self { first_m, step_m, width_m, .. } = *self;
        Some(Cells { first_m, step_m, width_m, ratio, shapes, passes: group })
    }

    /// Shapes of a power and of the median around it, from that of their ratio: relative variances add up. Of the cells
    /// around, which overlap, every second counts.
    fn shapes(&self, of_ratio: f64) -> [f64; 2] {
        let independent = (2 * self.near + 1) as f64 / STEPS as f64;
        let variance = MEDIAN_VARIANCE / independent;
        let power = of_ratio * (1.0 + variance);
        [power, power / variance]
    }

    fn powers(&self, pass: &Pass) -> Option<Vec<f64>> {
        let background = Background::of(&pass.signal)?;
        let band_hz = self.kind.band(pass, &background, self.spacing_m)?;
        let white = whitened(&pass.signal, &background, band_hz);
        let energy = Energy::new(pass, &white);
        let power = |cell: usize| {
            let middle = self.first_m + cell as f64 * self.step_m;
            energy.mean(middle - 0.5 * self.width_m, middle + 0.5 * self.width_m)
        };
        Some((0..self.count).map(power).collect())
    }

    /// Divides by what is usual at the same place between two sleepers, where that is above the normal power:
    /// the rail is stiffer over every sleeper, and on a smooth rail every sleeper is heard.
    fn remove_usual_profile(&self, ratio: &mut [f64]) {
        let reach = (BAYS * self.spacing_m / self.step_m) as usize;
        let phase = |cell: usize| (cell as f64 * self.step_m / self.spacing_m).fract();
        let is_alike = |one: usize, other: usize| {
            let apart = (phase(one) - phase(other)).abs();
            apart.min(1.0 - apart) * self.spacing_m <= 0.5 * self.step_m
        };
        let usual = |cell: usize| {
            let near = cell.saturating_sub(reach)..(cell + reach + 1).min(self.count);
            let alike = near.filter(|&other| is_alike(cell, other));
            let alike: Vec<f64> = alike.map(|other| ratio[other]).collect();
            if alike.len() < BAYS_MIN { 1.0 } else { median(alike).max(1.0) }
        };
        let usual: Vec<f64> = (0..self.count).map(usual).collect();
        for (value, usual) in ratio.iter_mut().zip(usual) {
            *value /= usual;
        }
    }

    fn around(&self, cell: usize) -> Range<usize> {
        cell.saturating_sub(self.near)..(cell + self.near + 1).min(self.count)
    }
}

/// Shape of the gamma distribution with the quartiles of these ratios; `None` if the ratios do not vary.
///
/// The standard deviation of the logarithm of a gamma variable is slightly above `1/sqrt(shape)`; a few
/// cells with impacts do not change the quartiles.
fn shape(ratio: &[f64]) -> Option<f64> {
    let mut logs: Vec<f64> = ratio.iter().map(|value| value.max(1e-12).ln()).collect();
    logs.sort_by(f64::total_cmp);
    let quartile = |quarters: usize| logs[(logs.len() - 1) * quarters / 4];
    let deviation = (quartile(3) - quartile(1)) / (2.0 * NORMAL_QUARTILE);
    (deviation > 0.0).then(|| 0.5 + 1.0 / deviation.powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_every_sleeper_does_is_usual_and_a_louder_one_stands_out() {
        // Sleepers are 25.5 steps apart.
        let (spacing_m, step_m, count) = (0.6, 0.6 / 25.5, 1000);
        let kind = ImpactKind::Blows;
        let grid = Grid { kind, spacing_m, first_m: 0.0, step_m, width_m: 0.048, count, near: 38 };
        let sleeper = |cell: usize| (cell as f64 / 25.5).round();
        let is_over_sleeper = |cell: usize| (cell as f64 - 25.5 * sleeper(cell)).abs() < 1.0;
        let power = |cell: usize| match (is_over_sleeper(cell), sleeper(cell)) {
            (false, _) => 0.9,
            (true, 12.0) => 12.0,
            (true, _) => 3.0,
        };
        let mut ratio: Vec<f64> = (0..count).map(power).collect();
        grid.remove_usual_profile(&mut ratio);
        for (cell, ratio) in ratio.into_iter().enumerate() {
            let expected = match (is_over_sleeper(cell), sleeper(cell)) {
                (false, _) => 0.9,
                (true, 12.0) => 4.0,
                (true, _) => 1.0,
            };
            assert!((ratio - expected).abs() < 1e-12, "cell {cell}: {ratio}");
        }
    }
}
