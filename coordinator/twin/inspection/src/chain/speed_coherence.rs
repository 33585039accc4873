//! Coherence between the passes at one speed and those at other speeds.

use crate::along::{Background, Ruler, by_speed, hann, on_even_places, whitened};
use num_complex::Complex64;
use tracktwin_signal::recording::{Pass, Recording};

/// Compared waves, in waves per sleeper spacing: longer than the error of the odometer, and with high power
/// at every speed.
const WAVES: [usize; 2] = [1, 10];
/// Number of points on the shortest wave.
const POINTS: usize = 4;
/// Length of a segment in sleeper spacings; segments overlap by half.
const SEGMENT_SPACINGS: usize = 3;
/// Smallest number of segments; with fewer the coherence by chance is too large.
const SEGMENTS_MIN: usize = 8;

/// Spectral lines of the compared waves, for every segment of a pass.
type Segments = Vec<Vec<Complex64>>;

/// Coherence between the passes at one speed and those at other speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpeedCoherence {
    /// Nominal speed in km/h.
    pub(super) speed_km_h: f64,
    /// Greatest coherence of one of these passes with one at another speed: zero on average by chance, one
    /// if both contain only the same surface.
    pub(super) coherence: f64,
}

/// Coherence of every speed; empty if there is only one speed, or if the common stretch is too short.
pub(super) fn speed_coherences(recording: &Recording) -> Vec<SpeedCoherence> {
    let speeds = by_speed(&recording.passes);
    if speeds.len() < 2 {
        return Vec::new();
    }
    let Some(segments) = segments(recording) else { return Vec::new() };
    let speed_coherence = |own: &Vec<usize>| {
        let others = || (0..recording.passes.len()).filter(|other| !own.contains(other));
        let pairs = own.iter().flat_map(|&pass| others().map(move |other| [pass, other]));
        let coherences = pairs.map(|[pass, other]| coherence(&segments[pass], &segments[other]));
        SpeedCoherence {
            speed_km_h: recording.passes[own[0]].speed_km_h,
            coherence: coherences.fold(f64::NEG_INFINITY, f64::max),
        }
    };
    speeds.iter().map(speed_coherence).collect()
}

/// Segments of all passes at the same positions; `None` if the common stretch is too short.
fn segments(recording: &Recording) -> Option<Vec<Segments>> {
    let ends = |pass: &Pass| [pass.position_m[0], pass.position_m[pass.position_m.len() - 1]];
    let passes = || recording.passes.iter();
    let from_m = passes().map(|pass| ends(pass)[0]).fold(f64::NEG_INFINITY, f64::max);
    let to_m = passes().map(|pass| ends(pass)[1]).fold(f64::INFINITY, f64::min);
    let step_m = recording.spacing_m / (WAVES[1] * POINTS) as f64;
    let points = ((to_m - from_m) / step_m) as usize;
    let length = SEGMENT_SPACINGS * WAVES[1] * POINTS;
    if (2 * points / length).saturating_sub(1) < SEGMENTS_MIN {
        return None;
    }
    let stretch_m = [from_m, from_m + points as f64 * step_m];
    passes()
        .map(|pass| {
            let band =
                WAVES.map(|waves| waves as f64 * pass.mean_speed_m_s() / recording.spacing_m);
            let white = whitened(&pass.signal, &Background::of(&pass.signal)?, band);
            let values = on_even_places(pass, &white, stretch_m, points, Ruler::Odometer);
            Some(lines(&values, length))
        })
        .collect()
}

fn lines(values: &[Complex64], length: usize) -> Segments {
    let transform = tracktwin_fourier::forward(length);
    let of_segment = |start: usize| {
        let mut lines: Vec<Complex64> =
            (0..length).map(|i| values[start + i] * hann(i, length)).collect();
        transform.process(&mut lines);
        lines[WAVES[0] * SEGMENT_SPACINGS..=WAVES[1] * SEGMENT_SPACINGS].to_vec()
    };
    (0..=values.len() - length).step_by(length / 2).map(of_segment).collect()
}

/// Mean over the waves of the magnitude-squared coherence over the segments, corrected for the coherence
/// that a small number of segments has by chance.
///
/// The transfer from surface to signal is the same in all segments, as far as the track is even.
fn coherence(first: &Segments, second: &Segments) -> f64 {
    let waves = first[0].len();
    let of_wave = |wave: usize| {
        let pairs = || first.iter().zip(second).map(|(a, b)| (a[wave], b[wave]));
        let cross: Complex64 = pairs().map(|(a, b)| a.conj() * b).sum();
        let own = |part: fn((Complex64, Complex64)) -> Complex64| -> f64 {
            pairs().map(|pair| part(pair).norm_sqr()).sum()
        };
        cross.norm_sqr() / (own(|pair| pair.0) * own(|pair| pair.1)).max(f64::MIN_POSITIVE)
    };
    let mean = (0..waves).map(of_wave).sum::<f64>() / waves as f64;
    let by_chance = 1.0 / first.len() as f64;
    (mean - by_chance) / (1.0 - by_chance)
}
