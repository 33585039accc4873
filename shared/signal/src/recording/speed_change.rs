//! Passes whose speed changes: comparisons take the mean speed of a pass.

use super::Pass;
use tracktwin_number::rounded;

/// Difference of the speeds in the two halves of a pass, as a share of the mean speed, that is stated.
const CHANGE_MAX: f64 = 0.05;

impl Pass {
    /// Difference of the mean speeds in the two halves of the time, as a share of their mean, from the positions.
    pub fn speed_change(&self) -> f64 {
        let [first, second] = self.half_speeds_m_s();
        2.0 * (second - first).abs() / (second + first).abs()
    }

    fn half_speeds_m_s(&self) -> [f64; 2] {
        let half = self.position_m.len() / 2;
        let seconds = (half - 1).max(1) as f64 / self.signal.sample_rate_hz();
        let way_m = |from: usize| self.position_m[from + half - 1] - self.position_m[from];
        [0, half].map(|from| way_m(from) / seconds)
    }
}

/// Doubt about a pass whose speed changes much.
pub(super) fn doubt(pass: &Pass) -> Option<String> {
    let [first, second] = pass.half_speeds_m_s().map(|m_s| rounded(3.6 * m_s, 3));
    (pass.speed_change() > CHANGE_MAX).then(|| {
        format!(
            "doubt: {}: the mean speed is {first} km/h in the first half and {second} km/h in the second, and the levels \
             are compared with those at the mean speed of the pass; record at a steady speed",
            pass.file
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Signal;

    /// A pass of two seconds at these speeds in m/s, a second each.
    fn pass([first, second]: [f64; 2]) -> Pass {
        let (count, rate_hz) = (2000_u32, 1e3);
        let position_m = |n: u32| {
            let time_s = f64::from(n) / rate_hz;
            first * time_s.min(1.0) + second * (time_s - 1.0).max(0.0)
        };
        Pass {
            file: "pass.csv".to_owned(),
            speed_km_h: 1.8 * (first + second),
            axle: None,
            signal: Signal::new(rate_hz, vec![0.0; count as usize]).unwrap(),
            position_m: (0..count).map(position_m).collect(),
            contact_loss_share: None,
        }
    }

    #[test]
    fn a_pass_that_brakes_is_doubted_and_one_that_drifts_is_not() {
        assert_eq!(doubt(&pass([20.0, 20.4])), None);
        let said = doubt(&pass([20.0, 10.0])).unwrap();
        assert!(said.contains("72 km/h in the first half and 36 km/h in the second"), "{said}");
    }
}
