//! The assembled track.

use super::assembly::Assembled;
use super::{
    Assembly, ContactPatch, ForceLaw, Layout, Matrices, Mesh, Roughness, Support, Surface, Vehicle,
};
use crate::element::SpringDamper;
use crate::extension::{Extension, Measured};
use crate::time;
use num_complex::Complex64;
use std::sync::{Arc, OnceLock};
use tracktwin_parameters::TrackDesign;

/// Rail, sleepers, railpads, ballast and extensions as `M ü + C u̇ + K u = f`.
///
/// The rail runs from 0 to `spans × spacing`, its ends held in deflection and free in rotation;
/// sleeper `i` (from 0) stands at `(i + 1) × spacing`, and none stands at the ends. Source: paper,
/// 2.4.1, Appendices B and C.
///
/// The matrices do not contain every contribution of an extension. The model, not the extension, provides the
/// others: force laws, height of the surface, spectrum of its roughness, vehicle, sensor.
#[derive(Clone, Debug)]
pub struct TrackModel {
    design: TrackDesign,
    layout: Layout,
    matrices: Matrices,
    force_laws: Vec<ForceLaw>,
    vehicle: Vehicle,
    /// The contact patch that filters the surface, if the design has one.
    contact_patch: Option<ContactPatch>,
    /// Offsets in m and weights of the mean over the patch, computed when they are first needed.
    patch_weights: OnceLock<Vec<(f64, f64)>>,
    /// Distance in m that the first wheel rolled before it reached the origin of the track.
    wheel_turned_m: f64,
    extensions: Vec<Arc<dyn Extension>>,
}

/// Why a track cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The track has no sleeper, or a span or the sleepers have no element.
    #[error("the mesh needs at least two spans, and at least one element per span and per sleeper")]
    Mesh,
    /// The number of supports differs from the number of sleepers.
    #[error("{spans} spans have {} sleepers, but {supports} supports are given", spans - 1)]
    Supports {
        /// Number of spans of the mesh.
        spans: usize,
        /// Number of given supports.
        supports: usize,
    },
    /// A stiffness or damping is negative, NaN or infinite, or a sleeper has no bending stiffness.
    #[error("the support of sleeper {sleeper} is not physical: {support:?}")]
    Support {
        /// Index of the sleeper, from 0.
        sleeper: usize,
        /// Its support.
        support: Support,
    },
    /// The rail seat lies beyond the sleeper.
    #[error("the rail seat at {rail_seat_m} m lies outside the half sleeper of {half_length_m} m")]
    RailSeat {
        /// Its distance from the symmetry plane in m.
        rail_seat_m: f64,
        /// Length of the half sleeper in m.
        half_length_m: f64,
    },
}

impl TrackModel {
    /// Assembles the track from one support per sleeper, then adds the extensions by their [`Stage`](crate::extension::Stage).
    ///
    /// # Errors
    /// [`ModelError`] names the invalid input.
    pub fn build(
        design: &TrackDesign,
        mesh: &Mesh,
        supports: &[Support],
        extensions: &[Arc<dyn Extension>],
    ) -> Result<Self, ModelError> {
        check(design, mesh, supports)?;
        let mut assembly = Assembly::new(design, Layout::new(design, mesh), supports);
        let mut vehicle = Vehicle::rigid(&design.wheel);
        let mut staged: Vec<_> = extensions.iter().collect();
        staged.sort_by_key(|extension| extension.stage());
        for extension in staged {
            extension.assemble(&mut assembly);
        }
        for extension in extensions {
            extension.equip(&mut vehicle);
        }
        let Assembled { layout, matrices, force_laws } = assembly.finish();
        let contact_patch = design.contact_patch_filter.then(|| ContactPatch::new(design));
        let (design, extensions) = (design.clone(), extensions.to_vec());
        let wheel_turned_m = 0.0;
        let assembled = Self {
            design,
            layout,
            matrices,
            force_laws,
            vehicle,
            contact_patch,
            patch_weights: OnceLock::new(),
            wheel_turned_m,
            extensions,
        };
        Ok(assembled.linearised())
    }

    /// The track with every force law linearised for a wheel directly above the law.
    ///
    /// If the track cannot carry a wheel, its matrices do not change. A pass over this track then
    /// returns the error.
    fn linearised(self) -> Self {
        if self.force_laws.is_empty() {
            return self;
        }
        let tangents =
            time::StaticSolution::new(&self).and_then(|solution| solution.tangents_above());
        match tangents {
            Some(tangents) => self.with_tangents(&tangents),
            None => self,
        }
    }

    /// The track with each force law linearised to the given spring and damper.
    pub(crate) fn with_tangents(mut self, tangents: &[SpringDamper]) -> Self {
        let change = |(law, tangent): (&ForceLaw, &SpringDamper)| SpringDamper {
            stiffness: tangent.stiffness - law.linear.stiffness,
            damping: tangent.damping - law.linear.damping,
        };
        let pairs = self.force_laws.iter().zip(tangents);
        let changes: Vec<_> = pairs.map(|pair| (&pair.0.port, change(pair))).collect();
        self.matrices = self.matrices.with(&changes);
        for (law, tangent) in self.force_laws.iter_mut().zip(tangents) {
            law.linear = *tangent;
        }
        self
    }

    /// Design from which the track was built. The supports are separate.
    pub fn design(&self) -> &TrackDesign {
        &self.design
    }

    /// Positions and numbers of the degrees of freedom.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Whether both tracks differ only in the values of their matrices, and in masses, loads and contacts of
    /// their wheels.
    pub(crate) fn has_pattern_of(&self, other: &Self) -> bool {
        self.layout == other.layout
            && self.vehicle.oscillators == other.vehicle.oscillators
            && self.vehicle.further_wheels_m == other.vehicle.further_wheels_m
            && self.matrices.has_pattern_of(&other.matrices)
    }

    /// Mass, damping and stiffness matrix. They contain the force laws in linearised form.
    pub fn matrices(&self) -> &Matrices {
        &self.matrices
    }

    /// The force laws: forces that are not linear.
    pub fn force_laws(&self) -> &[ForceLaw] {
        &self.force_laws
    }

    /// The vehicle on the track.
    pub fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// Whether the track is linear: no force laws, and one rigid wheel as the vehicle.
    pub fn is_linear(&self) -> bool {
        self.force_laws.is_empty() && self.vehicle.is_rigid_wheel()
    }

    /// The contact patch that filters the surface, if the design has one.
    pub const fn contact_patch(&self) -> Option<ContactPatch> {
        self.contact_patch
    }

    /// Height in m, positive downwards, that the shapes of rail and first wheel add for the contact at `x_m`.
    pub fn felt_profile_m(&self, x_m: f64) -> f64 {
        self.felt_rail_profile_m(x_m) + self.wheel_profile_m(x_m)
    }

    /// As [`TrackModel::felt_profile_m`] for a further wheel, which is round: the profile of the rail, with the
    /// part that the contact patch averages as its mean over the patch.
    pub fn felt_rail_profile_m(&self, x_m: f64) -> f64 {
        let point_m = self.point_profile_m(x_m);
        let has_averaged = self.extensions.iter().any(|extension| self.averages(extension));
        let Some(patch) = self.contact_patch.filter(|_| has_averaged) else { return point_m };
        let weights = self.patch_weights.get_or_init(|| patch.weights());
        let at = |(offset_m, weight): &(f64, f64)| weight * self.averaged_profile_m(x_m + offset_m);
        point_m + weights.iter().map(at).sum::<f64>()
    }

    /// Part of [`TrackModel::profile_m`] that the contact patch averages; zero without a patch.
    pub fn averaged_profile_m(&self, x_m: f64) -> f64 {
        let averaged = self.extensions.iter().filter(|extension| self.averages(extension));
        averaged.map(|extension| extension.profile_m(x_m)).sum()
    }

    /// The other part of [`TrackModel::profile_m`].
    pub fn point_profile_m(&self, x_m: f64) -> f64 {
        let others = self.extensions.iter().filter(|extension| !self.averages(extension));
        others.map(|extension| extension.profile_m(x_m)).sum()
    }

    fn averages(&self, extension: &Arc<dyn Extension>) -> bool {
        self.contact_patch.is_some() && extension.is_averaged()
    }

    /// Height in m, positive downwards, that extensions add to the surface at `x_m`.
    pub fn profile_m(&self, x_m: f64) -> f64 {
        self.extensions.iter().map(|extension| extension.profile_m(x_m)).sum()
    }

    /// Height in m, positive downwards, that the first wheel's own shape adds at `x_m`.
    pub fn wheel_profile_m(&self, x_m: f64) -> f64 {
        let rolled_m = x_m + self.wheel_turned_m;
        self.extensions.iter().map(|extension| extension.wheel_profile_m(rolled_m)).sum()
    }

    /// The track with a first wheel that has rolled `rolled_m` metres farther. The wheel then enters the
    /// track at another angle.
    #[must_use]
    pub fn with_wheel_turned(mut self, rolled_m: f64) -> Self {
        self.wheel_turned_m += rolled_m;
        self
    }

    /// Factor of contact patch and extensions on the spectral density of the irregularity at a wave
    /// number in rad/m.
    pub fn roughness_gain(&self, wave_number_rad_m: f64) -> f64 {
        let gain = |extension: &Arc<dyn Extension>| extension.roughness_gain(wave_number_rad_m);
        let by_extensions: f64 = self.extensions.iter().map(gain).product();
        let by_patch = self.contact_patch.map_or(1.0, |patch| patch.gain(wave_number_rad_m));
        by_extensions * by_patch
    }

    /// The irregularity along the whole track, from this seed and the given roughness, with the changes
    /// by extensions. It does not contain [`TrackModel::profile_m`].
    pub fn surface(&self, roughness: &Roughness, seed: u64) -> Surface {
        let gain = |wave_number| self.roughness_gain(wave_number);
        roughness.shaped_surface(seed, self.layout.length_m(), gain)
    }

    /// Transfer function of the measuring chain for a harmonic acceleration at a frequency in Hz: ratio of
    /// recorded to true amplitude.
    pub fn sensor_transfer(&self, frequency_hz: f64) -> Complex64 {
        self.extensions.iter().map(|extension| extension.sensor_transfer(frequency_hz)).product()
    }

    /// Replaces the true acceleration and position by those that the measuring chain would have recorded.
    pub fn measure(&self, measured: &mut Measured) {
        for extension in &self.extensions {
            extension.measure(measured);
        }
    }
}

fn check(design: &TrackDesign, mesh: &Mesh, supports: &[Support]) -> Result<(), ModelError> {
    let spans = mesh.spans();
    if spans < 2 || mesh.sleeper_elements == 0 || mesh.rail_elements.contains(&0) {
        return Err(ModelError::Mesh);
    }
    if supports.len() != spans - 1 {
        return Err(ModelError::Supports { spans, supports: supports.len() });
    }
    if let Some(sleeper) = supports.iter().position(|support| !support.is_physical()) {
        return Err(ModelError::Support { sleeper, support: supports[sleeper] });
    }
    let (rail_seat_m, half_length_m) = (design.sleeper.rail_seat_m, design.sleeper.half_length_m);
    if !(0.0..=half_length_m).contains(&rail_seat_m) {
        return Err(ModelError::RailSeat { rail_seat_m, half_length_m });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::ParameterSet;

    const SPANS: usize = 5;

    fn model(design: &TrackDesign) -> TrackModel {
        let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
        TrackModel::build(design, &Mesh::uniform(SPANS, 8, 8), &supports, &[]).unwrap()
    }

    #[test]
    fn the_matrices_are_symmetric() {
        let model = model(&TrackDesign::v_track());
        let matrices = model.matrices();
        for values in [matrices.mass(), matrices.damping(), matrices.stiffness()] {
            let entries: std::collections::HashMap<_, _> = matrices
                .places()
                .map(|(row, column, place)| ((row, column), values[place]))
                .collect();
            for (row, column, place) in matrices.places() {
                assert_eq!(values[place], entries[&(column, row)], "entry {row}, {column}");
            }
        }
    }

    #[test]
    fn lowered_as_a_whole_every_sleeper_weighs_its_mass_and_rests_on_all_its_ballast() {
        let design = TrackDesign::v_track();
        let model = model(&design);
        let mut down = vec![0.0; model.matrices().size()];
        for sleeper in model.layout().sleepers() {
            for node in 0..=sleeper.tip_node() {
                down[sleeper.deflection_dof(node)] = 1.0;
            }
        }
        let work = |values: &[f64]| -> f64 {
            model.matrices().product(values, &down).iter().zip(&down).map(|(f, u)| f * u).sum()
        };
        let sleepers = (SPANS - 1) as f64;
        let support = Support::from(&ParameterSet::nominal());
        let mass = sleepers * design.sleeper_mass();
        let stiffness = sleepers * (support.ballast_stiffness + support.railpad_stiffness);
        let damping = sleepers * (support.ballast_damping + support.railpad_damping);
        // Sums of some hundred terms that cancel.
        assert!((work(model.matrices().mass()) / mass - 1.0).abs() < 1e-9);
        assert!((work(model.matrices().stiffness()) / stiffness - 1.0).abs() < 1e-9);
        assert!((work(model.matrices().damping()) / damping - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_node_stands_under_the_rail_seat_wherever_it_is() {
        for (rail_seat_m, elements) in [(0.0, 8), (0.15, 8), (0.01, 4), (0.24, 8), (0.15, 1)] {
            let mut design = TrackDesign::v_track();
            design.sleeper.rail_seat_m = rail_seat_m;
            let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
            let mesh = Mesh::uniform(SPANS, 2, elements);
            let model = TrackModel::build(&design, &mesh, &supports, &[]).unwrap();
            let sleeper = &model.layout().sleepers()[0];
            assert_eq!(sleeper.nodes_m[sleeper.seat_node], rail_seat_m);
            assert_eq!(sleeper.nodes_m[sleeper.tip_node()], design.sleeper.half_length_m);
            assert!(sleeper.nodes_m.is_sorted_by(|a, b| a < b), "{:?}", sleeper.nodes_m);
        }
    }

    #[test]
    fn a_wrong_number_of_supports_is_refused() {
        let design = TrackDesign::v_track();
        let support = Support::from(&ParameterSet::nominal());
        let error = TrackModel::build(&design, &Mesh::uniform(5, 8, 8), &[support], &[]);
        assert_eq!(error.unwrap_err(), ModelError::Supports { spans: 5, supports: 1 });
    }

    #[test]
    fn a_rail_point_interpolates_between_its_nodes() {
        let model = model(&TrackDesign::v_track());
        let layout = model.layout();
        let sleeper = &layout.sleepers()[1];
        let mut displacement = vec![0.0; model.matrices().size()];
        let above = layout.rail_node_dofs(sleeper.rail_node)[0].unwrap();
        displacement[above] = 1.0;
        let point = layout.rail_point(sleeper.position_m);
        assert!((point.deflection(&displacement) - 1.0).abs() < 1e-12);
        assert_eq!(layout.rail_port(sleeper.position_m).motion(&displacement), 1.0);
        assert_eq!(layout.railpad_port(1).motion(&displacement), 1.0);
        assert_eq!(layout.railpad_port(0).motion(&displacement), 0.0);
    }
}
