//! The wheel at rest on the track: where every pass starts.

use super::cholesky::Cholesky;
use super::{Pass, PassError};
use crate::model::{HertzContact, TrackModel};

/// Displacements under the standing wheel.
pub(super) struct Equilibrium {
    /// Displacement of every degree of freedom of the track in m and rad.
    pub(super) track: Vec<f64>,
    /// Displacement of the wheel in m.
    pub(super) wheel_m: f64,
}

impl Equilibrium {
    /// Equilibrium at the start of the pass, on a surface of height `height_m` there.
    pub(super) fn new(model: &TrackModel, pass: &Pass, height_m: f64) -> Result<Self, PassError> {
        let matrices = model.matrices();
        let load = model.design().wheel.load_n;
        let point = model.layout().rail_point(pass.start_m);
        let mut track = vec![0.0; matrices.size()];
        for (dof, shape) in point.entries() {
            track[dof] = shape * load;
        }
        Cholesky::new(matrices, matrices.stiffness())?.solve(&mut track);
        let approach = HertzContact::new(model.design()).approach(load);
        let local = if pass.local_flexibility { point.local_flexibility * load } else { 0.0 };
        let wheel_m = point.deflection(&track) + local + approach + height_m;
        Ok(Self { track, wheel_m })
    }
}
