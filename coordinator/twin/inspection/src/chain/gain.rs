//! Gain errors: passes at one speed that differ by a constant factor.

use crate::along::{Background, Energy, bonferroni, by_speed, ln_student_tail, median, whitened};
use tracktwin_signal::recording::{Pass, Recording};

/// Bands in Hz whose powers are compared; a gain error is the same in all bands.
const BANDS_HZ: [[f64; 2]; 3] = [[100.0, 400.0], [400.0, 1200.0], [1200.0, 4000.0]];
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// Usual difference of two passes in dB.
const USUAL_DB: f64 = 0.2;
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
    /// Gain in dB and its standard deviation: the level relative to the median of the other passes at this
    /// nominal speed, corrected for the difference of the true speeds.
    pub gain_db: (f64, f64),
    /// Largest difference between bands in dB.
    pub spread_db: f64,
    /// Largest difference of a band from all bands in its standard deviations.
    pub spread_deviations: f64,
    /// Natural logarithm of the probability of such a difference among all passes without a gain error.
    pub ln_p: f64,
}

impl Gain {
    /// Whether this is a gain error: the same in every band, and improbable (`alpha`) otherwise.
    pub fn is_error(&self, alpha: f64) -> bool {
        let is_narrow = self.spread_db < UNIFORM_DB.max(0.2 * self.gain_db.0.abs());
        let is_uniform = is_narrow || self.spread_deviations < BAND_DEVIATIONS;
        is_uniform && self.ln_p <= alpha.ln()
    }
}

/// Gains of all passes with at least one other pass at their speed.
pub fn gains(recording: &Recording) -> Vec<Gain> {
    let groups = by_speed(&recording.passes);
    let tries = recording.passes.len();
    let mut gains: Vec<Gain> = groups.iter().flat_map(|group| of_speed(recording, group)).collect();
    for gain in &mut gains {
        gain.ln_p = bonferroni(gain.ln_p, tries);
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
        let largest = errors.iter().map(|gain| gain.gain_db.0.abs()).fold(0.0, f64::max);
        let passes: Vec<usize> = match (errors.is_empty(), group.len()) {
            (true, _) => Vec::new(),
            (false, 2) => group,
            (false, _) => {
                let is_far = |gain: &&&Gain| gain.gain_db.0.abs() > 0.5 * largest;
                errors.iter().filter(is_far).map(|gain| gain.pass).collect()
            }
        };
        passes
    };
    by_speed(&recording.passes).into_iter().flat_map(of_group).collect()
}

fn of_speed(recording: &Recording, group: &[usize]) -> Vec<Gain> {
    let passes: Vec<&Pass> = group.iter().map(|&index| &recording.passes[index]).collect();
    let Some(background) = Background::of(&passes[0].signal) else { return Vec::new() };
    if group.len() < 2 {
        return Vec::new();
    }
    // Levels in dB by pass, band and stretch.
    let level = |pass: &&Pass| levels(recording, pass, &background);
    let levels: Vec<Vec<Vec<f64>>> = passes.iter().map(level).collect();
    let gain = |this: usize| {
        let others = (0..passes.len()).filter(|&pass| pass != this);
        let other = median(others.map(|pass| mean_speed(passes[pass])).collect());
        let faster_db = 10.0 * (mean_speed(passes[this]) / other).log10();
        let bands: Vec<Vec<f64>> = (0..levels[this].len())
            .map(|band| differences(&levels, this, band))
            .map(|band| band.iter().map(|level| level - SPEED_POWER * faster_db).collect())
            .collect();
        gain(group, this, &bands, USUAL_DB + SPEED_POWER_UNSURE * faster_db.abs())
    };
    (0..group.len()).filter_map(gain).collect()
}

/// Level of a pass relative to the median of the others, one value per stretch, in dB.
fn differences(levels: &[Vec<Vec<f64>>], this: usize, band: usize) -> Vec<f64> {
    let stretches = levels.iter().map(|pass| pass[band].len()).min().unwrap_or(0);
    let over = |stretch: usize| {
        let others = (0..levels.len()).filter(|&pass| pass != this);
        levels[this][band][stretch] - median(others.map(|p| levels[p][band][stretch]).collect())
    };
    (0..stretches).map(over).filter(|level| level.is_finite()).collect()
}

fn gain(group: &[usize], this: usize, bands: &[Vec<f64>], usual_db: f64) -> Option<Gain> {
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
    let gain_db = (mean, deviation);
    let (pass, passes) = (group[this], group.len());
    let spread_db = ends[1] - ends[0];
    Some(Gain { pass, passes, gain_db, spread_db, spread_deviations, ln_p })
}

/// Mean speed of a pass in m/s, from its positions.
fn mean_speed(pass: &Pass) -> f64 {
    let last = pass.position_m.len() - 1;
    let way_m = pass.position_m[last] - pass.position_m[0];
    way_m * pass.signal.sample_rate_hz() / last as f64
}

/// Mean and its standard error.
fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (square / (count - 1.0) / count).sqrt())
}

/// Levels in dB relative to one background, by band and by sleeper spacing along the track.
fn levels(recording: &Recording, pass: &Pass, background: &Background) -> Vec<Vec<f64>> {
    let top = HIGH_SHARE * pass.signal.sample_rate_hz();
    let spacing = recording.spacing_m;
    let band = |[low, high]: [f64; 2]| {
        let white = whitened(&pass.signal, background, [low, high.min(top)]);
        let energy = Energy::new(pass, &white);
        let [from, to] = energy.ends();
        let stretches = ((to - from) / spacing).floor() as usize;
        let start = |stretch: usize| from + stretch as f64 * spacing;
        // The fading ends stay out.
        (1..stretches.saturating_sub(1))
            .map(|stretch| 10.0 * energy.mean(start(stretch), start(stretch + 1)).log10())
            .collect()
    };
    BANDS_HZ.into_iter().filter(|[low, _]| *low < 0.5 * top).map(band).collect()
}
