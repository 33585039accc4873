//! One-third-octave levels of a typical line, or of a recording: `cargo run --release -p
//! tracktwin-second-simulator --example line_levels -- [SEED | FOLDER]`.

#![expect(clippy::unwrap_used, reason = "an example that fails says where")]

use std::time::Instant;
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::Scene;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{PowerSpectrum, ThirdOctave};

fn main() {
    let argument = std::env::args().nth(1).unwrap_or_else(|| "1".to_owned());
    let begin = Instant::now();
    let recording = match argument.parse() {
        Ok(seed) => {
            let scene = Scene::typical_line(Preset::Concrete60E1, seed);
            println!("level {:.3}", scene.irregularity_level);
            tracktwin_second_simulator::simulate(&scene).unwrap()
        }
        Err(_) => Recording::open(argument).unwrap(),
    };
    println!("{:.1} s", begin.elapsed().as_secs_f64());
    let spectra: Vec<PowerSpectrum> = recording
        .passes
        .iter()
        .map(|pass| PowerSpectrum::welch(&pass.signal, 4096).unwrap())
        .collect();
    for pass in &recording.passes {
        let samples = pass.signal.samples();
        let rms = (samples.iter().map(|a| a * a).sum::<f64>() / samples.len() as f64).sqrt();
        let crest = samples.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
        println!("{} km/h: rms {rms:.2}, crest {crest:.1} m/s2", pass.speed_km_h);
    }
    for band in ThirdOctave::all() {
        let [low_hz, high_hz] = band.edges_hz();
        print!("{:>6} Hz", band.nominal_hz());
        for spectrum in &spectra {
            print!(" {:7.2}", 10.0 * spectrum.mean_density(low_hz, high_hz).unwrap().log10());
        }
        println!();
    }
}
