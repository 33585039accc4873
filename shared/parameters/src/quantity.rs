//! Limits of numbers from users and files: unit, allowed range and usual range.

/// Meaning and limits of a number from a user.
///
/// The program checks every number from a command line or a file against a `Quantity`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Name of the quantity, to follow "no": `sleeper spacing`.
    pub name: &'static str,
    /// Unit as plain text. Empty for counts and ratios.
    pub unit: &'static str,
    /// Lowest and highest allowed value.
    pub range: [f64; 2],
    /// Lowest and highest usual value.
    pub usual: [f64; 2],
    /// Whether the quantity is a count.
    pub is_count: bool,
}

/// A number outside the limits of its [`Quantity`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuantityError {
    /// The text is not a number.
    #[error("`{text}` is not a {}number; give the {}", if of.is_count { "whole " } else { "" }, of.described())]
    Text {
        /// The beginning of the text.
        text: String,
        /// The expected quantity.
        of: Box<Quantity>,
    },
    /// The number is outside the allowed range.
    #[error("{} is not a valid {}{}", with_unit(*value, of.unit), of.described(), of.guess(*value))]
    Range {
        /// The number.
        value: f64,
        /// The expected quantity.
        of: Box<Quantity>,
    },
}

impl Quantity {
    /// A quantity with this name, unit, allowed range and usual range.
    pub const fn new(
        name: &'static str,
        unit: &'static str,
        range: [f64; 2],
        usual: [f64; 2],
    ) -> Self {
        Self { name, unit, range, usual, is_count: false }
    }

    /// A count with this name, allowed range and usual range.
    pub const fn count(name: &'static str, range: [u64; 2], usual: [u64; 2]) -> Self {
        let [low, high] = range;
        let [usual_low, usual_high] = usual;
        let (range, usual) = ([low as f64, high as f64], [usual_low as f64, usual_high as f64]);
        Self { name, unit: "", range, usual, is_count: true }
    }

    /// Returns the value if it is in the allowed range.
    ///
    /// # Errors
    /// [`QuantityError::Range`] if the value is out of range, infinite or NaN.
    pub fn check(self, value: f64) -> Result<f64, QuantityError> {
        let [low, high] = self.range;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(QuantityError::Range { value, of: Box::new(self) })
    }

    /// Parses a text and checks the value.
    ///
    /// # Errors
    /// [`QuantityError::Text`] if the text is not a number; [`QuantityError::Range`] if the number is
    /// out of range.
    pub fn parse(self, text: &str) -> Result<f64, QuantityError> {
        let shown = || text.chars().take(SHOWN).collect();
        let value = text.trim().parse();
        let value = value.map_err(|_| QuantityError::Text { text: shown(), of: Box::new(self) })?;
        self.check(value)
    }

    /// Parses a text as a whole number and checks the value.
    ///
    /// # Errors
    /// The errors of [`Quantity::parse`].
    pub fn parse_count(self, text: &str) -> Result<u64, QuantityError> {
        let digits = text.trim();
        let is_whole = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        if !is_whole && digits.parse::<i128>().is_err() {
            let text = text.chars().take(SHOWN).collect();
            return Err(QuantityError::Text { text, of: Box::new(self) });
        }
        // Beyond 64 bits it is out of range all the more.
        Ok(self.parse(digits)? as u64)
    }

    /// Text with name, allowed range and usual range.
    fn described(self) -> String {
        let Self { name, unit, range: [low, high], usual: [from, to], .. } = self;
        let [low, high, from, to] = [low, high, from, to].map(number);
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let usual = if from == to { from } else { format!("{from} to {to}") };
        format!("{name}: it can be {low} to {high}{unit}; a usual value is {usual}{unit}")
    }

    /// Text with the probable meaning, if the value is usual in another unit.
    fn guess(self, value: f64) -> String {
        let is_usual = |meant: &f64| (self.usual[0]..=self.usual[1]).contains(meant);
        let meant = SLIPS.iter().map(|factor| rounded(value * factor)).find(is_usual);
        meant.map(|meant| format!("; did you mean {}?", number(meant))).unwrap_or_default()
    }
}

/// Characters of a wrong text that a message shows.
const SHOWN: usize = 40;

/// Factors between units that users confuse: milli, kilo, per cent, mega, m/s for km/h.
const SLIPS: [f64; 8] = [1e-3, 1e3, 1e-2, 1e2, 1e-6, 1e6, 3.6, 1.0 / 3.6];

/// The value without the rounding error of a multiplication.
fn rounded(value: f64) -> f64 {
    format!("{value:.12e}").parse().unwrap_or(value)
}

fn with_unit(value: f64, unit: &str) -> String {
    if unit.is_empty() { number(value) } else { format!("{} {unit}", number(value)) }
}

/// The shortest text that parses to the same number.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e7).contains(&value.abs()) || !value.is_finite() {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// Speed of a vehicle in km/h; the fastest train ran 575 km/h once, a measuring trolley walks.
pub const SPEED: Quantity = Quantity::new("speed", "km/h", [0.5, 500.0], [5.0, 350.0]);

/// Distance of neighbouring sleepers in m.
pub const SPACING: Quantity = Quantity::new("sleeper spacing", "m", [0.05, 2.0], [0.1, 0.8]);

/// Samples per second of a recording in Hz.
pub const SAMPLE_RATE: Quantity =
    Quantity::new("sample rate", "Hz", [10.0, 1e7], [1000.0, 200_000.0]);

/// Position along a track in m.
pub const PLACE: Quantity = Quantity::new("position along a track", "m", [-1e7, 1e7], [0.0, 1e5]);

/// Radius of a wheel in m.
pub const WHEEL_RADIUS: Quantity =
    Quantity::new("radius of a wheel", "m", [0.02, 1.5], [0.05, 0.6]);

/// Time step of a simulation in s.
pub const TIME_STEP: Quantity = Quantity::new("time step", "s", [1e-7, 1e-3], [1e-6, 5e-5]);

/// Number of spans of a track.
pub const SPANS: Quantity = Quantity::count("number of spans", [2, 1000], [20, 200]);

/// Number of finite elements of a span or of a half sleeper.
pub const ELEMENTS: Quantity = Quantity::count("number of elements", [1, 64], [2, 16]);

/// Number of cases of a campaign. Each case is a row of the library before the first one is simulated.
pub const CASES: Quantity = Quantity::count("number of cases", [1, 10_000_000], [200, 100_000]);

/// Number of cores of a machine.
pub const CORES: Quantity = Quantity::count("number of cores", [1, 4096], [1, 128]);

/// Frequency of a receptance in Hz.
pub const FREQUENCY: Quantity = Quantity::new("frequency", "Hz", [0.1, 1e5], [10.0, 1e4]);

/// Number of points of a curve.
pub const POINTS: Quantity = Quantity::count("number of frequencies", [2, 100_000], [100, 2000]);

/// Number of passes at a speed, or of a recording.
pub const PASSES: Quantity = Quantity::count("number of passes", [1, 1000], [1, 20]);

/// Standard deviation of a sensor's noise, or a step of its recorder, in m/s2.
pub const SENSOR: Quantity =
    Quantity::new("noise or resolution of a sensor", "m/s2", [0.0, 1e5], [0.0, 10.0]);

/// Error of an odometer in m. Even with the largest value, positions still increase.
pub const WANDER: Quantity = Quantity::new("odometer error", "m", [0.0, 0.05], [0.0, 0.02]);

/// Waiting time of a process in s, up to one year.
pub const SECONDS: Quantity = Quantity::count("time in seconds", [0, 31_536_000], [1, 86_400]);

/// Number of sleepers of a recording.
pub const SLEEPERS: Quantity = Quantity::count("number of sleepers", [0, 100_000], [1, 2000]);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_outside_is_refused_with_unit_range_and_what_was_meant() {
        let refused = |text: &str| SPACING.parse(text).unwrap_err().to_string();
        assert_eq!(
            refused("600"),
            "600 m is not a valid sleeper spacing: it can be 0.05 to 2 m; a usual value is 0.1 to 0.8 m; did you \
                 mean 0.6?"
        );
        assert!(
            refused("1e-6").starts_with("1e-6 m is not a valid sleeper spacing"),
            "{}",
            refused("1e-6")
        );
        for none in ["NaN", "inf", "-inf", "0", "-0.6", "1e400"] {
            assert!(refused(none).contains("it can be 0.05 to 2 m"), "{none}");
        }
        for none in ["", "wide", "0,6", "0.6m", "0x1"] {
            assert!(refused(none).contains("is not a number; give the sleeper spacing"), "{none}");
        }
        assert_eq!(SPACING.parse("0.6"), Ok(0.6));
        assert_eq!(SPEED.parse(" 13 "), Ok(13.0));
        assert!(SPEED.parse("0.1").unwrap_err().to_string().ends_with("km/h; did you mean 100?"));
    }

    #[test]
    fn a_count_is_whole() {
        let refused = |text: &str| CORES.parse_count(text).unwrap_err().to_string();
        for none in ["1.5", "1e3", "", "-", "four", "NaN"] {
            assert!(refused(none).contains("is not a whole number"), "{none}: {}", refused(none));
        }
        for none in ["0", "-1", "1000000000", "18446744073709551616", "99999999999999999999999"] {
            assert!(refused(none).contains("it can be 1 to 4096"), "{none}: {}", refused(none));
        }
        assert_eq!(CORES.parse_count("8"), Ok(8));
    }

    #[test]
    fn what_is_usual_can_be() {
        for of in [
            SPEED,
            SPACING,
            SAMPLE_RATE,
            PLACE,
            WHEEL_RADIUS,
            TIME_STEP,
            SPANS,
            ELEMENTS,
            CASES,
            CORES,
            SLEEPERS,
        ] {
            for usual in of.usual {
                assert_eq!(of.check(usual), Ok(usual), "{}", of.name);
            }
        }
    }
}
