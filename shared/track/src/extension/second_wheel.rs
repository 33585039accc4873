//! A second wheel on the same rail.

use super::{
    Bound, Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Places, Screening, Trials,
};
use crate::model::Vehicle;
use std::sync::Arc;

/// Trial distances in m. The wavelength of the rail at 1 kHz is 15 steps. The largest distance is the
/// length of track that is modelled beyond the compared stretch.
const DISTANCES_M: [f64; 46] = {
    let mut distances_m = [0.0; 46];
    let mut step = 0;
    while step < distances_m.len() {
        distances_m[step] = 0.2 + 0.04 * step as f64;
        step += 1;
    }
    distances_m
};

pub(super) const KIND: Kind = Kind {
    physics: "second_wheel",
    summary: "a second wheel on the same rail, which reflects waves",
    family: EffectFamily::Vehicle,
    group: LookAlikeGroup::Vehicle,
    classes: &[Class::Frequency, Class::Global],
    place: PlaceKind::Nowhere,
    measuring_chain: false,
    parameters: &[KindParameter::new("distance_m", "m", "how far ahead it runs; negative: behind")
        .ranges([0.2, 3.2], [1.8, 3.0], 0.5)
        .bound(Bound::Any)],
    look_alikes: &["support_variation", "rail_cross_section"],
    would_separate: "a run with the second wheel lifted or at another distance",
    screening: Screening::tried(&[Family::new(
        Places::Everywhere,
        &["distance_m"],
        Trials::Grid(&[&DISTANCES_M]),
    )])
    .unless_stated(|design| !design.wheel.further_wheels_m.is_empty()),
    build: |inputs| {
        if inputs.value("distance_m").abs() < 2.0 * inputs.design.wheel.radius_m {
            return Err(inputs.refuse("distance_m", "at least the diameter of the wheel"));
        }
        Ok(Arc::new(SecondWheel { distance_m: inputs.value("distance_m") }))
    },
};

/// A wheel of the same mass and load, rigid, at a fixed distance; its contact makes the rail
/// `alpha_xx - alpha_xd² / (alpha_dd + 1/k_H + alpha_w)` under the first
/// (Wu & Thompson 2001).
#[derive(Debug)]
struct SecondWheel {
    distance_m: f64,
}

impl Extension for SecondWheel {
    fn equip(&self, vehicle: &mut Vehicle) {
        vehicle.further_wheels_m.push(self.distance_m);
    }
}

#[cfg(test)]
mod tests {
    use crate::extension::testing::{distance, instance, pass_at, smooth_accelerations, track};
    use crate::model::Surface;
    use crate::time;

    #[test]
    fn a_wheel_beyond_hearing_is_none_and_a_near_one_is_heard() {
        let pass = pass_at(13.0 / 3.6);
        let surface = Surface::rough(1, 3.0, 1.5);
        let felt = |ahead: Option<f64>| {
            let wheel = ahead.map(|metres| instance("second_wheel").with("distance_m", metres));
            let model = track(&Vec::from_iter(wheel));
            time::passes(&[model], &pass, std::slice::from_ref(&surface)).unwrap().remove(0)
        };
        let alone = felt(None).acceleration_m_s2;
        let near = distance(&felt(Some(0.2)).acceleration_m_s2, &alone);
        let far = distance(&felt(Some(0.5)).acceleration_m_s2, &alone);
        assert!(near > 0.02 && far < near, "{near} {far}");
    }

    #[test]
    fn on_a_smooth_symmetric_track_both_wheels_carry_their_load() {
        let ahead = track(&[instance("second_wheel").with("distance_m", 0.25)]);
        let pass = pass_at(1.0);
        let forces = time::pass(&ahead, &pass, &Surface::smooth()).unwrap().contact_force_n;
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        // Over many spans a wheel neither rises nor falls.
        assert!((mean / 4500.0 - 1.0).abs() < 1e-3, "{mean}");
        assert!(smooth_accelerations(&ahead, &pass).iter().all(|value| value.is_finite()));
    }

    #[test]
    fn both_wheels_must_stay_on_the_track() {
        let ahead = track(&[instance("second_wheel").with("distance_m", 0.6)]);
        assert!(time::pass(&ahead, &pass_at(1.0), &Surface::smooth()).is_err());
    }
}
