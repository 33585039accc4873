//! Positions from an odometer, a counter or a satellite receiver, in steps or with fine resolution.
//!
//! This module checks a position column alone. It interpolates steps and returns an error for an
//! impossible motion. Other modules check the agreement with times and speeds.

use super::motion::MotionFault;
use super::steps::Steps;

/// Median number of samples with constant position above which it advances in steps.
const STAIR_SAMPLES: usize = 2;
/// Number of steps below which an interpolation is impossible.
const STEPS_MIN: usize = 4;
/// Share of a pass's length by which a restarted position falls back.
const RESTART: f64 = 0.1;
/// Longest step as a share of the sleeper spacing that separates sleepers.
const STEPS_A_SPACING: f64 = 4.0;

/// Positions of a pass, and the length of their original steps.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Odometer {
    /// Position of the wheel in m at every sample. Positions do not decrease.
    pub position_m: Vec<f64>,
    /// Length in m of the original steps, if these were interpolated.
    pub step_m: Option<f64>,
}

impl Odometer {
    /// Checks and interpolates positions in m at even times, along the direction of travel, over sleepers at
    /// this spacing.
    ///
    /// Steps become straight lines between the instants at which the position changes. At these instants
    /// the position is known to half a step; between them the speed is assumed constant.
    ///
    /// # Errors
    /// [`MotionFault::StandsStill`], [`MotionFault::Decreases`], [`MotionFault::RunsBack`], [`MotionFault::Restarts`],
    /// [`MotionFault::Jumps`] or [`MotionFault::FewSteps`].
    pub(super) fn straightened(
        position_m: Vec<f64>,
        rate_hz: f64,
        spacing_m: f64,
    ) -> Result<Self, MotionFault> {
        forwards(&position_m)?;
        let steps = Steps::of(&position_m);
        let is_stair = steps.median_run() >= STAIR_SAMPLES;
        if is_stair && steps.changes.len() < STEPS_MIN {
            return Err(MotionFault::FewSteps {
                steps: steps.changes.len(),
                step_m: steps.median_m(),
            });
        }
        steps.check(rate_hz, spacing_m)?;
        if !is_stair {
            return Ok(Self { position_m, step_m: None });
        }
        Ok(Self { position_m: steps.straight(), step_m: Some(steps.median_m()) })
    }

    /// Whether steps of this length separate sleepers at this spacing.
    ///
    /// # Errors
    /// [`MotionFault::CoarsePosition`] if the steps are too long.
    pub(super) fn tells_sleepers(&self, spacing_m: f64) -> Result<(), MotionFault> {
        match self.step_m {
            Some(step_m) if step_m > spacing_m / STEPS_A_SPACING => {
                Err(MotionFault::CoarsePosition { step_m, needed_m: spacing_m / STEPS_A_SPACING })
            }
            _ => Ok(()),
        }
    }
}

/// How many steps of the positions lead to smaller ones, and how many to greater ones.
pub(super) fn steps_back_and_ahead(position_m: &[f64]) -> [usize; 2] {
    let count = |is_it: fn(&f64, &f64) -> bool| {
        position_m.windows(2).filter(|pair| is_it(&pair[1], &pair[0])).count()
    };
    [count(f64::lt), count(f64::gt)]
}

/// Checks that the position never decreases.
fn forwards(position_m: &[f64]) -> Result<(), MotionFault> {
    let (first, last) = (position_m[0], position_m[position_m.len() - 1]);
    if position_m.iter().all(|&place| place == first) {
        return Err(MotionFault::StandsStill { row: 1, from_s: 0.0, to_s: None });
    }
    let falls = || position_m.windows(2).enumerate().filter(|(_, pair)| pair[1] < pair[0]);
    let fall_m = |(_, pair): &(usize, &[f64])| pair[0] - pair[1];
    let (Some((index, _)), Some(greatest)) =
        (falls().next(), falls().max_by(|a, b| fall_m(a).total_cmp(&fall_m(b))))
    else {
        return Ok(());
    };
    let at = |index: usize| (index + 2, position_m[index], position_m[index + 1]);
    let ends = |ends: [f64; 2], &x: &f64| [ends[0].min(x), ends[1].max(x)];
    let [low, high] = position_m.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    let [back, ahead] = steps_back_and_ahead(position_m);
    Err(if back > ahead && last < first {
        MotionFault::Decreases { from_m: first, to_m: last }
    } else if fall_m(&greatest) > RESTART * (high - low) {
        let (row, before, after) = at(greatest.0);
        MotionFault::Restarts { row, before, after }
    } else {
        let (row, before, after) = at(index);
        MotionFault::RunsBack { row, before, after }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 2000.0;
    const SPEED_M_S: f64 = 67.4 / 3.6;
    const SPACING_M: f64 = 0.6;

    /// Ten seconds from a place that is no multiple of anything, braking by a tenth.
    fn true_m() -> Vec<f64> {
        let place = |row: u32| {
            let time = f64::from(row) / RATE_HZ;
            1234.567 + SPEED_M_S * (time - 0.005 * time * time)
        };
        (0..20_000).map(place).collect()
    }

    fn stepped(step_m: f64) -> Vec<f64> {
        true_m().iter().map(|x| (x / step_m).round() * step_m).collect()
    }

    fn held(samples: usize) -> Vec<f64> {
        let places = true_m();
        (0..places.len()).map(|row| places[row / samples * samples]).collect()
    }

    fn span(places: &[f64]) -> f64 {
        places[places.len() - 1] - places[0]
    }

    /// Greatest distance of positions from the true ones, in m, and that of their span.
    fn off(places: &[f64]) -> [f64; 2] {
        let each = places.iter().zip(true_m()).map(|(a, b)| (a - b).abs());
        [each.fold(0.0, f64::max), (span(places) - span(&true_m())).abs()]
    }

    #[test]
    fn steps_become_lines_that_are_true_to_half_a_step() {
        for step_m in [0.05, 0.1, 1.0, 7.0] {
            let odometer = Odometer::straightened(stepped(step_m), RATE_HZ, SPACING_M).unwrap();
            assert!((odometer.step_m.unwrap() / step_m - 1.0).abs() < 1e-6);
            assert!(odometer.position_m.is_sorted());
            let [each, span] = off(&odometer.position_m);
            assert!(each < 0.5 * step_m && span < 0.2 * step_m, "{step_m}: {each} {span}");
        }
    }

    #[test]
    fn values_held_for_a_while_become_lines_and_the_speed_is_right() {
        for samples in [20, 200, 2000] {
            let odometer = Odometer::straightened(held(samples), RATE_HZ, SPACING_M).unwrap();
            let step_m = odometer.step_m.unwrap();
            let [each, span] = off(&odometer.position_m);
            assert!(each < 0.1 * step_m && span < 0.1 * step_m, "{samples}: {each} {span}");
        }
    }

    #[test]
    fn fine_positions_stay_as_they_are() {
        for places in [true_m(), stepped(1e-3), stepped(6e-3)] {
            let odometer = Odometer::straightened(places.clone(), RATE_HZ, SPACING_M).unwrap();
            assert_eq!(odometer, Odometer { position_m: places, step_m: None });
        }
    }

    #[test]
    fn steps_too_long_for_the_sleepers_are_refused_for_them_only() {
        let odometer = Odometer::straightened(stepped(1.0), RATE_HZ, SPACING_M).unwrap();
        assert!(matches!(odometer.tells_sleepers(0.6), Err(MotionFault::CoarsePosition { .. })));
        let odometer = Odometer::straightened(stepped(0.05), RATE_HZ, SPACING_M).unwrap();
        assert!(odometer.tells_sleepers(0.6).is_ok());
        let odometer = Odometer::straightened(true_m(), RATE_HZ, SPACING_M).unwrap();
        assert!(odometer.tells_sleepers(0.125).is_ok());
    }

    #[test]
    fn what_no_wheel_does_is_refused() {
        let fault = |change: &dyn Fn(usize, f64) -> f64| {
            [0.0, 0.1, 1.0].map(|step_m| {
                let rounded = |x: f64| if step_m > 0.0 { (x / step_m).round() * step_m } else { x };
                let places = true_m();
                let changed = places.iter().enumerate().map(|(row, &x)| rounded(change(row, x)));
                Odometer::straightened(changed.collect(), RATE_HZ, SPACING_M).unwrap_err()
            })
        };
        let all = |faults: [MotionFault; 3], of_kind: fn(&MotionFault) -> bool| {
            assert!(faults.iter().all(of_kind), "{faults:?}");
        };
        all(fault(&|_, x| -x), |f| matches!(f, MotionFault::Decreases { .. }));
        all(fault(&|_, _| 3.0), |f| matches!(f, MotionFault::StandsStill { .. }));
        let places = true_m();
        let rest = |row: usize, x: f64| {
            let (from, to) = (places[8000], places[14_000]);
            if row < 14_000 { x.min(from) } else { x - (to - from) }
        };
        all(fault(&rest), |f| matches!(f, MotionFault::StandsStill { to_s: Some(_), .. }));
        all(fault(&|row, x| if row < 8000 { x } else { x + 30.0 }), |f| {
            matches!(f, MotionFault::Jumps { row: 7990..8110, .. })
        });
        all(fault(&|row, x| if row < 8000 { x } else { x - 150.0 }), |f| {
            matches!(
                f,
                MotionFault::Restarts { row: 7990..8110, .. } | MotionFault::RunsBack { .. }
            )
        });
        let mut few = held(8000);
        few.truncate(18_000);
        assert!(matches!(
            Odometer::straightened(few, RATE_HZ, SPACING_M),
            Err(MotionFault::FewSteps { .. })
        ));
    }

    /// Positions that are constant from one time in s on for so many seconds, then true or late by that.
    fn with_hold(fine: &[f64], from_s: f64, seconds: f64, is_late: bool) -> Vec<f64> {
        let [from, until] = [from_s, from_s + seconds].map(|time| (time * RATE_HZ) as usize);
        let late_m = if is_late { fine[until] - fine[from] } else { 0.0 };
        let place = |(row, &x): (usize, &f64)| match row {
            _ if row < from => x,
            _ if row < until => fine[from],
            _ => x - late_m,
        };
        fine.iter().enumerate().map(place).collect()
    }

    #[test]
    fn a_position_that_is_held_and_catches_up_is_refused_with_its_rows() {
        for (seconds, end) in [(0.05, 8101), (0.3, 8601), (3.0, 14_001)] {
            for places in [true_m(), stepped(6e-3), stepped(0.05)] {
                let held = with_hold(&places, 4.0, seconds, false);
                let fault = Odometer::straightened(held, RATE_HZ, SPACING_M).unwrap_err();
                let MotionFault::Jumps { row, constant_from: Some(from), .. } = fault else {
                    panic!("{seconds} s: {fault:?}");
                };
                assert!(row.abs_diff(end) <= 6 && from.abs_diff(8001) <= 6, "{from} to {row}");
                let text = fault.to_string();
                assert!(text.contains(&format!("row {from} to row {}; leave", row - 1)), "{text}");
            }
        }
    }

    #[test]
    fn a_position_that_is_held_and_goes_on_late_is_refused_and_a_stop_is_not() {
        let late = with_hold(&true_m(), 4.0, 0.05, true);
        let fault = Odometer::straightened(late, RATE_HZ, SPACING_M).unwrap_err();
        assert!(matches!(fault, MotionFault::StandsStill { row: 8001, .. }), "{fault:?}");
        // The last metres before a stop, with a resolution of a millimetre.
        let braking = (0..8000).map(|row| (f64::from(row) - 8000.0) / RATE_HZ);
        let braking = braking.map(|time| ((100.0 - time * time) * 1e3).round() / 1e3);
        Odometer::straightened(braking.collect(), RATE_HZ, SPACING_M).unwrap();
    }
}
