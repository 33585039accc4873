//! Logarithms of tail probabilities; the probabilities of real defects would underflow.

use libm::lgamma as ln_gamma;

/// Largest number of terms of a series or continued fraction.
const TERMS_MAX: usize = 500;

/// `ln P(X >= x)` of a gamma variable of this shape and mean one.
///
/// The mean of `shape` independent periodogram values has this distribution. Source: regularised incomplete
/// gamma function, Abramowitz & Stegun 6.5.29 and 6.5.31.
pub(crate) fn ln_gamma_tail(shape: f64, x: f64) -> f64 {
    let x = x * shape;
    if x <= 0.0 {
        return 0.0;
    }
    let front = shape * x.ln() - x - ln_gamma(shape);
    if x < shape + 1.0 {
        let (mut term, mut sum) = (1.0 / shape, 1.0 / shape);
        for n in 1..TERMS_MAX {
            term *= x / (shape + n as f64);
            sum += term;
        }
        let below = (front + sum.ln()).exp().min(1.0 - f64::EPSILON);
        return (-below).ln_1p();
    }
    // Lentz's continued fraction.
    let (mut b, mut c) = (x + 1.0 - shape, f64::MAX);
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..TERMS_MAX {
        let a = -(n as f64) * (n as f64 - shape);
        b += 2.0;
        d = 1.0 / (a * d + b);
        c = b + a / c;
        fraction *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    (front + fraction.ln()).min(0.0)
}

/// `ln P(R >= ratio)` for the ratio `R` of a periodogram value to the mean of `neighbours` others.
///
/// `R` is the ratio of a chi-square variable with 2 degrees of freedom to one with `2 neighbours`.
pub(crate) fn ln_line_tail(neighbours: f64, ratio: f64) -> f64 {
    -neighbours * (ratio.max(0.0) / neighbours).ln_1p()
}

/// `ln P(R >= ratio)` for the ratio `R` of two independent gamma variables of these shapes and mean one.
///
/// `R` has an F distribution with twice as many degrees of freedom. Source: Abramowitz & Stegun 26.6.2.
pub(crate) fn ln_ratio_tail([above, below]: [f64; 2], ratio: f64) -> f64 {
    if ratio <= 0.0 {
        return 0.0;
    }
    ln_incomplete_beta(below, above, below / (below + above * ratio)).min(0.0)
}

/// `ln P(T >= t)` for a Student variable with `freedom` degrees of freedom.
pub(crate) fn ln_student_tail(freedom: f64, t: f64) -> f64 {
    if t <= 0.0 {
        return 0.0;
    }
    let x = freedom / (freedom + t * t);
    ln_incomplete_beta(0.5 * freedom, 0.5, x) - 2f64.ln()
}

/// `ln I_x(a, b)`, by the continued fraction of Abramowitz & Stegun 26.5.8.
fn ln_incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    let front = ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (1.0 - x).ln();
    if x > (a + 1.0) / (a + b + 2.0) {
        let other = (front + (beta_fraction(b, a, 1.0 - x) / b).ln()).exp();
        return (-other.min(1.0 - f64::EPSILON)).ln_1p();
    }
    front + (beta_fraction(a, b, x) / a).ln()
}

fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    let nonzero = |value: f64| if value.abs() < 1e-300 { 1e-300 } else { value };
    let (mut c, mut d) = (1.0, 1.0 / nonzero(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for m in 1..TERMS_MAX {
        let m = m as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        for step in [even, odd] {
            d = 1.0 / nonzero(1.0 + step * d);
            c = nonzero(1.0 + step / c);
            fraction *= d * c;
        }
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    fraction
}

/// `ln P(N >= hits)` for the number `N` of hits in `tries` trials with probability `chance` each.
pub(crate) fn ln_binomial_tail(hits: usize, tries: usize, chance: f64) -> f64 {
    if hits == 0 {
        return 0.0;
    }
    let (n, k) = (tries as f64, hits as f64);
    // The first term of the sum and a geometric bound on the rest.
    let choices = ln_gamma(n + 1.0) - ln_gamma(k + 1.0) - ln_gamma(n - k + 1.0);
    let first = choices + k * chance.ln() + (n - k) * (1.0 - chance).ln();
    let falling = (n - k) / (k + 1.0) * chance / (1.0 - chance);
    if falling >= 1.0 { 0.0 } else { (first - (-falling).ln_1p()).min(0.0) }
}

/// Upper bound of `ln P(Z >= z)` for a standard normal variable; the bound of `P` is within a factor of
/// three.
pub(crate) fn ln_normal_bound(z: f64) -> f64 {
    if z <= 0.0 { 0.0 } else { -0.5 * z * z - (1.0 + z).ln() }
}

/// Combines probabilities with unknown dependence into one; input and result are logarithms.
///
/// The result is `e` times the geometric mean. Source: Vovk & Wang 2020, *Combining p-values via
/// averaging*, Biometrika 107, proposition 4.
pub(crate) fn combine_dependent_p_values(ln_probabilities: &[f64]) -> f64 {
    if ln_probabilities.len() == 1 {
        return ln_probabilities[0];
    }
    let mean = ln_probabilities.iter().sum::<f64>() / ln_probabilities.len() as f64;
    (1.0 + mean).min(0.0)
}

/// Bonferroni correction: log probability that the best of `tries` trials reaches this log probability.
pub(crate) fn bonferroni(ln_probability: f64, tries: usize) -> f64 {
    (ln_probability + (tries as f64).ln()).min(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_tails_are_those_of_chi_square_tables() {
        // Chi-square with 2, 10 and 24 degrees of freedom at their 5 % and 0.1 % points (tables
        // with three decimals).
        for (freedom, point, tail) in
            [(2.0, 5.991, 0.05), (10.0, 18.307, 0.05), (24.0, 51.179, 0.001), (10.0, 3.940, 0.95)]
        {
            let found = ln_gamma_tail(0.5 * freedom, point / freedom).exp();
            assert!((found / tail - 1.0).abs() < 1e-3, "{found} against {tail}");
        }
    }

    #[test]
    fn a_line_over_many_neighbours_has_an_exponential_tail() {
        assert!((ln_line_tail(1e9, 7.0) + 7.0).abs() < 1e-6);
        assert!(ln_line_tail(10.0, 7.0) > -7.0);
    }

    #[test]
    fn ratio_tails_are_those_of_f_tables() {
        // F with 4 and 10, and with 12 and 20 degrees of freedom at their 5 % and 1 % points.
        for (shapes, point, tail) in [
            ([2.0, 5.0], 3.478, 0.05),
            ([2.0, 5.0], 5.994, 0.01),
            ([6.0, 10.0], 2.278, 0.05),
            ([6.0, 10.0], 3.231, 0.01),
        ] {
            let found = ln_ratio_tail(shapes, point).exp();
            assert!((found / tail - 1.0).abs() < 2e-3, "{found} against {tail}");
        }
        // Over a known mean the tail is a gamma variable's.
        let gamma = ln_gamma_tail(6.0, 5.0);
        assert!((ln_ratio_tail([6.0, 1e7], 5.0) / gamma - 1.0).abs() < 1e-4);
    }

    #[test]
    fn student_tails_are_those_of_tables() {
        for (freedom, t, tail) in [(1.0, 6.314, 0.05), (10.0, 2.764, 0.01), (25.0, 3.450, 0.001)] {
            let found = ln_student_tail(freedom, t).exp();
            // Tables with three decimals of `t`.
            assert!((found / tail - 1.0).abs() < 2e-3, "{found} against {tail}");
        }
        assert!(ln_student_tail(10.0, 0.1).exp() < 0.5);
    }

    #[test]
    fn normal_tails_are_bounded_from_above() {
        for (z, tail) in [(1.0, 0.158_655), (3.0, 1.349_9e-3), (5.0, 2.866_5e-7)] {
            let bound = ln_normal_bound(z).exp();
            assert!(bound >= tail && bound < 3.0 * tail, "{bound} against {tail}");
        }
    }

    #[test]
    fn counts_are_bounded_from_above_and_nearly_reached() {
        // Nine or ten heads of ten: 11 of 1024.
        let found = ln_binomial_tail(9, 10, 0.5).exp();
        let exact = 11.0 / 1024.0;
        assert!(found >= exact && found < 1.02 * exact, "{found}");
        assert_eq!(ln_binomial_tail(5, 10, 0.5), 0.0);
    }

    #[test]
    fn combining_equal_probabilities_costs_a_factor_of_e() {
        let p: f64 = 1e-4;
        assert!((combine_dependent_p_values(&[p.ln(), p.ln()]) - (p.ln() + 1.0)).abs() < 1e-12);
        assert_eq!(combine_dependent_p_values(&[p.ln()]), p.ln());
        assert!((bonferroni(p.ln(), 10).exp() - 1e-3).abs() < 1e-15);
    }
}
