//! The vehicle at rest on the track: where every pass starts.

use super::cholesky::Cholesky;
use super::coupled::{self, Resistance};
use super::kinematics::Kinematics;
use super::{Pass, PassError};
use crate::model::{HertzContact, Port, RailPoint, TrackModel};
use nalgebra::{DMatrix, DVector};

/// Displacements under the standing vehicle.
pub(super) struct Equilibrium {
    /// Displacement of every degree of freedom of the track in m and rad.
    pub(super) track: Vec<f64>,
    /// Displacement of every wheel's contact point in m, the first wheel first.
    pub(super) contacts_m: Vec<f64>,
}

impl Equilibrium {
    /// Equilibrium at the start of the pass, on a surface of these heights under each wheel.
    pub(super) fn new(
        model: &TrackModel,
        pass: &Pass,
        heights_m: &[f64],
    ) -> Result<Self, PassError> {
        let (matrices, layout) = (model.matrices(), model.layout());
        let load = model.vehicle().wheel.load_n;
        let ahead = [0.0].into_iter().chain(model.vehicle().further_wheels_m.iter().copied());
        let points: Vec<_> = ahead.map(|ahead| layout.rail_point(pass.start_m + ahead)).collect();
        let mut track = vec![0.0; matrices.size()];
        for (dof, shape) in points.iter().flat_map(RailPoint::entries) {
            track[dof] += shape * load;
        }
        let stiffness = Cholesky::new(matrices, matrices.stiffness())?;
        stiffness.solve(&mut track);
        resist(model, &stiffness, &mut track)
            .ok_or(PassError::NotFinite { position_m: pass.start_m })?;
        let approach = HertzContact::new(model.design()).approach(load);
        let contacts_m = points
            .iter()
            .zip(heights_m)
            .map(|(point, height_m)| {
                let local =
                    if pass.local_flexibility { point.local_flexibility * load } else { 0.0 };
                point.deflection(&track) + local + approach + height_m
            })
            .collect();
        Ok(Self { track, contacts_m })
    }
}

/// Lets the force laws push back on displacements that were found without them.
fn resist(model: &TrackModel, stiffness: &Cholesky, track: &mut [f64]) -> Option<()> {
    let laws = model.force_laws();
    if laws.is_empty() {
        return Some(());
    }
    let resistance = |law| Resistance::Law(law, Kinematics::default(), None);
    let resistances: Vec<_> = laws.iter().map(resistance).collect();
    let ports: Vec<&Port> = laws.iter().map(|law| &law.port).collect();
    let units: Vec<_> = ports.iter().map(|port| stiffness.solve_port(port)).collect();
    let count = laws.len();
    let compliance = DMatrix::from_fn(count, count, |i, j| ports[i].motion(&units[j]));
    let free = DVector::from_iterator(count, ports.iter().map(|port| port.motion(track)));
    let (_, forces) = coupled::solve(&resistances, &compliance, &free, free.clone())?;
    for (unit, force) in units.iter().zip(&forces) {
        track.iter_mut().zip(unit).for_each(|(dof, unit)| *dof -= force * unit);
    }
    Some(())
}
