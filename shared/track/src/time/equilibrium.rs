//! Static equilibrium of vehicle and track: the initial state of every pass.

use super::statics::Statics;
use super::{Pass, PassError};
use crate::model::{HertzContact, TrackModel};

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
        let load = model.vehicle().wheel.load_n;
        let ahead = [0.0].into_iter().chain(model.vehicle().further_wheels_m.iter().copied());
        let places_m: Vec<_> = ahead.map(|ahead| pass.start_m + ahead).collect();
        let track = Statics::new(model)?.under(load, &places_m)?;
        let approach = HertzContact::new(model.design()).approach(load);
        let contact = |(&place_m, height_m): (&f64, &f64)| {
            let point = model.layout().rail_point(place_m);
            let local = if pass.local_flexibility { point.local_flexibility * load } else { 0.0 };
            point.deflection(&track) + local + approach + height_m
        };
        let contacts_m = places_m.iter().zip(heights_m).map(contact).collect();
        Ok(Self { track, contacts_m })
    }
}
