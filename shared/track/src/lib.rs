//! Finite-element model of wheel and track.
//!
//! This crate contains the elements, the assembled track, its extensions and the simulation of a wheel that
//! runs over it. The crate `tracktwin-signal` computes signals and features from the results.
//!
//! Convention: one rail, half sleepers; displacement, load and irregularity positive **downwards**.
//!
//! # Example: receptance of a beam on springs
//!
//! With rigid sleepers, every rail seat rests on railpad and ballast in series. At rest the rail is then a
//! Timoshenko beam on an elastic foundation `k`, whose receptance is
//! `(1/c + EI/GA) / (2 EI sqrt(2 (a + c)))` with `a = k / (2 GA)` and `c = sqrt(k / EI)`.
//!
//! ```
//! use tracktwin_parameters::{ParameterSet, TrackDesign};
//! use tracktwin_track::frequency::{ReceptancePoint, receptance};
//! use tracktwin_track::model::{Mesh, Support, TrackModel};
//!
//! let (design, spans) = (TrackDesign::v_track(), 40);
//! let nominal = Support::from(&ParameterSet::nominal());
//! let support = Support { sleeper_bending_stiffness: 5e9, ..nominal };
//! let mesh = Mesh::uniform(spans, 8, 8);
//! let track = TrackModel::build(&design, &mesh, &vec![support; spans - 1], &[])?;
//! let middle = ReceptancePoint::Rail(spans as f64 / 2.0 * design.sleeper.spacing_m);
//! let found_m_n = receptance(&track, middle, middle, &[0.0])?[0].re;
//!
//! let seat = 1.0 / (1.0 / support.railpad_stiffness + 1.0 / support.ballast_stiffness);
//! let foundation = seat / design.sleeper.spacing_m;
//! let rail = &design.rail;
//! let bending = rail.youngs_modulus_pa * rail.second_moment_m4;
//! let shear_modulus = rail.youngs_modulus_pa / (2.0 * (1.0 + rail.poisson));
//! let shear = rail.shear_coefficient * shear_modulus * rail.area_m2;
//! let (a, c) = (foundation / (2.0 * shear), (foundation / bending).sqrt());
//! let expected_m_n = (1.0 / c + bending / shear) / (2.0 * bending * (2.0 * (a + c)).sqrt());
//! // The supports are points.
//! assert!((found_m_n / expected_m_n - 1.0).abs() < 0.02, "{found_m_n} {expected_m_n}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(test)]
mod analytical;
pub mod element;
pub mod extension;
pub mod frequency;
pub mod model;
pub mod time;
