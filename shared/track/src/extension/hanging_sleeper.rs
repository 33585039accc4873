//! Sleepers that hang on the rail, with a gap between sleeper and ballast.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Stage, Trials,
};
use crate::element::SpringDamper;
use crate::model::{Assembly, ForceLaw, Law, Reaction, Support};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "hanging_sleeper",
    summary: "a sleeper hangs on the rail over a gap and meets its ballast only when it closes",
    family: EffectFamily::Support,
    group: LookAlikeGroup::Support,
    classes: &[Class::Frequency, Class::Local, Class::Load, Class::Concentrated],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("gap_m", "m", "gap between the unloaded sleeper and ballast")
            .ranges([2e-5, 4e-4], [1e-4, 3e-3], 2e-4)
            .bound(Bound::NotNegative),
        KindParameter::new(
            "damping_share",
            "1",
            "share of the ballast's damping that acts while the gap is open",
        )
        .ranges([0.0, 0.9], [0.0, 0.9], 0.0)
        .bound(Bound::Share)
        .or(0.0),
    ],
    look_alikes: &["support_variation", "rail_joint"],
    would_separate: "passes with another wheel load: a void closes, soft ballast does not",
    screening: Screening::tried(&[
        // Gaps that close while the wheel is above the sleeper, or near it; and one that no load closes.
        Family::new(Places::SleepersAndPairs, &["gap_m"], Trials::Grid(&[&[6e-5, 1e-4, 1.6e-4]])),
        Family::new(Places::SleepersAndPairs, &[], Trials::Grid(&[])).held(&[("gap_m", 4e-4)]),
        // Loose ballast under a sleeper that it does not carry still damps.
        Family::new(Places::SleepersAndPairs, &["damping_share"], Trials::Grid(&[&[0.15]]))
            .held(&[("gap_m", 4e-4)]),
    ]),
    build: |inputs| {
        let (gap_m, damping_share) = (inputs.value("gap_m"), inputs.value("damping_share"));
        Ok(Arc::new(HangingSleeper { sleepers: inputs.sleepers(), gap_m, damping_share }))
    },
};

/// Distance in m after the closing of the gap over which the damping of the ballast rises from zero.
/// Without this transition the force would jump, and no time step could satisfy the equations. A
/// hundredth of usual gaps.
const ONSET_M: f64 = 1e-6;

/// Ballast that pushes `k_b (u - g) + c_b u'` where the sleeper has sunk by more than the gap `g`,
/// and never pulls (Lundqvist & Dahlberg 2005).
///
/// The matrices contain the ballast if the gap closes under a wheel that stands on the sleeper.
#[derive(Debug)]
struct HangingSleeper {
    sleepers: Vec<usize>,
    gap_m: f64,
    damping_share: f64,
}

impl Extension for HangingSleeper {
    fn stage(&self) -> Stage {
        Stage::ForceLaw
    }

    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            let place_m = assembly.layout().sleepers()[index].position_m;
            for (port, ballast) in assembly.ballast(index) {
                let linear = SpringDamper { stiffness: 0.0, damping: 0.0 };
                let damping = (1.0 - self.damping_share) * ballast.damping;
                let law = Arc::new(Gap {
                    gap_m: self.gap_m,
                    ballast: SpringDamper { damping, ..ballast },
                });
                assembly.add_force_law(ForceLaw { port, place_m, linear, law });
            }
            let support = assembly.supports()[index];
            let ballast_damping = self.damping_share * support.ballast_damping;
            let open = Support { ballast_stiffness: 0.0, ballast_damping, ..support };
            assembly.set_support(index, open);
        }
    }
}

/// A spring and damper behind a gap.
#[derive(Debug)]
struct Gap {
    gap_m: f64,
    ballast: SpringDamper,
}

impl Law for Gap {
    fn reaction(&self, displacement_m: f64, velocity_m_s: f64) -> Reaction {
        let closed_m = displacement_m - self.gap_m;
        if closed_m <= 0.0 {
            return Reaction::default();
        }
        let SpringDamper { stiffness, damping } = self.ballast;
        let onset = (closed_m / ONSET_M).min(1.0);
        let force = stiffness * closed_m + onset * damping * velocity_m_s;
        if force <= 0.0 {
            return Reaction::default();
        }
        let onset_slope = if onset < 1.0 { damping * velocity_m_s / ONSET_M } else { 0.0 };
        Reaction { force, stiffness: stiffness + onset_slope, damping: onset * damping }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::testing::{
        direct_receptance, distance, instance, pass_at, relative_distance, track, track_on,
    };
    use crate::frequency::{ReceptancePoint, receptance};
    use crate::model::{Surface, TrackModel};
    use crate::time::{self, Pass};
    use tracktwin_parameters::ParameterSet;

    /// Sleepers as good as rigid: all of the ballast sinks alike.
    fn rigid() -> Support {
        let nominal = Support::from(&ParameterSet::nominal());
        Support { sleeper_bending_stiffness: 5e9, ..nominal }
    }

    fn hanging(gap_m: f64) -> TrackModel {
        track_on(rigid(), &[instance("hanging_sleeper").on([5]).with("gap_m", gap_m)])
    }

    /// Where the contact point stands under the standing wheel, in m.
    fn deflection(model: &TrackModel) -> f64 {
        time::standing(model, &Pass { start_m: 0.75, ..pass_at(1.0) })
    }

    #[test]
    fn a_gap_that_closes_takes_over_from_the_rail() {
        let (open, closed) = (hanging(1.0), hanging(0.0));
        let place = ReceptancePoint::SleeperSeat(5);
        let of = |from, to| receptance(&open, from, to, &[0.0]).unwrap()[0].re;
        let (own, cross) = (of(place, place), of(ReceptancePoint::Rail(0.75), place));
        let stiffness = rigid().ballast_stiffness;
        for gap_m in [0.0, 2e-5, 5e-5] {
            // What the open gap would close by, less what the ballast pushes back.
            let push = stiffness * (cross * 4500.0 - gap_m) / (1.0 + own * stiffness);
            let expected = deflection(&open) - cross * push;
            let found = deflection(&hanging(gap_m));
            // The sleeper bends by a millionth of what it sinks.
            assert!((found / expected - 1.0).abs() < 1e-5, "{gap_m}: {found} {expected}");
        }
        let plain = deflection(&track_on(rigid(), &[]));
        assert!((deflection(&closed) / plain - 1.0).abs() < 1e-9);
    }

    #[test]
    fn over_a_gap_that_stays_open_the_wheel_runs_as_without_ballast() {
        let (pass, surface) = (pass_at(13.0 / 3.6), Surface::rough(1, 3.0, 1.5));
        let run = |model: &TrackModel| time::pass(model, &pass, &surface).unwrap();
        let (wide, wider) = (run(&hanging(6e-4)), run(&hanging(4e-3)));
        assert_eq!(wide, wider);
        let plain = run(&track_on(rigid(), &[]));
        assert!(distance(&wide.acceleration_m_s2, &plain.acceleration_m_s2) > 0.02);
    }

    #[test]
    fn a_gap_that_keeps_all_damping_lacks_the_stiffness_alone() {
        let kept = instance("hanging_sleeper").on([5]).with("gap_m", 1.0);
        let kept = track_on(rigid(), &[kept.with("damping_share", 0.4)]);
        let plain = track_on(rigid(), &[]);
        let seat = ReceptancePoint::SleeperSeat(5);
        let of = |model: &TrackModel, hz| {
            let receptance = receptance(model, seat, seat, &[hz]).unwrap()[0];
            receptance.inv()
        };
        // What the support lacks at the seat: its stiffness, and the rest of its damping.
        for hz in [20.0, 60.0] {
            let missing = of(&plain, hz) - of(&kept, hz);
            let support = rigid();
            let damping = 0.6 * support.ballast_damping * std::f64::consts::TAU * hz;
            assert!((missing.re / support.ballast_stiffness - 1.0).abs() < 1e-3, "{missing}");
            assert!((missing.im / damping - 1.0).abs() < 1e-3, "{missing}");
        }
    }

    #[test]
    fn a_closing_gap_is_felt_and_every_step_has_a_solution() {
        let (pass, surface) = (pass_at(13.0 / 3.6), Surface::rough(1, 3.0, 1.5));
        let run = |gap_m: f64| {
            let sleepers = instance("hanging_sleeper").on([4, 5]).with("gap_m", gap_m);
            time::pass(&track(&[sleepers]), &pass, &surface).unwrap().acceleration_m_s2
        };
        let (closing, open) = (run(6e-5), run(1.0));
        assert!(distance(&closing, &open) > 0.02, "{}", distance(&closing, &open));
    }

    #[test]
    fn in_the_matrices_a_gap_that_closes_under_the_wheel_is_closed() {
        let [closing, open] = [2e-5, 1.0].map(hanging);
        let plain = track_on(rigid(), &[]);
        let of = |model| direct_receptance(model, ReceptancePoint::Rail(0.75));
        // What was taken away and put back again: rounding.
        assert!(relative_distance(&of(&closing), &of(&plain)) < 1e-9);
        assert!(relative_distance(&of(&open), &of(&plain)) > 0.05);
    }

    #[test]
    fn the_ballast_pushes_and_never_pulls() {
        let gap = Gap { gap_m: 1e-4, ballast: SpringDamper { stiffness: 1e7, damping: 900.0 } };
        assert_eq!(gap.reaction(0.9e-4, 1.0), Reaction::default());
        assert_eq!(gap.reaction(1.1e-4, -1.0), Reaction::default());
        let pressed = gap.reaction(2e-4, 0.01);
        assert!((pressed.force - 1009.0).abs() < 1e-6, "{pressed:?}");
        for (displacement, velocity) in [(1.000_5e-4, 0.01), (1.5e-4, -0.01)] {
            let force = |u: f64, v: f64| gap.reaction(displacement + u, velocity + v).force;
            let slope = gap.reaction(displacement, velocity);
            let by_displacement = (force(1e-10, 0.0) - force(-1e-10, 0.0)) / 2e-10;
            let by_velocity = (force(0.0, 1e-6) - force(0.0, -1e-6)) / 2e-6;
            // Bilinear in both: rounding of differences only.
            assert!((by_displacement / slope.stiffness - 1.0).abs() < 1e-4, "{displacement}");
            assert!((by_velocity / slope.damping - 1.0).abs() < 1e-4, "{displacement}");
        }
    }
}
