//! Orders of an out-of-round wheel: lines at integer numbers of waves per turn.
//!
//! The rail surface is the same in all passes and cancels in the difference of two passes at one speed. The
//! orders of the wheel do not cancel if the passes begin with different angles of the wheel. If all passes
//! begin with the same angle, the orders appear in the passes themselves.

use crate::along::{
    Line, Ruler, Spectrum, Surface, amplitude, bonferroni, by_speed, combine_dependent_p_values,
    on_even_places, separate_wavelengths,
};
use num_complex::Complex64;
use std::f64::consts::FRAC_1_SQRT_2;
use tracktwin_signal::recording::{Pass, Recording};

/// Largest relative deviation of the circumference from its nominal value, from wear and odometer scale.
///
/// With a larger tolerance every short wave would be near some order.
const TOLERANCE: f64 = 0.005;
/// Highest order: waves of 10 mm for a wheel of 0.4 m. Above it the tolerance exceeds a fifth of an order.
const ORDER_MAX: usize = 40;
/// Smallest number of turns in a pass that separates the orders from the bins between them.
const TURNS_MIN: f64 = 5.0;
/// Lowest frequency in Hz of an order at every speed.
const LOW_HZ: f64 = 15.0;
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// A line is present at a speed if its probability by chance is below this.
const EACH_SPEED: f64 = 0.05;
/// Smallest number of speeds with the line in the differences: two passes may begin with the same wheel
/// angle.
const SPEEDS_APART_MIN: usize = 2;
/// Factor by which a line in a difference is more probable than in noise: of forty recordings of another
/// simulator, one had a probability of 0.002 by chance.
const UNEVEN: f64 = 10.0;
/// Smallest ratio of a line in the differences, over its neighbours, to that in the passes, for waves of the wheel.
const TURNING_MIN: f64 = 3.0;
/// Half width, in resolution cells, of an order or of a harmonic of the sleeper-passing frequency.
const CELLS: f64 = 1.5;
/// Highest harmonic of the sleeper-passing frequency that cannot be distinguished from an order. On a
/// smooth rail even the first harmonic has only a hundredth of the power of the irregularity around it.
const PASSING_MAX: f64 = 4.5;
/// Distance of the farthest neighbours of an order on either side in resolution cells: four orders for a
/// stretch of nine turns. Only bins between the orders count.
const REACH: f64 = 36.0;
/// Number of parts of the stretch in which an order must appear, and the smallest share of a steady line's
/// power in each part: a wheel is out of round along the whole stretch.
const PARTS: usize = 3;
const PART_SHARE: f64 = 0.2;
/// Largest ratio of the log probability of a line at one speed to the median of all speeds. An order is there
/// at all speeds; one that is 700 times its neighbours at one speed and 3 to 5 times at the others is something else.
const ALONE_MAX: f64 = 4.0;
/// Largest distance in orders over which a line may leak, and the smallest ratio of its power to the leaked
/// power: the side lobes of the Hann window at five cells are 50 dB down.
const LEAKS: usize = 4;
const LEAKAGE: f64 = 1e3;

/// One order of an out-of-round wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Number of waves per turn.
    pub number: usize,
    /// Amplitude in m and its standard deviation on the usual surface of the track; proportional to the
    /// square root of its irregularity level.
    pub amplitude_m: (f64, f64),
    /// Natural logarithm of the probability of such a line at any order of a round wheel.
    pub ln_p: f64,
    /// Power relative to the bins between the orders, in the passes or in their differences, as mean of all
    /// speeds.
    pub ratio: f64,
    /// Whether passes at one speed differ by this line more than by the surface beside it. Otherwise it may be
    /// corrugation of the whole rail, or no speed has two passes, or all passes begin with the same angle of the wheel.
    pub turns: bool,
    /// Power of the line at each speed.
    powers: Vec<f64>,
}

/// Signals whose spectra are searched for an order.
#[derive(Clone, Copy)]
enum SpectrumSource {
    Passes,
    /// Differences of neighbouring passes at one speed.
    Differences,
}

/// Spectra along a stretch of the track at one speed.
struct AtSpeed {
    /// Spectra of the passes.
    passes: Vec<Spectrum>,
    /// Spectra of the differences of neighbouring passes, scaled to the power of one pass; empty for a
    /// single pass.
    differences: Vec<Spectrum>,
}

impl AtSpeed {
    fn source(&self, source: SpectrumSource) -> &[Spectrum] {
        match source {
            SpectrumSource::Passes => &self.passes,
            SpectrumSource::Differences => &self.differences,
        }
    }
}

/// Detects orders of an out-of-round wheel, with a false-alarm rate of `alpha`, in ascending order.
///
/// Empty if the speeds are too similar ([`separate_wavelengths`]), because a resonance then looks like an
/// order.
pub fn out_of_round(recording: &Recording, circumference_m: f64, alpha: f64) -> Vec<Order> {
    let passes = &recording.passes;
    let from = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
    let ends = passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
    let to = ends.fold(f64::MAX, f64::min);
    if !separate_wavelengths(&recording.speeds_km_h()) || to - from < TURNS_MIN * circumference_m {
        return Vec::new();
    }
    let search = OrderSearch { recording, circumference_m, stretch_m: [from, to] };
    let mut tries = 0;
    let mut found: Vec<Order> = Vec::new();
    for ruler in Ruler::BOTH {
        let speeds = search.spectra(search.stretch_m, ruler);
        let parts = search.parts().map(|part| search.spectra(part, ruler));
        let repeated = speeds.iter().all(|speed| !speed.differences.is_empty());
        let source =
            [Some(SpectrumSource::Passes), repeated.then_some(SpectrumSource::Differences)]
                .into_iter()
                .flatten();
        for (source, number) in source.flat_map(|source| (1..=ORDER_MAX).map(move |n| (source, n)))
        {
            let (order, bins) = search.order(&speeds, source, number);
            tries += bins;
            if !parts.iter().all(|part| order.is_detected(part, source, circumference_m)) {
                continue;
            }
            match found.iter_mut().find(|other| other.number == number) {
                Some(other) => {
                    let turns = order.turns || other.turns;
                    if order.ln_p < other.ln_p {
                        *other = order;
                    }
                    other.turns = turns;
                }
                None => found.push(order),
            }
        }
    }
    for order in &mut found {
        order.ln_p = bonferroni(order.ln_p, tries);
    }
    found.retain(|order| order.ln_p <= alpha.ln());
    let all = found.clone();
    found.retain(|order| !all.iter().any(|louder| louder.leaks_into(order)));
    found
}

/// Log probabilities of a line at each speed, none of them counted more than [`ALONE_MAX`] times the median; of two
/// speeds, than the weaker one.
fn none_alone(each: &[f64]) -> Vec<f64> {
    let mut sorted = each.to_vec();
    sorted.sort_by(f64::total_cmp);
    let least = ALONE_MAX * sorted[sorted.len() / 2];
    each.iter().map(|ln_p| ln_p.max(least)).collect()
}

impl Order {
    /// Probability that waves of any length on the rail are taken for some order near this one.
    pub fn share_of_lengths(&self) -> f64 {
        (2.0 * TOLERANCE * self.number as f64).min(1.0)
    }

    /// Whether a part of the stretch has its share of the line's power, as mean of all speeds. The power of
    /// a steady line is proportional to the square of the length.
    fn is_detected(&self, part: &[AtSpeed], source: SpectrumSource, circumference_m: f64) -> bool {
        let wave_number = self.number as f64 / circumference_m;
        let share = |(speed, power): (&AtSpeed, &f64)| {
            let each = speed.source(source).iter();
            let lines = each.filter_map(|s| s.line(s.bin(wave_number), |_| false));
            let lines: Vec<Line> = lines.collect();
            Line::mean(&lines).map_or(0.0, |line| line.power() / power)
        };
        let shares: f64 = part.iter().zip(&self.powers).map(share).sum();
        !self.powers.is_empty()
            && shares / self.powers.len() as f64 >= PART_SHARE / (PARTS * PARTS) as f64
    }

    /// Whether `other` may be a side lobe of this order.
    fn leaks_into(&self, other: &Self) -> bool {
        let power = |order: &Self| order.powers.iter().sum::<f64>();
        let distance = self.number.abs_diff(other.number);
        distance > 0 && distance <= LEAKS && power(self) > LEAKAGE * power(other)
    }
}

/// Data of a search for orders.
struct OrderSearch<'a> {
    recording: &'a Recording,
    circumference_m: f64,
    stretch_m: [f64; 2],
}

impl OrderSearch<'_> {
    fn length(&self) -> f64 {
        self.stretch_m[1] - self.stretch_m[0]
    }

    /// Equal parts of the stretch.
    fn parts(&self) -> [[f64; 2]; PARTS] {
        let part = self.length() / PARTS as f64;
        let start = |index: usize| self.stretch_m[0] + index as f64 * part;
        std::array::from_fn(|index| [start(index), start(index + 1)])
    }

    /// Spectra of all passes on a stretch of track, grouped by speed.
    fn spectra(&self, stretch_m: [f64; 2], ruler: Ruler) -> Vec<AtSpeed> {
        let passes = &self.recording.passes;
        let length = stretch_m[1] - stretch_m[0];
        // Eight points on the shortest wave.
        let points = (8.0 * length / self.circumference_m * ORDER_MAX as f64).ceil() as usize;
        let step_m = length / points as f64;
        let values = |index: usize| {
            let smooth = smoothed(&passes[index], step_m);
            on_even_places(&passes[index], &smooth, stretch_m, points, ruler)
        };
        let spectrum = |values: &Vec<Complex64>| Spectrum::new(values, step_m).reaching(REACH);
        let speed = |group: Vec<usize>| {
            let values: Vec<Vec<Complex64>> = group.into_iter().map(values).collect();
            let passes: Vec<Spectrum> = values.iter().map(spectrum).collect();
            // What passes differ by has the resonances of the passes.
            let apart =
                |pair: &[Vec<Complex64>]| spectrum(&difference(&pair[0], &pair[1])).like(&passes);
            let differences: Vec<Spectrum> = values.windows(2).map(apart).collect();
            AtSpeed { passes, differences }
        };
        by_speed(passes).into_iter().map(speed).collect()
    }

    /// Whether the wave number lies within [`CELLS`] resolution cells of an integer number of waves per
    /// `period_m`.
    fn is_multiple(&self, wave_number: f64, period_m: f64) -> bool {
        let order = wave_number * period_m;
        order.round() >= 1.0 && (order - order.round()).abs() < CELLS * period_m / self.length()
    }

    /// The least probable line of the order, and the number of tested bins.
    fn order(&self, speeds: &[AtSpeed], source: SpectrumSource, number: usize) -> (Order, usize) {
        let middle = number as f64 / self.circumference_m;
        let (amplitude_m, powers) = ((0.0, 0.0), Vec::new());
        let mut best = Order { number, amplitude_m, ln_p: 0.0, ratio: 1.0, turns: false, powers };
        let spacing = self.recording.spacing_m;
        let passing = self.is_multiple(middle, spacing) && middle * spacing < PASSING_MAX;
        if passing || !self.audible(middle) {
            return (best, 0);
        }
        let first = &speeds[0].passes[0];
        let bins = first.bin(middle * (1.0 - TOLERANCE))..=first.bin(middle * (1.0 + TOLERANCE));
        let tries = bins.clone().count();
        for bin in bins {
            let Some(lines) = self.lines(speeds, source, number, bin) else { continue };
            let each: Vec<f64> = lines.iter().map(|line| line.ln_tail()).collect();
            let repeats = each.iter().filter(|&&ln_p| ln_p <= EACH_SPEED.ln()).count();
            let (least, uneven) = match source {
                SpectrumSource::Passes => (each.len(), 0.0),
                SpectrumSource::Differences => (each.len().min(SPEEDS_APART_MIN), UNEVEN.ln()),
            };
            let ln_p = combine_dependent_p_values(&none_alone(&each)) + uneven;
            if repeats < least || ln_p >= best.ln_p {
                continue;
            }
            let Some(passes) = self.lines(speeds, SpectrumSource::Passes, number, bin) else {
                continue;
            };
            best = Order {
                number,
                amplitude_m: self.amplitude_m(middle, &lines, &passes),
                ln_p,
                ratio: mean(lines.iter().map(|line| line.ratio)),
                turns: stands_out(source, &lines, &passes),
                powers: lines.iter().map(|line| line.power()).collect(),
            };
        }
        (best, tries)
    }

    /// The line in a bin at each speed; `None` if too few bins lie between the orders.
    fn lines(
        &self,
        speeds: &[AtSpeed],
        source: SpectrumSource,
        number: usize,
        bin: usize,
    ) -> Option<Vec<Line>> {
        let turn = number as f64 / (bin as f64 * speeds[0].passes[0].bin_width());
        let skip = |wave_number: f64| {
            self.is_multiple(wave_number, turn)
                || self.is_multiple(wave_number, self.recording.spacing_m)
        };
        let of_speed = |speed: &AtSpeed| {
            let each = speed.source(source).iter().map(|spectrum| spectrum.line(bin, skip));
            Line::mean(&each.collect::<Option<Vec<Line>>>()?)
        };
        speeds.iter().map(of_speed).collect()
    }

    /// Amplitude in m, and its standard deviation, of lines at a wave number in cycles/m. The power of the
    /// surface beside the lines in the passes is the reference.
    fn amplitude_m(&self, wave_number: f64, lines: &[Line], passes: &[Line]) -> (f64, f64) {
        let over_surface = lines.iter().zip(passes).map(|(line, passes)| {
            passes.ratio.max(1.0 + (line.ratio - 1.0) * line.beside / passes.beside)
        });
        let surface = Surface::of(self.recording);
        let density = surface.density_m3(wave_number);
        let amplitude = amplitude(mean(over_surface), density, self.length());
        (amplitude, surface.height_deviation.hypot(0.25) * amplitude)
    }

    fn audible(&self, wave_number: f64) -> bool {
        self.recording.passes.iter().all(|pass| {
            let frequency = wave_number * pass.mean_speed_m_s();
            (LOW_HZ..HIGH_SHARE * pass.signal.sample_rate_hz()).contains(&frequency)
        })
    }
}

/// Whether lines in differences stand out more than in the passes. Differences of passes whose positions disagree keep
/// a part of the rail's waves, and the same part of the surface beside them.
fn stands_out(source: SpectrumSource, lines: &[Line], passes: &[Line]) -> bool {
    let ratio = |lines: &[Line]| mean(lines.iter().map(|line| line.ratio));
    matches!(source, SpectrumSource::Differences) && ratio(lines) > TURNING_MIN * ratio(passes)
}

/// The acceleration minus its mean, averaged over `step_m`, so that short waves do not alias to long ones.
fn smoothed(pass: &Pass, step_m: f64) -> Vec<Complex64> {
    let samples = pass.signal.samples();
    let width = ((step_m / pass.mean_speed_m_s() * pass.signal.sample_rate_hz()) as usize).max(1);
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    // Twice, for side lobes of the square of those of a single average.
    let mut values: Vec<f64> = samples.iter().map(|value| value - mean).collect();
    for _ in 0..2 {
        values = average(&values, width);
    }
    values.into_iter().map(Complex64::from).collect()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

/// Difference of two passes, scaled to the power of one pass if they are independent.
fn difference(one: &[Complex64], other: &[Complex64]) -> Vec<Complex64> {
    one.iter().zip(other).map(|(one, other)| (one - other) * FRAC_1_SQRT_2).collect()
}

/// Running mean of `width` values around each value.
fn average(values: &[f64], width: usize) -> Vec<f64> {
    let mut summed = vec![0.0; values.len() + 1];
    for (index, value) in values.iter().enumerate() {
        summed[index + 1] = summed[index] + value;
    }
    let around = |index: usize| {
        let (from, to) =
            (index.saturating_sub(width / 2), (index + width.div_ceil(2)).min(values.len()));
        (summed[to] - summed[from]) / (to - from) as f64
    };
    (0..values.len()).map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::none_alone;

    #[test]
    fn a_line_at_one_speed_counts_four_times_as_much_as_at_the_others() {
        assert_eq!(none_alone(&[-4.0, -3.0, -63.0]), [-4.0, -3.0, -16.0]);
        assert_eq!(none_alone(&[-0.1, -20.0, -25.0]), [-0.1, -20.0, -25.0]);
        assert_eq!(none_alone(&[-30.0, -3.0]), [-12.0, -3.0]);
    }
}
