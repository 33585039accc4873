//! Gain errors: passes at one speed that differ by a constant factor.

use crate::along::{Background, Energy, bonferroni, by_speed, ln_student_tail, median, whitened};
use tracktwin_signal::recording::{Pass, Recording};

/// Bands in Hz whose powers are compared; a gain error is the same in all bands.
const BANDS_HZ: [[f64; 2]; 3] = [[100.0, 400.0], [400.0, 1200.0], [1200.0, 4000.0]];
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// Usual difference of two passes in dB.
pub(super) const USUAL_DB: f64 = 0.2;
/// Exponent of the power as a function of speed, and its uncertainty: surface spectra decrease with the
/// third or fourth power of the wave number.
const SPEED_POWER: f64 = 3.0;
const SPEED_POWER_UNSURE: f64 = 1.0;
/// Largest difference between the gains of the bands in dB; a larger difference is not a gain error, unless the
/// bands are known no better.
const UNIFORM_DB: f64 = 0.6;
/// Standard deviations by which the gain of a band may differ from that of all bands.
const BAND_DEVIATIONS: f64 = 2.5;
/// Neighbouring stretches are not independent where the track rings across several of them: standard errors of
/// the mean over a band are this many times larger.
const RINGING: f64 = 2.0;
/// Smallest number of stretches for a mean and its standard deviation.
const STRETCHES_MIN: usize = 6;

/// Gain of a pass relative to the other passes at its speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// Index of the pass.
    pub pass: usize,
    /// Number of passes at this speed, including this one.
    pub passes: usize,
    /// Level relative to the median of the other passes at this nominal speed, corrected for the difference of
    /// the true speeds.
    pub level: LevelDifference,
}

/// Difference of two levels, over all bands.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelDifference {
    /// Mean difference in dB and its standard deviation.
    pub mean_db: (f64, f64),
    /// Largest difference between bands in dB.
    pub spread_db: f64,
    /// Largest difference of a band from all bands in its standard deviations.
    pub spread_deviations: f64,
    /// Natural logarithm of the probability of such a difference by chance.
    pub ln_p: f64,
}

impl LevelDifference {
    /// Whether it is the same in every band.
    pub(super) fn is_uniform(&self) -> bool {
        let is_narrow = self.spread_db < UNIFORM_DB.max(0.2 * self.mean_db.0.abs());
        is_narrow || self.spread_deviations < BAND_DEVIATIONS
    }
}

impl Gain {
    /// Whether this is a gain error: the same in every band, and improbable (`alpha`) otherwise.
    pub fn is_error(&self, alpha: f64) -> bool {
        self.level.is_uniform() && self.level.ln_p <= alpha.ln()
    }
}

/// Gains of all passes with at least one other pass at their speed.
pub fn gains(recording: &Recording) -> Vec<Gain> {
    let groups = by_speed(&recording.passes);
    let tries = recording.passes.len();
    let mut gains: Vec<Gain> = groups.iter().flat_map(|group| of_speed(recording, group)).collect();
    for gain in &mut gains {
        gain.level.ln_p = bonferroni(gain.level.ln_p, tries);
    }
    gains.sort_by_key(|gain| gain.pass);
    gains
}

/// The passes whose gain is wrong: both of two, because none tells which it is, and of more the one that differs most
/// with those that differ half as much.
pub(crate) fn of_other_gain(
    recording: &Recording,
    gains: &[Gain],
    is_error: impl Fn(&Gain) -> bool,
) -> Vec<usize> {
    let of_group = |group: Vec<usize>| {
        let errors = gains.iter().filter(|gain| group.contains(&gain.pass) && is_error(gain));
        let errors: Vec<&Gain> = errors.collect();
        let largest = errors.iter().map(|gain| gain.level.mean_db.0.abs()).fold(0.0, f64::max);
        let passes: Vec<usize> = match (errors.is_empty(), group.len()) {
            (true, _) => Vec::new(),
            (false, 2) => group,
            (false, _) => {
                let is_far = |gain: &&&Gain| gain.level.mean_db.0.abs() > 0.5 * largest;
                errors.iter().filter(is_far).map(|gain| gain.pass).collect()
            }
        };
        passes
    };
    by_speed(&recording.passes).into_iter().flat_map(of_group).collect()
}

fn of_speed(recording: &Recording, group: &[usize]) -> Vec<Gain> {
    if group.len() < 2 {
        return Vec::new();
    }
    let Some(levels) = Levels::of(recording, group) else { return Vec::new() };
    let gain = |this: usize| {
        let others: Vec<usize> = (0..group.len()).filter(|&pass| pass != this).collect();
        let level = levels.difference(&[this], &others)?;
        Some(Gain { pass: group[this], passes: group.len(), level })
    };
    (0..group.len()).filter_map(gain).collect()
}

/// Levels of the passes at one speed, in dB.
pub(super) struct Levels {
    /// By pass, band and stretch: the same stretches of all passes.
    levels: Vec<Vec<Vec<f64>>>,
    /// Mean speed of each pass in m/s.
    speeds_m_s: Vec<f64>,
}

impl Levels {
    /// Levels of the passes with these indices. `None` if the first one is too short or constant.
    pub(super) fn of(recording: &Recording, passes: &[usize]) -> Option<Self> {
        let passes: Vec<&Pass> = passes.iter().map(|&index| &recording.passes[index]).collect();
        let background = Background::of(&passes.first()?.signal)?;
        let from = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
        let last = |pass: &&Pass| pass.position_m[pass.position_m.len() - 1];
        let to = passes.iter().map(last).fold(f64::MAX, f64::min);
        let of = |pass: &&Pass| levels(pass, &background, [from, to], recording.spacing_m);
        let speeds_m_s = passes.iter().map(|pass| pass.mean_speed_m_s()).collect();
        Some(Self { levels: passes.iter().map(of).collect(), speeds_m_s })
    }

    /// Level of some passes relative to that of others, both the median of their passes, corrected for the difference
    /// of the true speeds. `None` if the passes share too short a stretch.
    pub(super) fn difference(&self, some: &[usize], others: &[usize]) -> Option<LevelDifference> {
        let speed =
            |passes: &[usize]| median(passes.iter().map(|&it| self.speeds_m_s[it]).collect());
        let faster_db = 10.0 * (speed(some) / speed(others)).log10();
        let bands: Vec<Vec<f64>> = (0..self.levels[some[0]].len())
            .map(|band| self.differences(some, others, band))
            .map(|band| band.iter().map(|level| level - SPEED_POWER * faster_db).collect())
            .collect();
        over_bands(&bands, USUAL_DB + SPEED_POWER_UNSURE * faster_db.abs())
    }

    /// Differences in dB in a band, one value per stretch.
    fn differences(&self, some: &[usize], others: &[usize], band: usize) -> Vec<f64> {
        let over = |stretch: usize| {
            let level = |passes: &[usize]| {
                median(passes.iter().map(|&pass| self.levels[pass][band][stretch]).collect())
            };
            level(some) - level(others)
        };
        let stretches = 0..self.levels[some[0]][band].len();
        stretches.map(over).filter(|level| level.is_finite()).collect()
    }
}

/// Difference over all bands from one value per stretch in each.
fn over_bands(bands: &[Vec<f64>], usual_db: f64) -> Option<LevelDifference> {
    let count = bands.iter().map(Vec::len).min()?;
    if count < STRETCHES_MIN {
        return None;
    }
    let each: Vec<(f64, f64)> = bands.iter().map(|band| mean_and_deviation(band)).collect();
    let variance = |(_, error): &(f64, f64)| usual_db.powi(2) + (RINGING * error).powi(2);
    let weights: Vec<f64> = each.iter().map(|band| 1.0 / variance(band)).collect();
    let weight: f64 = weights.iter().sum();
    let over_bands = |stretch: usize| {
        bands.iter().zip(&weights).map(|(band, own)| own * band[stretch]).sum::<f64>() / weight
    };
    let (mean, deviation) = mean_and_deviation(&(0..count).map(over_bands).collect::<Vec<f64>>());
    let apart = |band: &(f64, f64)| (band.0 - mean).abs() / variance(band).sqrt();
    let spread_deviations = each.iter().map(apart).fold(0.0, f64::max);
    let ends = each.iter().fold([f64::MAX, f64::MIN], |e, (m, _)| [e[0].min(*m), e[1].max(*m)]);
    let beyond = (mean.abs() - usual_db) / deviation.max(1e-6);
    // Two-sided.
    let ln_p = (ln_student_tail(count as f64 - 1.0, beyond) + 2f64.ln()).min(0.0);
    let (mean_db, spread_db) = ((mean, deviation), ends[1] - ends[0]);
    Some(LevelDifference { mean_db, spread_db, spread_deviations, ln_p })
}

/// Mean and its standard error.
fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (square / (count - 1.0) / count).sqrt())
}

/// Levels of a pass in dB relative to a background, by band and by sleeper spacing between two positions in m.
fn levels(
    pass: &Pass,
    background: &Background,
    [from, to]: [f64; 2],
    spacing: f64,
) -> Vec<Vec<f64>> {
    let top = HIGH_SHARE * pass.signal.sample_rate_hz();
    let band = |[low, high]: [f64; 2]| {
        let white = whitened(&pass.signal, background, [low, high.min(top)]);
        let energy = Energy::new(pass, &white);
        let stretches = ((to - from) / spacing).max(0.0).floor() as usize;
        let start = |stretch: usize| from + stretch as f64 * spacing;
        // The fading ends stay out.
        (1..stretches.saturating_sub(1))
            .map(|stretch| 10.0 * energy.mean(start(stretch), start(stretch + 1)).log10())
            .collect()
    };
    BANDS_HZ.into_iter().filter(|[low, _]| *low < 0.5 * top).map(band).collect()
}
