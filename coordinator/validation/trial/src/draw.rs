//! Hidden physics of a trial's cases, drawn from the seed alone.
//!
//! Owns shares of classes, places and strengths; what a track looks like is the truth simulator's.

use crate::class::Class;
use crate::effect::{self, Draw};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::Distribution;
use rand_distr::uniform::Uniform;
use tracktwin_reference_simulator::Scene;

/// A case of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Number in the trial, from 0.
    pub number: u32,
    /// What kind of case it is.
    pub class: Class,
    /// Track, passes and what is hidden.
    pub scene: Scene,
}

/// Classes of forty cases in a row: of them 10, 6, 17, 3 and 4.
const SHARES: [(Class, usize); 5] = [
    (Class::Control, 10),
    (Class::Artefact, 6),
    (Class::Single, 17),
    (Class::Double, 3),
    (Class::Unknown, 4),
];

/// Cases over which the shares hold.
const BLOCK: u32 = 40;

/// The case of this number in the trial of this seed.
pub fn plan(seed: u64, number: u32) -> Plan {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Streams of their own: a block's order, and each case.
    rng.set_stream(u64::from(number / BLOCK) << 32);
    let classes = shuffled(blocks(), &mut rng);
    let class = classes[(number % BLOCK) as usize];
    let before = classes[..(number % BLOCK) as usize].iter().filter(|&&c| c == class).count();
    let effects = shuffled(effect::of(class), &mut rng);
    rng.set_stream((u64::from(number / BLOCK) << 32) + 1 + u64::from(number % BLOCK));
    let scene_seed = Uniform::new(0, u64::MAX).expect("the range is not empty").sample(&mut rng);
    let mut scene = Scene::typical(scene_seed);
    let wanted = effects.into_iter().cycle().skip(before * class.effects()).take(class.effects());
    let level = scene.irregularity_level;
    let mut draw = Draw { level, rng: &mut rng };
    scene.left_out = wanted.map(|effect| effect(&mut draw)).collect();
    Plan { number, class, scene }
}

fn blocks() -> Vec<Class> {
    SHARES.iter().flat_map(|&(class, count)| std::iter::repeat_n(class, count)).collect()
}

/// Another order of a track's sleepers for each speed: `[speed][sleeper]`.
pub fn orders(seed: u64, speeds: usize, sleepers: usize) -> Vec<Vec<usize>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..speeds).map(|_| shuffled((0..sleepers).collect(), &mut rng)).collect()
}

/// Fisher and Yates.
fn shuffled<T>(mut items: Vec<T>, rng: &mut ChaCha8Rng) -> Vec<T> {
    for last in (1..items.len()).rev() {
        let other = Uniform::new_inclusive(0, last).expect("the range is not empty").sample(rng);
        items.swap(last, other);
    }
    items
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known::{is_artefact, kind};

    #[test]
    fn a_case_follows_from_seed_and_number_alone() {
        assert_eq!(plan(3, 17), plan(3, 17));
        assert_ne!(plan(3, 17).scene, plan(3, 18).scene);
        assert_ne!(plan(3, 17).scene, plan(4, 17).scene);
    }

    #[test]
    fn forty_cases_have_their_shares_in_another_order_each() {
        let classes =
            |from: u32| (from..from + BLOCK).map(|n| plan(1, n).class).collect::<Vec<_>>();
        let (first, second) = (classes(0), classes(BLOCK));
        assert_ne!(first, second);
        for (class, count) in SHARES {
            assert_eq!(first.iter().filter(|&&c| c == class).count(), count, "{class:?}");
        }
    }

    #[test]
    fn each_speed_has_all_sleepers_in_an_order_of_its_own() {
        let orders = orders(1, 3, 24);
        for order in &orders {
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..24).collect::<Vec<_>>());
        }
        assert!(orders[0] != orders[1] && orders[1] != orders[2]);
    }

    #[test]
    fn what_is_hidden_is_of_its_class_and_on_the_track() {
        for number in 0..2 * BLOCK {
            let Plan { class, scene, .. } = plan(5, number);
            scene.check().unwrap();
            assert_eq!(scene.left_out.len(), class.effects());
            for hidden in &scene.left_out {
                assert_eq!(is_artefact(hidden), class == Class::Artefact);
                assert_eq!(kind(hidden).is_some(), class != Class::Unknown);
            }
        }
    }

    #[test]
    fn every_effect_has_its_turn_in_a_block() {
        let names = |class: Class| {
            let plans = (0..BLOCK).map(|number| plan(2, number)).filter(|plan| plan.class == class);
            let names = plans.flat_map(|plan| plan.scene.left_out).map(|hidden| hidden.physics());
            names.collect::<std::collections::BTreeSet<_>>()
        };
        assert_eq!(names(Class::Single).len(), 13);
        assert_eq!(names(Class::Artefact).len(), 5);
        assert_eq!(names(Class::Unknown).len(), 4);
    }
}
