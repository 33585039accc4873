use super::*;
use crate::scheme::STEP_S;
use crate::seat::testing::seat;
use std::f64::consts::PI;
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::SleeperTruth;

fn scene(preset: Preset, spans: usize) -> Scene {
    let sleeper = SleeperTruth {
        railpad_stiffness_n_m: 1.5e8,
        ballast_stiffness_n_m: 1.2e7,
        sleeper_ei_n_m2: 5000.0,
    };
    Scene { preset, ..Scene::uniform(spans, sleeper) }
}

/// An even track whose seats are all like `base`, with `cells` in a span.
fn with_cells(preset: Preset, spans: usize, base: &Seat, cells: Option<usize>) -> Track {
    let scene = scene(preset, spans);
    let (design, mut scale) = (scene.design(), Scale::of(&scene));
    scale.cells = cells.unwrap_or(scale.cells);
    let spacing_m = scale.spacing_m;
    let at =
        |index: usize| Seat { x_m: (index as f64 - BEYOND as f64) * spacing_m, ..base.clone() };
    let seats: Vec<Seat> = (0..spans + 1 + 2 * BEYOND).map(at).collect();
    Track::new(&scene, &design, &scale, &Layout::new(&design.sleeper, 1.0), &seats)
}

fn even(preset: Preset, spans: usize, base: &Seat) -> Track {
    with_cells(preset, spans, base, None)
}

/// Railpad and ballast of the reference levels of a line.
fn line_seat() -> Seat {
    Seat { pad: [1.5e8, 2.5e4], ballast: [7e7, 6e4], ei: 6.1e6, ..seat() }
}

/// Deflection in m/N of a beam on Winkler's foundation under a force, the beam shears too: Fourier integral in
/// closed form.
fn winkler(design: &TrackDesign, foundation: f64) -> f64 {
    let ei = design.rail.bending_stiffness();
    let shear = ei / design.rail.shear_stiffness();
    let root = (foundation * shear + 2.0 * (ei * foundation).sqrt()).sqrt();
    1.0 / (2.0 * root) * (foundation.powf(-0.5) + shear * ei.powf(-0.5))
}

#[test]
fn the_deflection_at_rest_is_that_of_a_beam_on_an_elastic_foundation() {
    // Supports so soft that they act as one foundation, under stiff sleepers.
    let rig = Seat { ballast: [1.2e6, 90.0], ei: 5e7, ..seat() };
    let line = Seat { ballast: [3e6, 90.0], ei: 6e10, ..line_seat() };
    for (preset, base) in [(Preset::VTrack, rig), (Preset::Concrete60E1, line)] {
        let design = preset.design();
        let spacing_m = design.sleeper.spacing_m;
        let mut track = even(preset, 80, &base);
        let place = track.place(40.0 * spacing_m);
        let deflection = track.rest_under(&[place], 4500.0)[0];
        let foundation = 1.0 / (1.0 / base.ballast[0] + 1.0 / base.pad[0]) / spacing_m;
        let closed = 4500.0 * winkler(&design, foundation);
        assert!((deflection / closed - 1.0).abs() < 0.01, "{deflection} and {closed}");
    }
}

/// Displacement and acceleration of the rail at `x_m` after a blow of one step there.
fn ring(track: &mut Track, x_m: f64, steps: usize) -> [Vec<f64>; 2] {
    let place = track.place(x_m);
    let mut heard = [Vec::with_capacity(steps), Vec::with_capacity(steps)];
    for step in 0..steps {
        track.begin(&[place]);
        track.end(&[place], &[if step == 0 { 1000.0 } else { 0.0 }]);
        heard[0].push(place.of(|row| track.rail.motion.displacement[row]));
        heard[1].push(place.of(|row| track.rail.motion.acceleration[row]));
    }
    heard
}

/// Real and imaginary part at a frequency in Hz.
fn transform(heard: &[f64], frequency_hz: f64) -> [f64; 2] {
    let turn = TAU * frequency_hz * STEP_S;
    let (mut re, mut im) = (0.0, 0.0);
    for (step, value) in heard.iter().enumerate() {
        re += value * (turn * step as f64).cos();
        im += value * (turn * step as f64).sin();
    }
    [re, im]
}

fn power(heard: &[f64], frequency_hz: f64) -> f64 {
    let [re, im] = transform(heard, frequency_hz);
    re * re + im * im
}

/// Receptance in m/N after a blow of 0.01 N s.
fn receptance(heard: &[f64], frequency_hz: f64) -> f64 {
    power(heard, frequency_hz).sqrt() * STEP_S / 0.01
}

#[test]
fn the_pinned_pinned_resonance_is_that_of_a_timoshenko_beam() {
    let rig = Seat { pad: [6e8, 100.0], ..seat() };
    let line = Seat { pad: [2e9, 2e3], ..line_seat() };
    for (preset, base, range_hz, known_hz) in [
        (Preset::VTrack, rig, 4000..9000, None),
        // The frequency that every textbook has for 60E1 at 0.6 m.
        (Preset::Concrete60E1, line, 900..1300, Some(1067.0)),
    ] {
        let design = preset.design();
        let spacing_m = design.sleeper.spacing_m;
        let mut track = even(preset, 30, &base);
        let [_, heard] = ring(&mut track, 15.5 * spacing_m, 6000);
        let (_, found) = range_hz
            .step_by(2)
            .map(|hz| (power(&heard[100..], f64::from(hz)), f64::from(hz)))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        // A pinned beam of one span: the lower root of Timoshenko's equation.
        let rail = &design.rail;
        let wave = PI / spacing_m;
        let (ei, ga) = (rail.bending_stiffness(), rail.shear_stiffness());
        let (mass, inertia) = (rail.mass_per_length(), rail.rotary_inertia_per_length());
        let b = ei * mass * wave * wave + ga * (mass + inertia * wave * wave);
        let square = (b - (b * b - 4.0 * mass * inertia * ei * ga * wave.powi(4)).sqrt())
            / (2.0 * mass * inertia);
        let closed = square.sqrt() / TAU;
        assert!(known_hz.is_none_or(|known: f64| (closed / known - 1.0).abs() < 1e-3), "{closed}");
        // The scheme's period at the rig's frequency is a few per cent long.
        let tolerance = known_hz.map_or(0.05, |_| 0.01);
        assert!((found / closed - 1.0).abs() < tolerance, "{found} and {closed}");
    }
}

/// Receptance in m/N of a beam on an even foundation of pads, rigid masses and ballast: Fourier integral over
/// wave numbers.
fn on_two_layers(design: &TrackDesign, base: &Seat, frequency_hz: f64) -> f64 {
    use nalgebra::Complex;
    let omega = TAU * frequency_hz;
    let spring = |[stiffness, damping]: [f64; 2]| Complex::new(stiffness, omega * damping);
    let under = spring(base.ballast) - omega * omega * design.sleeper_mass();
    let pad = spring(base.pad);
    let foundation = pad * under / (pad + under) / design.sleeper.spacing_m;
    let rail = &design.rail;
    let inertia = omega * omega * rail.rotary_inertia_per_length();
    let translation = foundation - omega * omega * rail.mass_per_length();
    let (ei, ga) = (rail.bending_stiffness(), rail.shear_stiffness());
    let step = 0.01;
    let compliance = |index: u32| {
        let square = (step * (f64::from(index) + 0.5)).powi(2);
        let turning = ei * square + ga - inertia;
        // Without the local deflection, which no wave carries: that of shear alone at short waves.
        (translation + ga * square * (turning - ga) / turning).inv()
    };
    (0..20_000).map(compliance).sum::<Complex<f64>>().norm() * step / PI
}

#[test]
fn a_lines_receptance_has_its_resonances_where_masses_on_springs_have_them() {
    // Rigid sleepers: the track and the rail on its pads resonate like two layers of masses.
    let base = Seat { ei: 6e10, ..line_seat() };
    let design = Preset::Concrete60E1.design();
    // Above a sleeper the receptance is lower than on an even foundation, between two sleepers it is higher.
    let heard = [35.0, 35.5].map(|span| {
        let mut track = even(Preset::Concrete60E1, 70, &base);
        ring(&mut track, span * 0.6, 20_000)
    });
    for frequency_hz in [50.0, 80.0, 100.0, 130.0, 200.0, 300.0, 400.0, 500.0] {
        let [above, between] = [&heard[0][0], &heard[1][0]].map(|it| receptance(it, frequency_hz));
        let closed = on_two_layers(&design, &base, frequency_hz);
        let deviation_db = 10.0 * (above * between / closed / closed).log10();
        assert!(deviation_db.abs() < 0.5, "{frequency_hz} Hz: {deviation_db} dB of {closed}");
    }
}

#[test]
fn twice_as_many_cells_change_the_receptance_of_a_line_little() {
    let heard = [None, Some(32)].map(|cells| {
        let mut track = with_cells(Preset::Concrete60E1, 40, &line_seat(), cells);
        ring(&mut track, 20.5 * 0.6, 8000)
    });
    for frequency_hz in [60.0, 125.0, 250.0, 500.0, 800.0, 1100.0, 1600.0, 2500.0] {
        let [coarse, fine] = [&heard[0][0], &heard[1][0]].map(|it| receptance(it, frequency_hz));
        let change_db = 20.0 * (coarse / fine).log10();
        assert!(change_db.abs() < 0.3, "{frequency_hz} Hz: {change_db} dB");
    }
}

#[test]
fn a_force_does_not_reach_the_next_wheel_within_a_step() {
    let mut track = even(Preset::Concrete60E1, 30, &line_seat());
    let place = track.place(9.0);
    track.begin(&[place]);
    let at = |x_m: f64| {
        let place = track.place(x_m);
        place.of(|row| track.sides[row][1]).abs()
    };
    assert!(at(9.0 - 1.28) < 1e-8 * at(9.0), "{} and {}", at(9.0 - 1.28), at(9.0));
}
