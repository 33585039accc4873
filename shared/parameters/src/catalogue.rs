//! The table of parameters that may differ from case to case or from sleeper to sleeper.

use crate::Quantity;
use crate::preset::REAL_SCALE;
use serde::{Deserialize, Serialize};

/// A row of the catalogue, without its documentation.
struct Row {
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    label: &'static str,
    nominal: f64,
    range: [f64; 2],
    /// Exponent of the length ratio: on a track enlarged by `r`, the value is multiplied by `r` to this
    /// power.
    length_exponent: i32,
}

macro_rules! catalogue {
    ($($(#[$doc:meta])* $variant:ident = $row:expr;)+) => {
        /// A quantity of the track that a campaign may vary.
        ///
        /// The order is that of the Sobol axes: append, never insert, so that the coordinates of
        /// earlier axes stay as they were.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "&'static str")]
        pub enum Parameter { $($(#[$doc])* $variant,)+ }

        impl Parameter {
            /// All parameters, in catalogue order.
            pub const ALL: &'static [Parameter] = &[$(Parameter::$variant,)+];
            /// Number of parameters.
            pub const COUNT: usize = Self::ALL.len();

            const fn row(self) -> Row {
                match self { $(Parameter::$variant => $row,)+ }
            }
        }
    };
}

catalogue! {
    /// Vertical stiffness of the railpad under one rail seat, `k_p` in N/m (paper, Table D1).
    RailpadStiffness = Row { name: "railpad_stiffness_N_m", symbol: "k_p", unit: "N/m",
        label: "railpad stiffness", nominal: 1.5e8, range: [10e6, 300e6], length_exponent: 1 };
    /// Vertical damping of the railpad under one rail seat, `c_p` in N s/m (paper, Table D1).
    RailpadDamping = Row { name: "railpad_damping_N_s_m", symbol: "c_p", unit: "N s/m",
        label: "railpad damping", nominal: 6e3, range: [4e3, 9e3], length_exponent: 2 };
    /// Vertical stiffness of the ballast under one half sleeper, `k_b` in N/m (paper, Table D1).
    BallastStiffness = Row { name: "ballast_stiffness_N_m", symbol: "k_b", unit: "N/m",
        label: "ballast stiffness", nominal: 1.2e7, range: [4e6, 22e6], length_exponent: 1 };
    /// Vertical damping of the ballast under one half sleeper, `c_b` in N s/m (paper, Table D1).
    BallastDamping = Row { name: "ballast_damping_N_s_m", symbol: "c_b", unit: "N s/m",
        label: "ballast damping", nominal: 900.0, range: [400.0, 1300.0], length_exponent: 2 };
    /// Bending stiffness of the sleeper, `EI_s` in N m2 (paper, Table D1).
    SleeperBendingStiffness = Row { name: "sleeper_EI_N_m2", symbol: "EI_s", unit: "N m2",
        label: "sleeper bending stiffness", nominal: 5000.0, range: [3543.0, 7086.0], length_exponent: 4 };
    /// Level of the track irregularity, `A_irr` in 1e-4 m2 rad/m (paper, eq. B.6 and Table D1).
    IrregularityLevel = Row { name: "irregularity_level", symbol: "A_irr", unit: "1e-4 m2 rad/m",
        label: "irregularity level", nominal: 3.0, range: [1.0, 5.0], length_exponent: 0 };
}

impl Parameter {
    /// Name of the parameter in messages, SQL, TOML, files and on the command line.
    pub const fn name(self) -> &'static str {
        self.row().name
    }

    /// Symbol of the paper, as plain text.
    pub const fn symbol(self) -> &'static str {
        self.row().symbol
    }

    /// Unit, as plain text.
    pub const fn unit(self) -> &'static str {
        self.row().unit
    }

    /// Name of the parameter for readers.
    pub const fn label(self) -> &'static str {
        self.row().label
    }

    /// The nominal value on V-Track.
    pub const fn nominal(self) -> f64 {
        self.row().nominal
    }

    /// Lowest and highest value on V-Track (paper, Table D1).
    pub const fn range(self) -> [f64; 2] {
        self.row().range
    }

    /// Allowed values on any track: from a thousandth of the range of V-Track to a thousand times the
    /// range of the track `real-scale`.
    pub fn quantity(self) -> Quantity {
        let [low, high] = self.range();
        let real = self.enlarged(high, REAL_SCALE);
        Quantity::new(self.label(), self.unit(), [1e-3 * low, 1e3 * real], [low, real])
    }

    /// Scales a `value` from V-Track to a track whose lengths are `ratio` times those of V-Track (paper,
    /// Table D1: stiffness by the ratio, damping by its square).
    pub fn enlarged(self, value: f64, ratio: f64) -> f64 {
        value * ratio.powi(self.row().length_exponent)
    }

    /// Index in [`Parameter::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The parameter with this name, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|parameter| parameter.name() == name)
    }
}

impl std::fmt::Display for Parameter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl From<Parameter> for &'static str {
    fn from(parameter: Parameter) -> Self {
        parameter.name()
    }
}

impl TryFrom<String> for Parameter {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::from_name(&name).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|parameter| parameter.name()).collect();
            format!("unknown parameter `{name}`; known parameters: {}", known.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_back_to_its_parameter() {
        for (index, parameter) in Parameter::ALL.iter().copied().enumerate() {
            assert_eq!(Parameter::from_name(parameter.name()), Some(parameter));
            assert_eq!(parameter.index(), index);
        }
    }

    #[test]
    fn nominal_values_lie_inside_their_ranges() {
        for parameter in Parameter::ALL {
            let [low, high] = parameter.range();
            assert!(low < parameter.nominal() && parameter.nominal() < high, "{parameter}");
        }
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_known_ones() {
        let message = Parameter::try_from("pad_stiffness".to_owned()).unwrap_err();
        assert!(message.contains("`pad_stiffness`") && message.contains("railpad_stiffness_N_m"));
    }
}
