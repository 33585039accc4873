//! The fast solver: many cases at once, eight side by side in the lanes of vector registers.
//!
//! The same scheme on the same matrices as the plain solver. Cases on one pattern share the order
//! of elimination; the wheel stands at the same place in all of them, so that its shape functions
//! are scalars; and one forward elimination serves both the past and the contact force.

#![expect(
    clippy::inline_always,
    reason = "what runs inside a pass must be compiled into it for each instruction set"
)]

mod block;
mod contact;
mod elimination;
mod factor;
mod inertia;
mod motion;
mod runs;

use super::{Pass, PassError, PassRecord};
use crate::model::{Surface, TrackModel};
use block::{Block, LANES};
use elimination::Elimination;
use motion::{Motion, Station};
use std::array;

/// Runs the wheel over many tracks, each with its own surface; the records come in their order.
///
/// Equal to [`super::pass`] case by case, up to rounding; equal to the last bit however the cases
/// are grouped and ordered. Cases of one design, mesh and kind of extensions share their work,
/// eight at a time; others are computed apart.
///
/// # Errors
/// [`PassError`] of the first case that has one.
pub(super) fn passes(
    models: &[TrackModel],
    pass: &Pass,
    surfaces: &[Surface],
) -> Result<Vec<PassRecord>, PassError> {
    if models.len() != surfaces.len() {
        return Err(PassError::Surfaces { models: models.len(), surfaces: surfaces.len() });
    }
    let mut records: Vec<Option<PassRecord>> = vec![None; models.len()];
    for family in families(models) {
        let first = &models[family[0]];
        pass.check(first)?;
        let elimination = Elimination::new(first.layout(), first.matrices());
        let stations = stations(first, pass, &elimination);
        for group in family.chunks(LANES) {
            // A short last group is filled up with copies of its last case.
            let case = |lane: usize| group[lane.min(group.len() - 1)];
            let models: [&TrackModel; LANES] = array::from_fn(|lane| &models[case(lane)]);
            let surfaces: [&Surface; LANES] = array::from_fn(|lane| &surfaces[case(lane)]);
            let forces = run(&elimination, &stations, models, pass, surfaces)?;
            for (lane, &index) in group.iter().enumerate() {
                records[index] = Some(record(models[lane], pass, &forces, lane)?);
            }
        }
    }
    Ok(records.into_iter().flatten().collect())
}

/// Indices of the models that may run side by side: equal in all but their values.
fn families(models: &[TrackModel]) -> Vec<Vec<usize>> {
    let mut families: Vec<Vec<usize>> = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let alike = |family: &&mut Vec<usize>| models[family[0]].has_pattern_of(model);
        match families.iter_mut().find(alike) {
            Some(family) => family.push(index),
            None => families.push(vec![index]),
        }
    }
    families
}

/// Where the wheel stands at the end of every step, and at the start.
fn stations(model: &TrackModel, pass: &Pass, elimination: &Elimination) -> Vec<Station> {
    let station = |step| Station::new(model, pass, elimination, pass.position_m(step));
    (0..=pass.steps()).map(station).collect()
}

/// Contact forces of eight cases at the start and after every step.
fn run(
    elimination: &Elimination,
    stations: &[Station],
    models: [&TrackModel; LANES],
    pass: &Pass,
    surfaces: [&Surface; LANES],
) -> Result<Vec<Block>, PassError> {
    let heights: Vec<Block> = (0..stations.len())
        .map(|step| Block::from_fn(|lane| pass.height_m(models[lane], surfaces[lane], step)))
        .collect();
    let motion = Motion::start(elimination, &stations[0], models, pass, heights[0])?;
    Ok(motion.run(&stations[1..], &heights[1..]))
}

/// The record of one lane.
fn record(
    model: &TrackModel,
    pass: &Pass,
    forces: &[Block],
    lane: usize,
) -> Result<PassRecord, PassError> {
    let wheel = &model.design().wheel;
    let mut record = PassRecord::start(pass, forces[0].0[lane]);
    for (step, force) in forces.iter().enumerate().skip(1) {
        let force_n = force.0[lane];
        if !force_n.is_finite() {
            return Err(PassError::NotFinite { position_m: pass.position_m(step) });
        }
        record.push((wheel.load_n - force_n) / wheel.mass_kg, force_n);
    }
    Ok(record)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mesh, Support};
    use crate::time;
    use tracktwin_parameters::{Parameter, ParameterSet, TrackDesign};

    const SPACING_M: f64 = 0.125;

    fn pass() -> Pass {
        Pass {
            speed_m_s: 13.0 / 3.6,
            start_m: 2.0 * SPACING_M,
            end_m: 4.5 * SPACING_M,
            time_step_s: 1e-5,
            local_flexibility: true,
        }
    }

    /// Tracks that differ in every parameter from case to case and from sleeper to sleeper.
    fn cases(count: usize, mesh: &Mesh) -> (Vec<TrackModel>, Vec<Surface>) {
        let design = TrackDesign::v_track();
        let support = |case: usize, sleeper: usize| {
            let mut set = ParameterSet::nominal();
            for (index, parameter) in Parameter::ALL.iter().enumerate() {
                let scatter = ((7 * case + 3 * sleeper + 5 * index) % 11) as f64 / 10.0;
                set[*parameter] *= 0.7 + 0.6 * scatter;
            }
            Support::from(&set)
        };
        let model = |case| {
            let supports: Vec<_> =
                (1..mesh.spans()).map(|sleeper| support(case, sleeper)).collect();
            TrackModel::build(&design, mesh, &supports, &[]).unwrap()
        };
        let surface = |case| Surface::rough(case as u64, 1.0 + case as f64, 1.0);
        ((0..count).map(model).collect(), (0..count).map(surface).collect())
    }

    fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = values.len() as f64;
        (values.map(|value| value * value).sum::<f64>() / count).sqrt()
    }

    fn assert_equal_to_plain(mesh: &Mesh, pass: &Pass, level_factor: f64) {
        let (models, mut surfaces) = cases(3, mesh);
        for (case, surface) in surfaces.iter_mut().enumerate() {
            *surface = Surface::rough(case as u64, level_factor, 1.0);
        }
        let records = passes(&models, pass, &surfaces).unwrap();
        for ((model, surface), fast) in models.iter().zip(&surfaces).zip(&records) {
            let plain = time::pass(model, pass, surface).unwrap();
            assert_eq!(plain.contact_force_n.len(), fast.contact_force_n.len());
            let pairs = plain.acceleration_m_s2.iter().zip(&fast.acceleration_m_s2);
            let difference = rms(pairs.map(|(a, b)| a - b));
            let relative = difference / rms(plain.acceleration_m_s2.iter().copied());
            // Rounding of two different orders of summation, in differences of 1e-16 of the
            // displacement over dt² / 4.
            assert!(relative < 1e-8, "{relative:e}");
        }
    }

    #[test]
    fn the_lanes_agree_with_the_plain_solver() {
        assert_equal_to_plain(&Mesh::uniform(6, 8, 8), &pass(), 3.0);
    }

    #[test]
    fn the_lanes_agree_with_the_plain_solver_where_the_mesh_changes() {
        let mesh = Mesh { rail_elements: vec![2, 4, 8, 3, 2, 1], sleeper_elements: 3 };
        assert_equal_to_plain(&mesh, &Pass { local_flexibility: false, ..pass() }, 3.0);
    }

    #[test]
    fn the_lanes_agree_with_the_plain_solver_when_wheels_lift_off() {
        assert_equal_to_plain(&Mesh::uniform(6, 4, 4), &pass(), 3000.0);
    }

    #[test]
    fn the_lanes_agree_with_the_plain_solver_from_end_to_end_of_the_track() {
        let pass = Pass { start_m: 0.0, end_m: 6.0 * SPACING_M, ..pass() };
        assert_equal_to_plain(&Mesh::uniform(6, 4, 4), &pass, 3.0);
    }

    #[test]
    fn no_bit_depends_on_the_grouping() {
        let (models, surfaces) = cases(11, &Mesh::uniform(6, 4, 4));
        let together = passes(&models, &pass(), &surfaces).unwrap();
        for (case, record) in together.iter().enumerate() {
            let one = case..case + 1;
            let alone = passes(&models[one.clone()], &pass(), &surfaces[one]).unwrap();
            assert_eq!(&alone[0], record, "case {case}");
        }
        let backwards = |count: usize| (0..count).rev();
        let models: Vec<_> = backwards(11).map(|case| models[case].clone()).collect();
        let surfaces: Vec<_> = backwards(11).map(|case| surfaces[case].clone()).collect();
        let mut reversed = passes(&models, &pass(), &surfaces).unwrap();
        reversed.reverse();
        assert_eq!(reversed, together);
    }

    #[test]
    fn tracks_of_different_meshes_may_run_together() {
        let (mut models, mut surfaces) = cases(2, &Mesh::uniform(6, 4, 4));
        let (others, other_surfaces) = cases(2, &Mesh::uniform(6, 2, 4));
        models.insert(1, others[0].clone());
        surfaces.insert(1, other_surfaces[0].clone());
        let records = passes(&models, &pass(), &surfaces).unwrap();
        for (case, record) in records.iter().enumerate() {
            let one = case..case + 1;
            let alone = passes(&models[one.clone()], &pass(), &surfaces[one]).unwrap();
            assert_eq!(&alone[0], record, "case {case}");
        }
    }

    #[test]
    fn a_missing_surface_is_refused() {
        let (models, surfaces) = cases(2, &Mesh::uniform(6, 4, 4));
        let error = passes(&models, &pass(), &surfaces[..1]).unwrap_err();
        assert_eq!(error, PassError::Surfaces { models: 2, surfaces: 1 });
    }
}
