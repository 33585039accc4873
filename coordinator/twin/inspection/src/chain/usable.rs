//! The passes of a recording from which something can be said of the track.

use super::offset::offsets;
use super::trouble::{Trouble, between_passes, of_passes};
use crate::along::by_speed;
use tracktwin_signal::recording::Recording;

/// A recording without the passes that tell nothing of the track, and what is wrong with those. A
/// short pass tells what it covers.
pub fn usable(recording: &Recording) -> (Recording, Vec<Trouble>) {
    let mut own = of_passes(recording);
    own.retain(|trouble| !matches!(trouble, Trouble::Short { .. }));
    let all: Vec<usize> = (0..recording.passes.len()).collect();
    let sound = without(recording, all, &own);
    // A pass without a signal is no company for the others.
    let rest = only(recording, &sound);
    let mut between = between_passes(&rest, &offsets(&rest));
    for trouble in &mut between {
        if let Trouble::Unlike { passes, .. } = trouble {
            *passes = passes.map(|pass| sound[pass]);
        }
    }
    let kept = without(recording, sound, &between);
    own.extend(between);
    (only(recording, &kept), own)
}

fn only(recording: &Recording, passes: &[usize]) -> Recording {
    let passes = passes.iter().map(|&pass| recording.passes[pass].clone()).collect();
    Recording { passes, ..recording.clone() }
}

/// Those of the passes that no trouble is about.
fn without(recording: &Recording, mut passes: Vec<usize>, troubles: &[Trouble]) -> Vec<usize> {
    for trouble in troubles {
        let named = about(trouble, recording);
        passes.retain(|pass| !named.contains(pass));
    }
    passes
}

/// Indices of the passes that a trouble is about.
fn about(trouble: &Trouble, recording: &Recording) -> Vec<usize> {
    match *trouble {
        Trouble::DropOut { pass, .. }
        | Trouble::Dead { pass }
        | Trouble::Noise { pass }
        | Trouble::Saturated { pass, .. }
        | Trouble::Airborne { pass, .. }
        | Trouble::Short { pass, .. } => vec![pass],
        Trouble::Unlike { passes, .. } => passes.to_vec(),
        Trouble::Stranger { speed_km_h, .. } => {
            let at_speed = |passes: &Vec<usize>| {
                passes
                    .iter()
                    .any(|&p| recording.passes[p].speed_km_h.total_cmp(&speed_km_h).is_eq())
            };
            by_speed(&recording.passes).into_iter().find(at_speed).unwrap_or_default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::Rolled;

    #[test]
    fn a_dead_pass_is_left_out_and_the_others_are_no_strangers_for_it() {
        let still = |pass: usize, samples: &mut [f64], _: &mut [f64]| {
            if pass == 1 {
                samples.fill(0.0);
            }
        };
        let mut recording = Rolled { chain: &still, ..Rolled::faultless(6) }.recording();
        recording.passes.drain(2..3);
        let (kept, troubles) = usable(&recording);
        assert_eq!(troubles, [Trouble::Dead { pass: 1 }]);
        assert_eq!(kept.speeds_km_h(), [8.0, 13.0]);
        recording.passes.remove(0);
        let (kept, troubles) = usable(&recording);
        assert_eq!((kept.speeds_km_h(), troubles), (vec![8.0], vec![Trouble::Dead { pass: 0 }]));
    }

    #[test]
    fn speeds_that_share_no_surface_are_left_out() {
        let mut recording = Rolled::faultless(6).recording();
        let elsewhere = Rolled::faultless(7).recording().passes.split_off(2);
        assert_eq!(usable(&recording).0.passes.len(), 4);
        recording.passes.splice(2.., elsewhere);
        let (kept, troubles) = usable(&recording);
        assert!(kept.passes.is_empty() && troubles.len() == 2, "{troubles:?}");
    }
}
