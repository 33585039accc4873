//! The quantities of a support, by which the baseline's unknowns are addressed.

use tracktwin_parameters::Parameter;

/// A quantity of which every sleeper has its own value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Own {
    /// Stiffness of the ballast, `k_b`.
    BallastStiffness,
    /// Stiffness of the railpad, `k_p`.
    RailpadStiffness,
    /// Irregularity level of the surface, `A_irr`.
    Level,
}

/// A quantity that all sleepers have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Common {
    /// Bending stiffness of the sleeper, `EI_s`.
    SleeperBendingStiffness,
    /// Damping of the railpad, `c_p`.
    RailpadDamping,
    /// Damping of the ballast, `c_b`.
    BallastDamping,
}

/// A quantity of a sleeper, its own or that of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Own(Own),
    Common(Common),
}

impl Own {
    /// All of them, in the order of the unknowns.
    pub const ALL: [Self; 3] = [Self::BallastStiffness, Self::RailpadStiffness, Self::Level];

    /// The parameter of the track that it is.
    pub const fn parameter(self) -> Parameter {
        match self {
            Self::BallastStiffness => Parameter::BallastStiffness,
            Self::RailpadStiffness => Parameter::RailpadStiffness,
            Self::Level => Parameter::IrregularityLevel,
        }
    }
}

impl Common {
    /// All of them, in the order of the unknowns.
    pub const ALL: [Self; 3] =
        [Self::SleeperBendingStiffness, Self::RailpadDamping, Self::BallastDamping];

    /// The parameter of the track that it is.
    pub const fn parameter(self) -> Parameter {
        match self {
            Self::SleeperBendingStiffness => Parameter::SleeperBendingStiffness,
            Self::RailpadDamping => Parameter::RailpadDamping,
            Self::BallastDamping => Parameter::BallastDamping,
        }
    }
}
