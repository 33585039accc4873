use super::*;
use crate::testing::{diagnosis, hypothesis};
use std::collections::BTreeMap;
use tracktwin_diagnosis::{BeforeAfter, Estimate, Levels, SleeperValues};

const SPACING_M: f64 = 0.125;

/// A layer under the sleepers SN18 and SN19 (2.375 and 2.5 m) and an absorber at 3.5 m, on a track whose sleepers
/// all differ.
fn plan() -> Plan {
    let mut scene = Scene::typical(1);
    for (number, sleeper) in scene.sleepers.iter_mut().enumerate() {
        sleeper.railpad_stiffness_n_m = 1e8 * f64::exp(0.2 * number as f64);
        sleeper.ballast_stiffness_n_m = 1e7 * f64::exp(-0.3 * number as f64);
    }
    scene.left_out = vec![
        Hidden::SubgradeLayer {
            sleepers: Some(vec![18, 19]),
            mass_kg: 1.0,
            stiffness_n_per_m: 3e7,
            damping_n_s_per_m: 1e3,
        },
        Hidden::RailAbsorber {
            x_m: [3.5, 3.5],
            mass_kg: 1.0,
            frequency_hz: 900.0,
            damping_ratio: 0.05,
        },
    ];
    Plan { number: 7, class: Class::Double, making: Making::Varied, scene }
}

fn said(physics: &str, x_m: Option<[f64; 2]>, probability: f64, accepted: bool) -> Hypothesis {
    Hypothesis { probability, accepted, ..hypothesis(physics, x_m) }
}

/// Stiffnesses of a sleeper that are too high by these logarithms, before and after.
fn sleeper(scene: &Scene, number: usize, railpad: [f64; 2], ballast: [f64; 2]) -> SleeperValues {
    let truth = scene.sleepers[number];
    let of = |truth: f64, [before, after]: [f64; 2]| {
        let estimate = |error: f64| Estimate { mean: truth * error.exp(), sd: 0.1 * truth };
        BeforeAfter { before: estimate(before), after: estimate(after) }
    };
    SleeperValues {
        id: format!("SN{number}"),
        x_m: (number + 1) as f64 * SPACING_M,
        railpad_stiffness: of(truth.railpad_stiffness_n_m, railpad),
        ballast_stiffness: of(truth.ballast_stiffness_n_m, ballast),
        irregularity_level: of(1.0, [0.0; 2]),
        flags: Vec::new(),
    }
}

/// Both effects are named at their places, beside two wrong ones that are not accepted.
fn right(plan: &Plan) -> Diagnosis {
    let hypotheses = vec![
        said("subgrade_layer", Some([2.375, 2.625]), 0.95, true),
        said(UNKNOWN, Some([3.375, 3.5]), 0.6, true),
        said("squat", Some([3.5; 2]), 0.1, false),
        said("subgrade_layer", None, 0.05, false),
    ];
    // Sleepers next to the effects reach from SN17 to SN20 and from SN26 to SN28.
    let near = [17, 18, 19, 20, 26, 27, 28];
    let track = (5..35).map(|number| {
        let is_near = near.contains(&number);
        let [railpad, ballast] = if is_near { [[0.3, -0.1], [-0.5, 0.1]] } else { [[5.0; 2]; 2] };
        sleeper(&plan.scene, number, railpad, ballast)
    });
    let mut right = diagnosis(Verdict::LeftOutPhysics, hypotheses);
    right.fit.held_out_gain_nats =
        BTreeMap::from([("10".to_owned(), 9.0), ("13".to_owned(), -2.0)]);
    Diagnosis { track: track.collect(), ..right }
}

fn scored(plan: &Plan, diagnosis: &Diagnosis) -> CaseScore {
    score(plan, diagnosis, &[Some(8.0), None], 60.0)
}

#[test]
fn names_places_and_probabilities_are_compared_with_the_truth() {
    let plan = plan();
    let it = scored(&plan, &right(&plan));
    assert_eq!((it.number, it.class, it.making), (7, Class::Double, Making::Varied));
    assert_eq!(it.accepted, ["subgrade_layer", UNKNOWN]);
    let [layer, absorber] = &it.hidden[..] else { panic!("{:?}", it.hidden) };
    assert_eq!((layer.physics.as_str(), layer.detectability), ("subgrade_layer", Some(8.0)));
    assert!(layer.first && layer.accepted && layer.in_set);
    assert!(!absorber.first && absorber.accepted && absorber.in_set);
    // The middle of two sleepers is half a spacing from that of the next two, and from the end.
    assert_eq!(layer.place, Some(Placed { error_spacings: Some(0.5) }));
    assert_eq!(absorber.place, Some(Placed { error_spacings: Some(0.5) }));
    // A layer everywhere is not a layer under two sleepers.
    assert_eq!(it.probabilities, [(0.95, true), (0.6, true), (0.1, false), (0.05, false)]);
    assert!(!it.wrong_member && it.is_right());
    assert_eq!(it.held_out_gain_nats, Some(7.0));
}

#[test]
fn a_wrong_place_or_an_improbable_name_is_wrong() {
    let plan = plan();
    let with = |change: &dyn Fn(&mut Diagnosis)| {
        let mut diagnosis = right(&plan);
        change(&mut diagnosis);
        scored(&plan, &diagnosis)
    };
    let location = |it: &Diagnosis, hypothesis: usize| it.hypotheses[hypothesis].location.clone();
    // The other effect is 1.0 m away.
    let swapped = with(&|it| {
        it.hypotheses[0].location = location(it, 1);
        it.hypotheses.remove(1);
    });
    assert!(swapped.wrong_member && !swapped.probabilities[0].1 && !swapped.is_right());
    assert_eq!(swapped.hidden[0].place, Some(Placed { error_spacings: Some(8.0) }));
    let beside = with(&|it| it.hypotheses[0].location.as_mut().unwrap().x_m = [2.6875; 2]);
    assert_eq!(beside.hidden[0].place, Some(Placed { error_spacings: Some(2.0) }));
    assert!(beside.hidden[0].accepted && !beside.is_right());
    // Accepted everywhere, it has no place. The absorber is the nearest.
    let everywhere = with(&|it| it.hypotheses[0].location = None);
    assert!(everywhere.wrong_member && !everywhere.probabilities[0].1 && !everywhere.is_right());
    // 0.9 of the sum of 1.75 is 1.575: the first two have more.
    let improbable = with(&|it| {
        it.hypotheses[1].probability = 0.05;
        it.hypotheses[2].probability = 0.7;
        it.hypotheses.swap(1, 2);
    });
    assert!(improbable.hidden[0].in_set && !improbable.hidden[1].in_set);
    assert!(improbable.hidden[1].accepted);
    let consistent = with(&|it| {
        it.verdict = Verdict::Consistent;
        it.nothing_left_out = Some(0.8);
        it.hypotheses.clear();
    });
    assert_eq!(consistent.probabilities, [(0.8, false)]);
    assert_eq!(consistent.hidden[0].place, Some(Placed { error_spacings: None }));
}

#[test]
fn stiffnesses_are_compared_with_those_of_the_same_sleeper_next_to_an_effect() {
    let plan = plan();
    let bias = scored(&plan, &right(&plan)).bias.unwrap();
    assert!((bias.before - 0.4).abs() < 1e-9 && (bias.after - 0.1).abs() < 1e-9, "{bias:?}");
    // Shifted by a sleeper, the truths differ by 0.2 and 0.3.
    let mut shifted = right(&plan);
    shifted.track.iter_mut().for_each(|sleeper| sleeper.x_m -= SPACING_M);
    let bias = scored(&plan, &shifted).bias.unwrap();
    assert!(bias.after > 0.2, "{bias:?}");
    let control = Plan { scene: Scene::typical(1), class: Class::Control, ..plan };
    assert_eq!(scored(&control, &diagnosis(Verdict::Consistent, Vec::new())).bias, None);
}

#[test]
fn a_baseline_looks_well_inside_the_ranges_and_the_random_variation() {
    let plan = plan();
    let well = |measured_db: Vec<Vec<Vec<f64>>>, railpad: f64| {
        let mut it = diagnosis(Verdict::Consistent, Vec::new());
        it.track = vec![sleeper(&Scene::typical(1), 10, [railpad.ln(), 0.0], [0.0; 2])];
        let before_db = vec![vec![vec![50.0, 60.0]; 2]; 2];
        let scatter_db = vec![vec![Some(1.0), None], vec![Some(2.0), Some(1.0)]];
        it.levels = Levels { measured_db, before_db, scatter_db, ..Levels::default() };
        let it = scored(&plan, &it);
        (it.cells_inside, it.parameters_inside)
    };
    // Two speeds, two sleepers, two bands. The second band of the first speed is not compared.
    let usual = vec![vec![vec![50.0, 90.0], vec![53.4, 60.0]], vec![vec![56.9, 63.4]; 2]];
    assert_eq!(well(usual.clone(), 1.0), (true, true));
    assert_eq!(well(usual.clone(), 0.01), (true, false));
    for (speed, sleeper, band, db) in [(0, 1, 0, 46.4), (1, 0, 0, 57.1), (1, 1, 1, 63.6)] {
        let mut unusual = usual.clone();
        unusual[speed][sleeper][band] = db;
        assert_eq!(well(unusual, 1.0), (false, true), "{speed} {sleeper} {band}");
    }
}

#[test]
fn a_fault_of_the_measuring_chain_must_be_named_to_be_right() {
    let scene = Scene { left_out: vec![Hidden::Clipping { limit_m_s2: 9.0 }], ..plan().scene };
    let plan = Plan { class: Class::Artefact, scene, ..plan() };
    let is_right = |verdict, names: &[&str]| {
        let all = names.iter().map(|physics| said(physics, None, 0.6, true));
        score(&plan, &diagnosis(verdict, all.collect()), &[None], 60.0).is_right()
    };
    assert!(is_right(Verdict::MeasurementChain, &["clipping"]));
    assert!(!is_right(Verdict::MeasurementChain, &["gain_error"]));
    assert!(!is_right(Verdict::MeasurementChain, &["clipping", "gain_error"]));
    assert!(!is_right(Verdict::LeftOutPhysics, &["clipping"]));
    assert!(!is_right(Verdict::Consistent, &[]));
}
