//! The track at rest under standing loads, force laws included.

use super::PassError;
use super::cholesky::Cholesky;
use super::coupled::{self, Resistance};
use super::kinematics::Kinematics;
use crate::element::SpringDamper;
use crate::model::{ForceLaw, Port, Reaction, TrackModel};
use nalgebra::{DMatrix, DVector};

/// A track whose stiffness has been factorised.
pub(super) struct Statics<'a> {
    model: &'a TrackModel,
    stiffness: Cholesky,
    /// Displacements of the track per unit force of each law.
    units: Vec<Vec<f64>>,
    /// Motion at each law per unit force of each law, in m/N.
    compliance: DMatrix<f64>,
}

impl<'a> Statics<'a> {
    pub(super) fn new(model: &'a TrackModel) -> Result<Self, PassError> {
        let stiffness = Cholesky::new(model.matrices(), model.matrices().stiffness())?;
        let ports: Vec<&Port> = model.force_laws().iter().map(|law| &law.port).collect();
        let units: Vec<_> = ports.iter().map(|port| stiffness.solve_port(port)).collect();
        let count = ports.len();
        let compliance = DMatrix::from_fn(count, count, |i, j| ports[i].motion(&units[j]));
        Ok(Self { model, stiffness, units, compliance })
    }

    /// Displacements under a load on each of the given places of the rail.
    pub(super) fn under(&self, load_n: f64, places_m: &[f64]) -> Result<Vec<f64>, PassError> {
        let layout = self.model.layout();
        let mut track = vec![0.0; self.model.matrices().size()];
        for &x_m in places_m {
            for (dof, shape) in layout.rail_point(x_m).entries() {
                track[dof] += shape * load_n;
            }
        }
        self.stiffness.solve(&mut track);
        let position_m = places_m.first().copied().unwrap_or_default();
        self.resist(&mut track).ok_or(PassError::NoEquilibrium { position_m })?;
        Ok(track)
    }

    /// Motion in m at each force law under a load on each of the given places of the rail.
    ///
    /// By Maxwell's reciprocity, without a solution of the track: a load at a place moves a law as a
    /// force of the law moves the place.
    fn law_motions(&self, load_n: f64, places_m: &[f64]) -> Option<Vec<f64>> {
        let layout = self.model.layout();
        let places: Vec<_> = places_m.iter().map(|&x_m| layout.rail_point(x_m)).collect();
        let deflection = |unit: &Vec<f64>| places.iter().map(|it| it.deflection(unit)).sum::<f64>();
        let free = self.units.iter().map(|unit| load_n * deflection(unit));
        let (motions, _) = self.resisted(&DVector::from_iterator(self.units.len(), free))?;
        Some(motions.iter().copied().collect())
    }

    /// Adds the effect of the force laws to displacements computed without them.
    fn resist(&self, track: &mut [f64]) -> Option<()> {
        let laws = self.model.force_laws();
        if laws.is_empty() {
            return Some(());
        }
        let motions = laws.iter().map(|law| law.port.motion(track));
        let (_, forces) = self.resisted(&DVector::from_iterator(laws.len(), motions))?;
        for (unit, force) in self.units.iter().zip(&forces) {
            track.iter_mut().zip(unit).for_each(|(dof, unit)| *dof -= force * unit);
        }
        Some(())
    }

    /// Motions in m at the force laws, and their forces in N, from the motions without them.
    fn resisted(&self, free: &DVector<f64>) -> Option<(DVector<f64>, DVector<f64>)> {
        let resistance = |law| Resistance::Law(law, Kinematics::default(), None);
        let resistances: Vec<_> = self.model.force_laws().iter().map(resistance).collect();
        coupled::solve(&resistances, &self.compliance, free, free.clone())
    }
}

/// A track under the standing vehicle.
pub(crate) struct StaticSolution<'a>(Statics<'a>);

impl<'a> StaticSolution<'a> {
    /// `None` where the track cannot carry a wheel.
    pub(crate) fn new(model: &'a TrackModel) -> Option<Self> {
        Statics::new(model).ok().map(Self)
    }

    /// Spring and damper that each force law equals for small motions while the first wheel is at `x_m`.
    pub(crate) fn tangents(&self, x_m: f64) -> Option<Vec<SpringDamper>> {
        let Self(statics) = self;
        let load_n = statics.model.vehicle().wheel.load_n;
        let motions = statics.law_motions(load_n, &self.wheels_m(x_m))?;
        Some(self.tangents_at(motions.into_iter()))
    }

    /// Computes the tangents from the displacements of the whole track. The version of the physics
    /// depends on the last digits of this result.
    fn tangents_by_track(&self, x_m: f64) -> Option<Vec<SpringDamper>> {
        let Self(statics) = self;
        let load_n = statics.model.vehicle().wheel.load_n;
        let track = statics.under(load_n, &self.wheels_m(x_m)).ok()?;
        Some(self.tangents_at(statics.model.force_laws().iter().map(|law| law.port.motion(&track))))
    }

    /// Places in m of the wheels on the track, with the first wheel at `x_m`.
    fn wheels_m(&self, x_m: f64) -> Vec<f64> {
        let Self(statics) = self;
        let nodes_m = statics.model.layout().rail_nodes_m();
        let ends_m = nodes_m[0]..=nodes_m[nodes_m.len() - 1];
        let further = statics.model.vehicle().further_wheels_m.iter().map(|ahead_m| x_m + ahead_m);
        [x_m].into_iter().chain(further.filter(|place_m| ends_m.contains(place_m))).collect()
    }

    fn tangents_at(&self, motions_m: impl Iterator<Item = f64>) -> Vec<SpringDamper> {
        let tangent = |(law, motion_m): (&ForceLaw, f64)| {
            let Reaction { stiffness, damping, .. } = law.law.reaction(motion_m, 0.0);
            SpringDamper { stiffness, damping }
        };
        self.0.model.force_laws().iter().zip(motions_m).map(tangent).collect()
    }

    /// Tangents of each law with the first wheel directly above the law.
    pub(crate) fn tangents_above(&self) -> Option<Vec<SpringDamper>> {
        let Self(statics) = self;
        let mut latest: Option<(f64, Vec<SpringDamper>)> = None;
        let mut tangents = Vec::with_capacity(statics.model.force_laws().len());
        for (index, law) in statics.model.force_laws().iter().enumerate() {
            let all = match latest.take() {
                Some((place_m, all)) if place_m == law.place_m => all,
                _ => self.tangents_by_track(law.place_m)?,
            };
            tangents.push(all[index]);
            latest = Some((law.place_m, all));
        }
        Some(tangents)
    }
}
