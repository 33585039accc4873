//! What the transforms do to signals whose content is known.

use std::f64::consts::TAU;
use tracktwin_signal::{
    Conventions, Cwt, Extractor, FeatureDefinition, Morlet, Normalisation, Padding, Signal,
    ThirdOctave, TimeFrequency, squeeze,
};

const RATE_HZ: f64 = 100_000.0;
const VOICES: u32 = 48;

/// White noise of unit variance from a fixed seed (a linear congruential generator, summed to
/// near a Gaussian).
fn noise(samples: usize) -> Vec<f64> {
    let mut state = 2_u64;
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    (0..samples).map(|_| (0..12).map(|_| uniform()).sum()).collect()
}

fn sampled(samples: u32, value: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..samples).map(|n| value(f64::from(n) / RATE_HZ)).collect()
}

/// CWT and SSWT on voices from 47.7 kHz down.
fn transforms(samples: &[f64], voices: i32) -> (Cwt, TimeFrequency) {
    let wavelet = Morlet::new(6.0);
    let scales_s: Vec<_> =
        (0..=voices).map(|j| 2.0 / RATE_HZ * (f64::from(j) / f64::from(VOICES)).exp2()).collect();
    let padding = Padding::Zeros(samples.len().next_power_of_two());
    let cwt = Cwt::new(samples, RATE_HZ, padding, wavelet, &scales_s);
    let conventions = Conventions { normalisation: Normalisation::SignalBack, threshold: 1e-8 };
    let squeezed = squeeze(&cwt, wavelet, VOICES, conventions);
    (cwt, squeezed)
}

#[test]
fn a_tone_of_amplitude_a_gives_a_in_its_bin() {
    let frequencies_hz = FeatureDefinition::default().frequencies_hz();
    let extractor = Extractor::new(&FeatureDefinition::default()).unwrap();
    for (bin, tolerance) in [(0, 0.03), (20, 0.01), (100, 0.01), (200, 0.01), (303, 0.01)] {
        // Off the bin's centre, as tones are.
        let tone_hz = frequencies_hz[bin] * 1.004;
        let samples = sampled(40_000, |t| 2.5 * (TAU * tone_hz * t).cos());
        let signal = Signal::new(RATE_HZ, samples).unwrap();
        let features = extractor.extract(&signal, 15_000..25_000).unwrap();
        let amplitude = (0.5 * features.log_power[bin]).exp();
        // The voices beyond 3 standard deviations, left out, hold 0.2 %. At 50 Hz the wavelet is
        // as long as the margins, whose faded part holds 2 % of it.
        assert!((amplitude / 2.5 - 1.0).abs() < tolerance, "{tone_hz} Hz: {amplitude}");
    }
}

#[test]
fn the_level_of_a_tone_is_that_of_its_mean_square() {
    let extractor = Extractor::new(&FeatureDefinition::default()).unwrap();
    let samples = sampled(20_000, |t| 10.0 * (TAU * 1000.0 * t).cos());
    let signal = Signal::new(RATE_HZ, samples).unwrap();
    let features = extractor.extract(&signal, 8000..12_000).unwrap();
    let level = |hz| {
        let band = ThirdOctave::all().position(|band| band.nominal_hz() == hz).unwrap();
        features.band_levels_db[band]
    };
    // 10 log10(10^2 / 2) = 16.99 dB; 0.2 % of the amplitude are 0.02 dB.
    assert!((level(1000) - 16.99).abs() < 0.03, "{}", level(1000));
    assert!(level(500) < -20.0 && level(2000) < -20.0);
}

#[test]
fn the_real_part_summed_over_frequency_is_the_signal() {
    // Noise between 200 Hz and 5 kHz, well inside the voices (23 Hz to 48 kHz) and the stretch.
    let white = noise(8192);
    let envelope = |n: usize| (-((n as f64 - 4096.0) / 1200.0).powi(2)).exp();
    let smooth = |width: usize| -> Vec<f64> {
        let weight = |k: f64| (-0.5 * (k / width as f64).powi(2)).exp();
        let span = 5 * width;
        let total: f64 = (0..=2 * span).map(|k| weight(k as f64 - span as f64)).sum();
        (0..white.len())
            .map(|n| {
                (0..=2 * span)
                    .filter_map(|k| {
                        Some(
                            weight(k as f64 - span as f64)
                                * white.get((n + k).checked_sub(span)?)?,
                        )
                    })
                    .sum::<f64>()
                    / total
            })
            .collect()
    };
    let (fine, coarse) = (smooth(8), smooth(80));
    let samples: Vec<_> =
        fine.iter().zip(&coarse).enumerate().map(|(n, (a, b))| (a - b) * envelope(n)).collect();

    let (_, squeezed) = transforms(&samples, 528);
    let back = |n: usize| -> f64 {
        (0..squeezed.frequencies_hz.len()).map(|bin| squeezed.row(bin)[n].re).sum()
    };
    let square = |x: f64| x * x;
    let error: f64 = samples.iter().enumerate().map(|(n, x)| square(back(n) - x)).sum();
    let total: f64 = samples.iter().map(|x| square(*x)).sum();
    let relative = (error / total).sqrt();
    println!("reconstruction error: {relative:.2e}");
    assert!(relative < 0.01, "{relative}");
}

/// Share of the power within one bin of either chirp, in the middle of the stretch.
fn share_on_chirps(
    map: &TimeFrequency,
    weight: impl Fn(usize) -> f64,
    chirps: [[f64; 2]; 2],
) -> f64 {
    let octaves = |a: f64, b: f64| (a / b).log2().abs() * f64::from(VOICES);
    let (mut near, mut total) = (0.0, 0.0);
    for column in (3000_u16..7000).step_by(10) {
        let t = f64::from(column) / RATE_HZ;
        for (row, &frequency_hz) in map.frequencies_hz.iter().enumerate() {
            let power = map.row(row)[usize::from(column)].norm_sqr() * weight(row);
            let close = chirps
                .iter()
                .any(|[start_hz, rate]| octaves(frequency_hz, start_hz + rate * t) <= 1.5);
            total += power;
            near += if close { power } else { 0.0 };
        }
    }
    near / total
}

#[test]
fn the_sswt_resolves_two_chirps_that_the_cwt_smears() {
    // From 300 and 800 Hz, both rising by 3 kHz a second.
    let chirps = [[300.0, 3000.0], [800.0, 3000.0]];
    let samples = sampled(10_000, |t| {
        chirps.iter().map(|[start, rate]| (TAU * (start + 0.5 * rate * t) * t).cos()).sum()
    });
    let (cwt, squeezed) = transforms(&samples, 400);
    let in_cwt = share_on_chirps(&cwt.coefficients, |row| 1.0 / cwt.scales_s[row], chirps);
    let in_sswt = share_on_chirps(&squeezed, |_| 1.0, chirps);
    println!("power within a bin of the chirps: CWT {in_cwt:.3}, SSWT {in_sswt:.3}");
    // A voice's hill is 1 / 6 wide (standard deviation of the amplitude), 16 bins from side to
    // side in power: three bins hold at most a fifth of it. Reassigned, nearly all is in them.
    assert!(in_cwt < 0.25, "{in_cwt}");
    assert!(in_sswt > 0.95, "{in_sswt}");
}

#[test]
fn noise_keeps_a_known_part_of_its_power() {
    let extractor = Extractor::new(&FeatureDefinition::default()).unwrap();
    let signal = Signal::new(RATE_HZ, noise(212_000)).unwrap();
    let features = extractor.extract(&signal, 6000..206_000).unwrap();
    let shares: Vec<_> = ThirdOctave::all()
        .zip(&features.band_levels_db)
        .map(|(band, level)| {
            let [low, high] = band.edges_hz();
            // White noise of unit variance: the same power at all frequencies up to 50 kHz.
            level - 10.0 * ((high - low) / (0.5 * RATE_HZ)).log10()
        })
        .collect();
    println!("LWPS level above the mean square of white noise, dB: {shares:.2?}");
    // Scale invariance: the same loss in every band, up to the scatter of 2 s of noise (about
    // 4.3 / sqrt(bandwidth times duration) dB: 0.9 dB at 50 Hz, 0.1 dB at 4 kHz).
    let mean = shares[5..].iter().sum::<f64>() / 15.0;
    for (band, share) in ThirdOctave::all().zip(&shares) {
        let [low, high] = band.edges_hz();
        let scatter = 4.34 / ((high - low) * 2.0).sqrt();
        assert!((share - mean).abs() < 4.0 * scatter + 0.2, "{band}: {share}, mean {mean}");
    }
}
