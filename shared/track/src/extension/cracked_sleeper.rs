//! Sleepers that are cracked through at the rail seat.

use super::{
    Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind, Places,
    Screening, Trials,
};
use crate::model::Assembly;
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "cracked_sleeper",
    summary: "a sleeper is cracked at the rail seat and bends more easily there",
    family: EffectFamily::Support,
    group: LookAlikeGroup::Support,
    classes: &[Class::Frequency, Class::Local],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("bending_factor", "1", "remaining share of EI_s").ranges(
            [1e-2, 0.2],
            [1e-2, 0.2],
            5e-2,
        ),
        KindParameter::new("bending_length_m", "m", "length of the softened part").ranges(
            [1e-2, 4e-2],
            [5e-2, 0.2],
            2e-2,
        ),
    ],
    look_alikes: &["missing_railpad", "sleeper_bolt", "support_variation"],
    would_separate: "a hammer test of the sleeper's end: a crack lowers its bending resonances",
    screening: Screening::tried(&[Family::new(
        Places::SleepersAndPairs,
        &["bending_factor"],
        Trials::Grid(&[&[4e-2, 0.2]]),
    )
    .held(&[("bending_length_m", 2e-2)])]),
    build: |inputs| {
        Ok(Arc::new(CrackedSleeper {
            sleepers: inputs.sleepers(),
            bending_factor: inputs.value("bending_factor"),
            length_m: inputs.value("bending_length_m"),
        }))
    },
};

/// Bending stiffness `beta EI_s` over a length `l` around the rail seat: a hinge of the rotational
/// flexibility `(1 / beta - 1) l / EI_s`. Cracks at the rail seat are the usual ones of concrete sleepers
/// (Ferdous & Manalo 2014).
#[derive(Debug)]
struct CrackedSleeper {
    sleepers: Vec<usize>,
    bending_factor: f64,
    length_m: f64,
}

impl Extension for CrackedSleeper {
    fn assemble(&self, assembly: &mut Assembly) {
        let (seat_m, half_m) = (assembly.design().sleeper.rail_seat_m, 0.5 * self.length_m);
        for &index in &self.sleepers {
            let cracked_m = [seat_m - half_m, seat_m + half_m];
            assembly.soften_sleeper(index, cracked_m, self.bending_factor);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{
        assert_felt_alike_in_both_solvers, direct_receptance, instance, relative_distance, track,
        track_on,
    };
    use crate::frequency::ReceptancePoint;
    use crate::model::{Mesh, Support, TrackModel};
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    /// Softened share of the half sleeper.
    const CRACKED: f64 = 0.25;
    const FACTOR: f64 = 0.2;

    /// Static deflection in m/N of a sleeper's seat on ballast under a load there. The rail does not
    /// rest on it.
    fn deflection(bending_stiffness: f64, sleeper_elements: usize, cracked: bool) -> f64 {
        let design = TrackDesign::v_track();
        let support = Support {
            sleeper_bending_stiffness: bending_stiffness,
            railpad_stiffness: 0.0,
            railpad_damping: 0.0,
            // Soft: the ballast presses evenly on the whole sleeper.
            ballast_stiffness: 1e3,
            ballast_damping: 0.0,
        };
        let crack = instance("cracked_sleeper").on([0]);
        let length_m = 2.0 * CRACKED * design.sleeper.half_length_m;
        let crack = crack.with("bending_length_m", length_m);
        let crack = crack.with("bending_factor", FACTOR).build(&design, 2).unwrap();
        let cracks = if cracked { vec![crack] } else { Vec::new() };
        let model =
            TrackModel::build(&design, &Mesh::uniform(2, 2, sleeper_elements), &[support], &cracks);
        let (model, seat) = (model.unwrap(), ReceptancePoint::SleeperSeat(0));
        crate::frequency::receptance(&model, seat, seat, &[0.0]).unwrap()[0].re
    }

    #[test]
    fn under_an_even_pressure_the_seat_sinks_deeper_by_the_work_of_the_cracked_part() {
        let half_m = TrackDesign::v_track().sleeper.half_length_m;
        let bending_stiffness = 5000.0;
        // A cantilever under 1 N spread evenly: M = (l - x)^2 / (2 l). Its mean deflection under this load
        // is the work, and the seat sinks by as much below the ballast's mean.
        let squares = half_m.powi(3) * (1.0 - (1.0 - CRACKED).powi(5)) / 20.0;
        let expected = squares * (1.0 / FACTOR - 1.0) / bending_stiffness;
        // With that many elements, the points of the ballast are as good as an even pressure.
        let of = |cracked| deflection(bending_stiffness, 64, cracked);
        let found = of(true) - of(false);
        assert!((found / expected - 1.0).abs() < 1e-2, "{found} {expected}");
    }

    #[test]
    fn a_sleeper_cracked_over_its_whole_length_is_a_softer_one_but_for_shear() {
        let softer =
            Support { sleeper_bending_stiffness: 1e4, ..Support::from(&ParameterSet::nominal()) };
        let half = Support { sleeper_bending_stiffness: 5e3, ..softer };
        let crack = instance("cracked_sleeper").with("bending_length_m", 10.0);
        let cracked = track_on(softer, &[crack.with("bending_factor", 0.5)]);
        let plain = track_on(half, &[]);
        let of = |model| direct_receptance(model, ReceptancePoint::SleeperTip(5));
        // Half of the shear stiffness is missing in the softer sleeper only.
        let distance = relative_distance(&of(&cracked), &of(&plain));
        assert!(distance < 0.2, "{distance}");
        let other = relative_distance(&of(&track_on(softer, &[])), &of(&plain));
        assert!(other > 2.0 * distance, "{other} {distance}");
    }

    #[test]
    fn two_cracks_of_one_sleeper_add_their_flexibilities() {
        let crack = |factor: f64| {
            instance("cracked_sleeper")
                .on([5])
                .with("bending_length_m", 0.02)
                .with("bending_factor", factor)
        };
        // 1/0.25 - 1 = 3 is the sum of 1/0.4 - 1 = 1.5 twice.
        let (one, two) = (track(&[crack(0.25)]), track(&[crack(0.4), crack(0.4)]));
        let of = |model| direct_receptance(model, ReceptancePoint::Rail(0.75));
        assert!(relative_distance(&of(&two), &of(&one)) < 1e-9);
        assert!(relative_distance(&of(&track(&[])), &of(&one)) > 1e-3);
    }

    #[test]
    fn a_passing_wheel_feels_it_in_both_solvers_alike() {
        let crack = instance("cracked_sleeper").on([4]).with("bending_factor", 0.02);
        assert_felt_alike_in_both_solvers(&crack.with("bending_length_m", 0.02));
    }
}
