//! Formatting of parameter estimates: units with prefixes, and digits according to the uncertainty.

use tracktwin_parameters::Parameter;

/// Format of a parameter: the SI value divided by `divisor`, in the unit `unit`.
pub struct Shown {
    /// Divisor of the SI value.
    pub divisor: f64,
    /// The unit, with its prefix.
    pub unit: String,
}

impl Shown {
    /// Format of this parameter. The upper end of the parameter's range determines the prefix.
    pub fn of(parameter: Parameter) -> Self {
        let [_, high] = parameter.range();
        let (divisor, prefix) = match high {
            1e6.. => (1e6, "M"),
            1e3.. => (1e3, "k"),
            _ => (1.0, ""),
        };
        let unit = parameter.unit().replace("1e-4", "10⁻⁴").replace("m2", "m²");
        Self { divisor, unit: format!("{prefix}{unit}") }
    }

    /// Formats mean and standard deviation, both in SI units, as `148 ± 12`.
    pub fn estimate(&self, mean: f64, sd: f64) -> String {
        let (mean, sd) = (mean / self.divisor, sd / self.divisor);
        let decimals = tracktwin_number::decimals(mean, 3);
        format!("{mean:.decimals$} ± {sd:.decimals$}")
    }
}

/// Formats a number with three significant digits.
pub fn significant(value: f64) -> String {
    tracktwin_number::significant(value, 3)
}

/// Formats a share (0 to 1) in percent with two significant digits.
pub fn percent(share: f64) -> String {
    format!("{} %", tracktwin_number::significant(100.0 * share, 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_have_three_significant_digits_and_a_prefix() {
        let shown = Shown::of(Parameter::RailpadStiffness);
        assert_eq!(shown.unit, "MN/m");
        assert_eq!(shown.estimate(1.4829e8, 1.27e7), "148 ± 13");
        assert_eq!(Shown::of(Parameter::IrregularityLevel).unit, "10⁻⁴ m² rad/m");
        assert_eq!(significant(0.012_345), "0.0123");
        assert_eq!(significant(0.0), "0");
        let shares = [0.0, 4.3e-5, 0.0214, 0.45, 1.0].map(percent);
        assert_eq!(shares, ["0 %", "0.0043 %", "2.1 %", "45 %", "100 %"]);
    }
}
