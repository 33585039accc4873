//! A kind of physics is defined in one place. Its definition alone adds it to both solvers, the simulated
//! recordings, the diagnosis, the text of its page and the blind trial.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::sync::Once;
use system_tests::{RAIL_ABSORBER, run};
use tracktwin_diagnosis::{Section, candidates};
use tracktwin_parameters::{ParameterSet, TrackDesign};
use tracktwin_track::extension::{ExtensionInstance, Kind};
use tracktwin_track::frequency::{ReceptancePoint, receptance};
use tracktwin_track::model::{Mesh, Support, Surface, TrackModel};
use tracktwin_track::time::{self, Pass};
use tracktwin_trial::{Class, plan};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-with-made-up-kind");
const NAME: &str = "rail_absorber";
const SPANS: usize = 12;
const PLACE_M: f64 = 0.75;

/// Adds the kind to the catalogue of this process.
fn add() {
    static ADDED: Once = Once::new();
    ADDED.call_once(|| Kind::add(&RAIL_ABSORBER).unwrap());
}

/// A track model with or without an extension of this kind.
fn track(has_it: bool) -> TrackModel {
    let design = TrackDesign::v_track();
    let instance = ExtensionInstance::new(NAME).at([PLACE_M, PLACE_M]);
    let with_values = RAIL_ABSORBER
        .parameters
        .iter()
        .fold(instance, |instance, it| instance.with(it.name, it.typical));
    let extensions: Vec<_> =
        has_it.then(|| with_values.build(&design, SPANS).unwrap()).into_iter().collect();
    let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
    TrackModel::build(&design, &Mesh::uniform(SPANS, 4, 4), &supports, &extensions).unwrap()
}

#[test]
fn both_domains_have_it() {
    add();
    let [without, with] = [track(false), track(true)];
    let at = ReceptancePoint::Rail(PLACE_M);
    let direct = |model| receptance(model, at, at, &[900.0]).unwrap()[0];
    let change = (direct(&with) - direct(&without)).norm() / direct(&without).norm();
    assert!(change > 0.05, "{change}");

    let pass = Pass {
        speed_m_s: 13.0 / 3.6,
        start_m: 0.5,
        end_m: 0.95,
        time_step_s: 1e-5,
        local_flexibility: true,
    };
    let surface = [Surface::rough(1, 3.0, 1.5)];
    let acceleration =
        |model| time::passes(&[model], &pass, &surface).unwrap().remove(0).acceleration_m_s2;
    let [without, with] = [acceleration(without), acceleration(with)];
    let power = |values: &[f64]| values.iter().map(|it| it * it).sum::<f64>();
    let difference: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
    assert!(power(&difference) > 1e-3 * power(&without));
}

#[test]
fn it_is_a_candidate_at_every_point_that_its_screening_names() {
    add();
    let sleepers = 9;
    let section = Section::new(TrackDesign::v_track(), sleepers, 1.0);
    let all = candidates(&section);
    let of_it = all.iter().filter(|candidate| candidate.kind.physics == NAME);
    assert_eq!(of_it.count(), 2 * sleepers - 1);
}

#[test]
fn a_trial_draws_it_as_known_instead_of_unknown() {
    add();
    let plans: Vec<_> = (0..40).map(|number| plan(1, number)).collect();
    let classes = plans.iter().filter_map(|plan| {
        let hides_it = plan.scene.left_out.iter().any(|hidden| hidden.physics() == NAME);
        hides_it.then_some(plan.class)
    });
    let classes: Vec<_> = classes.collect();
    let is_known = |class: &Class| matches!(class, Class::Single | Class::Double);
    assert!(!classes.is_empty() && classes.iter().all(is_known), "{classes:?}");
}

#[test]
fn the_program_lists_it_simulates_it_and_names_it_in_a_diagnosis() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let [recording, out] = ["recording", "out"].map(path);
    let list = run(PROGRAM, &["simulate", "--extend", "list"]).succeeded();
    assert!(list.contains(RAIL_ABSORBER.summary), "{list}");

    let absorber = format!("{NAME}@1.5m:mass_kg=1.2,frequency_Hz=900,damping_ratio=0.05");
    let arguments = ["simulate", "--seed", "3", "--extend", &absorber];
    let speeds = ["--speed", "13", "--speed", "10", "--out", &recording];
    run(PROGRAM, &[&arguments[..], &speeds].concat()).succeeded();

    // Nothing else is asked for: that takes a third of the time.
    let others = Kind::all().map(|kind| kind.physics).filter(|physics| *physics != NAME);
    let without: Vec<&str> = others.flat_map(|physics| ["--without", physics]).collect();
    let answer = run(PROGRAM, &[&["diagnose", &recording, "--out", &out], &without[..]].concat());
    assert_eq!(answer.code, Some(1), "{}", answer.err);
    assert!(answer.out.contains(RAIL_ABSORBER.summary), "{}", answer.out);
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    for words in ["rail absorber", RAIL_ABSORBER.summary, "mass of the absorber"] {
        assert!(page.contains(words), "not on the page: {words}");
    }
}
