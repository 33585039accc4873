//! Times the plain and the fast solver on the paper's track: `cargo run --release --example
//! pass_speed [cases]`.

use std::time::Instant;
use tracktwin_parameters::{Parameter, ParameterSet, Sequence, TrackDesign};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::{self, Pass};

const SPANS: usize = 25;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let cases: u32 = std::env::args().nth(1).map_or(Ok(16), |text| text.parse())?;
    let design = TrackDesign::v_track();
    let pass = Pass {
        speed_m_s: 13.0 / 3.6,
        start_m: 9.0 * design.sleeper.spacing_m,
        end_m: 16.0 * design.sleeper.spacing_m,
        time_step_s: 1e-5,
        local_flexibility: true,
    };
    let axes = Parameter::ALL.len();
    let points = Sequence::OwenScrambled.points(0..cases, axes, 1)?;
    let started = Instant::now();
    let models = points
        .iter()
        .map(|point| {
            let set = parameters(point);
            let supports = vec![Support::from(&set); SPANS - 1];
            TrackModel::build(&design, &Mesh::uniform(SPANS, 8, 8), &supports, &[])
        })
        .collect::<Result<Vec<_>, _>>()?;
    report("build", started, models.len());
    let started = Instant::now();
    let surfaces: Vec<_> = (0..cases).map(|seed| Surface::rough(seed.into(), 3.0, 3.2)).collect();
    report("surface", started, surfaces.len());

    let short = Pass { end_m: pass.start_m + 1e-4, ..pass.clone() };
    let started = Instant::now();
    time::passes(&models, &short, &surfaces)?;
    report("fast, start of a pass", started, models.len());
    let started = Instant::now();
    time::passes(&models, &pass, &surfaces)?;
    report("fast, time step", started, models.len() * pass.steps());
    let started = Instant::now();
    time::pass(&models[0], &pass, &surfaces[0])?;
    report("plain, time step", started, pass.steps());
    Ok(())
}

/// The paper's Table D1 at a point of the unit cube.
fn parameters(point: &[f64]) -> ParameterSet {
    let axes = Parameter::ALL.iter().zip(point);
    axes.fold(ParameterSet::nominal(), |set, (&parameter, x)| {
        let [low, high] = parameter.range();
        set.with(parameter, low + x * (high - low))
    })
}

fn report(what: &str, started: Instant, count: usize) {
    let each = started.elapsed().as_secs_f64() * 1e6 / count as f64;
    println!("{what:>24}: {each:10.3} us each of {count}");
}
