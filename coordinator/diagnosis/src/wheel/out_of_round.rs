//! Orders of an out-of-round wheel: lines at whole numbers of waves to a turn, at every speed.

use crate::along::{
    Ruler, Spectrum, amplitude, by_speed, combined, of_best, on_even_places, speed_m_s,
};
use rustfft::num_complex::Complex64;
use std::f64::consts::TAU;
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_track::model::Roughness;

/// How far wear and an odometer's scale may take the circumference from its nominal value.
const TOLERANCE: f64 = 0.01;
/// Highest order: 10 mm of a wheel of 0.4 m.
const ORDER_MAX: usize = 40;
/// Turns that a pass must have for orders to lie apart from what is between them.
const TURNS_MIN: f64 = 5.0;
/// Lowest frequency in Hz of an order that is heard at every speed.
const LOW_HZ: f64 = 15.0;
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// Probability of one speed's line without it above which it doesn't repeat at that speed.
const EACH_SPEED: f64 = 0.05;
/// Resolution cells around an order, or a harmonic of the sleepers' passing, that belong to it.
const CELLS: f64 = 2.0;
/// Level of eq. B.6 that amplitudes are stated for, and the relative deviation of its root.
const LEVEL: f64 = 3.0;
const ROOT_LEVEL_DEVIATION: f64 = 0.23;

/// One order of an out-of-round wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Waves to a turn.
    pub number: usize,
    /// Amplitude in m and its standard deviation, at irregularity level 3; goes with its root.
    pub amplitude_m: (f64, f64),
    /// Probability of such a line at any order of a round wheel, in logarithm.
    pub ln_p: f64,
    /// Power over what lies between the orders, mean of all speeds.
    pub ratio: f64,
}

/// The orders that are less likely than `alpha` on a round wheel, lowest first.
pub fn out_of_round(recording: &Recording, circumference_m: f64, alpha: f64) -> Vec<Order> {
    let passes = &recording.passes;
    let from = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
    let ends = passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
    let to = ends.fold(f64::MAX, f64::min);
    if to - from < TURNS_MIN * circumference_m {
        return Vec::new();
    }
    let search = Search { recording, circumference_m, stretch_m: [from, to] };
    let mut tries = 0;
    let mut found: Vec<Order> = Vec::new();
    for ruler in Ruler::BOTH {
        let speeds = search.spectra(ruler);
        for number in 1..=ORDER_MAX {
            let (order, bins) = search.order(&speeds, number);
            tries += bins;
            match found.iter_mut().find(|other| other.number == number) {
                Some(other) if order.ln_p < other.ln_p => *other = order,
                Some(_) => {}
                None => found.push(order),
            }
        }
    }
    for order in &mut found {
        order.ln_p = of_best(order.ln_p, tries);
    }
    found.retain(|order| order.ln_p <= alpha.ln());
    found
}

struct Search<'a> {
    recording: &'a Recording,
    circumference_m: f64,
    stretch_m: [f64; 2],
}

impl Search<'_> {
    fn length(&self) -> f64 {
        self.stretch_m[1] - self.stretch_m[0]
    }

    /// Spectra along the track of all passes, by speed.
    fn spectra(&self, ruler: Ruler) -> Vec<Vec<Spectrum>> {
        let passes = &self.recording.passes;
        // Four points on the shortest wave.
        let waves = self.length() / self.circumference_m * ORDER_MAX as f64;
        let points = (8.0 * waves).ceil() as usize;
        let spectrum = |index: usize| {
            let smooth = smoothed(&passes[index], self.length() / points as f64);
            let values = on_even_places(&passes[index], &smooth, self.stretch_m, points, ruler);
            Spectrum::new(&values, self.length() / points as f64)
        };
        let speed = |group: Vec<usize>| group.into_iter().map(spectrum).collect();
        by_speed(passes).into_iter().map(speed).collect()
    }

    /// Lies at a whole number of waves to `period_m`.
    fn is_multiple(&self, wave_number: f64, period_m: f64) -> bool {
        let order = wave_number * period_m;
        let reach = CELLS * period_m / self.length() + TOLERANCE * order;
        (order - order.round()).abs() < reach.min(0.35) && order.round() >= 1.0
    }

    /// The order's least likely line, and how many bins were looked at.
    fn order(&self, speeds: &[Vec<Spectrum>], number: usize) -> (Order, usize) {
        let middle = number as f64 / self.circumference_m;
        let nothing = Order { number, amplitude_m: (0.0, 0.0), ln_p: 0.0, ratio: 1.0 };
        let spacing = self.recording.spacing_m;
        let off_sleepers = (middle * spacing - (middle * spacing).round()).abs() / spacing;
        let sleepers = middle * spacing > 0.5 && off_sleepers < CELLS / self.length();
        if sleepers || !self.audible(middle) {
            return (nothing, 0);
        }
        let skip = |wave_number: f64| {
            self.is_multiple(wave_number, self.circumference_m)
                || self.is_multiple(wave_number, spacing)
        };
        let bins = speeds[0][0].bin(middle * (1.0 - TOLERANCE))
            ..=speeds[0][0].bin(middle * (1.0 + TOLERANCE));
        let tries = bins.clone().count();
        let mut best = nothing;
        for bin in bins {
            let ratios: Vec<f64> = speeds.iter().filter_map(|s| mean_ratio(s, bin, skip)).collect();
            let each: Vec<f64> = ratios.iter().map(|&ratio| Spectrum::ln_tail(ratio)).collect();
            let all = ratios.len() == speeds.len();
            if !all || each.iter().any(|&ln_p| ln_p > EACH_SPEED.ln()) {
                continue;
            }
            let ln_p = combined(&each);
            if ln_p < best.ln_p {
                let ratio = ratios.iter().sum::<f64>() / ratios.len() as f64;
                let density = TAU * Roughness::new(LEVEL).density(TAU * middle);
                let amplitude = amplitude(ratio, density, self.length());
                let deviation = ROOT_LEVEL_DEVIATION.hypot(0.25) * amplitude;
                best = Order { number, amplitude_m: (amplitude, deviation), ln_p, ratio };
            }
        }
        (best, tries)
    }

    fn audible(&self, wave_number: f64) -> bool {
        self.recording.passes.iter().all(|pass| {
            let frequency = wave_number * speed_m_s(pass);
            (LOW_HZ..HIGH_SHARE * pass.signal.sample_rate_hz()).contains(&frequency)
        })
    }
}

/// Mean over passes of one speed; none where one has no neighbours left.
fn mean_ratio(passes: &[Spectrum], bin: usize, skip: impl Fn(f64) -> bool) -> Option<f64> {
    let each: Option<Vec<f64>> =
        passes.iter().map(|spectrum| spectrum.ratio(bin, &skip)).collect();
    each.map(|each| each.iter().sum::<f64>() / each.len() as f64)
}

/// The acceleration without its mean, averaged over `step_m` of the way: short waves would fold
/// onto long ones.
fn smoothed(pass: &Pass, step_m: f64) -> Vec<Complex64> {
    let samples = pass.signal.samples();
    let width = ((step_m / speed_m_s(pass) * pass.signal.sample_rate_hz()) as usize).max(1);
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    // Twice, for side lobes of the square of those of a single average.
    let mut values: Vec<f64> = samples.iter().map(|value| value - mean).collect();
    for _ in 0..2 {
        values = average(&values, width);
    }
    values.into_iter().map(Complex64::from).collect()
}

/// Running mean of `width` values around each.
fn average(values: &[f64], width: usize) -> Vec<f64> {
    let mut summed = vec![0.0; values.len() + 1];
    for (index, value) in values.iter().enumerate() {
        summed[index + 1] = summed[index] + value;
    }
    let around = |index: usize| {
        let (from, to) = (index.saturating_sub(width / 2), (index + width.div_ceil(2)).min(values.len()));
        (summed[to] - summed[from]) / (to - from) as f64
    };
    (0..values.len()).map(around).collect()
}
