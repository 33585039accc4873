//! Massless spring and damper side by side: railpads and ballast.

/// Spring and damper in parallel, acting on one relative displacement.
///
/// Between two nodes with the port `b = (1, -1)` its matrices `k b bᵀ` and `c b bᵀ` are those of
/// the paper's eq. C.8 and C.9.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringDamper {
    /// Stiffness in N/m.
    pub stiffness: f64,
    /// Damping in N s/m.
    pub damping: f64,
}

impl SpringDamper {
    /// The element scaled by `share`: stiffness and damping of a part of the support.
    #[must_use]
    pub fn share(self, share: f64) -> Self {
        Self { stiffness: self.stiffness * share, damping: self.damping * share }
    }
}
