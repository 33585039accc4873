//! Position of the sleepers by the pattern that they give the levels within a span.
//!
//! Near the pinned-pinned resonance the levels above a sleeper and between two sleepers differ by some decibels. The
//! phase of this pattern tells where the sleepers lie. An error of the odometer that is the same in all passes is
//! visible in nothing else.

use crate::bands::Bands;
use crate::baseline::Unknowns;
use crate::forward::Forward;
use crate::prepared_recording::PreparedRecording;
use crate::section::{ELEMENTS, blur_m};
use crate::spectra::log_powers;
use nalgebra::DVector;
use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;
use tracktwin_signal::recording::{Pass, Recording, SleeperWindow};

/// Smallest number of spans that tell a pattern from the scatter of the surface.
const SPANS_MIN: usize = 8;

/// Largest amplitude of the pattern of one span in nats: 6 dB. A defect of the rail is no pattern.
const AMPLITUDE_MAX: f64 = 1.4;

/// Smallest contrast of a pattern. By chance one recording in 3000 has it: the square of the amplitude is exponentially
/// distributed.
const CONTRAST_MIN: f64 = 4.0;

/// Distance of the sleepers from their stated positions that is an error, as a share of the spacing, and in standard
/// deviations.
const OFFSET_MIN: f64 = 0.1;
const DEVIATIONS_MIN: f64 = 3.0;

/// Distance of the first and the last sleeper from their stated positions, as a share of the spacing, from which the stated
/// distances are wrong. Bolts under a part of the sleepers turn the phase along the track by 0.12.
const ENDS_MIN: f64 = 0.18;

/// Smallest ratio of the contrasts with and without an error of the stated distances. A phase that turns by 0.36 along the
/// track halves the contrast of a clear pattern.
const CONTRAST_RATIO_MIN: f64 = 1.5;

/// Largest error of the stated distances that is searched, as a share of them.
const SCALE_MAX: f64 = 0.03;

/// Number of tried scales times spans in which the phase of the pattern turns once.
const SCALES_A_TURN: f64 = 50.0;

/// Position of the sleepers relative to the stated positions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SleeperPattern {
    /// Distance in m by which the sleepers lie further along the track than stated, at most half a spacing; in the middle
    /// of the compared sleepers.
    pub shift_m: f64,
    /// Distances of the sleepers divided by the stated ones; 1 if no error is distinguishable.
    pub distance_ratio: f64,
    /// Standard deviation of this ratio.
    pub ratio_deviation: f64,
    /// Distance in m from the middle to the first and the last span.
    pub half_length_m: f64,
    /// Standard deviation of the distance in m.
    pub deviation_m: f64,
    /// Amplitude of the pattern divided by its standard deviation.
    pub contrast: f64,
    /// Sleeper spacing in m.
    pub spacing_m: f64,
}

impl SleeperPattern {
    /// The pattern of a recording under tracks with fitted values. `None` if it is not visible.
    pub fn of(
        recording: &Recording,
        sections: &[(&PreparedRecording, &Unknowns, &DVector<f64>)],
    ) -> Option<Self> {
        let (first, ..) = sections.first()?;
        let measured = Measured::of(recording, first);
        let mut spans = vec![None; recording.sleepers.len()];
        for (prepared, unknowns, values) in sections {
            let mut forward = prepared.forward.clone();
            forward.unknowns = (*unknowns).clone();
            let expected = forward.span_pattern(values)?;
            let sleepers = prepared.sleepers();
            for (span, found) in
                (sleepers.start..sleepers.end - 1).zip(&mut spans[sleepers.start..])
            {
                *found = measured.along(span, &expected);
            }
        }
        let spans = spans.into_iter().enumerate();
        let spans: Vec<_> = spans.filter_map(|(span, it)| Some((span as f64, it?))).collect();
        (spans.len() >= SPANS_MIN)
            .then(|| Self::from_spans(&spans, recording.spacing_m))
            .filter(|pattern| pattern.contrast > CONTRAST_MIN)
    }

    /// Sentence on sleepers that do not lie where the recording states them.
    pub fn doubt(&self) -> Option<String> {
        if self.distance_ratio != 1.0 {
            return Some(self.wrong_scale());
        }
        let Self { shift_m, deviation_m, spacing_m, .. } = *self;
        let least_m = (OFFSET_MIN * spacing_m).max(DEVIATIONS_MIN * deviation_m);
        (shift_m.abs() > least_m).then(|| {
            let [side, remedy] = if shift_m < 0.0 {
                ["before", "subtract it from"]
            } else {
                ["after", "add it to"]
            };
            format!(
                "By the levels within a span, the sleepers lie {:.3} m (± {deviation_m:.3} m) {side} their stated \
                 positions in all passes, and the estimates belong to places between sleepers. Check the positions and \
                 the description of rail and sleepers; if the odometer has this offset, {remedy} `x_m` of every \
                 sleeper in recording.json.",
                shift_m.abs()
            )
        })
    }

    fn wrong_scale(&self) -> String {
        let Self { shift_m, distance_ratio, ratio_deviation, half_length_m, .. } = *self;
        let [first_m, last_m] =
            [-half_length_m, half_length_m].map(|x_m| shift_m + (distance_ratio - 1.0) * x_m);
        format!(
            "By the levels within a span, the distances of the sleepers are {distance_ratio:.4} (± {ratio_deviation:.4}) \
             times the stated ones in all passes: the sleepers lie {first_m:+.2} m from their stated positions at one end, and {last_m:+.2} m at \
             the other, and the estimates belong to places between sleepers. Correct the wheel circumference of the \
             odometer, or the stated positions."
        )
    }

    /// The pattern of spans by their number. Its phase turns along the track if the stated distances are wrong.
    fn from_spans(spans: &[(f64, Complex64)], spacing_m: f64) -> Self {
        let (first, last) = (spans[0].0, spans[spans.len() - 1].0);
        let middle = 0.5 * (first + last);
        let turned = |scale: f64| -> Vec<Complex64> {
            let turn =
                |(span, it): &(f64, Complex64)| it * Complex64::cis(TAU * scale * (span - middle));
            spans.iter().map(turn).collect()
        };
        let length = last - first + 1.0;
        let steps = (SCALE_MAX * length * SCALES_A_TURN).floor() as i32;
        let scales = (-steps..=steps).map(|step| f64::from(step) / (length * SCALES_A_TURN));
        let sum = |scale: &f64| turned(*scale).iter().sum::<Complex64>().norm();
        let scale = scales.max_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap_or(0.0);
        let of = |scale: f64| Self::in_phase(&turned(scale), spacing_m);
        let found = of(scale);
        // A straight line through phases of equal scatter.
        let deviation = |it: &Self| it.deviation_m / spacing_m * 12f64.sqrt() / length;
        let without = of(0.0);
        let is_known = scale.abs()
            > (2.0 * ENDS_MIN / length).max(DEVIATIONS_MIN * deviation(&found))
            && found.contrast > CONTRAST_RATIO_MIN * without.contrast;
        let (kept, scale) = if is_known { (found, scale) } else { (without, 0.0) };
        Self {
            distance_ratio: 1.0 + scale,
            ratio_deviation: deviation(&kept),
            half_length_m: 0.5 * (length - 1.0) * spacing_m,
            ..kept
        }
    }

    /// The pattern of spans whose phases differ by chance only.
    fn in_phase(spans: &[Complex64], spacing_m: f64) -> Self {
        let count = spans.len() as f64;
        let mean = spans.iter().sum::<Complex64>() / count;
        let direction = mean / mean.norm();
        let variance = |part: fn(Complex64) -> f64| {
            let of = |span: &Complex64| part((span - mean) * direction.conj()).powi(2);
            spans.iter().map(of).sum::<f64>() / (count * (count - 1.0))
        };
        let per_radian_m = spacing_m / TAU;
        Self {
            shift_m: -mean.arg() * per_radian_m,
            distance_ratio: 1.0,
            ratio_deviation: 0.0,
            half_length_m: 0.0,
            deviation_m: variance(|it| it.im).sqrt() / mean.norm() * per_radian_m,
            contrast: mean.norm() / variance(|it| it.re).max(variance(|it| it.im)).sqrt(),
            spacing_m,
        }
    }
}

/// First harmonic of the log powers within each span, with the stated position of its sleeper as origin.
struct Measured {
    /// `[span][speed and band]`; `None` where no pass of a speed covers the span.
    harmonics: Vec<Option<Vec<Complex64>>>,
    /// Mean square of the harmonics of one span, for each speed and band.
    variance: Vec<f64>,
}

impl Measured {
    fn of(recording: &Recording, prepared: &PreparedRecording) -> Self {
        let bands = &prepared.forward.bands;
        let of_speed = |passes: &Vec<usize>| -> Vec<_> {
            let passes = passes.par_iter().filter_map(|&pass| recording.passes.get(pass));
            let all: Vec<_> = passes.map(|pass| of_pass(recording, pass, bands)).collect();
            (0..recording.sleepers.len() - 1).map(|span| mean_of(&all, span)).collect()
        };
        let speeds: Vec<Vec<_>> = prepared.pass_numbers.iter().map(of_speed).collect();
        let span = |span: usize| -> Option<Vec<Complex64>> {
            let of_speeds: Option<Vec<_>> = speeds.iter().map(|it| it[span].clone()).collect();
            Some(of_speeds?.concat())
        };
        let harmonics: Vec<_> = (0..recording.sleepers.len() - 1).map(span).collect();
        let known: Vec<_> = harmonics.iter().flatten().collect();
        let count = known.len() as f64;
        let square = |at: usize| known.iter().map(|it| it[at].norm_sqr()).sum::<f64>() / count;
        let width = prepared.forward.per_sleeper();
        Self { variance: (0..width).map(square).collect(), harmonics }
    }

    /// Sum over speeds and bands of a span's harmonics times those expected, weighted by their variance.
    fn along(&self, span: usize, expected: &[Complex64]) -> Option<Complex64> {
        let harmonics = self.harmonics[span].as_ref()?;
        let terms = harmonics.iter().zip(expected).zip(&self.variance);
        Some(terms.map(|((it, expected), variance)| it * expected.conj() / variance).sum())
    }
}

/// First harmonic of a pass's log powers, `[span][band]`.
fn of_pass(recording: &Recording, pass: &Pass, bands: &Bands) -> Vec<Option<Vec<Complex64>>> {
    let width_m = recording.spacing_m / ELEMENTS as f64;
    let windows: Vec<_> = recording
        .sleepers
        .windows(2)
        .flat_map(|pair| {
            let step_m = (pair[1].x_m - pair[0].x_m) / ELEMENTS as f64;
            (0..ELEMENTS).map(move |place| pair[0].x_m + place as f64 * step_m)
        })
        .map(|x_m| SleeperWindow::around(x_m, width_m).samples(&pass.position_m))
        .collect();
    let powers = log_powers(&pass.signal, &windows, bands);
    let span = |places: &[Option<Vec<f64>>]| {
        let places: Option<Vec<&Vec<f64>>> = places.iter().map(Option::as_ref).collect();
        let places = places?;
        let band = |band: usize| {
            let harmonic = first_harmonic(places.iter().map(|powers| powers[band]));
            harmonic * (AMPLITUDE_MAX / harmonic.norm()).min(1.0)
        };
        Some((0..bands.count()).map(band).collect())
    };
    powers.chunks(ELEMENTS).map(span).collect()
}

/// Mean over the passes that cover a span; `None` if none does.
fn mean_of(passes: &[Vec<Option<Vec<Complex64>>>], span: usize) -> Option<Vec<Complex64>> {
    let covered: Vec<_> = passes.iter().filter_map(|pass| pass[span].as_ref()).collect();
    let first = covered.first()?;
    let mean =
        |band: usize| covered.iter().map(|it| it[band]).sum::<Complex64>() / covered.len() as f64;
    Some((0..first.len()).map(mean).collect())
}

/// Amplitude and phase of one period over equidistant places of a span.
fn first_harmonic(places: impl Iterator<Item = f64>) -> Complex64 {
    let turned = |(place, value): (usize, f64)| {
        value * Complex64::cis(-TAU * place as f64 / ELEMENTS as f64)
    };
    places.enumerate().map(turned).sum::<Complex64>() * 2.0 / ELEMENTS as f64
}

impl Forward {
    /// First harmonic of the log powers within a span, in the mean over the spans: `[speed and band]`. `None` if no
    /// track model exists for the values.
    fn span_pattern(&self, values: &DVector<f64>) -> Option<Vec<Complex64>> {
        let transfer = self.transfer(values, &[], false).ok()?;
        let excitation = self.excitation(&transfer, values);
        let spacing_m = self.section.track.design.sleeper.spacing_m;
        let spans = self.section.sleepers() - 1;
        let of = |speed: usize, band: usize| {
            let power = |node: usize| {
                let lines = self.bands.weights(band).iter();
                let power = |&(line, weight): &(usize, f64)| {
                    weight * excitation[speed][line] * transfer.power[line][node]
                };
                lines.map(power).sum::<f64>()
            };
            let span = |sleeper: usize| {
                let first = self.section.seat_node(sleeper);
                first_harmonic((first..first + ELEMENTS).map(|node| power(node).ln()))
            };
            let mean = (0..spans).map(span).sum::<Complex64>() / spans as f64;
            let centre_hz = self.bands.centres_hz()[band];
            let blur = blur_m(self.speeds_m_s[speed], centre_hz) / spacing_m;
            mean * (-0.5 * (TAU * blur).powi(2)).exp()
        };
        let speeds = 0..self.speeds_m_s.len();
        Some(
            speeds
                .flat_map(|speed| (0..self.bands.count()).map(move |band| (speed, band)))
                .map(|(speed, band)| of(speed, band))
                .collect(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use tracktwin_parameters::Preset;
    use tracktwin_signal::Signal;
    use tracktwin_signal::recording::Sleeper;

    const SPACING_M: f64 = 0.125;
    const RATE_HZ: f64 = 4e4;

    /// Two passes of noise whose level repeats with the sleepers of V-Track, `shift_m` after their stated positions.
    fn recording(amplitude: f64, shift_m: f64) -> Recording {
        scaled(amplitude, shift_m, 1.0)
    }

    /// As [`recording`], with distances of the sleepers that are `ratio` times the stated ones.
    fn scaled(amplitude: f64, shift_m: f64, ratio: f64) -> Recording {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut pass = |speed_km_h: f64| {
            let step_m = speed_km_h / 3.6 / RATE_HZ;
            let position_m: Vec<f64> =
                (0..(3.6 / step_m) as usize).map(|n| n as f64 * step_m).collect();
            let mut sample = |x_m: &f64| {
                let uniform = random.next_u64() as f64 / u64::MAX as f64 - 0.5;
                uniform
                    * (0.5 * amplitude * (TAU * (x_m - shift_m) / (ratio * SPACING_M)).cos()).exp()
            };
            let samples = position_m.iter().map(&mut sample).collect();
            let signal = Signal::new(RATE_HZ, samples).unwrap();
            let (file, axle, contact_loss_share) = (String::new(), None, None);
            Pass { file, speed_km_h, axle, signal, position_m, contact_loss_share }
        };
        let passes = vec![pass(13.0), pass(7.0)];
        let sleeper = |n: u32| Sleeper { id: format!("SN{n}"), x_m: SPACING_M * f64::from(n) };
        Recording {
            name: "noise".to_owned(),
            sample_rate_hz: RATE_HZ,
            channel: String::new(),
            passes,
            sleepers: (0..28).map(sleeper).collect(),
            nominal: serde_json::Map::new(),
            spacing_m: SPACING_M,
            doubts: Vec::new(),
        }
    }

    fn pattern(recording: &Recording) -> Option<SleeperPattern> {
        let prepared = PreparedRecording::new(recording, &Preset::VTrack.track(), &[]).unwrap();
        let unknowns = prepared.forward.unknowns.clone();
        let values = unknowns.typical();
        SleeperPattern::of(recording, &[(&prepared, &unknowns, &values)])
    }

    #[test]
    fn sleepers_that_lie_elsewhere_are_found() {
        let found = pattern(&recording(0.4, 0.0)).unwrap();
        assert!(found.shift_m.abs() < 0.004 && found.doubt().is_none(), "{found:?}");
        for shift_m in [-0.05, 0.04] {
            let found = pattern(&recording(0.4, shift_m)).unwrap();
            assert!((found.shift_m - shift_m).abs() < 3.0 * found.deviation_m, "{found:?}");
            let doubt = found.doubt().unwrap();
            let remedy = if shift_m < 0.0 { "subtract it from" } else { "add it to" };
            assert!(found.deviation_m < 0.004 && doubt.contains(remedy), "{doubt}");
        }
    }

    #[test]
    fn distances_that_are_wrong_by_two_percent_are_found() {
        let found = pattern(&recording(0.4, 0.0)).unwrap();
        assert_eq!(found.distance_ratio, 1.0);
        for ratio in [0.98, 1.02] {
            let found = pattern(&scaled(0.4, 0.0, ratio)).unwrap();
            assert!((found.distance_ratio - ratio).abs() < 3e-3, "{found:?}");
            let doubt = found.doubt().unwrap();
            assert!(doubt.contains("times the stated ones in all passes"), "{doubt}");
        }
    }

    #[test]
    fn without_a_pattern_nothing_is_said() {
        assert_eq!(pattern(&recording(0.0, 0.0)), None);
    }
}
