//! The usable passes of a recording.

use super::offset::offsets;
use super::pass_defect::{PassDefect, between_passes, of_passes};
use crate::along::by_speed;
use tracktwin_signal::recording::Recording;

/// The recording without its unusable passes, and all defects. A short pass stays usable over its length.
pub fn usable(recording: &Recording) -> (Recording, Vec<PassDefect>) {
    let mut own = of_passes(recording);
    own.retain(|defect| !matches!(defect, PassDefect::Short { .. }));
    let all: Vec<usize> = (0..recording.passes.len()).collect();
    let sound = without(recording, all, &own);
    // A pass without a signal is no company for the others.
    let rest = only(recording, &sound);
    let mut between = between_passes(&rest, &offsets(&rest));
    for defect in &mut between {
        if let PassDefect::UnrelatedPasses { passes, .. } = defect {
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

/// The passes without a defect.
fn without(
    recording: &Recording,
    mut passes: Vec<usize>,
    pass_defects: &[PassDefect],
) -> Vec<usize> {
    for defect in pass_defects {
        let named = about(defect, recording);
        passes.retain(|pass| !named.contains(pass));
    }
    passes
}

/// Indices of the passes with a defect.
fn about(defect: &PassDefect, recording: &Recording) -> Vec<usize> {
    match *defect {
        PassDefect::DropOut { pass, .. }
        | PassDefect::Dead { pass }
        | PassDefect::Noise { pass }
        | PassDefect::Saturated { pass, .. }
        | PassDefect::Airborne { pass, .. }
        | PassDefect::Short { pass, .. } => vec![pass],
        PassDefect::UnrelatedPasses { passes, .. } => passes.to_vec(),
        PassDefect::UnrelatedSpeed { speed_km_h, .. } => {
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
        let standstill = |pass: usize, samples: &mut [f64], _: &mut [f64]| {
            if pass == 1 {
                samples.fill(0.0);
            }
        };
        let mut recording = Rolled { chain: &standstill, ..Rolled::faultless(6) }.recording();
        recording.passes.drain(2..3);
        let (kept, pass_defects) = usable(&recording);
        assert_eq!(pass_defects, [PassDefect::Dead { pass: 1 }]);
        assert_eq!(kept.speeds_km_h(), [8.0, 13.0]);
        recording.passes.remove(0);
        let (kept, pass_defects) = usable(&recording);
        assert_eq!(
            (kept.speeds_km_h(), pass_defects),
            (vec![8.0], vec![PassDefect::Dead { pass: 0 }])
        );
    }

    #[test]
    fn speeds_that_share_no_surface_are_left_out() {
        let mut recording = Rolled::faultless(6).recording();
        let elsewhere = Rolled::faultless(7).recording().passes.split_off(2);
        assert_eq!(usable(&recording).0.passes.len(), 4);
        recording.passes.splice(2.., elsewhere);
        let (kept, pass_defects) = usable(&recording);
        assert!(kept.passes.is_empty() && pass_defects.len() == 2, "{pass_defects:?}");
    }
}
