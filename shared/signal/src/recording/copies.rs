//! Copies of a pass. They must not count as repeated passes.

/// Samples that are compared first.
const WINDOW: usize = 64;
/// Relative difference between two copies of a signal by rounding to single precision or to few
/// decimals.
const ALIKE: f64 = 1e-3;

/// The factor between two signals, if one is a scaled, shifted or shortened copy of the other.
///
/// Two passes over one track always differ more, by sensor noise, clock and speed.
pub(super) fn factor(first: &[f64], second: &[f64]) -> Option<f64> {
    let (long, short) = if first.len() < second.len() { (second, first) } else { (first, second) };
    if short.len() <= WINDOW {
        return None;
    }
    let loudest = loudest(short);
    let part = &short[loudest..loudest + WINDOW];
    let starts = 0..=long.len() - WINDOW;
    let place = starts.into_iter().find(|&start| is_near(part, &long[start..start + WINDOW]))?;
    // The whole of what both have, laid on each other there.
    let back = place.min(loudest);
    let (long, short) = (&long[place - back..], &short[loudest - back..]);
    let length = long.len().min(short.len());
    let factor = scale(&short[..length], &long[..length])?;
    Some(if first.len() < second.len() { factor } else { 1.0 / factor })
}

/// Start of the window with the largest changes of the signal.
fn loudest(samples: &[f64]) -> usize {
    let change = |index: usize| (samples[index + 1] - samples[index]).abs();
    let places = 0..samples.len() - WINDOW;
    places.max_by(|&a, &b| change(a).total_cmp(&change(b))).unwrap_or(0)
}

/// Whether the beginnings have one ratio, and then the windows: the quick test comes first.
fn is_near(part: &[f64], other: &[f64]) -> bool {
    let changes = |values: &[f64]| [values[1] - values[0], values[2] - values[1]];
    let ([a, b], [c, d]) = (changes(part), changes(other));
    (a * d - b * c).abs() <= ALIKE * (a * d).abs().max((b * c).abs())
        && scale(part, other).is_some()
}

/// The factor between the changes of `a` and those of `b`, if there is one.
///
/// The function compares changes, because a constant offset may have been removed from either signal.
fn scale(a: &[f64], b: &[f64]) -> Option<f64> {
    let pairs = || a.windows(2).zip(b.windows(2)).map(|(a, b)| (a[1] - a[0], b[1] - b[0]));
    let (square, cross) = pairs().fold((0.0, 0.0), |(s, c), (a, b)| (s + a * a, c + a * b));
    let factor = cross / square;
    let of_other = pairs().map(|(_, b)| b * b).sum::<f64>();
    let left = pairs().map(|(a, b)| (b - factor * a).powi(2)).sum::<f64>();
    (of_other > 0.0 && left <= ALIKE * ALIKE * of_other).then_some(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something that never repeats, with a little noise of its own for every `seed`.
    fn pass(seed: f64, noise: f64) -> Vec<f64> {
        let value = |i: u32| {
            let x = f64::from(i);
            (0.1 * x + 1e-5 * x * x).sin() + noise * (12.9898 * x + seed).sin() * (78.233 * x).cos()
        };
        (0..5000).map(value).collect()
    }

    #[test]
    fn copies_are_found_however_they_were_scaled_shifted_cut_and_rounded() {
        let whole = pass(0.0, 0.1);
        assert_eq!(factor(&whole, &whole), Some(1.0));
        let scaled: Vec<f64> = whole.iter().map(|v| 1.5 * v - 3.0).collect();
        assert!((factor(&whole, &scaled).unwrap() - 1.5).abs() < 1e-9);
        let single: Vec<f64> = whole.iter().map(|v| f64::from((-9.81 * v) as f32)).collect();
        assert!((factor(&whole, &single).unwrap() + 9.81).abs() < 1e-5);
        let cut: Vec<f64> = scaled[700..4000].to_vec();
        assert!((factor(&whole, &cut).unwrap() - 1.5).abs() < 1e-9);
        assert!((factor(&cut, &whole).unwrap() - 1.0 / 1.5).abs() < 1e-9);
        assert!((factor(&whole[..4000], &scaled[700..]).unwrap() - 1.5).abs() < 1e-9);
        let rounded: Vec<f64> = whole.iter().map(|v| (v * 1e4).round() / 1e4).collect();
        assert!(factor(&whole, &rounded).is_some());
    }

    #[test]
    fn repeats_with_a_hundredth_of_noise_and_signals_without_change_are_no_copies() {
        assert_eq!(factor(&pass(0.0, 0.01), &pass(1.0, 0.01)), None);
        assert_eq!(factor(&[1.0; 500], &[1.0; 500]), None);
        assert_eq!(factor(&pass(0.0, 0.1), &[1.0; 500]), None);
    }
}
