//! Railpads that are stiffer the more load they carry.

use super::{
    Bound, Class, EffectFamily, Extension, Kind, KindParameter, LookAlikeGroup, PlaceKind,
    Screening, Stage,
};
use crate::element::SpringDamper;
use crate::model::{Assembly, ForceLaw, Law, Reaction};
use std::sync::Arc;

pub(super) const KIND: Kind = Kind {
    physics: "load_dependent_railpad",
    summary: "railpads that grow stiffer with the load that they carry",
    family: EffectFamily::Fastening,
    group: LookAlikeGroup::Fastening,
    classes: &[Class::Frequency, Class::Global, Class::Load],
    place: PlaceKind::Sleepers,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("exponent", "1", "power of the load with which the stiffness grows")
            .ranges([0.2, 0.7], [0.2, 0.7], 0.4)
            .bound(Bound::Share),
        KindParameter::new(
            "reference_load_N",
            "N",
            "load beyond the toe load at which the stiffness is nominal",
        )
        .ranges([500.0, 2500.0], [1.2e4, 6e4], 1000.0)
        .or(1000.0),
        KindParameter::new("toe_load_N", "N", "load from the fastening, without any wheel")
            .ranges([100.0, 1000.0], [5e3, 2e4], 400.0)
            .or(400.0),
    ],
    look_alikes: &["support_variation", "frequency_dependent_railpad"],
    would_separate: "passes with a second wheel load, over 25 spans or more",
    screening: Screening::not_tried(
        "passes under one load show one stiffness: two loads would tell",
    ),
    build: |inputs| {
        Ok(Arc::new(LoadDependentRailpad {
            sleepers: inputs.sleepers(),
            exponent: inputs.value("exponent"),
            reference_load_n: inputs.value("reference_load_N"),
            toe_load_n: inputs.value("toe_load_N"),
        }))
    },
};

/// Tangent stiffness `k_p (T / T_0)^gamma` under the load `T`, toe load included (mismatch
/// catalogue 13).
#[derive(Debug)]
struct LoadDependentRailpad {
    sleepers: Vec<usize>,
    exponent: f64,
    reference_load_n: f64,
    toe_load_n: f64,
}

impl Extension for LoadDependentRailpad {
    fn stage(&self) -> Stage {
        Stage::ForceLaw
    }

    fn assemble(&self, assembly: &mut Assembly) {
        for &index in &self.sleepers {
            let stiffness = assembly.supports()[index].railpad_stiffness;
            let law = Arc::new(PowerLaw::new(self, stiffness));
            let port = assembly.layout().railpad_port(index);
            let place_m = assembly.layout().sleepers()[index].position_m;
            let linear = SpringDamper { stiffness, damping: 0.0 };
            assembly.add_force_law(ForceLaw { port, place_m, linear, law });
        }
    }
}

/// `dT/dy = k_0 (T / T_0)^gamma`, `T = toe` at `y = 0`; never in tension.
#[derive(Debug)]
struct PowerLaw {
    stiffness_n_m: f64,
    exponent: f64,
    /// `T_0` in N.
    nominal_load_n: f64,
    toe_load_n: f64,
}

impl PowerLaw {
    fn new(pad: &LoadDependentRailpad, stiffness_n_m: f64) -> Self {
        let nominal_load_n = pad.toe_load_n + pad.reference_load_n;
        let (exponent, toe_load_n) = (pad.exponent, pad.toe_load_n);
        Self { stiffness_n_m, exponent, nominal_load_n, toe_load_n }
    }

    fn tangent(&self, load_n: f64) -> f64 {
        self.stiffness_n_m * (load_n / self.nominal_load_n).powf(self.exponent)
    }
}

impl Law for PowerLaw {
    fn reaction(&self, displacement_m: f64, _velocity_m_s: f64) -> Reaction {
        let rest = 1.0 - self.exponent;
        // The equation integrated: (T / T_0)^(1 - gamma) grows linearly with y.
        let slope = rest * self.stiffness_n_m / self.nominal_load_n;
        let root = (self.toe_load_n / self.nominal_load_n).powf(rest) + slope * displacement_m;
        let load_n = self.nominal_load_n * root.max(0.0).powf(1.0 / rest);
        Reaction { force: load_n - self.toe_load_n, stiffness: self.tangent(load_n), damping: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::testing::{SPANS, distance, instance, pass_at, track};
    use crate::model::{Mesh, Support, Surface, TrackModel};
    use crate::time;
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    const LAW: PowerLaw =
        PowerLaw { stiffness_n_m: 1.5e8, exponent: 0.4, nominal_load_n: 1900.0, toe_load_n: 400.0 };

    #[test]
    fn the_force_is_the_integral_of_the_tangent() {
        for displacement_m in [-1e-6, 0.0, 3e-6, 2e-5] {
            let at = |shift: f64| LAW.reaction(displacement_m + shift, 0.0);
            let slope = (at(1e-9).force - at(-1e-9).force) / 2e-9;
            // A central difference over 1e-9 m of a curve that bends within 1e-5 m.
            assert!((slope / at(0.0).stiffness - 1.0).abs() < 1e-5, "{displacement_m}");
        }
        assert!(LAW.reaction(0.0, 0.0).force.abs() < 1e-9);
        assert!((LAW.tangent(1900.0) / 1.5e8 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_pad_never_pulls_by_more_than_its_toe_load() {
        assert_eq!(
            LAW.reaction(-1.0, 0.0),
            Reaction { force: -400.0, stiffness: 0.0, damping: 0.0 }
        );
    }

    #[test]
    fn with_exponent_zero_it_is_the_plain_pad() {
        let (pass, surface) = (pass_at(13.0 / 3.6), Surface::rough(1, 3.0, 1.5));
        let run = |exponent: f64| {
            let pads = instance("load_dependent_railpad").on([3, 4, 5]);
            let model = track(&[pads.with("exponent", exponent)]);
            time::pass(&model, &pass, &surface).unwrap().acceleration_m_s2
        };
        let plain = time::pass(&track(&[]), &pass, &surface).unwrap().acceleration_m_s2;
        // Newton's tolerance over 1e4 steps, in differences over dt².
        assert!(distance(&run(0.0), &plain) < 1e-6, "{}", distance(&run(0.0), &plain));
        assert!(distance(&run(0.5), &plain) > 1e-3);
    }

    #[test]
    fn in_the_matrices_a_lighter_wheel_meets_softer_pads() {
        let stiffness = |load_n: f64| {
            let mut design = TrackDesign::v_track();
            design.wheel.load_n = load_n;
            let pads = instance("load_dependent_railpad").with("exponent", 0.4);
            let pads = pads.build(&design, SPANS).unwrap();
            let supports = vec![Support::from(&ParameterSet::nominal()); SPANS - 1];
            let mesh = Mesh::uniform(SPANS, 2, 2);
            let model = TrackModel::build(&design, &mesh, &supports, &[pads]).unwrap();
            model.force_laws()[5].linear.stiffness
        };
        // A seat carries a good fifth of the wheel, about its reference of 1000 N.
        let (heavy, light) = (stiffness(4500.0), stiffness(3000.0));
        assert!((heavy / 1.5e8 - 1.0).abs() < 0.1, "{heavy}");
        assert!(light < 0.95 * heavy, "{light}");
    }
}
