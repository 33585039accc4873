//! Bolts that hold the sleepers' ends down on the substructure.

use super::{
    Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind, Places,
    Screening, Trials,
};
use crate::element::SpringDamper;
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "sleeper_bolt",
    summary: "bolts hold the sleepers' ends down on the substructure",
    family: EffectFamily::Fastening,
    group: LookAlikeGroup::HoldDown,
    classes: &[Class::Frequency, Class::Local],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[KindParameter::new("stiffness_N_per_m", "N/m", "vertical stiffness of a bolt")
        .ranges([5e6, 5e7], [2.5e7, 2.5e8], 3e7)],
    look_alikes: &["support_variation", "subgrade_layer"],
    would_separate: "a second speed, or a hammer test of the sleeper's end",
    screening: Screening::tried(&[
        Family::new(Places::SleepersAndPairs, &["stiffness_N_per_m"], Trials::Grid(&[&[1e7, 3e7]])),
        Family::new(
            Places::Everywhere,
            &["stiffness_N_per_m"],
            Trials::Grid(&[&[5e6, 1e7, 2e7, 4e7]]),
        ),
    ]),
    build: |inputs| {
        let (sleepers, stiffness) = (inputs.sleepers(), inputs.value("stiffness_N_per_m"));
        Ok(Arc::new(SleeperBolt { sleepers, stiffness }))
    },
};

/// A spring between the free end of a sleeper and the ground, on each of some sleepers.
///
/// V-Track's sleepers are bolted down; the paper leaves the bolts out and widens the range of the
/// sleeper's bending stiffness instead (Appendix D). As a spring on the port of the sleeper's tip
/// a bolt adds `k b bᵀ` to the stiffness.
#[derive(Debug)]
struct SleeperBolt {
    sleepers: Vec<usize>,
    stiffness: f64,
}

impl Extension for SleeperBolt {
    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            let tip = assembly.layout().sleepers()[index].tip_node();
            let port = assembly.layout().sleeper_port(index, tip);
            let bolt = SpringDamper { stiffness: self.stiffness, damping: 0.0 };
            assembly.add_spring_damper(&port, bolt);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::ExtensionInstance;
    use crate::frequency::{ReceptancePoint, receptance};
    use crate::model::{Mesh, Support, Surface, TrackModel};
    use crate::time::{self, Pass};
    use num_complex::Complex64;
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const SPANS: usize = 12;
    const BOLTED: usize = 5;
    const STIFFNESS: f64 = 3e7;

    fn track(bolts: &[usize]) -> TrackModel {
        let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
        let (design, mesh) = (TrackDesign::v_track(), Mesh::uniform(SPANS, 4, 4));
        let bolt = ExtensionInstance::new("sleeper_bolt").with("stiffness_N_per_m", STIFFNESS);
        let extensions: Vec<_> = match bolts {
            [] => Vec::new(),
            _ => vec![bolt.on(bolts.iter().copied()).build(&design, SPANS).unwrap()],
        };
        TrackModel::build(&design, &mesh, &supports, &extensions).unwrap()
    }

    #[test]
    fn one_bolt_changes_the_receptance_as_sherman_and_morrison_say() {
        let (plain, bolted) = (track(&[]), track(&[BOLTED]));
        let (rail, tip) = (ReceptancePoint::Rail(0.8), ReceptancePoint::SleeperTip(BOLTED));
        let frequencies = [0.0, 100.0, 700.0, 2800.0];
        let of = |model: &TrackModel, from, to| receptance(model, from, to, &frequencies).unwrap();
        let (direct, cross) = (of(&plain, rail, rail), of(&plain, rail, tip));
        let (own, changed) = (of(&plain, tip, tip), of(&bolted, rail, rail));
        for index in 0..frequencies.len() {
            let drop = cross[index].powi(2) * STIFFNESS / (Complex64::ONE + own[index] * STIFFNESS);
            // Exact, so that only the rounding of the solves remains.
            let error = (changed[index] - (direct[index] - drop)).norm();
            assert!(error < 1e-9 * direct[index].norm(), "{} Hz: {error}", frequencies[index]);
            assert!(drop.norm() > 1e-4 * direct[index].norm(), "{} Hz", frequencies[index]);
        }
    }

    #[test]
    fn bolts_stiffen_the_track_under_a_standing_load() {
        let static_receptance = |model: &TrackModel| {
            receptance(model, ReceptancePoint::Rail(0.75), ReceptancePoint::Rail(0.75), &[0.0])
                .unwrap()[0]
                .re
        };
        let all: Vec<usize> = (0..SPANS - 1).collect();
        let ratio = static_receptance(&track(&all)) / static_receptance(&track(&[]));
        // A spring more can only lower it; a thousandth is far beyond rounding.
        assert!(ratio < 0.999, "{ratio}");
    }

    #[test]
    fn a_passing_wheel_feels_the_bolts_in_both_solvers_alike() {
        let pass = Pass {
            speed_m_s: 13.0 / 3.6,
            start_m: 0.4,
            end_m: 1.0,
            time_step_s: 1e-5,
            local_flexibility: true,
        };
        let surface = Surface::rough(1, 3.0, 1.5);
        let all: Vec<usize> = (0..SPANS - 1).collect();
        let (free, bolted) = (track(&[]), track(&all));
        let run = |model: &TrackModel| time::pass(model, &pass, &surface).unwrap();
        let (free, reference) = (run(&free).acceleration_m_s2, run(&bolted).acceleration_m_s2);
        let fast = &time::passes(&[bolted], &pass, std::slice::from_ref(&surface)).unwrap()[0];
        assert!(distance(&free, &reference) > 0.05, "{}", distance(&free, &reference));
        // Two roads to one solution: the rounding of 1e4 steps, as in the fast solver's own test.
        let difference = distance(&fast.acceleration_m_s2, &reference);
        assert!(difference < 1e-6, "{difference}");
    }

    /// Root mean square of the difference, relative to the second's.
    fn distance(a: &[f64], b: &[f64]) -> f64 {
        let power = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
        let difference = power(&mut a.iter().zip(b).map(|(x, y)| x - y));
        (difference / power(&mut b.iter().copied())).sqrt()
    }
}
