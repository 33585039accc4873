//! Element that an unknown dynamic stiffness resembles: a spring, a damper, a mass, or a mass on a
//! spring.
//!
//! Each element has a dynamic stiffness of known form. The signatures of the port scan therefore give the
//! part of the residual that the element explains (docs/diagnosis.md, section 5).

use crate::estimate::Estimate;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use tracktwin_number::significant;

/// Smallest share of the gain of a free dynamic stiffness that an element must explain.
const ALIKE: f64 = 0.5;

/// Gain in nats that each parameter beyond the first must add.
const PARAMETER_NATS: f64 = 3.0;

/// Number of tested resonances between two centres.
const RESONANCES: usize = 6;

/// Tested damping ratios.
const DAMPING_RATIOS: [f64; 4] = [0.02, 0.05, 0.1, 0.3];

/// Number of points on half a basis function for its mean.
const POINTS: i32 = 8;

/// An element with one end at the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Element {
    /// A spring to the ground, `stiffness_N_per_m`; a negative value stands for a missing spring.
    Spring,
    /// A damper to the ground, `damping_N_s_per_m`; a negative value stands for a missing damper.
    Damper,
    /// A mass, `mass_kg`; a negative value stands for a missing mass.
    Mass,
    /// A mass on a spring: `mass_kg`, `frequency_Hz` and `damping_ratio`.
    MassOnSpring,
}

/// An element with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Behaviour {
    /// The element.
    pub element: Element,
    /// Parameters by name, with unit in the name; standard deviations are those of the linear model.
    pub parameters: Vec<(&'static str, Estimate)>,
}

/// Evidence at a port: gradient and Hessian of the log likelihood with respect to the heights of its basis
/// functions, and the magnitude of the receptance in m/N to which the heights refer, at the centres in Hz.
pub(crate) struct PortEvidence<'a> {
    pub(crate) along: &'a DVector<f64>,
    pub(crate) square: &'a DMatrix<f64>,
    pub(crate) receptance: &'a [f64],
    pub(crate) centres_hz: &'a [f64],
}

/// Best fit of one element.
struct ElementFit {
    behaviour: Behaviour,
    nats: f64,
}

impl PortEvidence<'_> {
    /// The element that explains most, if it explains enough of `free`, the gain of a free dynamic
    /// stiffness in nats.
    pub(crate) fn behaviour(&self, free: f64) -> Option<Behaviour> {
        let spring = self.linear(Element::Spring, "stiffness_N_per_m", |_| Complex64::ONE);
        let damper =
            self.linear(Element::Damper, "damping_N_s_per_m", |hz| Complex64::I * TAU * hz);
        let mass = self.linear(Element::Mass, "mass_kg", |hz| (-(TAU * hz).powi(2)).into());
        let all = [spring, damper, mass].into_iter().chain(self.mass_on_spring());
        let best = all.max_by(|a, b| a.nats.total_cmp(&b.nats))?;
        (best.nats >= ALIKE * free).then_some(best.behaviour)
    }

    /// Fit of an element whose dynamic stiffness in N/m is proportional to its one parameter.
    fn linear(
        &self,
        element: Element,
        name: &'static str,
        stiffness: impl Fn(f64) -> Complex64,
    ) -> ElementFit {
        let (parameter, nats) = self.amplitude(stiffness);
        ElementFit { behaviour: Behaviour { element, parameters: vec![(name, parameter)] }, nats }
    }

    /// Fit of the resonance and damping for which a positive mass explains most.
    fn mass_on_spring(&self) -> Option<ElementFit> {
        let (first, last) =
            (self.centres_hz[0].ln(), self.centres_hz[self.centres_hz.len() - 1].ln());
        let steps = RESONANCES * (self.centres_hz.len() - 1);
        let step = (last - first) / steps as f64;
        let resonances = (0..=steps).map(|number| (first + step * number as f64).exp());
        let fits = resonances.flat_map(|hz| {
            DAMPING_RATIOS.map(|ratio| {
                (hz, ratio, self.amplitude(|at| resonator(at / hz, ratio) * (TAU * at).powi(2)))
            })
        });
        let possible = fits.filter(|(_, _, (mass, _))| mass.mean > 0.0);
        let (hz, ratio, (mass, nats)) = possible.max_by(|a, b| a.2.1.total_cmp(&b.2.1))?;
        let parameters = vec![
            ("mass_kg", mass),
            ("frequency_Hz", Estimate { mean: hz, sd: step * hz }),
            ("damping_ratio", Estimate { mean: ratio, sd: 0.5 * ratio }),
        ];
        let behaviour = Behaviour { element: Element::MassOnSpring, parameters };
        Some(ElementFit { behaviour, nats: nats - 2.0 * PARAMETER_NATS })
    }

    /// Best factor of a dynamic stiffness in N/m, and its gain in nats.
    fn amplitude(&self, stiffness: impl Fn(f64) -> Complex64) -> (Estimate, f64) {
        let width = (self.centres_hz[1] / self.centres_hz[0]).ln();
        let mean = |centre_hz: f64| {
            let points = (1 - POINTS..POINTS).map(|point| f64::from(point) / f64::from(POINTS));
            let weighted =
                points.map(|at| (1.0 - at.abs()) * stiffness(centre_hz * (at * width).exp()));
            weighted.sum::<Complex64>() / f64::from(POINTS)
        };
        let heights = self.centres_hz.iter().zip(self.receptance).flat_map(|(&hz, receptance)| {
            let height = mean(hz) * receptance;
            [height.re, height.im]
        });
        let heights = DVector::from_iterator(self.along.len(), heights);
        let (slope, precision) = (self.along.dot(&heights), heights.dot(&(self.square * &heights)));
        (
            Estimate { mean: slope / precision, sd: precision.sqrt().recip() },
            0.5 * slope * slope / precision,
        )
    }
}

/// Dynamic stiffness of a mass on a spring divided by that of the mass alone, with opposite sign, at the
/// ratio `r` of frequency to resonance: `-1/(1 - r^2/(1 + 2i zeta r))`.
fn resonator(ratio: f64, damping_ratio: f64) -> Complex64 {
    let spring = Complex64::new(1.0, 2.0 * damping_ratio * ratio);
    -spring / (spring - ratio * ratio)
}

impl Behaviour {
    /// The parameters as a map by name.
    pub(crate) fn named(&self) -> BTreeMap<String, Estimate> {
        self.parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
    }
}

impl Element {
    /// Behaviour of the element as part of a sentence; `None` if a parameter is unknown.
    pub(crate) fn words(self, parameters: &BTreeMap<String, Estimate>) -> Option<String> {
        let value = |name: &str| parameters.get(name).map(|parameter| parameter.mean);
        let quantity = |name: &str, unit: &str, scale: f64, thing: &str| {
            let value = value(name)? / scale;
            let size = significant(value.abs(), 2);
            Some(if value >= 0.0 {
                format!("acts like {thing} of {size} {unit}")
            } else {
                format!("acts as if {thing} of {size} {unit} were missing")
            })
        };
        match self {
            Self::Spring => quantity("stiffness_N_per_m", "MN/m", 1e6, "a spring"),
            Self::Damper => quantity("damping_N_s_per_m", "kN s/m", 1e3, "a damper"),
            Self::Mass => quantity("mass_kg", "kg", 1.0, "a mass"),
            Self::MassOnSpring => {
                let mass = quantity("mass_kg", "kg", 1.0, "a mass")?;
                Some(format!(
                    "{mass} on a spring, at {} Hz",
                    significant(value("frequency_Hz")?, 2)
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behaviour of a stiffness in N/m at a port with signatures of equal size at all frequencies. `loud`
    /// is the size per relative stiffness; the centres are those of a scan from 100 to 3,300 Hz.
    fn evidence(stiffness: impl Fn(f64) -> Complex64, loud: f64) -> Option<Behaviour> {
        let centres_hz: Vec<f64> =
            (0..14).map(|bump| 100.0 * 33_f64.powf(f64::from(bump) / 13.0)).collect();
        // A beam's receptance falls with the frequency.
        let receptance: Vec<f64> = centres_hz.iter().map(|hz| 1e-6 / hz).collect();
        let heights = centres_hz.iter().zip(&receptance).flat_map(|(&hz, receptance)| {
            let height = stiffness(hz) * receptance;
            [height.re, height.im]
        });
        let heights = DVector::from_iterator(28, heights);
        let square = DMatrix::identity(28, 28) * (loud * loud);
        let along = &square * &heights;
        let evidence = PortEvidence {
            along: &along,
            square: &square,
            receptance: &receptance,
            centres_hz: &centres_hz,
        };
        evidence.behaviour(0.5 * along.dot(&heights))
    }

    fn value(behaviour: &Behaviour, name: &str) -> f64 {
        behaviour.named()[name].mean
    }

    #[test]
    fn each_element_is_known_again_with_its_size() {
        let spring = evidence(|_| (-3e7).into(), 1e4).unwrap();
        assert_eq!(spring.element, Element::Spring);
        assert!((value(&spring, "stiffness_N_per_m") / -3e7 - 1.0).abs() < 1e-9);
        let damper = evidence(|hz| Complex64::I * TAU * hz * 5e3, 1e4).unwrap();
        assert_eq!(damper.element, Element::Damper);
        // The mean over a bump is not the value at its middle.
        assert!((value(&damper, "damping_N_s_per_m") / 5e3 - 1.0).abs() < 0.05);
        let mass = evidence(|hz| (-(TAU * hz).powi(2) * 0.7).into(), 1e4).unwrap();
        assert_eq!(mass.element, Element::Mass);
        assert!((value(&mass, "mass_kg") / 0.7 - 1.0).abs() < 0.1);
        let absorber =
            evidence(|hz| resonator(hz / 900.0, 0.1) * (TAU * hz).powi(2) * 0.4, 1e4).unwrap();
        assert_eq!(absorber.element, Element::MassOnSpring, "{absorber:?}");
        assert!((value(&absorber, "frequency_Hz") / 900.0 - 1.0).abs() < 0.1);
        assert!((value(&absorber, "mass_kg") / 0.4 - 1.0).abs() < 0.3, "{absorber:?}");
    }

    #[test]
    fn what_jumps_with_the_frequency_is_like_none() {
        let jumps =
            |hz: f64| Complex64::from(if (hz.ln() * 4.0) as i64 % 2 == 0 { 3e7 } else { -3e7 });
        assert_eq!(evidence(jumps, 1e4), None);
    }

    #[test]
    fn a_mass_on_a_spring_is_a_mass_far_below_its_resonance_and_a_spring_far_above() {
        let (mass, hz) = (0.4, 900.0);
        let stiffness = |at: f64| resonator(at / hz, 0.01) * (TAU * at).powi(2) * mass;
        let rigid = |at: f64| -(TAU * at).powi(2) * mass;
        assert!((stiffness(9.0) / rigid(9.0) - 1.0).norm() < 1e-3);
        let spring = (TAU * hz).powi(2) * mass;
        assert!((stiffness(90_000.0) / spring - 1.0).norm() < 0.03 * 90_000.0 / hz);
        assert!(stiffness(hz).im > 0.0);
    }

    #[test]
    fn a_behaviour_is_said_with_two_digits_and_its_unit() {
        let said = |element: Element, values: &[(&str, f64)]| {
            let estimate =
                |&(name, mean): &(&str, f64)| (name.to_owned(), Estimate { mean, sd: 0.0 });
            element.words(&values.iter().map(estimate).collect()).unwrap()
        };
        let spring = said(Element::Spring, &[("stiffness_N_per_m", -1.234e7)]);
        assert_eq!(spring, "acts as if a spring of 12 MN/m were missing");
        let absorber =
            said(Element::MassOnSpring, &[("mass_kg", 0.4123), ("frequency_Hz", 1234.0)]);
        assert_eq!(absorber, "acts like a mass of 0.41 kg on a spring, at 1200 Hz");
    }
}
