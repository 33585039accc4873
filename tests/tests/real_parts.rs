//! Kinds of the catalogue beside measured wheels and railpads of others.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::path::{Path, PathBuf};
use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_track::extension::ExtensionInstance;
use tracktwin_track::frequency::{ReceptancePoint, receptance};
use tracktwin_track::model::{Mesh, Support, TrackModel};

/// Radius of the measured wheel, whose circumference is 2.88 m.
const RADIUS_M: f64 = 0.4585;

/// Rows of numbers in a text file; commas inside a number are decimal.
fn rows(path: &Path) -> Vec<Vec<f64>> {
    let bytes = std::fs::read(path).unwrap();
    let text: String = bytes.into_iter().map(char::from).collect();
    let row = |line: &str| -> Option<Vec<f64>> {
        let fields = line.trim().split('\t').map(|field| field.replace(',', ".").parse().ok());
        fields.collect()
    };
    text.lines().filter_map(row).collect()
}

/// Depth in m of a measured flat by distance in m from its deepest point, 60 mm on either side.
fn measured_flat(path: &Path) -> Vec<[f64; 2]> {
    let mut depth_m: Vec<f64> = rows(path).iter().map(|row| -1e-6 * row[1]).collect();
    let mut sorted = depth_m.clone();
    sorted.sort_by(f64::total_cmp);
    let tread = sorted[sorted.len() / 2];
    let deepest = (0..depth_m.len()).max_by(|&a, &b| depth_m[a].total_cmp(&depth_m[b])).unwrap();
    let (count, middle) = (depth_m.len(), depth_m.len() / 2);
    depth_m.rotate_right((middle + count - deepest) % count);
    (0..=120).map(|at| [1e-3 * (at as f64 - 60.0), depth_m[middle - 60 + at] - tread]).collect()
}

/// Share of the mean square of a measured flat that the best `wheel_flat` leaves, with its depth factor.
fn left_by_flat(measured: &[[f64; 2]], depth_factors: &[f64]) -> (f64, f64) {
    let mut design = TrackDesign::v_track();
    design.wheel.radius_m = RADIUS_M;
    let all: f64 = measured.iter().map(|[_, depth_m]| depth_m * depth_m).sum();
    let mut best = (f64::INFINITY, 1.0);
    for (length_mm, &factor) in
        (8..90).step_by(2).flat_map(|l| depth_factors.iter().map(move |f| (l, f)))
    {
        let flat =
            ExtensionInstance::new("wheel_flat").with("length_m", 1e-3 * f64::from(length_mm));
        let flat = flat.with("depth_factor", factor).build(&design, 2).unwrap();
        for middle_mm in -6..=6 {
            let middle_m = 1e-3 * f64::from(middle_mm);
            let left = |[x_m, depth_m]: &[f64; 2]| {
                (depth_m - flat.wheel_profile_m(x_m - middle_m)).powi(2)
            };
            let left = measured.iter().map(left).sum::<f64>() / all;
            if left < best.0 {
                best = (left, factor);
            }
        }
    }
    best
}

fn flat(folder: &str, file: &str) -> Option<PathBuf> {
    Some(test_needs::shared_data()?.join("real/wheel-flat-profiles").join(folder).join(file))
}

#[test]
fn measured_flats_are_a_worn_flat_of_its_own_depth() {
    let factors: Vec<f64> = (0..25).map(|step| 0.5 * 1.125_f64.powi(step)).collect();
    // Two flats that the law of a worn one describes within a quarter, and a pit.
    for (folder, file, from, to) in [
        ("0.4", "flat_0p4_05.dat", 1.2, 2.0),
        ("0.6", "flat_0p6_07.dat", 1.0, 1.5),
        ("0.2", "flat_0p3_03.dat", 4.5, 7.0),
    ] {
        let Some(path) = flat(folder, file) else { return };
        let measured = measured_flat(&path);
        let (left, factor) = left_by_flat(&measured, &factors);
        assert!(left < 0.02, "{file}: {left} at {factor}");
        assert!((from..to).contains(&factor), "{file}: {factor}");
    }
    let Some(pit) = flat("0.2", "flat_0p3_03.dat") else { return };
    let (left, _) = left_by_flat(&measured_flat(&pit), &[1.0]);
    assert!(left > 0.15, "without a depth of its own: {left}");
}

/// Loss factors at some frequencies in Hz of a railpad in a track, with the ratio of its damping to its
/// stiffness in s.
///
/// Only the railpad joins the rail seat to the rest of the track. Off the diagonal, the inverse of the
/// receptances of rail and seat is therefore its dynamic stiffness with the opposite sign.
fn loss_factors(pads: &ExtensionInstance, damping_s: f64, frequencies_hz: &[f64]) -> Vec<f64> {
    let (design, nominal) = (TrackDesign::v_track(), Support::from(&ParameterSet::nominal()));
    let railpad_damping = damping_s * nominal.railpad_stiffness;
    let supports = [Support { railpad_damping, ..nominal }; 5];
    let pads = pads.build(&design, 6).unwrap();
    let model = TrackModel::build(&design, &Mesh::uniform(6, 4, 4), &supports, &[pads]).unwrap();
    let (rail, seat) = (ReceptancePoint::Rail(0.375), ReceptancePoint::SleeperSeat(2));
    let of = |from, to| receptance(&model, from, to, frequencies_hz).unwrap();
    let (a, b, c) = (of(rail, rail), of(rail, seat), of(seat, seat));
    let stiffness = |k: usize| b[k] / (a[k] * c[k] - b[k] * b[k]);
    (0..frequencies_hz.len()).map(stiffness).map(|k| k.im / k.re).collect()
}

#[test]
fn two_branches_have_the_loss_factor_of_a_measured_railpad_and_one_has_not() {
    let Some(shared) = test_needs::shared_data() else { return };
    let measured = rows(&shared.join("real/railpad-dma-b91/EVA_tanD.csv"));
    let measured: Vec<_> = measured.iter().filter(|row| (30.0..3000.0).contains(&row[0])).collect();
    assert!(measured.len() > 15, "{}", measured.len());
    let frequencies_hz: Vec<f64> = measured.iter().map(|row| row[0]).collect();
    let error = |pads: &ExtensionInstance, damping_s| {
        let found = loss_factors(pads, damping_s, &frequencies_hz);
        let each = found.iter().zip(&measured).map(|(found, row)| (found / row[1] - 1.0).powi(2));
        (each.sum::<f64>() / measured.len() as f64).sqrt()
    };
    // Least squares of modulus and loss factor from 30 Hz to 3 kHz.
    let pads = ExtensionInstance::new("frequency_dependent_railpad");
    let one = pads.clone().with("stiffness_ratio", 0.41).with("relaxation_time_s", 7.9e-4);
    let two = pads.with("stiffness_ratio", 0.363).with("relaxation_time_s", 2e-4);
    let two = two.with("second_stiffness_ratio", 0.298).with("second_relaxation_time_s", 2.5e-3);
    let (one, two) = (error(&one, 1.6e-5), error(&two, 9e-6));
    assert!(two < 0.15 && one > 2.0 * two, "one branch: {one}, two: {two}");
}
