//! Shape of the surface at an impact, from the ratio of its spectrum to the background spectrum.
//!
//! Impact and irregularity pass through the same wheel, contact and track. The ratio of their spectra is
//! therefore the ratio of their surfaces, `q(f) = |Z(k)|^2 / (pi v S(2 pi k))` with `k = f/v`, for every
//! track.

use super::repeated::ImpactKind;
use crate::along::{Background, Surface, hann};
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use tracktwin_signal::recording::{Pass, Recording};
use tracktwin_track::model::ContactPatch;

/// Examined time in s before and after the first blow; afterwards the track rings.
const BEFORE_S: f64 = 0.01;
const AFTER_S: f64 = 0.03;
/// Lowest frequency in Hz for the shape.
const LOW_HZ: f64 = 80.0;
/// Number of bands per octave.
const BANDS_PER_OCTAVE: f64 = 6.0;
/// Standard deviation of the logarithm of a band's ratio: difference in power between the track at one
/// position and the mean track (about 1 dB).
const MODEL_DEVIATION: f64 = 0.25;
/// Relative standard deviation of a length that follows from the slope of the surface's spectrum: measured on
/// ten hollows of two other simulators.
const LENGTH_DEVIATION: f64 = 0.15;
/// Smallest number of bands for a shape.
const BANDS_MIN: usize = 6;

/// Lengths of similar defects, as shares of a form's length.
const SIMILAR: [f64; 5] = [0.85, 0.92, 1.0, 1.08, 1.18];

/// Form of the surface at an impact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A kink with long flanks, `d exp(-|x|/l)`: a dipped joint.
    Dip,
    /// A smooth hollow, `d/2 (1 + cos(2 pi x/l))`: a squat, or a worn flat.
    Hollow,
}

/// Surface wave fitted to an impact.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// The form that fits best.
    pub form: Form,
    /// Length `l` of the form in m and its standard deviation.
    pub length_m: (f64, f64),
    /// Depth in m and its standard deviation.
    pub depth_m: (f64, f64),
    /// Change of slope at the kink in rad, as the depth: `2 d/l` of a dip. More accurate than depth and
    /// length.
    pub slope_rad: f64,
    /// Advantage over the other form in nats: half the difference of the sums of squares.
    pub lead: f64,
}

/// Ratio of an impact's spectrum to the background, by band.
#[derive(Clone, Debug)]
pub(crate) struct Observed {
    /// Position of the blow in m.
    pub x_m: f64,
    /// For every band: wave number in cycles/m, `q v` in m, and the variance of the logarithm of `q`.
    bands: Vec<(f64, f64, f64)>,
    /// `q v` in m of the background alone.
    floor: f64,
}

impl Observed {
    /// The blow nearest to `x_m`, within `reach_m`; `None` if the pass ends too close to it.
    pub(crate) fn at(recording: &Recording, pass: usize, x_m: f64, reach_m: f64) -> Option<Self> {
        let pass = &recording.passes[pass];
        let background = Background::of(&pass.signal)?;
        let [_, high] = ImpactKind::Blows.band(pass, &background, recording.spacing_m)?;
        let rate = pass.signal.sample_rate_hz();
        let samples = pass.signal.samples();
        let blow = loudest(pass, samples, x_m, reach_m);
        let [before, after] = [BEFORE_S, AFTER_S].map(|time| (time * rate) as usize);
        let start = blow.checked_sub(before)?;
        let segment = samples.get(start..blow + after)?;
        let (power, window_s) = spectrum(segment, before, rate);
        let speed = pass.mean_speed_m_s();
        let step = rate / segment.len() as f64;
        let mut bands = Vec::new();
        let mut low = LOW_HZ.min(0.25 * high);
        while low < high {
            let next = low * 2f64.powf(1.0 / BANDS_PER_OCTAVE);
            let bins = (low / step).ceil() as usize..(next / step).ceil() as usize;
            if !bins.is_empty() && bins.end <= power.len() {
                let count = bins.len() as f64;
                let over = |bin: usize| power[bin] / background.at(bin as f64 * step);
                let q = bins.map(over).sum::<f64>() / count;
                let share = (window_s / q).min(1.0);
                let variance = share * (2.0 - share) / count + MODEL_DEVIATION.powi(2);
                bands.push(((low * next).sqrt() / speed, q * speed, variance));
            }
            low = next;
        }
        let x_m = pass.position_m[blow];
        Some(Self { x_m, bands, floor: window_s * speed })
    }
}

/// Index of the largest change between two samples within reach: the blow itself.
fn loudest(pass: &Pass, samples: &[f64], x_m: f64, reach_m: f64) -> usize {
    let place = |x: f64| pass.position_m.partition_point(|&position| position < x);
    let range = place(x_m - reach_m).max(1)..place(x_m + reach_m).min(samples.len());
    let magnitude = |index: usize| (samples[index] - samples[index - 1]).abs();
    let middle = place(x_m).clamp(1, samples.len() - 1);
    range.max_by(|&a, &b| magnitude(a).total_cmp(&magnitude(b))).unwrap_or(middle)
}

/// One-sided energy density of a segment, and the energy of its window in s. The window rises before the
/// blow and falls over the second half.
fn spectrum(segment: &[f64], before: usize, rate: f64) -> (Vec<f64>, f64) {
    let length = segment.len();
    let mean = segment.iter().sum::<f64>() / length as f64;
    let weight = |index: usize| {
        let (rise, fall) = (before / 2, length / 2);
        if index < rise {
            hann(index, 2 * rise)
        } else if index >= length - fall {
            hann(length - index, 2 * fall)
        } else {
            1.0
        }
    };
    let mut lines: Vec<_> = segment
        .iter()
        .enumerate()
        .map(|(index, value)| Complex64::new((value - mean) * weight(index), 0.0))
        .collect();
    tracktwin_fourier::forward(length).process(&mut lines);
    let power =
        lines[..length / 2].iter().map(|line| 2.0 * line.norm_sqr() / (rate * rate)).collect();
    (power, (0..length).map(|index| weight(index).powi(2)).sum::<f64>() / rate)
}

impl Form {
    /// Height in m of a shape of 1 m depth and the length `l` in m, at a distance in m from its middle.
    pub(super) fn height(self, distance: f64, length: f64) -> f64 {
        match self {
            Self::Dip => (-distance.abs() / length).exp(),
            Self::Hollow if distance.abs() < 0.5 * length => {
                0.5 * (1.0 + (TAU * distance / length).cos())
            }
            Self::Hollow => 0.0,
        }
    }

    /// `|Z(k)|` in m2 for a depth of 1 m and the length `l` in m, at `k` cycles/m.
    fn transform(self, length: f64, wave_number: f64) -> f64 {
        let turns = wave_number * length;
        match self {
            Self::Dip => 2.0 * length / (1.0 + (TAU * turns).powi(2)),
            Self::Hollow => {
                let rest = 1.0 - turns * turns;
                // At one turn a length sine and rest vanish together: the limit is one half.
                let value =
                    if rest.abs() < 1e-6 { 0.5 } else { (PI * turns).sin() / (PI * turns) / rest };
                (0.5 * length * value).abs()
            }
        }
    }

    /// Mean square of the transform over similar lengths: no defect has exactly this form, and the contact is
    /// not linear. Nulls are filled.
    fn square(self, length: f64, wave_number: f64) -> f64 {
        let squares = SIMILAR.map(|share| self.transform(share * length, wave_number).powi(2));
        squares.iter().sum::<f64>() / SIMILAR.len() as f64
    }

    /// Shortest and longest length in sleeper spacings: 1.5 mm to 0.1 m for a hollow on V-Track.
    const fn lengths(self) -> [f64; 2] {
        match self {
            Self::Dip => [0.04, 2.4],
            Self::Hollow => [0.012, 0.8],
        }
    }
}

/// Fit of a form with fixed length: sum of squares, length and depth in m.
#[derive(Clone)]
pub(super) struct Fitted {
    pub squares: f64,
    pub length: f64,
    pub depth: f64,
}

/// Fits form and size to all observed blows together; `None` if there are too few bands.
pub(crate) fn fit(recording: &Recording, observed: &[Observed]) -> Option<Shape> {
    if observed.iter().map(|seen| seen.bands.len()).sum::<usize>() < BANDS_MIN {
        return None;
    }
    let surface = Surface::of(recording);
    let design = recording.stated_track().track.design;
    let patch = design.contact_patch_filter.then(|| ContactPatch::new(&design));
    let grid = |form: Form| {
        let lengths = form.lengths().map(|share| share * recording.spacing_m);
        let felt = grid(form, lengths, observed, &|k| 1.0 / surface.density_m3(k));
        // Where the patch averages the surface, not every simulation averages the defect.
        let point = patch.map_or_else(Vec::new, |patch| {
            let gain = |k| 1.0 / patch.gain(TAU * k) / surface.density_m3(k);
            grid(form, lengths, observed, &gain)
        });
        [felt, point].concat()
    };
    let [dips, hollows] = [Form::Dip, Form::Hollow].map(grid);
    Some(most_likely(dips, hollows, surface.height_deviation))
}

/// The more likely of two forms, from fits of all their lengths.
pub(super) fn most_likely(dips: Vec<Fitted>, hollows: Vec<Fitted>, height_deviation: f64) -> Shape {
    let (form, best, other) = if best_of(&dips).squares < best_of(&hollows).squares {
        (Form::Dip, dips, hollows)
    } else {
        (Form::Hollow, hollows, dips)
    };
    let chosen = best_of(&best);
    let (length, length_deviation) = spread(&best, chosen.squares, |fitted| fitted.length);
    let (depth, depth_deviation) = spread(&best, chosen.squares, |fitted| fitted.depth);
    let length_deviation = length_deviation.hypot(LENGTH_DEVIATION * length);
    let depth_deviation = depth_deviation.hypot(height_deviation * depth);
    Shape {
        form,
        length_m: (length, length_deviation),
        depth_m: (depth, depth_deviation),
        slope_rad: 2.0 * chosen.depth / chosen.length,
        lead: 0.5 * (best_of(&other).squares - chosen.squares),
    }
}

fn best_of(grid: &[Fitted]) -> &Fitted {
    let best = grid.iter().min_by(|a, b| a.squares.total_cmp(&b.squares));
    best.expect("a grid of lengths is not empty")
}

/// Mean and standard deviation of a quantity, weighted by the likelihood on the grid.
fn spread(grid: &[Fitted], least: f64, quantity: impl Fn(&Fitted) -> f64) -> (f64, f64) {
    let weight = |fitted: &Fitted| (-0.5 * (fitted.squares - least)).exp();
    let sum: f64 = grid.iter().map(weight).sum();
    let mean = grid.iter().map(|fitted| weight(fitted) * quantity(fitted)).sum::<f64>() / sum;
    let square = |fitted: &Fitted| weight(fitted) * (quantity(fitted) - mean).powi(2);
    // The step of the grid is the resolution.
    let variance = grid.iter().map(square).sum::<f64>() / sum;
    (mean, variance.sqrt().max(0.02 * mean))
}

/// Fits of all lengths of the form, each with its best depth. `gain` is the power that the contact lets pass
/// at a wave number in cycles/m, over the spectral density of the surface in m3.
fn grid(
    form: Form,
    [shortest, longest]: [f64; 2],
    observed: &[Observed],
    gain: &dyn Fn(f64) -> f64,
) -> Vec<Fitted> {
    const LENGTHS: usize = 120;
    let length_of =
        |step: usize| shortest * (longest / shortest).powf(step as f64 / (LENGTHS - 1) as f64);
    let fitted = |length: f64| {
        let expected: Vec<(f64, f64, f64, f64)> = observed
            .iter()
            .flat_map(|seen| {
                seen.bands.iter().map(|&(k, q, variance)| {
                    let unit = 2.0 * form.square(length, k) * gain(k);
                    (q.ln(), unit, seen.floor, variance)
                })
            })
            .collect();
        best_depth(length, &expected)
    };
    (0..LENGTHS).map(|step| fitted(length_of(step))).collect()
}

/// The depth with the least sum of squares of logarithms.
fn best_depth(length: f64, expected: &[(f64, f64, f64, f64)]) -> Fitted {
    let squares = |depth: f64| -> f64 {
        let square = |&(ln_q, unit, floor, variance): &(f64, f64, f64, f64)| {
            // A null of the form is filled by what lies beside it in the band.
            let model = depth * depth * unit + floor;
            // Beyond three deviations a band counts as an outlier, not with its square.
            ((ln_q - model.ln()).powi(2) / variance).min(9.0)
        };
        expected.iter().map(square).sum()
    };
    // From a tenth of a micrometre to two millimetres, in steps of 5 %.
    let depths = (0..200).map(|step| 1e-7 * 1.05f64.powi(step));
    let best = depths.map(|depth| (squares(depth), depth)).min_by(|a, b| a.0.total_cmp(&b.0));
    let (squares, depth) = best.expect("a range of depths is not empty");
    Fitted { squares, length, depth }
}
