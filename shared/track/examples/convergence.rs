//! Prints tables of the change of levels with time step and mesh:
//! `cargo run --release -p tracktwin-track --example convergence`.

use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_signal::{PowerSpectrum, Signal};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::{Pass, passes};

/// Spans of the evaluated stretch. On every track the same number of spans lies before this stretch.
const WINDOW_SPANS: usize = 9;
const SPANS_BEFORE: usize = 8;
/// Number of those spans that the wheel runs over.
const RUN_IN_SPANS: usize = 2;
/// Long enough for every track below.
const SURFACE_M: f64 = 7.0;
const SURFACES: u64 = 8;
/// Bands of the paper's features in Hz (eq. 9), and what lies below them.
const BANDS_HZ: [[f64; 2]; 4] = [[50.0, 400.0], [400.0, 700.0], [800.0, 1500.0], [1500.0, 4000.0]];

/// Settings that are varied.
#[derive(Clone, Copy)]
struct Scheme {
    time_step_s: f64,
    rail_elements: usize,
    sleeper_elements: usize,
    local_flexibility: bool,
    spans_after: usize,
}

/// Settings that the program uses.
const DEFAULT: Scheme = Scheme {
    time_step_s: 1e-5,
    rail_elements: 8,
    sleeper_elements: 8,
    local_flexibility: true,
    spans_after: 8,
};

type Error = Box<dyn std::error::Error>;

fn main() -> Result<(), Error> {
    let steps = [2e-5, 1e-5, 5e-6, 2.5e-6];
    let steps = steps.map(|time_step_s| {
        (format!("step {:.1} us", time_step_s * 1e6), Scheme { time_step_s, ..DEFAULT })
    });
    table("Time step", &steps)?;
    let rail = |local_flexibility: bool, name: &str| {
        [4, 8, 16, 32].map(|rail_elements| {
            let scheme = Scheme { rail_elements, local_flexibility, ..DEFAULT };
            (format!("{rail_elements} elements a span{name}"), scheme)
        })
    };
    table("Rail, with local flexibility", &rail(true, ""))?;
    let mut plain = rail(false, ", plain").to_vec();
    plain.push(rail(true, ", local flexibility")[3].clone());
    table("Rail, the paper's plain scheme", &plain)?;
    let sleepers = [2, 4, 8, 16].map(|sleeper_elements| {
        let scheme = Scheme { sleeper_elements, ..DEFAULT };
        (format!("{sleeper_elements} elements a half sleeper"), scheme)
    });
    table("Sleeper", &sleepers)?;
    let ends = [2, 4, 8, 16, 32].map(|spans_after| {
        (format!("{spans_after} spans to the end"), Scheme { spans_after, ..DEFAULT })
    });
    table("Distance to the far end of the rail", &ends)
}

/// Levels of all schemes minus the levels of the last scheme, which is the finest.
fn table(title: &str, schemes: &[(String, Scheme)]) -> Result<(), Error> {
    println!("\n{title}: level less that of the last row, in dB\n");
    let bands = BANDS_HZ.map(|[low, high]| format!("{low:.0}-{high:.0} Hz")).join(" | ");
    println!("| scheme | {bands} |\n|---|{}", "---|".repeat(BANDS_HZ.len()));
    let rows = schemes.iter().map(|(_, scheme)| levels(*scheme)).collect::<Result<Vec<_>, _>>()?;
    let finest = rows[rows.len() - 1];
    for ((name, _), row) in schemes.iter().zip(&rows) {
        let cells: Vec<_> =
            row.iter().zip(finest).map(|(level, last)| format!("{:+.3}", level - last)).collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
    Ok(())
}

/// Level in each band, in dB, of the mean power over the surfaces at 13 km/h.
fn levels(scheme: Scheme) -> Result<[f64; 4], Error> {
    let design = TrackDesign::v_track();
    let spans = SPANS_BEFORE + WINDOW_SPANS + scheme.spans_after;
    let supports = vec![Support::from(&ParameterSet::nominal()); spans - 1];
    let mesh = Mesh::uniform(spans, scheme.rail_elements, scheme.sleeper_elements);
    let model = TrackModel::build(&design, &mesh, &supports, &[])?;
    let spacing = design.sleeper.spacing_m;
    let pass = Pass {
        speed_m_s: 13.0 / 3.6,
        start_m: (SPANS_BEFORE - RUN_IN_SPANS) as f64 * spacing,
        end_m: (SPANS_BEFORE + WINDOW_SPANS) as f64 * spacing,
        time_step_s: scheme.time_step_s,
        local_flexibility: scheme.local_flexibility,
    };
    let surfaces: Vec<_> = (0..SURFACES).map(|seed| Surface::rough(seed, 3.0, SURFACE_M)).collect();
    let models = vec![model; surfaces.len()];
    let mut powers = [0.0; 4];
    for record in passes(&models, &pass, &surfaces)? {
        let run_in =
            (RUN_IN_SPANS as f64 * spacing / (pass.speed_m_s * scheme.time_step_s)) as usize;
        let kept = record.acceleration_m_s2[run_in..].to_vec();
        // Segments of 0.16 s whatever the step.
        let segment = (0.164 / scheme.time_step_s).round() as usize;
        let spectrum =
            PowerSpectrum::welch(&Signal::new(1.0 / scheme.time_step_s, kept)?, segment)?;
        for (power, [low, high]) in powers.iter_mut().zip(BANDS_HZ) {
            *power += spectrum.mean_density(low, high).ok_or("no bin in the band")?;
        }
    }
    Ok(powers.map(|power| 10.0 * (power / SURFACES as f64).log10()))
}
