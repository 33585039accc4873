//! Search on log powers from the forward model with known random variation: the search must find the added
//! extension, and nothing if none was added.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use nalgebra::{Cholesky, DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::sync::LazyLock;
use tracktwin_diagnosis::{
    Bands, Common, Evidence, Fixed, Forward, NullModel, PortPlace, PreparedRecording,
    SearchOutcome, Section, Uncovered, Verdict, candidates, search,
};
use tracktwin_inspection::Inspection;
use tracktwin_parameters::TrackDesign;
use tracktwin_signal::recording::{Recording, Sleeper};
use tracktwin_track::extension::ExtensionInstance;

const SLEEPERS: usize = 7;
const SPEEDS_KM_H: [f64; 2] = [7.0, 13.0];
const SIMULATIONS: usize = 40;

fn forward() -> Forward {
    let section = Section::new(TrackDesign::v_track(), SLEEPERS, 1.0);
    Forward::new(section, Bands::new(100.0, 3300.0), &SPEEDS_KM_H, vec![0.0; 2])
}

/// Standard normal numbers.
struct Normal(ChaCha8Rng);

impl Normal {
    fn next(&mut self) -> f64 {
        // Twelve uniform numbers: close enough to a Gaussian for scatter within three deviations.
        let mut uniform = || (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    /// Scatter of log powers that neighbouring bands share, 0.15 nats.
    fn scatter(&mut self, forward: &Forward) -> DVector<f64> {
        let bands = forward.bands.count();
        let covariance = DMatrix::from_fn(bands, bands, |i, j| {
            let distance = (i as f64 - j as f64) / 1.5;
            0.0225 * (-0.5 * distance * distance).exp() + if i == j { 1e-4 } else { 0.0 }
        });
        let factor = Cholesky::new(covariance).unwrap().l();
        let mut all = DVector::zeros(forward.count());
        for first in (0..forward.count()).step_by(bands) {
            let white = DVector::from_fn(bands, |_, _| self.next());
            all.rows_mut(first, bands).copy_from(&(&factor * white));
        }
        all
    }
}

/// Searches a recording of this track with an extension in it for all that the catalogue has.
fn searched(seed: u64, extension: Option<ExtensionInstance>) -> SearchOutcome {
    searched_for(seed, extension, |_| true)
}

/// The same for some kinds only.
fn searched_for(
    seed: u64,
    extension: Option<ExtensionInstance>,
    is_known: impl Fn(&str) -> bool,
) -> SearchOutcome {
    let (prepared, null) = recorded(seed, extension);
    search_for(&prepared, &null, is_known)
}

/// The log powers of this track as a prepared recording, with its null model.
fn recorded(seed: u64, extension: Option<ExtensionInstance>) -> (PreparedRecording, NullModel) {
    let values = forward().unknowns.typical();
    recorded_with(seed, extension, &values)
}

/// The same for a track with these values.
fn recorded_with(
    seed: u64,
    extension: Option<ExtensionInstance>,
    values: &DVector<f64>,
) -> (PreparedRecording, NullModel) {
    let forward = forward();
    let mut random = Normal(ChaCha8Rng::seed_from_u64(seed));
    let numbers: Vec<f64> =
        (0..SIMULATIONS).flat_map(|_| random.scatter(&forward).as_slice().to_vec()).collect();
    let null = NullModel::from_numbers(&forward, &numbers).unwrap();
    let section = &forward.section;
    let built = extension.map(|extension| {
        section.in_model(&extension).build(&section.track.design, section.spans()).unwrap()
    });
    let expected = forward.log_power(values, built.as_slice()).unwrap();
    let log_power = expected + random.scatter(&forward);
    let pass_variance = DVector::from_element(forward.per_sleeper(), 1e-3);
    let pass_numbers = vec![vec![0], vec![1]];
    let (without, detected_shapes_m) = (Vec::new(), Vec::new());
    let prepared = PreparedRecording {
        forward,
        log_power,
        pass_variance,
        first_sleeper: 0,
        pass_numbers,
        passes_repeat: false,
        uncovered: Uncovered::default(),
        without,
        detected_shapes_m,
    };
    (prepared, null)
}

fn search_for(
    prepared: &PreparedRecording,
    null: &NullModel,
    is_known: impl Fn(&str) -> bool,
) -> SearchOutcome {
    let mut all = candidates(&prepared.forward.section);
    all.retain(|candidate| is_known(candidate.kind.physics));
    let mut prepared = prepared.clone();
    if !is_known("corrugation") {
        prepared.without.push("corrugation".to_owned());
    }
    search(&prepared, null, prepared.forward.unknowns.typical(), &all, &|_, _| ()).unwrap()
}

fn layer() -> ExtensionInstance {
    ExtensionInstance::new("subgrade_layer")
        .on([3])
        .with("mass_kg", 2.0)
        .with("stiffness_N_per_m", 1e7)
        .with("damping_N_s_per_m", 5e2)
}

fn is_everywhere(physics: &str) -> bool {
    ["rail_cross_section", "frequency_dependent_railpad"].contains(&physics)
}

/// The recording of a bolt under the sleeper 3, and what the search for all kinds finds in it.
static BOLT: LazyLock<(PreparedRecording, SearchOutcome)> = LazyLock::new(|| {
    let bolt = ExtensionInstance::new("sleeper_bolt").on([3]).with("stiffness_N_per_m", 3e7);
    let (prepared, null) = recorded(1, Some(bolt));
    let found = search_for(&prepared, &null, |_| true);
    (prepared, found)
});

#[test]
fn a_bolt_under_one_sleeper_is_named_at_its_place_and_its_stiffness_found() {
    let (_, found) = &*BOLT;
    assert_eq!(found.accepted.len(), 1, "{:?}", found.rounds);
    assert_eq!(found.accepted[0].extension.physics, "sleeper_bolt");
    assert_eq!(found.accepted[0].extension.sleepers, Some(vec![3]));
    let stiffness = found.last.values[found.last.values.len() - 1].exp();
    // Two speeds and one scatter of 0.15 nats: a factor of two at most.
    assert!((1.5e7..6e7).contains(&stiffness), "{stiffness}");
    assert!(found.held_out[1] > found.held_out[0]);
}

#[test]
fn a_name_that_is_taken_back_leaves_something_unknown_of_its_family_at_its_place() {
    let (prepared, mut search) = BOLT.clone();
    assert_eq!(search.accepted.len(), 1, "{:?}", search.rounds);
    // As if more were left there than the name may leave.
    search.accepted.clear();
    search.last = search.baseline.clone();
    search.rounds.truncate(1);
    search.rounds[0].accepted = false;
    search.rounds[0].remainder = Some(20.0);
    let sleeper =
        |number: usize| Sleeper { id: format!("SN{number}"), x_m: 1.0 + 0.125 * number as f64 };
    let recording = Recording {
        name: "bolt".to_owned(),
        sample_rate_hz: 1e5,
        channel: String::new(),
        passes: Vec::new(),
        sleepers: (0..SLEEPERS).map(sleeper).collect(),
        nominal: serde_json::Map::new(),
        spacing_m: 0.125,
        doubts: Vec::new(),
    };
    let inspection = Inspection::default();
    let evidence = Evidence {
        recording: &recording,
        prepared: &prepared,
        inspection: &inspection,
        search: &search,
    };
    let diagnosis = evidence.conclude().unwrap();
    assert_eq!(diagnosis.verdict, Verdict::UnknownPhysics);
    let found = &diagnosis.hypotheses[0];
    assert!(found.accepted && found.physics == "unknown_physics", "{found:?}");
    assert_eq!(found.family.as_deref(), Some("fastening"));
    assert_eq!(found.location.as_ref().unwrap().sleepers, ["SN3"]);
    assert!(diagnosis.notes.iter().any(|note| note.contains("something similar")));
}

#[test]
fn where_nothing_is_left_out_nothing_is_named() {
    for seed in 2..4 {
        let found = searched(seed, None);
        assert!(found.accepted.is_empty(), "{:?}", found.rounds);
    }
}

#[test]
fn a_layer_that_the_catalogue_lacks_is_something_unknown_under_its_sleeper() {
    let found = searched_for(1, Some(layer()), is_everywhere);
    assert!(found.accepted.is_empty(), "{:?}", found.accepted);
    let port = found.rounds[0].port.as_ref().unwrap();
    assert_eq!(port.place, PortPlace::Seats(vec![3]), "{}", port.log_evidence);
    let first = &found.rounds[0];
    assert!(first.unknown_is_predictive(), "{:?}", first.unknown_gain);
}

#[test]
fn something_unknown_that_only_one_speed_hears_strays() {
    let ((mut prepared, null), (plain, _)) = (recorded(1, Some(layer())), recorded(1, None));
    let bands = prepared.forward.bands.count();
    for row in (0..prepared.forward.count()).filter(|row| row / bands % 2 == 1) {
        prepared.log_power[row] = plain.log_power[row];
    }
    let found = search_for(&prepared, &null, is_everywhere);
    assert!(found.accepted.is_empty(), "{:?}", found.accepted);
    let first = &found.rounds[0];
    assert!(first.p_value < 1e-3, "{}", first.p_value);
    assert!(!first.unknown_is_predictive(), "{:?}", first.unknown_gain);
}

#[test]
fn speeds_that_passed_other_tracks_are_told_and_nothing_is_named_on_them() {
    let (mut prepared, null) = recorded(1, None);
    let together = search_for(&prepared, &null, is_everywhere);
    assert!(!together.speeds_disagree(), "{}", together.speed_disagreement);

    let forward = &prepared.forward;
    let (typical, bands) = (forward.unknowns.typical(), forward.bands.count());
    let mut random = Normal(ChaCha8Rng::seed_from_u64(9));
    let mut other = typical.clone();
    for index in forward.unknowns.ballast().chain(forward.unknowns.railpad()) {
        other[index] += 0.7 * random.next();
    }
    let plain = forward.log_power(&typical, &[]).unwrap();
    let change = forward.log_power(&other, &[]).unwrap() - plain;
    for row in (0..prepared.forward.count()).filter(|row| row / bands % 2 == 1) {
        prepared.log_power[row] += change[row];
    }
    let apart = search_for(&prepared, &null, is_everywhere);
    assert!(apart.speeds_disagree(), "{}", apart.speed_disagreement);
    assert!(apart.accepted.is_empty(), "{:?}", apart.accepted);
}

#[test]
fn an_axle_box_that_the_catalogue_lacks_is_something_unknown_at_the_wheel() {
    let axle_box = ExtensionInstance::new("flexible_axle_box")
        .with("mass_kg", 2.0)
        .with("stiffness_N_per_m", 9e8)
        .with("damping_N_s_per_m", 2e4);
    let supports = ["sleeper_bolt", "subgrade_layer", "hanging_sleeper", "missing_railpad"];
    let found = searched_for(5, Some(axle_box), |physics| supports.contains(&physics));
    assert!(found.accepted.is_empty(), "{:?}", found.accepted);
    let port = found.rounds[0].port.as_ref().unwrap();
    assert_eq!(port.place, PortPlace::Wheel, "{}", port.log_evidence);
}

#[test]
fn waves_of_one_length_that_no_pass_suggested_are_named_where_they_are() {
    let waves = ExtensionInstance::new("corrugation").at([1.2, 1.6]);
    let waves = waves.with("wavelength_m", 8e-3).with("amplitude_m", 4e-6);
    let found =
        searched_for(4, Some(waves), |physics| ["sleeper_bolt", "corrugation"].contains(&physics));
    let [named] = &found.accepted[..] else { panic!("{:?}", found.patch) };
    assert_eq!(named.kind.physics, "corrugation");
    let [from_m, to_m] = named.extension.x_m.unwrap();
    assert!((0.9..1.35).contains(&from_m) && (1.5..1.85).contains(&to_m), "{from_m} {to_m}");
    let length_m = found.last.values[found.last.values.len() - 2].exp();
    assert!((length_m / 8e-3 - 1.0).abs() < 0.1, "{length_m}");
}

#[test]
fn waves_that_may_not_be_named_are_a_patch_of_their_wavelength() {
    let waves = ExtensionInstance::new("corrugation").at([1.2, 1.6]);
    let waves = waves.with("wavelength_m", 8e-3).with("amplitude_m", 4e-6);
    let (prepared, null) = recorded(4, Some(waves));
    let found = search_for(&prepared, &null, |physics| physics == "sleeper_bolt");
    let (patch, p_value) = found.patch.unwrap();
    assert!(p_value < 0.01 && patch.height > 0.5, "{patch:?} {p_value}");
    let Fixed::Wavelength(length_m) = patch.fixed else { panic!("{patch:?}") };
    assert!((length_m / 8e-3 - 1.0).abs() < 0.1, "{length_m}");
}

#[test]
fn bolts_under_a_run_of_sleepers_are_named_under_that_run() {
    let bolts = ExtensionInstance::new("sleeper_bolt").on([1, 2, 3, 4]);
    let found = searched_for(6, Some(bolts.with("stiffness_N_per_m", 3e7)), |physics| {
        ["sleeper_bolt", "subgrade_layer"].contains(&physics)
    });
    let named = &found.accepted[0];
    assert_eq!(named.kind.physics, "sleeper_bolt");
    let sleepers = named.extension.sleepers.clone().unwrap();
    assert!(sleepers.len() >= 3 && sleepers.iter().all(|it| (1..=4).contains(it)), "{sleepers:?}");
}

#[test]
fn bolts_under_all_sleepers_are_as_stiff_as_they_are_and_so_are_soft_sleepers() {
    let bolts = ExtensionInstance::new("sleeper_bolt").with("stiffness_N_per_m", 3e7);
    let unknowns = forward().unknowns;
    let bending = unknowns.common(Common::SleeperBendingStiffness);
    let mut values = unknowns.typical();
    values[bending] -= 0.75;
    let (prepared, null) = recorded_with(3, Some(bolts), &values);
    let found = search_for(&prepared, &null, |_| true);
    assert_eq!(found.accepted.len(), 1, "{:?}", found.rounds);
    assert_eq!(found.accepted[0].extension.physics, "sleeper_bolt");
    // The other minimum has stiffer sleepers on bolts of a third.
    let stiffness = found.last.values[found.last.values.len() - 1].exp();
    assert!((2e7..4.5e7).contains(&stiffness), "{stiffness}");
    assert!((found.last.values[bending] - values[bending]).abs() < 0.2);
}
