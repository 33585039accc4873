//! Forces that are not a linear function of the motion. The matrices cannot contain them.

use super::Port;
use crate::element::SpringDamper;
use std::fmt::Debug;
use std::sync::Arc;

/// A force at one relative motion, with its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Force in N that resists a positive motion.
    pub force: f64,
    /// Its derivative by the displacement in N/m.
    pub stiffness: f64,
    /// Its derivative by the velocity in N s/m.
    pub damping: f64,
}

/// A law by which a port resists its motion.
///
/// The force must be a continuous function of both arguments that does not decrease: then every
/// time step has one solution.
pub trait Law: Debug + Send + Sync {
    /// The force at a displacement in m and a velocity in m/s.
    fn reaction(&self, displacement_m: f64, velocity_m_s: f64) -> Reaction;
}

/// A force law on a port. It replaces the spring and damper that the matrices contain for this port.
#[derive(Clone, Debug)]
pub struct ForceLaw {
    /// The motion that it resists.
    pub port: Port,
    /// Position of the law along the track in m. A wheel at this position loads the law most.
    pub place_m: f64,
    /// Linear terms that represent the law in the matrices. During assembly they are the terms of its
    /// extension, afterwards the slopes of the law under the standing wheel.
    pub linear: SpringDamper,
    /// The law itself.
    pub law: Arc<dyn Law>,
}

impl ForceLaw {
    /// Difference between the law and its linear terms in the matrices.
    pub(crate) fn correction(&self, displacement_m: f64, velocity_m_s: f64) -> Reaction {
        let Reaction { force, stiffness, damping } =
            self.law.reaction(displacement_m, velocity_m_s);
        let SpringDamper { stiffness: k, damping: c } = self.linear;
        Reaction {
            force: force - k * displacement_m - c * velocity_m_s,
            stiffness: stiffness - k,
            damping: damping - c,
        }
    }
}
