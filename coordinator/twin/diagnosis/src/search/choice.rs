//! Evidence that the choice of sleepers costs.

use crate::candidate::Candidate;

/// Logarithm of the number of ways to choose some of all sleepers, in nats: by this much the evidence of the best choice
/// is too high by chance.
pub(super) fn choice_cost(of: usize, chosen: usize) -> f64 {
    let ln_factorial = |number: usize| libm::lgamma(number as f64 + 1.0);
    ln_factorial(of) - ln_factorial(chosen) - ln_factorial(of - chosen)
}

/// A candidate at some of all sleepers, chosen freely.
pub(super) fn on(candidate: &Candidate, chosen: Vec<usize>, of: usize) -> Candidate {
    let mut candidate = candidate.clone();
    candidate.choice_nats = choice_cost(of, chosen.len());
    candidate.extension.sleepers = Some(chosen);
    candidate
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_can_be_chosen_from_thirty_in_142506_ways() {
        assert!((choice_cost(30, 5) - 142_506_f64.ln()).abs() < 1e-9);
        assert!(choice_cost(30, 30).abs() < 1e-9 && choice_cost(30, 0).abs() < 1e-9);
    }
}
