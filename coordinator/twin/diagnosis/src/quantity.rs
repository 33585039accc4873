//! Quantities of a support, which identify the unknowns of the baseline.

use tracktwin_parameters::Parameter;

/// A quantity with a separate value at every sleeper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Own {
    /// Stiffness of the ballast, `k_b`.
    BallastStiffness,
    /// Stiffness of the railpad, `k_p`.
    RailpadStiffness,
    /// Irregularity level of the surface, `A_irr`.
    Level,
}

/// A quantity with one value for all sleepers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Common {
    /// Bending stiffness of the sleeper, `EI_s`.
    SleeperBendingStiffness,
    /// Damping of the railpad, `c_p`.
    RailpadDamping,
    /// Damping of the ballast, `c_b`.
    BallastDamping,
}

/// A quantity of a sleeper, either its own or common to all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Own(Own),
    Common(Common),
}

impl Own {
    /// All quantities, in the order of the unknowns.
    pub const ALL: [Self; 3] = [Self::BallastStiffness, Self::RailpadStiffness, Self::Level];

    /// The corresponding parameter of the track.
    pub const fn parameter(self) -> Parameter {
        match self {
            Self::BallastStiffness => Parameter::BallastStiffness,
            Self::RailpadStiffness => Parameter::RailpadStiffness,
            Self::Level => Parameter::IrregularityLevel,
        }
    }
}

impl Common {
    /// All quantities, in the order of the unknowns.
    pub const ALL: [Self; 3] =
        [Self::SleeperBendingStiffness, Self::RailpadDamping, Self::BallastDamping];

    /// The corresponding parameter of the track.
    pub const fn parameter(self) -> Parameter {
        match self {
            Self::SleeperBendingStiffness => Parameter::SleeperBendingStiffness,
            Self::RailpadDamping => Parameter::RailpadDamping,
            Self::BallastDamping => Parameter::BallastDamping,
        }
    }
}
