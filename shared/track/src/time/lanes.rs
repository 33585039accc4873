//! The fast solver: many cases at once, eight in the lanes of one vector register.
//!
//! The fast solver uses the same scheme and the same matrices as the plain solver. If each sleeper is
//! connected to one degree of freedom of the rail, the track is condensed to its rail. This is the case
//! without extensions that connect sleepers. Any other track is eliminated as a whole. The wheel is at
//! the same place in all cases, so its shape functions are scalars. Further wheels run on condensed tracks
//! only, at a distance at which no wheel moves the rail under another within a step.

#![expect(
    clippy::inline_always,
    reason = "what runs inside a pass must be compiled into it for each instruction set"
)]

mod block;
mod condensed;
mod contact;
mod general;
mod state;

use super::{Pass, PassError, PassRecord};
use crate::model::{Surface, TrackModel};
use block::{Block, LANES};
use std::array;

/// Whether this solver can run a vehicle over a track in steps of `dt`.
pub(super) fn can_run(model: &TrackModel, dt: f64) -> bool {
    model.is_linear()
        || model.force_laws().is_empty()
            && model.vehicle().oscillators.is_empty()
            && condensed::apart(model, dt)
            && condensed::hanging(model, dt).is_some()
}

/// Runs the vehicle over many tracks, each with its own surface. The records have the order of the tracks.
///
/// Each record equals that of [`super::pass`] up to rounding. Order and grouping of the cases do not
/// change a single bit. Cases with the same rail, mesh, places of sleepers and wheels, and kinds of extension
/// are computed in groups of eight, other cases separately.
///
/// # Errors
/// [`PassError`] of the first case that fails.
pub(super) fn passes(
    models: &[TrackModel],
    pass: &Pass,
    surfaces: &[Surface],
) -> Result<Vec<PassRecord>, PassError> {
    if models.len() != surfaces.len() {
        return Err(PassError::Surfaces { models: models.len(), surfaces: surfaces.len() });
    }
    let cases: Vec<_> = (models.iter().zip(surfaces))
        .map(|(model, surface)| Case {
            model,
            surface,
            hanging: condensed::hanging(model, pass.time_step_s),
        })
        .collect();
    let mut records: Vec<Option<PassRecord>> = vec![None; models.len()];
    for family in families(&cases) {
        let first = &cases[family[0]];
        pass.check(first.model)?;
        let solver = Solver::new(first, pass);
        for group in family.chunks(LANES) {
            // A short last group is filled up with copies of its last case.
            let lanes = array::from_fn(|lane| &cases[group[lane.min(group.len() - 1)]]);
            let forces = solver.run(lanes, pass)?;
            for (lane, &index) in group.iter().enumerate() {
                records[index] = Some(record(lanes[lane].model, pass, &forces, lane)?);
            }
        }
    }
    Ok(records.into_iter().flatten().collect())
}

/// A track, its surface and, if the track can be condensed to the rail, its substructures.
struct Case<'a> {
    model: &'a TrackModel,
    surface: &'a Surface,
    hanging: Option<condensed::Hanging>,
}

/// Indices of the cases that can share one vector register: those that differ only in their values.
fn families(cases: &[Case]) -> Vec<Vec<usize>> {
    let mut families: Vec<Vec<usize>> = Vec::new();
    for (index, case) in cases.iter().enumerate() {
        let alike = |family: &&mut Vec<usize>| {
            let first = &cases[family[0]];
            first.hanging.is_some() == case.hanging.is_some()
                && first.model.has_pattern_of(case.model)
        };
        match families.iter_mut().find(alike) {
            Some(family) => family.push(index),
            None => families.push(vec![index]),
        }
    }
    families
}

/// What a family has in common.
enum Solver {
    Condensed(condensed::Solver),
    General(general::Solver),
}

impl Solver {
    fn new(first: &Case, pass: &Pass) -> Self {
        match first.hanging {
            Some(_) => Self::Condensed(condensed::Solver::new(first.model, pass)),
            None => Self::General(general::Solver::new(first.model, pass)),
        }
    }

    /// Contact forces of eight cases at the start and after every step.
    fn run(&self, cases: [&Case; LANES], pass: &Pass) -> Result<Vec<Block>, PassError> {
        let side_by_side = |heights: [Vec<f64>; LANES]| -> Vec<Block> {
            (0..=pass.steps()).map(|step| Block::from_fn(|lane| heights[lane][step])).collect()
        };
        let models = cases.map(|case| case.model);
        let further = models[0].vehicle().further_wheels_m.iter().map(|&ahead_m| {
            side_by_side(cases.map(|case| {
                let height = |step| pass.further_height_m(case.model, case.surface, step, ahead_m);
                (0..=pass.steps()).map(height).collect()
            }))
        });
        let first = side_by_side(cases.map(|case| pass.heights_m(case.model, case.surface)));
        let heights: Vec<_> = [first].into_iter().chain(further).collect();
        match self {
            Self::Condensed(solver) => {
                let hanging = cases.map(|case| {
                    case.hanging.as_ref().expect("a family is condensed as a whole or not at all")
                });
                solver.run(models, hanging, pass, &heights)
            }
            Self::General(solver) => solver.run(models, pass, &heights[0]),
        }
    }
}

/// The record of one lane.
fn record(
    model: &TrackModel,
    pass: &Pass,
    forces: &[Block],
    lane: usize,
) -> Result<PassRecord, PassError> {
    let wheel = &model.vehicle().wheel;
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
    use crate::element::SpringDamper;
    use crate::model::{Mesh, Support};
    use crate::time;
    use std::sync::Arc;
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
            assert_near(&plain, fast);
        }
    }

    fn assert_near(plain: &PassRecord, fast: &PassRecord) {
        assert_eq!(plain.contact_force_n.len(), fast.contact_force_n.len());
        let pairs = plain.acceleration_m_s2.iter().zip(&fast.acceleration_m_s2);
        let relative =
            rms(pairs.map(|(a, b)| a - b)) / rms(plain.acceleration_m_s2.iter().copied());
        // Rounding of two different orders of summation, in differences of 1e-16 of the
        // displacement over dt² / 4.
        assert!(relative < 1e-8, "{relative:e}");
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
    fn vehicles_of_one_group_may_differ_in_mass_load_and_contact() {
        let mesh = Mesh::uniform(6, 4, 4);
        let support = Support::from(&ParameterSet::nominal());
        let model = |case: usize| {
            let mut design = TrackDesign::v_track();
            design.wheel.mass_kg *= 1.0 + 0.1 * case as f64;
            design.wheel.load_n *= 1.0 + 0.2 * case as f64;
            design.railhead_radius_m *= 1.0 + 0.3 * case as f64;
            // Condensed, and eliminated as a whole.
            [Extra::Under, Extra::Between].map(|extra| {
                TrackModel::build(&design, &mesh, &[support; 5], &[Arc::new(extra)]).unwrap()
            })
        };
        let pairs: Vec<_> = (0..3).map(model).collect();
        for solver in 0..2 {
            let models: Vec<_> = pairs.iter().map(|pair| pair[solver].clone()).collect();
            assert!(models.iter().all(|model| model.has_pattern_of(&models[0])));
            let surfaces: Vec<_> = (0..3).map(|seed| Surface::rough(seed, 3.0, 1.0)).collect();
            let records = passes(&models, &pass(), &surfaces).unwrap();
            for ((model, surface), fast) in models.iter().zip(&surfaces).zip(&records) {
                assert_near(&time::pass(model, &pass(), surface).unwrap(), fast);
            }
        }
    }

    #[test]
    fn the_lanes_count_the_time_without_contact_as_the_plain_solver_does() {
        let (models, _) = cases(2, &Mesh::uniform(6, 4, 4));
        let surfaces = [3.0, 3000.0].map(|level| Surface::rough(1, level, 1.0));
        let fast = passes(&models, &pass(), &surfaces).unwrap();
        assert_eq!(fast[0].contact_loss_share(0), 0.0);
        let share = fast[1].contact_loss_share(0);
        assert!(0.05 < share && share < 0.95, "{share}");
        let plain = time::pass(&models[1], &pass(), &surfaces[1]).unwrap();
        // Rounding may move the sample in which contact ends.
        let samples = plain.contact_force_n.len() as f64;
        assert!((plain.contact_loss_share(0) - share).abs() * samples < 3.0, "{share}");
    }

    /// Something between sleepers, the ground and the rail.
    #[derive(Clone, Copy, Debug)]
    enum Extra {
        /// A beam's worth of ballast between two sleepers: they hang on two places of the rail.
        Between,
        /// A mass on a spring under a sleeper.
        Under,
        /// A mass on a spring on the rail.
        OnRail,
    }

    impl crate::extension::Extension for Extra {
        fn assemble(&self, assembly: &mut crate::model::Assembly) {
            let layout = assembly.layout();
            let [first, second] = [0, 1].map(|sleeper| layout.sleeper_port(sleeper, 0));
            let rail = layout.rail_port(0.3);
            let element = SpringDamper { stiffness: 3e7, damping: 2e3 };
            let port = match self {
                Self::Between => first.minus(&second),
                Self::Under | Self::OnRail => {
                    let mass = assembly.append_dof();
                    assembly.add_mass(&mass, 0.5);
                    mass.minus(if matches!(self, Self::Under) { &first } else { &rail })
                }
            };
            assembly.add_spring_damper(&port, element);
        }
    }

    #[test]
    fn the_lanes_agree_with_the_plain_solver_whatever_hangs_under_the_rail() {
        let supports = vec![Support::from(&ParameterSet::nominal()); 5];
        let mesh = Mesh::uniform(6, 4, 4);
        let surface = Surface::rough(1, 3.0, 1.0);
        // A port within an element has four places on the rail, more than one can be condensed.
        for (extra, condensed) in
            [(Extra::Between, false), (Extra::Under, true), (Extra::OnRail, false)]
        {
            let model =
                TrackModel::build(&TrackDesign::v_track(), &mesh, &supports, &[Arc::new(extra)])
                    .unwrap();
            assert_eq!(condensed::hanging(&model, 1e-5).is_some(), condensed, "{extra:?}");
            let plain = time::pass(&model, &pass(), &surface).unwrap();
            let fast = &passes(&[model], &pass(), std::slice::from_ref(&surface)).unwrap()[0];
            assert_near(&plain, fast);
        }
    }

    #[test]
    fn the_lanes_agree_with_the_plain_solver_on_wheels_ahead_and_behind() {
        let (mesh, surface) = (Mesh::uniform(30, 4, 4), Surface::rough(1, 3.0, 1.0));
        let supports = vec![Support::from(&ParameterSet::nominal()); 29];
        let track = |further_wheels_m: &[f64]| {
            let mut design = TrackDesign::v_track();
            design.wheel.further_wheels_m = further_wheels_m.to_vec();
            TrackModel::build(&design, &mesh, &supports, &[]).unwrap()
        };
        let pass = Pass { start_m: 14.0 * SPACING_M, end_m: 16.3 * SPACING_M, ..pass() };
        let run = |further_wheels_m: &[f64]| {
            let model = track(further_wheels_m);
            assert!(can_run(&model, pass.time_step_s));
            let plain = time::pass(&model, &pass, &surface).unwrap();
            let fast = passes(&[model], &pass, std::slice::from_ref(&surface)).unwrap().remove(0);
            assert_near(&plain, &fast);
            fast
        };
        let alone = run(&[]);
        for further in [&[-1.4, 1.5][..], &[-1.0], &[1.2]] {
            let changes = run(further).acceleration_m_s2.into_iter().zip(&alone.acceleration_m_s2);
            let change = rms(changes.map(|(with, without)| with - without));
            assert!(change > 1e-3 * rms(alone.acceleration_m_s2.iter().copied()), "{further:?}");
        }
        assert!(!can_run(&track(&[-0.5]), pass.time_step_s));
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
