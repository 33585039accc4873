//! Peaks of the rail's point receptance on tracks of growing length, as a table:
//! `cargo run --release -p tracktwin-track --example receptance_peaks`.

use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_track::frequency::{ReceptancePoint, peaks, receptance};
use tracktwin_track::model::{Mesh, Support, TrackModel};

/// Lengths of the track in spans; an even number has a sleeper in the middle.
const SPANS: [usize; 5] = [24, 40, 80, 160, 200];

/// Smallest prominence of a peak in dB.
const PROMINENCE_DB: f64 = 1.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let design = TrackDesign::v_track();
    let frequencies: Vec<f64> = (10..1600).map(|step| 5.0 * f64::from(step)).collect();
    println!(
        "| spans | struck | peaks in Hz (in brackets how far they stand out in dB) |\n|---|---|---|"
    );
    for spans in SPANS {
        let supports = vec![Support::from(&ParameterSet::nominal()); spans - 1];
        let model = TrackModel::build(&design, &Mesh::uniform(spans, 8, 8), &supports, &[])?;
        let middle = model.layout().length_m() / 2.0;
        for (name, x_m) in
            [("sleeper", middle), ("midspan", middle + design.sleeper.spacing_m / 2.0)]
        {
            let place = ReceptancePoint::Rail(x_m);
            let magnitudes: Vec<f64> = receptance(&model, place, place, &frequencies)?
                .iter()
                .map(|value| value.norm())
                .collect();
            let found: Vec<_> = peaks(&frequencies, &magnitudes, PROMINENCE_DB)
                .iter()
                .map(|peak| format!("{:.0} ({:.0})", peak.frequency_hz, peak.prominence_db))
                .collect();
            println!("| {spans} | {name} | {} |", found.join(", "));
        }
    }
    Ok(())
}
