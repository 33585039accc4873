//! Effect of further wheels on the power that is recorded at the first wheel.
//!
//! `a_1` and `a_2` are the receptances at the contacts, and `b` is the receptance of the rail between them.
//! The contact forces are `F = -A^-1 r`, `A = [[a_1, b], [b, a_2]]`. For a rough surface they give `|F_1|^2
//! = (|a_2|^2 + |b|^2) / |a_1 a_2 - b^2|^2 S`: both wheels roll on the same surface at a fixed distance,
//! and the phase between them turns many times within a band. The second term comes from the surface under
//! the other wheel; at a defect of the rail this is another position. The model treats several further
//! wheels one by one, each as a rigid wheel with the mass and load of the first. Source: T. X. Wu and D. J.
//! Thompson, Vehicle System Dynamics 34 (2001).

use num_complex::Complex64;
use std::f64::consts::TAU;
use tracktwin_track::frequency::shares;
use tracktwin_track::model::TrackModel;

/// Effect of all further wheels.
#[derive(Clone, Debug, Default)]
pub(crate) struct FurtherWheels {
    /// Factors on the power, `[line][node]`; empty for a single wheel.
    gains: Vec<Vec<f64>>,
    /// Share of the power that comes from the surface under each further wheel, `[wheel][line][node]`.
    parts: Vec<Vec<Vec<f64>>>,
}

impl FurtherWheels {
    /// Computes the effect for a model's wheels. `hertz` is the contact stiffness in N/m, `direct` the
    /// receptance of the rail in m/N, and `stiffness` that of contact, rail and vehicle in series in N/m,
    /// both `[line][node]`. `ahead` gives the receptances of the rail at a distance in m, as
    /// [`receptances_ahead`](tracktwin_track::frequency::receptances_ahead).
    pub(crate) fn new(
        model: &TrackModel,
        lines_hz: &[f64],
        hertz: f64,
        direct: &[Vec<Complex64>],
        stiffness: &[Vec<Complex64>],
        ahead: impl Fn(f64) -> Vec<Vec<Complex64>>,
    ) -> Self {
        let mut all = Self::default();
        for &distance_m in &model.vehicle().further_wheels_m {
            let one = OneWheel { model, hertz, distance_m, between: ahead(distance_m) };
            let (gains, parts): (Vec<_>, Vec<_>) =
                one.gains_and_parts(lines_hz, direct, stiffness).into_iter().unzip();
            all.parts.push(parts);
            if all.gains.is_empty() {
                all.gains = gains;
                continue;
            }
            for (all, gain) in all.gains.iter_mut().flatten().zip(gains.into_iter().flatten()) {
                *all *= gain;
            }
        }
        all
    }

    /// Factors on the power, line by line; empty for a single wheel.
    pub(crate) fn gains(&self) -> impl Iterator<Item = &f64> {
        self.gains.iter().flatten()
    }

    /// Share of the power at a node that comes from the surface under a further wheel.
    pub(crate) fn share(&self, wheel: usize, line: usize, node: usize) -> f64 {
        self.parts[wheel][line][node]
    }

    /// Share of the power at a node that comes from the surface under the first wheel.
    pub(crate) fn own_share(&self, line: usize, node: usize) -> f64 {
        1.0 - self.parts.iter().map(|parts| parts[line][node]).sum::<f64>()
    }
}

/// A wheel at `distance_m` ahead of the first one (negative: behind).
struct OneWheel<'a> {
    model: &'a TrackModel,
    hertz: f64,
    distance_m: f64,
    /// Receptances of the rail from each node to this wheel in m/N, `[line][node]`.
    between: Vec<Vec<Complex64>>,
}

impl OneWheel<'_> {
    /// For each line: the factor on the power at each node, and the share of the power that comes from the
    /// surface under this wheel.
    fn gains_and_parts(
        &self,
        lines_hz: &[f64],
        direct: &[Vec<Complex64>],
        stiffness: &[Vec<Complex64>],
    ) -> Vec<(Vec<f64>, Vec<f64>)> {
        let nodes_m = self.model.layout().rail_nodes_m();
        let there: Vec<_> =
            nodes_m.iter().map(|x_m| shares(nodes_m, x_m + self.distance_m)).collect();
        let of_line = |line: usize| {
            let omega = TAU * lines_hz[line];
            let mass_kg = self.model.vehicle().wheel.mass_kg;
            let wheel = 1.0 / self.hertz - 1.0 / (mass_kg * omega * omega);
            let of_node = |(node, there): (usize, &Vec<(usize, f64)>)| {
                if there.is_empty() {
                    return (1.0, 0.0);
                }
                let rail: Complex64 =
                    there.iter().map(|&(other, share)| share * direct[line][other]).sum();
                let (first, second) = (stiffness[line][node].inv(), wheel + rail);
                let between = self.between[line][node];
                let [own, other] = [second.norm_sqr(), between.norm_sqr()];
                let shared = (first * second - between * between).norm_sqr();
                (first.norm_sqr() * (own + other) / shared, other / (own + other))
            };
            there.iter().enumerate().map(of_node).unzip()
        };
        (0..lines_hz.len()).map(of_line).collect()
    }
}
