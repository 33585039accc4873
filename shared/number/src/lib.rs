//! Numbers as text for readers: on pages, in messages and in sentences; quantiles of the normal distribution.
//!
//! This crate defines the number of digits, and the text for numbers that are too large or too small to
//! be measured. The pages add units with prefixes. Files for programs contain the numbers themselves.

/// Smallest probability that the program states.
///
/// The statistical tests assume distributions whose tails are not verified below this probability.
pub const PROBABILITY_LEAST: f64 = 1e-12;

/// Largest ratio that is stated as a number. The text for a larger ratio is "more than 1000".
pub const RATIO_GREATEST: f64 = 1000.0;

/// Half width of the central 90 % interval of a normal distribution, in standard deviations.
pub const NORMAL_90: f64 = 1.644_853_626_951_472_7;

/// Upper quartile of a normal distribution, in standard deviations.
pub const NORMAL_QUARTILE: f64 = 0.674_489_750_196_081_7;

/// Largest number of decimals.
const DECIMALS_MAX: i64 = 9;
/// Magnitude from which a number is written with a power of ten.
const SIZE_MAX: f64 = 1e7;
const SIZE_MIN: f64 = 1e-5;

/// A probability from its logarithm, not below [`PROBABILITY_LEAST`] and not above one.
pub fn probability(ln_p: f64) -> f64 {
    floored(ln_p.exp())
}

/// A probability, not below [`PROBABILITY_LEAST`] and not above one.
pub const fn floored(probability: f64) -> f64 {
    probability.clamp(PROBABILITY_LEAST, 1.0)
}

/// A probability as text: `0.012`, `3e-7`, `below 1e-12`.
pub fn chance(probability: f64) -> String {
    chance_down_to(probability, PROBABILITY_LEAST)
}

/// A probability as text like [`chance`], for a test whose smallest probability is `least`.
pub fn chance_down_to(probability: f64, least: f64) -> String {
    if probability <= least {
        let least = if least < 1e-3 { format!("{least:.0e}") } else { least.to_string() };
        format!("below {least}")
    } else if probability < 1e-3 {
        format!("{probability:.0e}")
    } else {
        significant(probability, 2)
    }
}

/// A ratio of powers or amplitudes with two digits, to follow "is": `3.4`, `210`, `more than 1000`.
pub fn ratio(ratio: f64) -> String {
    if ratio > RATIO_GREATEST {
        format!("more than {RATIO_GREATEST}")
    } else {
        significant(ratio, 2)
    }
}

/// The number rounded to `digits` significant digits, without trailing zeros after the point: `67.4`,
/// `25600`, `0.0123`, `3.3e300`.
pub fn rounded(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    let (number, power) = text.split_once('e').map_or((text.as_str(), None), |(n, p)| (n, Some(p)));
    let number = if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        number
    };
    power.map_or_else(|| number.to_owned(), |power| format!("{number}e{power}"))
}

/// The number with `digits` significant digits, including trailing zeros: `30.0`, `0.150`, `0`.
///
/// Further digits before the point are zeros. A number that would need many zeros is written with a
/// power of ten.
pub fn significant(value: f64, digits: usize) -> String {
    let digits = digits.max(1);
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let text = format!("{value:.*e}", digits - 1);
    let rounded: f64 = text.parse().unwrap_or(value);
    if rounded.abs() >= SIZE_MAX || rounded.abs() < SIZE_MIN {
        return text;
    }
    let decimals = decimals(value, digits);
    format!("{rounded:.decimals$}")
}

/// Number of decimals that show `digits` significant digits of `value`, at most nine.
pub fn decimals(value: f64, digits: usize) -> usize {
    // Rounding first: 9.97 with two digits is 10, not 10.0.
    let text = format!("{value:.*e}", digits.max(1) - 1);
    let power: i64 = text.split_once('e').and_then(|(_, p)| p.parse().ok()).unwrap_or(0);
    if value == 0.0 {
        0
    } else {
        (i64::try_from(digits).unwrap_or(DECIMALS_MAX) - 1 - power).clamp(0, DECIMALS_MAX) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_the_digits_asked_for_and_no_more() {
        let cases = [
            (67.389, 3, "67.4"),
            (9.97, 2, "10"),
            (0.012_345, 3, "0.0123"),
            (0.0, 3, "0"),
            (30.0, 3, "30.0"),
            (123_456.0, 3, "123000"),
            (-4.04, 2, "-4.0"),
            (3.275_619_9e300, 3, "3.28e300"),
            (5e-324, 2, "4.9e-324"),
            (1e-10, 2, "1.0e-10"),
            (f64::INFINITY, 2, "inf"),
        ];
        for (value, digits, expected) in cases {
            assert_eq!(significant(value, digits), expected, "{value} with {digits}");
        }
    }

    #[test]
    fn trailing_zeros_behind_the_point_are_dropped_but_no_others() {
        let cases = [
            (10_000.000_000_1, 8, "10000"),
            (25_600.25, 8, "25600.25"),
            (0.6, 6, "0.6"),
            (100.0, 2, "100"),
            (2e300, 3, "2e300"),
        ];
        for (value, digits, expected) in cases {
            assert_eq!(rounded(value, digits), expected);
        }
    }

    #[test]
    fn no_probability_is_nought_and_none_is_told_below_the_least() {
        assert_eq!(probability(-1e4), PROBABILITY_LEAST);
        assert_eq!(probability(0.1), 1.0);
        assert_eq!(chance(0.0), "below 1e-12");
        assert_eq!(chance(probability(-1e4)), "below 1e-12");
        assert_eq!(chance(3.4e-7), "3e-7");
        assert_eq!(chance(0.0123), "0.012");
        assert_eq!(chance_down_to(1e-9, 1e-3), "below 0.001");
    }

    #[test]
    fn a_ratio_beyond_what_can_be_measured_is_only_said_to_be_greater() {
        assert_eq!(ratio(3.42), "3.4");
        assert_eq!(ratio(345.0), "340");
        assert_eq!(ratio(f64::MAX), "more than 1000");
        assert_eq!(ratio(f64::INFINITY), "more than 1000");
    }
}
