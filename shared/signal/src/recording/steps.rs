//! A column of positions as steps: what is usual in it, rests and jumps, and straight lines through the steps.

use super::motion::MotionFault;

/// Share of the usual speed below which a wheel is at rest, and the shortest time of rest in s.
const STANDING: f64 = 0.1;
const STANDING_S: f64 = 0.2;
/// Ratio to the usual speed above which a change of position is a jump.
pub const JUMP: f64 = 5.0;
/// Smallest change of position in m that counts as a jump.
pub const JUMP_M: f64 = 0.01;
/// Ratio to the usual time between changes, and to the usual change, from which on a position was held back
/// and then catches up; and the shortest distance at the usual speed, in sleeper spacings, of such a time.
const HELD: f64 = 4.0;
const HELD_SPACINGS: f64 = 0.1;
/// Share of the usual speed above which a wheel still rolls beside a constant position.
const ROLLING: f64 = 0.5;
/// Steps at either end of a pass whose speed is taken for what lies outside them.
const END_STEPS: usize = 8;

/// What is usual in a column of positions.
struct Usual {
    /// Speed in m a sample.
    speed: f64,
    /// Length of a change in m.
    step_m: f64,
    /// Samples from one change to the next.
    run: f64,
    /// Samples per second in Hz.
    rate_hz: f64,
    /// Spacing of the sleepers in m.
    spacing_m: f64,
}

/// A column of positions as the instants at which it changes.
pub(super) struct Steps<'a> {
    position_m: &'a [f64],
    /// Indices of the samples that differ from the one before.
    pub(super) changes: Vec<usize>,
}

impl<'a> Steps<'a> {
    /// The steps of a column of positions in m.
    pub(super) fn of(position_m: &'a [f64]) -> Self {
        let changed = |&index: &usize| position_m[index] != position_m[index - 1];
        Self { position_m, changes: (1..position_m.len()).filter(changed).collect() }
    }

    /// Median number of samples from one change to the next.
    pub(super) fn median_run(&self) -> usize {
        let runs = self.changes.windows(2).map(|pair| pair[1] - pair[0]);
        median(runs.collect::<Vec<_>>(), usize::cmp).unwrap_or(self.position_m.len())
    }

    /// Median length of the changes in m.
    pub(super) fn median_m(&self) -> f64 {
        let lengths = self.changes.iter().map(|&index| self.step(index));
        median(lengths.collect::<Vec<_>>(), f64::total_cmp).unwrap_or(0.0)
    }

    fn step(&self, index: usize) -> f64 {
        self.position_m[index] - self.position_m[index - 1]
    }

    /// Checks that the position neither stops nor jumps.
    pub(super) fn check(&self, rate_hz: f64, spacing_m: f64) -> Result<(), MotionFault> {
        let last = self.position_m.len() - 1;
        let usual = Usual {
            speed: self.usual_speed(),
            step_m: self.median_m(),
            run: self.median_run() as f64,
            rate_hz,
            spacing_m,
        };
        let bounds = std::iter::once(0).chain(self.changes.iter().copied()).chain([last]);
        let bounds: Vec<usize> = bounds.collect();
        bounds.windows(2).try_for_each(|pair| self.check_run(pair[0], pair[1], &usual))
    }

    /// Checks the samples from one change to the next.
    fn check_run(&self, from: usize, to: usize, usual: &Usual) -> Result<(), MotionFault> {
        let last = self.position_m.len() - 1;
        let samples = (to - from) as f64;
        let seconds = samples / usual.rate_hz;
        let usual_m = usual.speed * samples;
        let change_m = self.position_m[to] - self.position_m[from];
        // After the last change and before the first one a step may be under way.
        let length_m = change_m.max(if to == last || from == 0 { usual.step_m } else { 0.0 });
        let is_long = usual_m > HELD_SPACINGS * usual.spacing_m;
        let is_held = is_long && samples > HELD * usual.run && change_m > HELD * usual.step_m;
        let excess = length_m - JUMP * usual_m;
        if is_held || excess > JUMP_M.max((JUMP - 1.0) * usual.step_m) {
            let (before, after) = (self.position_m[to - 1], self.position_m[to]);
            let constant_from = is_held.then_some(from + 1);
            return Err(MotionFault::Jumps { row: to + 1, before, after, constant_from });
        }
        let is_standing =
            seconds > STANDING_S || is_long && self.rolls_beside(from, to, ROLLING * usual_m);
        if is_standing && length_m < STANDING * usual_m {
            let [from_s, to_s] = [from, to].map(|index| index as f64 / usual.rate_hz);
            return Err(MotionFault::StandsStill { row: from + 1, from_s, to_s: Some(to_s) });
        }
        Ok(())
    }

    /// Whether the position advances by `least_m` or more in the same time before or after these samples.
    fn rolls_beside(&self, from: usize, to: usize, least_m: f64) -> bool {
        let samples = to - from;
        let place = |index: usize| self.position_m.get(index).copied();
        let advance = |from: Option<f64>, to: Option<f64>| Some(to? - from?);
        let before = advance(from.checked_sub(samples).and_then(place), place(from));
        let after = advance(place(to), place(to + samples));
        [before, after].into_iter().flatten().any(|advance_m| advance_m >= least_m)
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
    pub(super) fn straight(&self) -> Vec<f64> {
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
