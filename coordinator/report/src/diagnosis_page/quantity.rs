//! Formatting of numbers with units: 30.0 MN/m, 0.15, 82 µm.
//!
//! This module chooses prefixes and digits. The suffix of a parameter's name gives its unit.

use tracktwin_diagnosis::Estimate;
use tracktwin_parameters::Parameter;

/// Suffixes of parameter names, with unit and whether the unit takes prefixes. A suffix that contains
/// another is listed before the other.
const UNITS: [(&str, &str, bool); 16] = [
    ("_N_m_per_rad", "N m/rad", true),
    ("_dB_per_octave", "dB/octave", false),
    ("_N_s_per_m", "N s/m", true),
    ("_N_per_m", "N/m", true),
    ("_N_s_m", "N s/m", true),
    ("_N_m2", "N m²", true),
    ("_N_m", "N/m", true),
    ("_m_s2", "m/s²", false),
    ("_km_h", "km/h", false),
    ("_dB", "dB", false),
    ("_Hz", "Hz", false),
    ("_kg", "kg", false),
    ("_rad", "rad", false),
    ("_N", "N", true),
    ("_s", "s", true),
    ("_m", "m", true),
];

/// Prefixes with their factors, in descending order.
const PREFIXES: [(f64, &str); 6] =
    [(1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ")];

/// The unit in which a value of a parameter is shown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unit {
    factor: f64,
    /// Name of the unit with prefix; empty for a dimensionless number.
    pub name: String,
}

impl Unit {
    /// Unit for the parameter `parameter`, with a prefix for values of about `size` in SI units.
    pub(super) fn of(parameter: &str, size: f64) -> Self {
        if let Some(known) = Parameter::from_name(parameter).filter(|p| p.unit().contains("1e-4")) {
            let shown = tracktwin_drawing::Shown::of(known);
            return Self { factor: shown.divisor, name: shown.unit };
        }
        let plain = |name: &str| Self { factor: 1.0, name: name.to_owned() };
        match UNITS.iter().find(|(end, ..)| parameter.ends_with(end)) {
            Some((_, unit, true)) => {
                let fits = |(factor, _): &&(f64, &str)| size.abs() >= *factor;
                match PREFIXES.iter().find(fits) {
                    Some((factor, prefix)) => {
                        Self { factor: *factor, name: format!("{prefix}{unit}") }
                    }
                    None => plain(unit),
                }
            }
            Some((_, unit, false)) => plain(unit),
            None => plain(""),
        }
    }

    /// Converts an SI value to this unit.
    pub(super) fn value(&self, si: f64) -> f64 {
        si / self.factor
    }

    /// Appends this unit to a text.
    pub(super) fn after(&self, text: &str) -> String {
        if self.name.is_empty() { text.to_owned() } else { format!("{text} {}", self.name) }
    }
}

/// Formats two SI values in one unit, with enough decimals for three digits of the second.
pub(super) fn rounded_pair(unit: &Unit, si: [f64; 2]) -> [String; 2] {
    let values = si.map(|value| unit.value(value));
    let decimals = tracktwin_number::decimals(values[1], 3);
    values.map(|value| unit.after(&rounded(value, decimals)))
}

/// Formats the mean with its unit, with the digits that its standard deviation justifies.
pub(super) fn mean(parameter: &str, estimate: Estimate) -> String {
    let unit = Unit::of(parameter, estimate.mean);
    unit.after(&rounded(unit.value(estimate.mean), decimals(&unit, estimate)))
}

/// Formats the interval of ± two standard deviations with its unit; it is cut at zero if `positive`.
pub(super) fn interval(parameter: &str, estimate: Estimate, positive: bool) -> String {
    let unit = Unit::of(parameter, estimate.mean);
    let decimals = decimals(&unit, estimate);
    let low = estimate.mean - 2.0 * estimate.sd;
    let low = if positive { low.max(0.0) } else { low };
    let [low, high] =
        [low, estimate.mean + 2.0 * estimate.sd].map(|end| rounded(unit.value(end), decimals));
    unit.after(&format!("{low} to {high}"))
}

/// Number of decimals: one digit of the standard deviation, two if its first digit is one, and at most
/// three digits of the mean.
fn decimals(unit: &Unit, estimate: Estimate) -> usize {
    let (mean, sd) = (unit.value(estimate.mean), unit.value(estimate.sd));
    let of_mean = tracktwin_number::decimals(mean, 3);
    if !(sd.is_finite() && sd > 0.0) {
        return of_mean;
    }
    let leading = sd / 10f64.powf(sd.log10().floor());
    of_mean.min(tracktwin_number::decimals(sd, if leading < 2.0 { 2 } else { 1 }))
}

/// Formats a number with `count` significant digits, without a power of ten.
pub(super) fn digits(value: f64, count: usize) -> String {
    rounded(value, tracktwin_number::decimals(value, count))
}

/// Formats a number with a typographic minus sign; a rounded zero has no sign.
fn rounded(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// Formats a probability in per cent; values near 0 and 100 % are shown as bounds.
pub(super) fn per_cent(probability: f64) -> String {
    match 100.0 * probability {
        p if p >= 99.5 => "over 99 %".to_owned(),
        p if p < 1.0 => "under 1 %".to_owned(),
        p => format!("{p:.0} %"),
    }
}

/// Formats a difference with its sign.
pub(super) fn signed(value: f64, decimals: usize) -> String {
    let text = rounded(value, decimals);
    if value > 0.0 { format!("+{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(parameter: &str, si: f64) -> String {
        let [_, text] = rounded_pair(&Unit::of(parameter, si), [0.0, si]);
        text
    }

    #[test]
    fn values_read_as_an_engineer_writes_them() {
        assert_eq!(value("stiffness_N_per_m", 3e7), "30.0 MN/m");
        assert_eq!(value("railpad_stiffness_N_m", 1.5e8), "150 MN/m");
        assert_eq!(value("rotational_N_m_per_rad", 1.2e5), "120 kN m/rad");
        assert_eq!(value("damping_N_s_per_m", 2e3), "2.00 kN s/m");
        assert_eq!(value("sleeper_EI_N_m2", 5010.0), "5.01 kN m²");
        assert_eq!(value("bending_factor", 0.15), "0.150");
        assert_eq!(value("frequency_Hz", 3210.0), "3210 Hz");
        assert_eq!(value("relaxation_time_s", 3e-4), "300 µs");
        assert_eq!(value("offset_m", -4e-3), "−4.00 mm");
        assert_eq!(value("irregularity_level", 3.0), "3.00 10⁻⁴ m² rad/m");
    }

    #[test]
    fn the_deviation_decides_how_many_digits_are_shown() {
        let dip = Estimate { mean: 8.2e-5, sd: 1.04e-5 };
        assert_eq!(mean("dip_m", dip), "82 µm");
        assert_eq!(interval("dip_m", dip, true), "61 to 103 µm");
        let bending = Estimate { mean: 0.1512, sd: 0.031 };
        assert_eq!(mean("bending_factor", bending), "0.15");
        assert_eq!(mean("stiffness_N_per_m", Estimate { mean: 3.004e7, sd: 1.3e6 }), "30.0 MN/m");
        let loose = Estimate { mean: 2e-5, sd: 1.5e-5 };
        assert_eq!(interval("dip_m", loose, true), "0 to 50 µm");
        assert_eq!(interval("offset_m", loose, false), "−10 to 50 µm");
    }

    #[test]
    fn certainty_is_never_printed_as_a_hundred_per_cent() {
        assert_eq!(per_cent(0.9999), "over 99 %");
        assert_eq!(per_cent(0.934), "93 %");
        assert_eq!(per_cent(0.001), "under 1 %");
    }
}
