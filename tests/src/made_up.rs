//! A kind of physics that the catalogue lacks. It is defined like a kind in an extension's file.
//!
//! The reference simulator simulates it as a hidden extension that is unknown to the twin.

use std::f64::consts::TAU;
use std::sync::Arc;
use tracktwin_track::element::SpringDamper;
use tracktwin_track::extension::{
    Class, EffectFamily, Extension, Family, Kind, KindParameter, LookAlikeGroup, PlaceKind, Places,
    Screening, Trials,
};
use tracktwin_track::model::Assembly;

/// A tuned mass under the rail.
pub static RAIL_ABSORBER: Kind = Kind {
    physics: "rail_absorber",
    summary: "a mass hangs under the rail on a damped spring",
    family: EffectFamily::RailBending,
    group: LookAlikeGroup::RailSection,
    classes: &[Class::Frequency, Class::Local],
    place: PlaceKind::Point,
    measuring_chain: false,
    parameters: &[
        KindParameter::new("mass_kg", "kg", "mass of the absorber").ranges(
            [0.2, 1.5],
            [25.0, 190.0],
            0.8,
        ),
        KindParameter::new("frequency_Hz", "Hz", "frequency to which it is tuned").ranges(
            [3e2, 2.5e3],
            [60.0, 500.0],
            9e2,
        ),
        KindParameter::new("damping_ratio", "1", "damping over critical damping").ranges(
            [2e-2, 1e-1],
            [2e-2, 1e-1],
            5e-2,
        ),
    ],
    look_alikes: &["missing_railpad"],
    would_separate: "a look under the rail",
    screening: Screening::tried(&[Family::new(
        Places::Points,
        &["mass_kg", "frequency_Hz", "damping_ratio"],
        Trials::Grid(&[&[0.8], &[5e2, 1e3], &[5e-2]]),
    )]),
    build: |inputs| {
        Ok(Arc::new(RailAbsorber {
            x_m: inputs.point_m(),
            mass_kg: inputs.value("mass_kg"),
            omega_rad_s: TAU * inputs.value("frequency_Hz"),
            damping_ratio: inputs.value("damping_ratio"),
        }))
    },
};

#[derive(Debug)]
struct RailAbsorber {
    x_m: f64,
    mass_kg: f64,
    omega_rad_s: f64,
    damping_ratio: f64,
}

impl Extension for RailAbsorber {
    fn assemble(&self, assembly: &mut Assembly) {
        let spring = SpringDamper {
            stiffness: self.mass_kg * self.omega_rad_s.powi(2),
            damping: 2.0 * self.damping_ratio * self.mass_kg * self.omega_rad_s,
        };
        let mass = assembly.append_dof();
        let rail = assembly.layout().rail_port(self.x_m);
        assembly.add_mass(&mass, self.mass_kg);
        assembly.add_spring_damper(&rail.minus(&mass), spring);
    }
}
