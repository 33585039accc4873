//! Expected powers against simulations in time.

use super::*;
use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_track::extension::ExtensionInstance;
use tracktwin_track::model::{Mesh, Roughness, Support};
use tracktwin_track::time::{Pass, passes};

const SPANS: usize = 24;

fn track(extension: Option<ExtensionInstance>) -> TrackModel {
    let design = TrackDesign::v_track();
    let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
    let extensions = extension.map(|extension| extension.build(&design, SPANS).unwrap());
    let mesh = Mesh::uniform(SPANS, 8, 8);
    TrackModel::build(&design, &mesh, &supports, &Vec::from_iter(extensions)).unwrap()
}

fn second_wheel(distance_m: f64) -> ExtensionInstance {
    ExtensionInstance::new("second_wheel").with("distance_m", distance_m)
}

/// Powers in third-octave bands over a stretch, mean of this number of passes.
fn powers(
    model: &TrackModel,
    centres_hz: &[f64],
    [start_m, end_m]: [f64; 2],
    surfaces: u64,
) -> Vec<f64> {
    let pass = Pass { speed_m_s: 2.8, start_m, end_m, time_step_s: 2e-5, local_flexibility: true };
    let surfaces: Vec<_> =
        (1..=surfaces).map(|seed| model.surface(&Roughness::new(1.0), seed)).collect();
    let records = passes(&vec![model.clone(); surfaces.len()], &pass, &surfaces).unwrap();
    let mut powers = vec![0.0; centres_hz.len()];
    for record in records {
        // What rings after the start is left out.
        let values = &record.acceleration_m_s2[5000..];
        let in_bands = band_powers(values, pass.time_step_s, centres_hz);
        for (power, in_band) in powers.iter_mut().zip(in_bands) {
            *power += in_band;
        }
    }
    powers
}

/// Powers in third-octave bands of samples under a Hann window.
fn band_powers(values: &[f64], time_step_s: f64, centres_hz: &[f64]) -> Vec<f64> {
    let turn = |index: usize| TAU * index as f64 / values.len() as f64;
    let mut spectrum: Vec<Complex64> = values
        .iter()
        .enumerate()
        .map(|(index, value)| Complex64::from(value * (1.0 - turn(index).cos())))
        .collect();
    tracktwin_fourier::forward(spectrum.len()).process(&mut spectrum);
    let hz = |line: usize| line as f64 / (values.len() as f64 * time_step_s);
    let inside = |centre: f64, line: usize| (hz(line) / centre).log2().abs() < 1.0 / 6.0;
    let power = |&centre: &f64| {
        let lines = (1..values.len() / 2).filter(|&line| inside(centre, line));
        lines.map(|line| spectrum[line].norm_sqr()).sum()
    };
    centres_hz.iter().map(power).collect()
}

/// Centres of bands of a third of an octave.
fn thirds_hz(first_hz: f64, count: i32) -> Vec<f64> {
    (0..count).map(|k| first_hz * 2_f64.powf(f64::from(k) / 3.0)).collect()
}

/// By how much powers in bands over some nodes are expected to differ, in dB, with the window
/// that a spectrum of the stretch has.
fn expected_db(models: [TrackModel; 2], centres_hz: &[f64], seen: Range<usize>) -> Vec<f64> {
    let lines_hz: Vec<f64> = centres_hz
        .iter()
        .flat_map(|hz| (0..8).map(move |k| hz * 2_f64.powf((f64::from(k) - 3.5) / 24.0)))
        .collect();
    let [alone, with] = models.map(|model| Transfer::new(model, &lines_hz, None).power);
    let turn = |index: usize| TAU * (index as f64 + 0.5) / seen.len() as f64;
    let share = |index: usize| (1.0 - turn(index).cos()).powi(2);
    let of_line = |line: &Vec<f64>| -> f64 {
        line[seen.clone()].iter().enumerate().map(|(index, power)| share(index) * power).sum()
    };
    let sum = |power: &[Vec<f64>]| -> f64 { power.iter().map(of_line).sum() };
    let bands = with.chunks(8).zip(alone.chunks(8));
    bands.map(|(with, alone)| 10.0 * (sum(with) / sum(alone)).log10()).collect()
}

fn ratios_db(with: Vec<f64>, alone: Vec<f64>) -> Vec<f64> {
    with.into_iter().zip(alone).map(|(with, alone)| 10.0 * (with / alone).log10()).collect()
}

fn rms_difference(one: &[f64], other: &[f64]) -> f64 {
    let square = |(one, other): (&f64, &f64)| (one - other).powi(2);
    (one.iter().zip(other).map(square).sum::<f64>() / one.len() as f64).sqrt()
}

#[test]
fn a_second_wheel_changes_the_power_as_in_time() {
    let centres_hz = thirds_hz(250.0, 10);
    let [alone, with] = [None, Some(second_wheel(0.3))].map(track);
    let in_time = |model| powers(model, &centres_hz, [0.5, 2.0], 8);
    let in_time = ratios_db(in_time(&with), in_time(&alone));
    let expected = expected_db([alone, with], &centres_hz, 6 * 8..16 * 8);
    assert!(expected.iter().any(|change| change.abs() > 6.0), "{expected:?}");
    // Eight surfaces leave some tenths of a decibel to chance in each band.
    assert!(rms_difference(&in_time, &expected) < 0.5, "{in_time:?} {expected:?}");
}

#[test]
fn a_squat_under_the_other_wheel_is_felt_as_in_time() {
    let centres_hz = thirds_hz(500.0, 6);
    let mut design = TrackDesign::v_track();
    let spacing_m = design.sleeper.spacing_m;
    design.wheel.further_wheels_m = vec![2.0 * spacing_m];
    let section = Section::new(design.clone(), 6, 0.0);
    let supports = vec![Support::from(&ParameterSet::nominal()); section.spans() - 1];
    let middle_m = section.model_x_m(section.x_m(4));
    let squat = ExtensionInstance::new("squat").at([middle_m, middle_m]).with("length_m", 1.2e-2);
    let squat = squat.with("depth_m", 2e-5).build(&design, section.spans()).unwrap();
    let model = TrackModel::build(&design, &section.mesh(), &supports, &[squat]).unwrap();

    let [under_other, under_first] = [2, 4].map(|sleeper| section.x_m(sleeper));
    let in_time = |x_m: f64| {
        let middle_m = section.model_x_m(x_m);
        let speed_m_s = 2.8;
        let pass = Pass {
            speed_m_s,
            start_m: middle_m - 0.4,
            end_m: middle_m + spacing_m,
            time_step_s: 2e-5,
            local_flexibility: true,
        };
        let surface = model.surface(&Roughness::new(1e-9), 1);
        let record = passes(std::slice::from_ref(&model), &pass, &[surface]).unwrap().remove(0);
        let sample = |x_m: f64| ((x_m - pass.start_m) / speed_m_s / pass.time_step_s) as usize;
        let values = &record.acceleration_m_s2
            [sample(middle_m - 0.5 * spacing_m)..sample(middle_m + 0.5 * spacing_m)];
        band_powers(values, pass.time_step_s, &centres_hz)
    };
    let in_time = ratios_db(in_time(under_other), in_time(under_first));

    let lines_hz: Vec<f64> = centres_hz
        .iter()
        .flat_map(|hz| (0..8).map(move |k| hz * 2_f64.powf((f64::from(k) - 3.5) / 24.0)))
        .collect();
    let transfer =
        Transfer::new(model.clone(), &lines_hz, None).with_shapes(&section, &WheelTurns::default());
    let (_, elsewhere) = &transfer.rail_elsewhere[0];
    let power = |line: usize, sleeper: usize, shape: &Shape, share: f64| {
        let density = shape.density(sleeper, 2.8, lines_hz[line]);
        share * transfer.power[line][section.seat_node(sleeper)] * density
    };
    let expected = centres_hz.iter().enumerate().map(|(band, _)| {
        let sum = |of: &dyn Fn(usize) -> f64| (8 * band..8 * band + 8).map(of).sum::<f64>();
        let other = sum(&|line| {
            let share = transfer.further_wheels().share(0, line, section.seat_node(2));
            power(line, 2, elsewhere, share)
        });
        let own = sum(&|line| {
            let share = transfer.further_wheels().own_share(line, section.seat_node(4));
            power(line, 4, &transfer.rail[0], share)
        });
        10.0 * (other / own).log10()
    });
    let expected: Vec<f64> = expected.collect();
    // One event each, of which the blow is followed by the ringing of the track.
    assert!(rms_difference(&in_time, &expected) < 3.0, "{in_time:?} {expected:?}");
}

#[test]
fn a_gap_that_closes_under_a_near_wheel_changes_the_power_as_in_time() {
    let centres_hz = thirds_hz(315.0, 6);
    let gap =
        |gap_m: f64| Some(ExtensionInstance::new("hanging_sleeper").on([11]).with("gap_m", gap_m));
    let [alone, closing, open] = [None, gap(1.6e-4), gap(4e-3)].map(track);
    let in_time = |model| powers(model, &centres_hz, [0.92, 1.8], 3);
    let in_time = ratios_db(in_time(&closing), in_time(&alone));
    let [closing, open] =
        [closing, open].map(|with| expected_db([alone.clone(), with], &centres_hz, 77..116));
    // Three passes over six spans, in which the ballast is struck twice.
    assert!(rms_difference(&in_time, &open) > 5.0, "{in_time:?} {open:?}");
    assert!(rms_difference(&in_time, &closing) < 1.5, "{in_time:?} {closing:?}");
}

#[test]
fn a_wheel_beyond_the_rail_changes_nothing() {
    let lines_hz = [500.0, 2000.0];
    let [alone, with] =
        [None, Some(second_wheel(10.0))].map(|e| Transfer::new(track(e), &lines_hz, None).power);
    assert_eq!(alone, with);
}
