//! From the rail's modes to its evenly spaced seats and back, by a folded sine transform.

use crate::system::dot;
use std::f64::consts::PI;

/// Deflections `sin(n pi s / S)` of the modes `n` at the seats `s = 1..S-1`.
///
/// At the seats a mode beyond `S` looks like one below: `2 S - n` with the other sign. So the
/// amplitudes are folded to `S - 1` first, and one small sine transform does the rest.
#[derive(Clone, Debug)]
pub(crate) struct SeatTransform {
    spans: usize,
    /// `sin(m pi s / S)`, row by row; symmetric.
    sines: Vec<f64>,
}

impl SeatTransform {
    /// The transform of a rail of so many spans.
    pub(crate) fn new(spans: usize) -> Self {
        let step = PI / spans as f64;
        let sine = |row: usize, column: usize| (step * ((row * column) % (2 * spans)) as f64).sin();
        let sines = (1..spans).flat_map(|row| (1..spans).map(move |column| sine(row, column)));
        Self { spans, sines: sines.collect() }
    }

    /// Number of seats.
    pub(crate) fn seats(&self) -> usize {
        self.spans - 1
    }

    /// Values at the seats of amplitudes of the modes, into `seats`; `folded` is scratch.
    #[inline]
    pub(crate) fn at_seats(&self, amplitudes: &[f64], folded: &mut [f64], seats: &mut [f64]) {
        folded.fill(0.0);
        for period in amplitudes.chunks(2 * self.spans) {
            let (first, second) = period.split_at((self.spans - 1).min(period.len()));
            for (sum, value) in folded.iter_mut().zip(first) {
                *sum += value;
            }
            // The mode of number S is zero at all seats, those after it are mirrored.
            for (sum, value) in folded.iter_mut().rev().zip(second.iter().skip(1)) {
                *sum -= value;
            }
        }
        self.transform(folded, seats);
    }

    /// Generalised forces on the modes of forces at the seats, subtracted from `forces`.
    #[inline]
    pub(crate) fn push(&self, seats: &[f64], folded: &mut [f64], forces: &mut [f64]) {
        self.transform(seats, folded);
        for period in forces.chunks_mut(2 * self.spans) {
            let (first, second) = period.split_at_mut((self.spans - 1).min(period.len()));
            for (force, value) in first.iter_mut().zip(&*folded) {
                *force -= value;
            }
            for (force, value) in second.iter_mut().skip(1).zip(folded.iter().rev()) {
                *force += value;
            }
        }
    }

    #[inline]
    fn transform(&self, from: &[f64], to: &mut [f64]) {
        for (value, row) in to.iter_mut().zip(self.sines.chunks_exact(self.spans - 1)) {
            *value = dot(row, from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPANS: usize = 7;

    fn shape(mode: usize, seat: usize) -> f64 {
        ((mode + 1) as f64 * PI * (seat + 1) as f64 / SPANS as f64).sin()
    }

    #[test]
    fn folding_gives_the_sum_over_all_modes() {
        let transform = SeatTransform::new(SPANS);
        // Not a multiple of the period of 14, so that the last fold is cut off.
        for count in [5_u32, 14, 25, 31] {
            let amplitudes: Vec<f64> = (0..count).map(|n| 1.0 / (1.0 + f64::from(n))).collect();
            let (mut folded, mut seats) = (vec![0.0; SPANS - 1], vec![0.0; SPANS - 1]);
            transform.at_seats(&amplitudes, &mut folded, &mut seats);
            for (seat, value) in seats.iter().enumerate() {
                let terms = amplitudes.iter().enumerate();
                let sum: f64 = terms.map(|(mode, a)| a * shape(mode, seat)).sum();
                assert!((value - sum).abs() < 1e-13, "{count} modes: {value} {sum}");
            }
        }
    }

    #[test]
    fn forces_at_the_seats_act_on_every_mode_by_its_shape() {
        let transform = SeatTransform::new(SPANS);
        let loads = [1.0, -2.0, 0.5, 3.0, 0.0, 1.5];
        let (mut folded, mut forces) = (vec![0.0; SPANS - 1], vec![0.0; 25]);
        transform.push(&loads, &mut folded, &mut forces);
        for (mode, force) in forces.iter().enumerate() {
            let terms = loads.iter().enumerate();
            let sum: f64 = terms.map(|(seat, load)| load * shape(mode, seat)).sum();
            assert!((force + sum).abs() < 1e-12, "mode {mode}: {force} {sum}");
        }
    }
}
