//! Offset between the odometers of two passes, from their common surface.

use crate::along::{
    Background, Ruler, bonferroni, by_speed, ln_normal_bound, median, on_even_places, whitened,
};
use num_complex::Complex64;
use std::f64::consts::LN_2;
use tracktwin_signal::recording::{Pass, Recording};

/// Lowest compared frequency times the sleeper spacing, in m/s: 500 Hz on V-Track. Above it the surface
/// dominates the signal. The frequencies of a track scale with the inverse of its lengths.
const LOW_M_S: f64 = 62.5;
/// Shortest compared wave, as a share of the sleeper spacing: 1.2 mm on V-Track.
const SHORTEST: f64 = 9.6e-3;
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// Number of points on the shortest wave.
const POINTS: f64 = 4.0;
/// Largest tested offset in either direction, in sleeper spacings.
const REACH_SPACINGS: f64 = 0.5;
/// A stretch is matched if the log probability of its correlation by chance is below this.
const MATCHED: f64 = -9.0;
/// Usual difference of two odometers, as a share of the sleeper spacing: each deviates by 3 mm on V-Track.
const USUAL: f64 = 0.048;
/// Standard deviation of that limit, as a share of the spacing: an offset is an error only well beyond the
/// limit.
const USUAL_DEVIATION: f64 = 8e-3;

/// Difference between the odometers of two passes at one position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Position in m.
    pub x_m: f64,
    /// Shift in m of the same point of the rail in the second pass.
    pub offset_m: f64,
    /// Correlation of the two passes, 0 to 1.
    pub correlation: f64,
}

/// Offsets between two passes at one speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Offsets {
    /// Indices of the passes.
    pub passes: [usize; 2],
    /// Offsets of the matched stretches.
    pub matched: Vec<Offset>,
    /// Number of compared stretches.
    pub stretches: usize,
    /// Median correlation over all stretches.
    pub correlation: f64,
    /// Lowest compared frequency in Hz.
    pub low_hz: f64,
    /// Sleeper spacing in m.
    spacing_m: f64,
}

impl Offsets {
    /// Usual difference of two odometers in m.
    pub fn usual_m(&self) -> f64 {
        USUAL * self.spacing_m
    }

    /// Straight line through the offsets: value in the middle in m, and slope in m/m.
    pub fn line(&self) -> (f64, f64) {
        let count = self.matched.len().max(1) as f64;
        let mean = |of: &dyn Fn(&Offset) -> f64| self.matched.iter().map(of).sum::<f64>() / count;
        let (x, offset) = (mean(&|o| o.x_m), mean(&|o| o.offset_m));
        let cross = mean(&|o| (o.x_m - x) * (o.offset_m - offset));
        let square = mean(&|o| (o.x_m - x).powi(2));
        (offset, if square > 0.0 { cross / square } else { 0.0 })
    }

    /// Absolute offset in m that a tenth of the matched stretches exceed.
    pub fn greatest_m(&self) -> f64 {
        let mut sizes: Vec<f64> = self.matched.iter().map(|o| o.offset_m.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len().saturating_sub(1 + sizes.len() / 10)).copied().unwrap_or(0.0)
    }

    /// Natural logarithm of the probability of such offsets between usual odometers: the normal tail beyond
    /// the usual limit.
    pub fn ln_p(&self) -> f64 {
        ln_normal_bound((self.greatest_m() - self.usual_m()) / (USUAL_DEVIATION * self.spacing_m))
    }
}

/// Offsets of every pass relative to the first pass at its speed.
pub fn offsets(recording: &Recording) -> Vec<Offsets> {
    let groups = by_speed(&recording.passes);
    let pairs = groups.iter().flat_map(|group| group[1..].iter().map(|&other| [group[0], other]));
    pairs.filter_map(|pair| compare(recording, pair)).collect()
}

/// Passes whose positions differ from those of the others at their speed: the pass that differs from all
/// others, or both of two, because nothing tells which one is wrong. `is_error` tells whether the odometers of
/// a pair differ too much.
pub(crate) fn misplaced(offsets: &[Offsets], is_error: impl Fn(&Offsets) -> bool) -> Vec<usize> {
    let at_speed = offsets.chunk_by(|one, other| one.passes[0] == other.passes[0]);
    at_speed
        .flat_map(|pairs| {
            let wrong: Vec<&Offsets> = pairs.iter().filter(|pair| is_error(pair)).collect();
            match (wrong.as_slice(), pairs.len()) {
                ([only], 1) => only.passes.to_vec(),
                (all, count) if all.len() == count => vec![all[0].passes[0]],
                (some, _) => some.iter().map(|pair| pair.passes[1]).collect(),
            }
        })
        .collect()
}

fn compare(recording: &Recording, passes: [usize; 2]) -> Option<Offsets> {
    let [first, second] = passes.map(|index| &recording.passes[index]);
    let from = first.position_m[0].max(second.position_m[0]);
    let last = |pass: &Pass| pass.position_m[pass.position_m.len() - 1];
    let to = last(first).min(last(second));
    let shortest_m = SHORTEST * recording.spacing_m;
    let high = (first.mean_speed_m_s() / shortest_m).min(HIGH_SHARE * recording.sample_rate_hz);
    let low = (LOW_M_S / recording.spacing_m).min(0.25 * high);
    let step = first.mean_speed_m_s() / high / POINTS;
    let points = ((to - from) / step) as usize;
    let values = |pass: &Pass| -> Option<Vec<Complex64>> {
        let white = whitened(&pass.signal, &Background::of(&pass.signal)?, [low, high]);
        let ends = [from, from + points as f64 * step];
        Some(on_even_places(pass, &white, ends, points, Ruler::Odometer))
    };
    let (a, b) = (values(first)?, values(second)?);
    let length = (recording.spacing_m / step) as usize;
    let reach = (REACH_SPACINGS * recording.spacing_m / step) as usize;
    if length == 0 || reach == 0 {
        // The sample rate resolves no stretch.
        return None;
    }
    // Independent values of a stretch: bandwidth times duration.
    let freedom = (high - low) * length as f64 * step / first.mean_speed_m_s();
    let mut all = Offsets {
        passes,
        matched: Vec::new(),
        stretches: 0,
        correlation: 0.0,
        low_hz: low,
        spacing_m: recording.spacing_m,
    };
    let mut correlations = Vec::new();
    let mut start = reach;
    while start + length + reach <= points.min(a.len()).min(b.len()) {
        let Match { lag, correlation, elsewhere } =
            best_lag(&a[start..start + length], &b, start, reach);
        // Squares of correlations by chance are exponential, with the mean of one over the freedom:
        // a stretch whose sound is of few frequencies has less than its bandwidth promises.
        let freedom = freedom.min(LN_2 / elsewhere.powi(2));
        let ln_p = bonferroni(-freedom * correlation.powi(2), 2 * reach);
        all.stretches += 1;
        correlations.push(correlation);
        if ln_p < MATCHED {
            let x_m = from + (start + length / 2) as f64 * step;
            all.matched.push(Offset { x_m, offset_m: lag * step, correlation });
        }
        start += length;
    }
    all.correlation = median(correlations);
    Some(all)
}

/// Best correlation of a stretch with the other pass.
struct Match {
    /// Lag in points, interpolated with a parabola through the peak.
    lag: f64,
    /// Correlation at this lag.
    correlation: f64,
    /// Median correlation over all lags.
    elsewhere: f64,
}

/// The lag at which a stretch of one pass, from point `start`, correlates best with the other pass; lags go
/// up to `reach` points in either direction.
fn best_lag(part: &[Complex64], other: &[Complex64], start: usize, reach: usize) -> Match {
    let norm = |values: &[Complex64]| values.iter().map(Complex64::norm_sqr).sum::<f64>().sqrt();
    let own = norm(part);
    let correlation = |lag: usize| {
        let shifted = &other[start + lag - reach..][..part.len()];
        let cross: Complex64 = part.iter().zip(shifted).map(|(x, y)| x.conj() * y).sum();
        cross.norm() / (own * norm(shifted)).max(f64::MIN_POSITIVE)
    };
    let values: Vec<f64> = (0..=2 * reach).map(correlation).collect();
    let best = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(reach);
    let mut lag = best as f64;
    if best > 0 && best + 1 < values.len() {
        let [left, peak, right] = [values[best - 1], values[best], values[best + 1]];
        let curvature = left - 2.0 * peak + right;
        if curvature < 0.0 {
            lag += 0.5 * (left - right) / curvature;
        }
    }
    Match { lag: lag - reach as f64, correlation: values[best], elsewhere: median(values) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_signal::Signal;

    #[test]
    fn passes_whose_sample_rate_resolves_no_stretch_are_not_compared() {
        let pass = |seed: u32| {
            let samples = (0..400).map(|i| f64::from((i * i + seed * i) % 101) - 50.0);
            Pass {
                file: seed.to_string(),
                speed_km_h: 200.0,
                axle: None,
                signal: Signal::new(50.0, samples.collect()).unwrap(),
                position_m: (0..400).map(|i| f64::from(i) * 200.0 / 3.6 / 50.0).collect(),
                contact_loss_share: None,
            }
        };
        let recording = Recording {
            name: "slow".to_owned(),
            sample_rate_hz: 50.0,
            channel: String::new(),
            passes: vec![pass(1), pass(2)],
            sleepers: Vec::new(),
            nominal: serde_json::Map::new(),
            spacing_m: 0.6,
            doubts: Vec::new(),
        };
        assert!(compare(&recording, [0, 1]).is_none());
    }

    #[test]
    fn the_pass_that_differs_from_all_others_is_misplaced_and_of_two_both_are() {
        let pair = |first: usize, second: usize, offset_m: f64| Offsets {
            passes: [first, second],
            matched: vec![Offset { x_m: 1.0, offset_m, correlation: 0.9 }],
            stretches: 1,
            correlation: 0.9,
            low_hz: 500.0,
            spacing_m: 0.6,
        };
        let of = |pairs: &[Offsets]| misplaced(pairs, |pair| pair.greatest_m() > 0.1);
        assert_eq!(of(&[pair(0, 1, 0.01), pair(2, 3, 0.2)]), [2, 3]);
        assert_eq!(of(&[pair(0, 1, 0.2), pair(0, 2, 0.01)]), [1]);
        assert_eq!(of(&[pair(0, 1, 0.2), pair(0, 2, 0.2)]), [0]);
        assert!(of(&[pair(0, 1, 0.01)]).is_empty());
    }
}
