//! Hidden physics of the cases of a trial, drawn from the seed alone.
//!
//! This module draws classes, places and strengths. The crate of the reference simulator draws the tracks.

use crate::class::Class;
use crate::effect::{self, Draw};
use crate::making::Making;
use crate::site::Site;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::Distribution;
use rand_distr::uniform::Uniform;
use serde::Serialize;
use tracktwin_parameters::Preset;
use tracktwin_reference_simulator::Scene;

/// Version of the plans and scores. Trials with different versions are not comparable. Version 2 added
/// makings, in version 3 clipping has the same share of the crests at every level.
pub const FORMAT: u32 = 3;

/// Plan of a case of a trial. The seal covers its content.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Number in the trial, from 0.
    pub number: u32,
    /// Class of the case.
    pub class: Class,
    /// How the case is simulated.
    pub making: Making,
    /// Track, passes and hidden effects.
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

/// First streams of a block for the makings of its classes, and for what its cases add to them; those
/// before are of classes, effects and tracks.
const MAKINGS: u64 = 1 << 16;
const NUISANCES: u64 = 1 << 17;

/// The plan of case `number` in the trial of V-Track with this seed.
pub fn plan(seed: u64, number: u32) -> Plan {
    plan_on(Preset::VTrack, seed, number)
}

/// The plan of case `number` in the trial of a track with this seed.
pub fn plan_on(preset: Preset, seed: u64, number: u32) -> Plan {
    // Streams of their own: a block's order, and each case.
    let mut rng = stream(seed, number / BLOCK, 0);
    let classes = shuffled(blocks(), &mut rng);
    let class = classes[(number % BLOCK) as usize];
    let before = classes[..(number % BLOCK) as usize].iter().filter(|&&c| c == class).count();
    let effects = shuffled(effect::of(preset, class), &mut rng);
    rng.set_stream((u64::from(number / BLOCK) << 32) + 1 + u64::from(number % BLOCK));
    let scene_seed = Uniform::new(0, u64::MAX).expect("the range is not empty").sample(&mut rng);
    let mut scene = match preset {
        Preset::VTrack => Scene::typical(scene_seed),
        _ => Scene::typical_line(preset, scene_seed),
    };
    let wanted = effects.into_iter().cycle().skip(before * class.effects()).take(class.effects());
    let (level, site) = (scene.irregularity_level, Site::of(&scene));
    let mut draw = Draw { level, site, rng: &mut rng };
    scene.left_out = wanted.map(|effect| effect(&mut draw)).collect();
    if preset != Preset::VTrack {
        // The only simulator that has lines; a typical line has its scatter and odometer already.
        return Plan { number, class, making: Making::Second, scene };
    }
    let making = makings(seed, number / BLOCK, class)[before];
    let rng = &mut stream(seed, number / BLOCK, NUISANCES + u64::from(number % BLOCK));
    making.complete(&mut scene, &mut Draw { level, site, rng });
    Plan { number, class, making, scene }
}

/// The makings of a class's cases in a block, in their order: one as often as another, but for one
/// case, and over all classes as well.
fn makings(seed: u64, block: u32, class: Class) -> Vec<Making> {
    let before = SHARES.iter().take_while(|(other, _)| *other != class);
    let first = block as usize + before.map(|(_, count)| count).sum::<usize>();
    let count = SHARES.iter().find(|(other, _)| *other == class).map_or(0, |(_, count)| *count);
    let turns = (first..first + count).map(|turn| Making::ALL[turn % Making::ALL.len()]);
    shuffled(turns.collect(), &mut stream(seed, block, MAKINGS + class as u64))
}

/// Random numbers of a block.
fn stream(seed: u64, block: u32, number: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((u64::from(block) << 32) + number);
    rng
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
    fn every_making_has_its_share_of_every_class_in_a_block() {
        for block in 0..3 {
            let plans: Vec<Plan> = (0..BLOCK).map(|n| plan(1, block * BLOCK + n)).collect();
            let count = |making: Making, is_of: &dyn Fn(Class) -> bool| {
                plans.iter().filter(|it| it.making == making && is_of(it.class)).count()
            };
            for making in Making::ALL {
                for (class, cases) in SHARES {
                    let share = cases / Making::ALL.len();
                    let found = count(making, &|other| other == class);
                    assert!((share..=share + 1).contains(&found), "{making:?} {class:?}: {found}");
                }
                let share = BLOCK as usize / Making::ALL.len();
                assert!((share..=share + 1).contains(&count(making, &|_| true)));
            }
        }
    }

    #[test]
    fn a_plain_case_is_a_typical_track_and_varied_ones_have_nuisances() {
        for number in 0..BLOCK {
            let Plan { class, making, scene, .. } = plan(7, number);
            let left_out = scene.left_out.clone();
            let typical = Scene { left_out, ..Scene::typical(scene.seed) };
            assert_eq!(scene == typical, making == Making::Plain, "{number}");
            assert_eq!(scene.nuisances != typical.nuisances, making == Making::Varied);
            assert_eq!(scene.left_out.is_empty(), class == Class::Control);
        }
    }

    #[test]
    fn what_is_sealed_says_how_the_case_was_made() {
        let plan = plan(1, 0);
        let sealed = serde_json::to_value(&plan).unwrap();
        assert_eq!(sealed["making"], plan.making.name());
        assert_eq!(sealed["class"], plan.class.name());
        assert_eq!(sealed["scene"]["seed"], plan.scene.seed);
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
        let names = |preset, class: Class| {
            let plans = (0..BLOCK).map(|number| plan_on(preset, 2, number));
            let plans = plans.filter(|plan| plan.class == class);
            let names = plans.flat_map(|plan| plan.scene.left_out).map(|hidden| hidden.physics());
            names.collect::<std::collections::BTreeSet<_>>().len()
        };
        for (preset, counts) in [(Preset::VTrack, [14, 5, 3]), (Preset::Concrete60E1, [11, 5, 2])] {
            let classes = [Class::Single, Class::Artefact, Class::Unknown];
            assert_eq!(classes.map(|class| names(preset, class)), counts, "{preset:?}");
        }
    }

    #[test]
    fn a_line_hides_what_is_of_its_class_inside_what_is_recorded() {
        for (number, preset) in
            (0..2 * BLOCK).zip([Preset::Concrete60E1, Preset::Wood54E1].into_iter().cycle())
        {
            let Plan { class, making, scene, .. } = plan_on(preset, 5, number);
            scene.check().unwrap();
            assert_eq!((scene.preset, making), (preset, Making::Second));
            assert_eq!(scene.left_out.len(), class.effects());
            let spacing_m = scene.spacing_m();
            let inner =
                [scene.recorded_m[0] + 1.9 * spacing_m, scene.recorded_m[1] - 1.9 * spacing_m];
            for hidden in &scene.left_out {
                assert_eq!(is_artefact(hidden), class == Class::Artefact);
                assert_eq!(kind(hidden).is_some(), class != Class::Unknown);
                let place = hidden.place(spacing_m);
                assert!(
                    place.is_none_or(|[from, to]| inner[0] <= from && to <= inner[1]),
                    "{hidden:?}"
                );
            }
        }
    }
}
