//! Positions from an odometer, a counter or a satellite receiver, in steps or with fine resolution.
//!
//! This module checks a position column alone. It interpolates steps and returns an error for an
//! impossible motion. Other modules check the agreement with times and speeds.

use super::error::Fault;

/// Median number of samples with constant position above which it advances in steps.
const STAIR_SAMPLES: usize = 2;
/// Number of steps below which an interpolation is impossible.
const STEPS_MIN: usize = 4;
/// Share of the usual speed below which a wheel is at rest, and the shortest time of rest in s.
const STANDING: f64 = 0.1;
const STANDING_S: f64 = 0.2;
/// Ratio to the usual speed above which a change of position is a jump.
pub const JUMP: f64 = 5.0;
/// Smallest change of position in m that counts as a jump.
pub const JUMP_M: f64 = 0.01;
/// Share of a pass's length by which a restarted position falls back.
const RESTART: f64 = 0.5;
/// Longest step as a share of the sleeper spacing that separates sleepers.
const STEPS_A_SPACING: f64 = 4.0;
/// Steps at either end of a pass whose speed is taken for what lies outside them.
const END_STEPS: usize = 8;

/// Positions of a pass, and the length of their original steps.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Odometer {
    /// Position of the wheel in m at every sample. Positions do not decrease.
    pub position_m: Vec<f64>,
    /// Length in m of the original steps, if these were interpolated.
    pub step_m: Option<f64>,
}

impl Odometer {
    /// Checks and interpolates positions in m at even times, along the direction of travel.
    ///
    /// Steps become straight lines between the instants at which the position changes. At these instants
    /// the position is known to half a step; between them the speed is assumed constant.
    ///
    /// # Errors
    /// [`Fault::StandsStill`], [`Fault::Decreases`], [`Fault::RunsBack`], [`Fault::Restarts`],
    /// [`Fault::Jumps`] or [`Fault::FewSteps`].
    pub(super) fn straightened(position_m: Vec<f64>, rate_hz: f64) -> Result<Self, Fault> {
        forwards(&position_m)?;
        let steps = Steps::of(&position_m);
        let is_stair = steps.median_run() >= STAIR_SAMPLES;
        if is_stair && steps.changes.len() < STEPS_MIN {
            return Err(Fault::FewSteps { steps: steps.changes.len(), step_m: steps.median_m() });
        }
        steps.check(rate_hz)?;
        if !is_stair {
            return Ok(Self { position_m, step_m: None });
        }
        Ok(Self { position_m: steps.straight(), step_m: Some(steps.median_m()) })
    }

    /// Whether steps of this length separate sleepers at this spacing.
    ///
    /// # Errors
    /// [`Fault::CoarsePosition`] if the steps are too long.
    pub(super) fn tells_sleepers(&self, spacing_m: f64) -> Result<(), Fault> {
        match self.step_m {
            Some(step_m) if step_m > spacing_m / STEPS_A_SPACING => {
                Err(Fault::CoarsePosition { step_m, needed_m: spacing_m / STEPS_A_SPACING })
            }
            _ => Ok(()),
        }
    }
}

/// Checks that the position never decreases.
fn forwards(position_m: &[f64]) -> Result<(), Fault> {
    let (first, last) = (position_m[0], position_m[position_m.len() - 1]);
    if position_m.iter().all(|&place| place == first) {
        return Err(Fault::StandsStill { from_s: 0.0, to_s: None });
    }
    let Some(index) = position_m.windows(2).position(|pair| pair[1] < pair[0]) else {
        return Ok(());
    };
    let (row, before, after) = (index + 2, position_m[index], position_m[index + 1]);
    let ends = |ends: [f64; 2], &x: &f64| [ends[0].min(x), ends[1].max(x)];
    let [low, high] = position_m.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    let back = position_m.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let ahead = position_m.windows(2).filter(|pair| pair[1] > pair[0]).count();
    Err(if back > ahead && last < first {
        Fault::Decreases { from_m: first, to_m: last }
    } else if before - after > RESTART * (high - low) {
        Fault::Restarts { row, before, after }
    } else {
        Fault::RunsBack { row, before, after }
    })
}

/// A column of positions as the instants at which it changes.
struct Steps<'a> {
    position_m: &'a [f64],
    /// Indices of the samples that differ from the one before.
    changes: Vec<usize>,
}

impl<'a> Steps<'a> {
    fn of(position_m: &'a [f64]) -> Self {
        let changed = |&index: &usize| position_m[index] != position_m[index - 1];
        Self { position_m, changes: (1..position_m.len()).filter(changed).collect() }
    }

    /// Median number of samples from one change to the next.
    fn median_run(&self) -> usize {
        let runs = self.changes.windows(2).map(|pair| pair[1] - pair[0]);
        median(runs.collect::<Vec<_>>(), usize::cmp).unwrap_or(self.position_m.len())
    }

    /// Median length of the changes in m.
    fn median_m(&self) -> f64 {
        let lengths = self.changes.iter().map(|&index| self.step(index));
        median(lengths.collect::<Vec<_>>(), f64::total_cmp).unwrap_or(0.0)
    }

    fn step(&self, index: usize) -> f64 {
        self.position_m[index] - self.position_m[index - 1]
    }

    /// Checks that the position neither stops nor jumps.
    fn check(&self, rate_hz: f64) -> Result<(), Fault> {
        let last = self.position_m.len() - 1;
        let (usual, step_m) = (self.usual_speed() * rate_hz, self.median_m());
        let bounds = std::iter::once(0).chain(self.changes.iter().copied()).chain([last]);
        let bounds: Vec<usize> = bounds.collect();
        for pair in bounds.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let seconds = (to - from) as f64 / rate_hz;
            let length_m = self.position_m[to] - self.position_m[from];
            // After the last change and before the first one a step may be under way.
            let length_m = length_m.max(if to == last || from == 0 { step_m } else { 0.0 });
            if seconds > STANDING_S && length_m < STANDING * usual * seconds {
                let [from_s, to_s] = [from, to].map(|index| index as f64 / rate_hz);
                return Err(Fault::StandsStill { from_s, to_s: Some(to_s) });
            }
            let excess = length_m - JUMP * usual * seconds;
            if excess > JUMP_M.max((JUMP - 1.0) * step_m) {
                let (before, after) = (self.position_m[to - 1], self.position_m[to]);
                return Err(Fault::Jumps { row: to + 1, before, after });
            }
        }
        Ok(())
    }

    /// Median speed between changes in m a sample, each weighted by its length.
    fn usual_speed(&self) -> f64 {
        let speed = |pair: &[usize]| (self.step(pair[1]) / (pair[1] - pair[0]) as f64, pair[1]);
        let mut speeds: Vec<(f64, usize)> = self.changes.windows(2).map(speed).collect();
        speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let whole: f64 = speeds.iter().map(|&(_, index)| self.step(index)).sum();
        let mut below = 0.0;
        let half = speeds.iter().find(|&&(_, index)| {
            below += self.step(index);
            below >= 0.5 * whole
        });
        half.map_or(0.0, |&(speed, _)| speed)
    }

    /// Whether values are held at even instants, as a receiver does, not at even places.
    fn is_held(&self) -> bool {
        let spread = |values: Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            (square / values.len() as f64).sqrt() / mean
        };
        let runs = self.changes.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
        let lengths = self.changes.iter().map(|&index| self.step(index)).collect();
        spread(runs) < spread(lengths)
    }

    /// Straight lines through the changes, and on at the speed of the steps next to an end.
    fn straight(&self) -> Vec<f64> {
        let knots = self.knots();
        let [first, last] = [knots[0], knots[knots.len() - 1]];
        let near = END_STEPS.min(knots.len() - 1);
        let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
        // No further than a step: then the next one would have been seen.
        let bound = |slope: f64, samples: f64| slope.min(self.median_m() / samples.max(1.0));
        let count = self.position_m.len();
        let before = bound(slope(first, knots[near]), first.0);
        let after = bound(slope(knots[knots.len() - 1 - near], last), count as f64 - last.0);
        let mut segment = 0;
        let place = |index: usize| {
            let at = index as f64;
            if at <= first.0 {
                return first.1 + before * (at - first.0);
            }
            if at >= last.0 {
                return last.1 + after * (at - last.0);
            }
            while knots[segment + 1].0 < at {
                segment += 1;
            }
            let (a, b) = (knots[segment], knots[segment + 1]);
            a.1 + slope(a, b) * (at - a.0)
        };
        (0..count).map(place).collect()
    }

    /// Instants in samples at which the position is known, and the position there in m.
    ///
    /// A rounded position changes half way between its values; one that is held is new when it changes.
    fn knots(&self) -> Vec<(f64, f64)> {
        let back = if self.is_held() { 0.0 } else { 0.5 };
        let knot =
            |&index: &usize| (index as f64 - 0.5, self.position_m[index] - back * self.step(index));
        self.changes.iter().map(knot).collect()
    }
}

fn median<T: Copy>(mut values: Vec<T>, order: impl Fn(&T, &T) -> std::cmp::Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 2000.0;
    const SPEED_M_S: f64 = 67.4 / 3.6;

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
            let odometer = Odometer::straightened(stepped(step_m), RATE_HZ).unwrap();
            assert!((odometer.step_m.unwrap() / step_m - 1.0).abs() < 1e-6);
            assert!(odometer.position_m.is_sorted());
            let [each, span] = off(&odometer.position_m);
            assert!(each < 0.5 * step_m && span < 0.2 * step_m, "{step_m}: {each} {span}");
        }
    }

    #[test]
    fn values_held_for_a_while_become_lines_and_the_speed_is_right() {
        for samples in [20, 200, 2000] {
            let odometer = Odometer::straightened(held(samples), RATE_HZ).unwrap();
            let step_m = odometer.step_m.unwrap();
            let [each, span] = off(&odometer.position_m);
            assert!(each < 0.1 * step_m && span < 0.1 * step_m, "{samples}: {each} {span}");
        }
    }

    #[test]
    fn fine_positions_stay_as_they_are() {
        for places in [true_m(), stepped(1e-3), stepped(6e-3)] {
            let odometer = Odometer::straightened(places.clone(), RATE_HZ).unwrap();
            assert_eq!(odometer, Odometer { position_m: places, step_m: None });
        }
    }

    #[test]
    fn steps_too_long_for_the_sleepers_are_refused_for_them_only() {
        let odometer = Odometer::straightened(stepped(1.0), RATE_HZ).unwrap();
        assert!(matches!(odometer.tells_sleepers(0.6), Err(Fault::CoarsePosition { .. })));
        let odometer = Odometer::straightened(stepped(0.05), RATE_HZ).unwrap();
        assert!(odometer.tells_sleepers(0.6).is_ok());
        let odometer = Odometer::straightened(true_m(), RATE_HZ).unwrap();
        assert!(odometer.tells_sleepers(0.125).is_ok());
    }

    #[test]
    fn what_no_wheel_does_is_refused() {
        let fault = |change: &dyn Fn(usize, f64) -> f64| {
            [0.0, 0.1, 1.0].map(|step_m| {
                let rounded = |x: f64| if step_m > 0.0 { (x / step_m).round() * step_m } else { x };
                let places = true_m();
                let changed = places.iter().enumerate().map(|(row, &x)| rounded(change(row, x)));
                Odometer::straightened(changed.collect(), RATE_HZ).unwrap_err()
            })
        };
        let all = |faults: [Fault; 3], of_kind: fn(&Fault) -> bool| {
            assert!(faults.iter().all(of_kind), "{faults:?}");
        };
        all(fault(&|_, x| -x), |f| matches!(f, Fault::Decreases { .. }));
        all(fault(&|_, _| 3.0), |f| matches!(f, Fault::StandsStill { .. }));
        let places = true_m();
        let rest = |row: usize, x: f64| {
            let (from, to) = (places[8000], places[14_000]);
            if row < 14_000 { x.min(from) } else { x - (to - from) }
        };
        all(fault(&rest), |f| matches!(f, Fault::StandsStill { to_s: Some(_), .. }));
        all(fault(&|row, x| if row < 8000 { x } else { x + 30.0 }), |f| {
            matches!(f, Fault::Jumps { row: 7990..8110, .. })
        });
        all(fault(&|row, x| if row < 8000 { x } else { x - 150.0 }), |f| {
            matches!(f, Fault::Restarts { row: 7990..8110, .. } | Fault::RunsBack { .. })
        });
        let mut few = held(8000);
        few.truncate(18_000);
        assert!(matches!(Odometer::straightened(few, RATE_HZ), Err(Fault::FewSteps { .. })));
    }
}
