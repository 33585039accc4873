//! The support under one rail seat.

use crate::element::SpringDamper;
use tracktwin_parameters::{Parameter, ParameterSet};

/// Railpad, half sleeper and ballast of one sleeper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Railpad stiffness `k_p` in N/m.
    pub railpad_stiffness: f64,
    /// Railpad damping `c_p` in N s/m.
    pub railpad_damping: f64,
    /// Ballast stiffness `k_b` under the half sleeper in N/m.
    pub ballast_stiffness: f64,
    /// Ballast damping `c_b` under the half sleeper in N s/m.
    pub ballast_damping: f64,
    /// Bending stiffness `EI_s` of the sleeper in N m2.
    pub sleeper_bending_stiffness: f64,
}

impl Support {
    /// The railpad, between rail and rail seat.
    pub fn railpad(&self) -> SpringDamper {
        SpringDamper { stiffness: self.railpad_stiffness, damping: self.railpad_damping }
    }

    /// All ballast under the half sleeper.
    pub fn ballast(&self) -> SpringDamper {
        SpringDamper { stiffness: self.ballast_stiffness, damping: self.ballast_damping }
    }

    /// Whether every value is a finite number and the sleeper has bending stiffness; pads and
    /// ballast may be missing (zero).
    pub(super) fn is_physical(&self) -> bool {
        let springs = [
            self.railpad_stiffness,
            self.railpad_damping,
            self.ballast_stiffness,
            self.ballast_damping,
        ];
        springs.iter().all(|value| value.is_finite() && *value >= 0.0)
            && self.sleeper_bending_stiffness.is_finite()
            && self.sleeper_bending_stiffness > 0.0
    }
}

impl From<&ParameterSet> for Support {
    fn from(set: &ParameterSet) -> Self {
        Self {
            railpad_stiffness: set[Parameter::RailpadStiffness],
            railpad_damping: set[Parameter::RailpadDamping],
            ballast_stiffness: set[Parameter::BallastStiffness],
            ballast_damping: set[Parameter::BallastDamping],
            sleeper_bending_stiffness: set[Parameter::SleeperBendingStiffness],
        }
    }
}
