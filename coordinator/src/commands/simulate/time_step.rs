//! Doubt about a coarse time step.

use tracktwin_diagnosis::highest_compared_hz;
use tracktwin_number::rounded;

/// Frequency times the time step at which the average-acceleration rule lowers a resonance by 5 %. A resonance at f
/// comes out at atan(π f Δt) / (π Δt).
const LOWERED: f64 = 0.129;

/// A line with a remedy if the error of the solver reaches the frequencies that are compared.
pub(super) fn doubt(time_step_s: f64, sample_rate_hz: f64) -> Option<String> {
    let compared_hz = highest_compared_hz(sample_rate_hz);
    let lowered_hz = LOWERED / time_step_s;
    (lowered_hz < compared_hz).then(|| {
        format!(
            "--time-step {time_step_s:e}: the solver lowers resonances above {} Hz by more than 5 %, and evaluations \
             compare frequencies up to {} Hz: they will be wrong. Use --time-step 1e-5 --sample-rate {sample_rate_hz}",
            rounded(lowered_hz, 3),
            rounded(compared_hz, 3),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_coarse_step_is_doubted_with_a_remedy_and_a_fine_one_is_not() {
        let line = doubt(5e-4, 2000.0).unwrap();
        assert!(line.contains("above 258 Hz") && line.contains("up to 600 Hz"), "{line}");
        assert!(line.ends_with("--time-step 1e-5 --sample-rate 2000"), "{line}");
        assert_eq!(doubt(1e-5, 100_000.0), None);
        assert_eq!(doubt(1e-5, 2000.0), None);
        assert_eq!(doubt(2e-5, 50_000.0), None);
    }

    #[test]
    fn the_rule_lowers_a_resonance_at_the_limit_by_5_percent() {
        let angle = PI * LOWERED;
        assert!((angle.atan() / angle - 0.95).abs() < 1e-3);
    }
}
