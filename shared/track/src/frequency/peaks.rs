//! Maxima of a response over frequency.

/// A local maximum of a magnitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Magnitude at the peak, in the unit of the input.
    pub magnitude: f64,
    /// Prominence in dB. On either side, find the lowest point between the peak and a higher value; the
    /// prominence is the height of the peak above the higher of these two points.
    pub prominence_db: f64,
}

/// The maxima with a prominence of at least `prominence_db`, by ascending frequency.
///
/// Values at the ends of the range do not count as maxima. A parabola through a maximum and its
/// neighbours gives the position of the peak between the given frequencies.
pub fn peaks(frequencies_hz: &[f64], magnitudes: &[f64], prominence_db: f64) -> Vec<Peak> {
    let levels: Vec<f64> = magnitudes.iter().map(|value| 20.0 * value.log10()).collect();
    let last = levels.len().min(frequencies_hz.len()).saturating_sub(1);
    (1..last)
        .filter(|&index| levels[index - 1] < levels[index] && levels[index] >= levels[index + 1])
        .map(|index| {
            let (offset, level) = vertex([levels[index - 1], levels[index], levels[index + 1]]);
            let neighbour = if offset < 0.0 { index - 1 } else { index + 1 };
            let distance = frequencies_hz[neighbour] - frequencies_hz[index];
            Peak {
                frequency_hz: frequencies_hz[index] + offset.abs() * distance,
                magnitude: 10.0_f64.powf(level / 20.0),
                prominence_db: prominence(&levels, index),
            }
        })
        .filter(|peak| peak.prominence_db >= prominence_db)
        .collect()
}

/// Place (in steps from the middle) and height of the parabola's vertex through three values.
fn vertex([before, middle, after]: [f64; 3]) -> (f64, f64) {
    let curvature = before - 2.0 * middle + after;
    let offset = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
    (offset, middle - 0.25 * (before - after) * offset)
}

fn prominence(levels: &[f64], index: usize) -> f64 {
    let height = levels[index];
    let lowest = |side: &mut dyn Iterator<Item = &f64>| {
        side.take_while(|&&level| level <= height).fold(height, |low, &level| low.min(level))
    };
    let left = lowest(&mut levels[..index].iter().rev());
    let right = lowest(&mut levels[index + 1..].iter());
    height - left.max(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_of_an_oscillator_stands_at_its_resonance() {
        let frequencies: Vec<f64> = (1..400).map(|index| f64::from(index) * 0.5).collect();
        let magnitudes: Vec<f64> = frequencies
            .iter()
            .map(|f| 1.0 / (1.0 - (f / 100.3).powi(2)).hypot(0.02 * f / 100.3))
            .collect();
        let found = peaks(&frequencies, &magnitudes, 6.0);
        assert_eq!(found.len(), 1);
        // 1 % damping: the peak is 1 Hz wide at half its power, the grid half as fine.
        assert!((found[0].frequency_hz - 100.3).abs() < 0.05, "{:?}", found[0]);
    }

    #[test]
    fn ripples_below_the_prominence_are_passed_over() {
        let frequencies: Vec<f64> = (0..5).map(f64::from).collect();
        // 0 dB, 1 dB, 0 dB, 20 dB, 0 dB.
        let magnitudes = [0.0, 1.0, 0.0, 20.0, 0.0_f64].map(|db| 10.0_f64.powf(db / 20.0));
        assert_eq!(peaks(&frequencies, &magnitudes, 3.0).len(), 1);
        assert_eq!(peaks(&frequencies, &magnitudes, 0.5).len(), 2);
    }
}
