//! Measuring chains with known faults.

use super::*;
use crate::along::testing::{Chain, Rolled, independent, noise};
use std::f64::consts::TAU;

pub(super) const ALPHA: f64 = 0.0025;

pub(super) fn measured(seed: u64, chain: &Chain<'_>) -> Recording {
    Rolled { chain, ..Rolled::faultless(seed) }.recording()
}

#[test]
fn a_limit_is_found_with_its_value() {
    let recording = measured(1, &|pass, samples, _| {
        if pass == 1 {
            for sample in samples {
                *sample = sample.clamp(-4.0, 4.0);
            }
        }
    });
    let found = clipping(&recording, ALPHA);
    assert_eq!(found.len(), 1, "{found:?}");
    // The mean of a pass without faults is zero within a hundredth.
    assert_eq!(found[0].pass, 1);
    assert!((found[0].level_m_s2.abs() - 4.0).abs() < 0.01, "{found:?}");
}

#[test]
fn a_limit_that_few_long_crests_reach_is_found_and_is_no_drop_out() {
    let recording = measured(1, &|pass, samples, _| {
        if pass == 1 {
            for (index, sample) in samples.iter_mut().enumerate() {
                let slow = 40.0 * (TAU * 2.0 * index as f64 / Rolled::RATE_HZ).sin();
                *sample = (0.01 * *sample + slow).clamp(-39.0, 39.0);
            }
        }
    });
    let found = clipping(&recording, ALPHA);
    assert_eq!(found.iter().map(|found| found.pass).collect::<Vec<_>>(), [1], "{found:?}");
    let drop_out = |defect: &PassDefect| matches!(defect, PassDefect::DropOut { .. });
    let pass_defects = pass_defects(&recording, &[]);
    assert!(!pass_defects.iter().any(drop_out), "{pass_defects:?}");
}

#[test]
fn a_strong_tone_is_not_clipped() {
    let tone = |limit: f64| {
        let recording = measured(1, &|_, samples, _| {
            let noise = noise(5, samples.len());
            for (index, (sample, noise)) in samples.iter_mut().zip(noise).enumerate() {
                let wave = (TAU * 83.3 * index as f64 / Rolled::RATE_HZ).sin();
                *sample = (30.0 * wave + 0.05 * noise).min(limit);
            }
        });
        clipping(&recording, ALPHA)
    };
    assert!(tone(f64::INFINITY).is_empty(), "{:?}", tone(f64::INFINITY));
    assert_eq!(tone(29.9).len(), 4);
}

/// Adds a narrow band around 200 Hz that differs from pass to pass, as loud as the rest, then the gain of pass 1.
fn with_ringing(factor: f64) -> Recording {
    measured(5, &|pass, samples, _| {
        let (decay, omega) = (0.9995_f64, TAU * 200.0 / Rolled::RATE_HZ);
        let own = noise(70 + pass as u64, samples.len());
        let loud = (samples.iter().map(|it| it * it).sum::<f64>() / samples.len() as f64).sqrt();
        let mut last = [0.0; 2];
        for (sample, blow) in samples.iter_mut().zip(own) {
            let next = 2.0 * decay * omega.cos() * last[0] - decay * decay * last[1] + blow;
            last = [next, last[0]];
            *sample += 1e-3 * loud * next;
            *sample *= if pass == 1 { factor } else { 1.0 };
        }
    })
}

#[test]
fn a_band_that_rings_differently_in_every_pass_does_not_speak_against_a_gain() {
    let found = gains(&with_ringing(0.77));
    assert!(found[1].level.spread_db > 0.6, "no test: {found:?}");
    assert!(found[1].is_error(ALPHA) && !found[2].is_error(ALPHA), "{found:?}");
    assert!(gains(&with_ringing(1.0)).iter().all(|gain| !gain.is_error(ALPHA)));
}

#[test]
fn without_its_hum_a_recording_is_what_it_was() {
    let humming = measured(5, &|pass, samples, _| {
        for (index, sample) in samples.iter_mut().enumerate() {
            let turns = 150.05 * index as f64 / Rolled::RATE_HZ + 0.3 * pass as f64;
            *sample += 2.0 * (TAU * turns).cos();
        }
    });
    let found = hum(&humming, None, ALPHA);
    assert_eq!(found[0].frequency_hz, 150.0);
    let cleared = without_hum(&humming, &found[..1]);
    let still = Rolled::faultless(5).recording();
    for (with, without) in cleared.passes.iter().zip(&still.passes) {
        let pairs = with.signal.samples().iter().zip(without.signal.samples());
        let square = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / with.signal.len() as f64;
        // The tone has a mean square of two.
        assert!(square < 0.1, "{square}");
    }
}

#[test]
fn a_pass_with_another_gain_is_told_from_one_with_another_spectrum() {
    let louder = measured(3, &|pass, samples, _| {
        if pass == 1 {
            for sample in samples {
                *sample *= 1.15;
            }
        }
    });
    let found = gains(&louder);
    // 1.15 is 1.21 dB; the noise of the sensor is a two hundredth of the signal's power.
    assert!((found[1].level.mean_db.0 - 1.21).abs() < 0.1 && found[1].is_error(ALPHA), "{found:?}");
    assert!(!found[2].is_error(ALPHA));
    let wrong =
        |recording, gains: &[Gain]| of_other_gain(recording, gains, |gain| gain.is_error(ALPHA));
    // None tells which of two passes is wrong; of four it is the one that differs from all others.
    assert_eq!(wrong(&louder, &found), [0, 1]);
    let mut at_one_speed = louder.clone();
    at_one_speed.passes.truncate(4);
    at_one_speed.passes.iter_mut().for_each(|pass| pass.speed_km_h = 13.0);
    let of = |pass: usize, gain_db: f64| {
        let likeness = LevelDifference { spread_db: 0.1, ln_p: -20.0, ..found[1].level.clone() };
        let level = LevelDifference { mean_db: (gain_db, 0.05), ..likeness };
        Gain { pass, level, ..found[1] }
    };
    let by_hand = [of(0, -0.4), of(1, 1.21), of(2, -0.4), of(3, -0.4)];
    assert_eq!(wrong(&at_one_speed, &by_hand), [1]);
    let rumble = measured(3, &|pass, samples, _| {
        if pass == 1 {
            let tone = |index: usize| (TAU * 200.0 * index as f64 / Rolled::RATE_HZ).sin();
            for (index, sample) in samples.iter_mut().enumerate() {
                *sample += 3.0 * tone(index);
            }
        }
    });
    assert!(!gains(&rumble)[1].is_error(ALPHA), "{:?}", gains(&rumble));
}

#[test]
fn a_shifted_and_stretched_odometer_is_measured() {
    let recording = measured(4, &|pass, _, positions| {
        if pass == 3 {
            for position in positions {
                *position = 0.012 + 1.004 * *position;
            }
        }
    });
    let found = offsets(&recording);
    assert_eq!(found[0].ln_p(), 0.0);
    assert!(found[1].ln_p() < ALPHA.ln(), "{:?}", found[1].line());
    let (middle, slope) = found[1].line();
    // 12 mm at the beginning and 0.4 % on 1.5 m.
    assert!((middle - 0.018).abs() < 3e-4 && (slope - 0.004).abs() < 3e-4, "{middle} {slope}");
}

#[test]
fn an_odometer_that_stretches_every_pass_alike_is_told_from_rounded_speeds() {
    let stretched = measured(7, &|_, _, positions| {
        for position in positions {
            *position *= 1.01;
        }
    });
    let found = scale(&stretched).unwrap();
    assert!((found.scale.0 - 0.01).abs() < 1e-4 && found.ln_p < ALPHA.ln(), "{found:?}");
    let rounded = measured(7, &|pass, _, positions| {
        for position in positions {
            *position *= if pass < 2 { 1.012 } else { 1.003 };
        }
    });
    assert_eq!(scale(&rounded), None);
}

#[test]
fn a_train_that_slows_down_does_not_keep_its_stated_speed() {
    // 1 % slower in its second half: 2 % from the stated speed are usual.
    let slowing = measured(7, &|_, _, positions| {
        let (first, last) = (positions[0], positions[positions.len() - 1]);
        for position in positions {
            let share = (*position - first) / (last - first);
            *position = first + (*position - first) * (1.018 - 0.01 * share);
        }
    });
    let found = scale(&slowing).unwrap();
    assert!(found.usual > 0.015 && found.ln_p == 0.0, "{found:?}");
}

#[test]
fn odometers_that_wander_as_usual_are_no_error() {
    let recording = measured(5, &|pass, _, positions| {
        for position in positions {
            *position += 3e-3 * (*position * 2.0 + pass as f64).sin();
        }
    });
    assert!(offsets(&recording).iter().all(|pair| pair.ln_p() == 0.0));
}

#[test]
fn passes_that_share_a_few_tones_are_not_matched_by_chance() {
    // With phases of its own in each pass a tone says nothing of places.
    const TONES_HZ: [f64; 5] = [700.0, 930.0, 1210.0, 1490.0, 1820.0];
    let recording = measured(8, &|pass, samples, _| {
        let phases = noise(20 + pass as u64, TONES_HZ.len());
        let background = noise(40 + pass as u64, samples.len());
        for (index, sample) in samples.iter_mut().enumerate() {
            let turns = |tone: f64| TAU * tone * index as f64 / Rolled::RATE_HZ;
            let tones = TONES_HZ.iter().zip(&phases);
            *sample = tones.map(|(tone, phase)| (turns(*tone) + 9.0 * phase).sin()).sum::<f64>()
                + 0.3 * background[index];
        }
    });
    for pair in offsets(&recording) {
        assert_eq!(pair.ln_p(), 0.0, "{:?}", pair.matched);
    }
}

#[test]
fn passes_that_cannot_be_used_are_named_with_the_reason() {
    let broken = |chain: &Chain<'_>| {
        let recording = measured(6, chain);
        pass_defects(&recording, &offsets(&recording))
    };
    assert_eq!(broken(&|_, _, _| ()), []);
    let standstill = broken(&|pass, samples, _| {
        if pass == 0 {
            samples[10_000..10_200].fill(0.25);
        }
    });
    assert!(matches!(standstill[..], [PassDefect::DropOut { pass: 0, .. }]), "{standstill:?}");
    let dead = broken(&|pass, samples, _| {
        if pass == 1 {
            samples.fill(0.0);
        }
    });
    assert_eq!(dead, [PassDefect::Dead { pass: 1 }]);
    let noisy = broken(&|pass, samples, _| {
        if pass == 2 {
            samples.copy_from_slice(&noise(7, samples.len()));
        }
    });
    assert!(matches!(noisy[..], [PassDefect::UnrelatedPasses { passes: [2, 3], .. }]), "{noisy:?}");
    let full = broken(&|pass, samples, _| {
        if pass == 3 {
            for sample in samples {
                *sample = sample.clamp(-1.0, 1.0);
            }
        }
    });
    assert!(matches!(full[..], [PassDefect::Saturated { pass: 3, .. }]), "{full:?}");
}

#[test]
fn passes_without_the_others_surface_are_named() {
    let mut lone = measured(6, &|_, samples, _| samples.copy_from_slice(&noise(7, samples.len())));
    lone.passes.truncate(1);
    assert_eq!(pass_defects(&lone, &offsets(&lone)), [PassDefect::Noise { pass: 0 }]);
    let elsewhere = measured(7, &|_, _, _| ());
    let other_rail = |pass: usize, samples: &mut [f64]| {
        samples.copy_from_slice(elsewhere.passes[pass].signal.samples());
    };
    let on_other_rail = |is_there: fn(usize) -> bool| {
        let recording = measured(6, &|pass, samples, _| {
            if is_there(pass) {
                other_rail(pass, samples);
            }
        });
        pass_defects(&recording, &offsets(&recording))
    };
    let unlike = on_other_rail(|pass| pass == 2);
    assert!(
        matches!(unlike[..], [PassDefect::UnrelatedPasses { passes: [2, 3], .. }]),
        "{unlike:?}"
    );
    let strange = on_other_rail(|pass| pass > 1);
    let speeds = strange.iter().map(|defect| match defect {
        PassDefect::UnrelatedSpeed { speed_km_h, .. } => Some(*speed_km_h),
        _ => None,
    });
    assert_eq!(speeds.collect::<Vec<_>>(), [Some(13.0), Some(8.0)], "{strange:?}");
}

#[test]
fn a_faultless_chain_shows_nothing() {
    for seed in 10..20 {
        let recording = measured(seed, &|_, _, _| ());
        assert!(clipping(&recording, ALPHA).is_empty(), "seed {seed}");
        assert!(hum(&recording, None, ALPHA).is_empty(), "seed {seed}");
        assert!(gains(&recording).iter().all(|gain| !gain.is_error(ALPHA)), "seed {seed}");
        assert!(offsets(&recording).iter().all(|pair| pair.ln_p() == 0.0), "seed {seed}");
        assert_eq!(scale(&recording).unwrap().ln_p, 0.0, "seed {seed}");
    }
}

#[test]
fn the_noise_of_an_independent_recording_is_what_was_added() {
    for recording in independent("dev-01") {
        for floor in noise_floors(&recording) {
            // 0.05 m/s2 over 50 kHz.
            assert!((floor.unwrap() / 5e-8 - 1.0).abs() < 0.1, "{floor:?}");
        }
    }
}
