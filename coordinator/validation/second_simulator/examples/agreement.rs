//! One-third-octave levels of both simulators over the same scenes: `cargo run --release -p
//! tracktwin-second-simulator --example agreement -- [SEEDS]`.

#![expect(clippy::unwrap_used, reason = "an example that fails says where")]

use std::time::Instant;
use tracktwin_reference_simulator::{PassPlan, Scene, SleeperTruth};
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{PowerSpectrum, ThirdOctave};

/// Speeds in km/h.
const SPEEDS: [f64; 3] = [13.0, 10.0, 7.0];
/// Railpad and ballast stiffness in N/m, sleeper's bending stiffness in N m2.
const TRACKS: [[f64; 3]; 3] = [[1.5e8, 1.2e7, 5000.0], [4e7, 6e6, 4000.0], [2.8e8, 2e7, 6500.0]];

fn scene(seed: u64, [railpad, ballast, sleeper_ei_n_m2]: [f64; 3]) -> Scene {
    let sleeper = SleeperTruth {
        railpad_stiffness_n_m: railpad,
        ballast_stiffness_n_m: ballast,
        sleeper_ei_n_m2,
    };
    let passes = SPEEDS.map(|speed_km_h| PassPlan { speed_km_h }).into();
    Scene { seed, passes, ..Scene::uniform(40, sleeper) }
}

/// Adds the mean density of every speed and band.
fn add(sum: &mut [[f64; ThirdOctave::COUNT]], recording: &Recording) {
    for (sum, pass) in sum.iter_mut().zip(&recording.passes) {
        let spectrum = PowerSpectrum::welch(&pass.signal, 16_384).unwrap();
        for (sum, band) in sum.iter_mut().zip(ThirdOctave::all()) {
            let [low_hz, high_hz] = band.edges_hz();
            *sum += spectrum.mean_density(low_hz, high_hz).unwrap();
        }
    }
}

fn main() {
    let seeds: u64 = std::env::args().nth(1).map_or(4, |text| text.parse().unwrap());
    for track in TRACKS {
        let mut powers = [[[0.0; ThirdOctave::COUNT]; SPEEDS.len()]; 2];
        let mut seconds = [0.0; 2];
        for seed in 1..=seeds {
            let scene = scene(seed, track);
            let simulators =
                [tracktwin_second_simulator::simulate, tracktwin_reference_simulator::simulate];
            for (i, simulate) in simulators.into_iter().enumerate() {
                let begin = Instant::now();
                add(&mut powers[i], &simulate(&scene).unwrap());
                seconds[i] += begin.elapsed().as_secs_f64();
            }
        }
        println!(
            "{track:?}: {:.1} and {:.1} s a scene",
            seconds[0] / seeds as f64,
            seconds[1] / seeds as f64
        );
        println!("    Hz   13   10    7 km/h: second over reference in dB");
        for (band, of) in ThirdOctave::all().enumerate() {
            print!("{:>6}", of.nominal_hz());
            for (second, reference) in powers[0].iter().zip(&powers[1]) {
                print!(" {:+5.2}", 10.0 * (second[band] / reference[band]).log10());
            }
            println!();
        }
    }
}
