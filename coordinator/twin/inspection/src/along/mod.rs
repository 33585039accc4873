//! A pass as a function of position: background, whitened power, lines, tail probabilities.
//!
//! The tests of wheel, impacts and measuring chain share these functions and draw the conclusions.

mod background;
mod energy;
mod innovation;
mod line;
mod surface;
mod tail;
#[cfg(test)]
pub(crate) mod testing;

pub use background::median;
pub(crate) use background::{Background, hann, whitened};
pub(crate) use energy::{Energy, by_speed};
pub use energy::{SPEED_RATIO, separate_wavelengths};
pub(crate) use innovation::Innovations;
pub(crate) use line::{LOBE, Line, Ruler, Spectrum, amplitude, index_at, on_even_places};
pub(crate) use surface::Surface;
pub(crate) use tail::{
    bonferroni, combine_dependent_p_values, ln_binomial_tail, ln_gamma_tail, ln_normal_bound,
    ln_ratio_tail, ln_student_tail,
};
