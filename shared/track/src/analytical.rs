//! Closed-form solutions. Tests compare the finite elements with them.

use crate::element::BeamElement;
use std::f64::consts::PI;

/// Natural frequency in rad/s of a simply supported Timoshenko beam, `half_waves` from 1: the
/// lower (bending) branch.
///
/// With `w = W sin(k x)` and `theta = T cos(k x)` the equations of motion leave
/// `(S k² - m w²)(B k² + S - j w²) = S² k²`; source: Timoshenko 1921.
pub(crate) fn simply_supported_frequency(
    beam: &BeamElement,
    length_m: f64,
    half_waves: u32,
) -> f64 {
    let k2 = (f64::from(half_waves) * PI / length_m).powi(2);
    let (bending, shear) = (beam.bending_stiffness, beam.shear_stiffness);
    let (mass, inertia) = (beam.mass_per_length, beam.rotary_inertia_per_length);
    let a = mass * inertia;
    let b = mass * (bending * k2 + shear) + inertia * shear * k2;
    let c = shear * bending * k2 * k2;
    (2.0 * c / (b + (b * b - 4.0 * a * c).sqrt())).sqrt()
}

/// Deflection in m/N under a unit load of an infinite Timoshenko beam on a Winkler foundation of
/// `foundation` in N/m2.
///
/// The integral over all wave numbers of `(1 + B k²/S) / (B k⁴ + f B k²/S + f)`, over 2 pi.
pub(crate) fn winkler_deflection(beam: &BeamElement, foundation: f64) -> f64 {
    let (bending, shear) = (beam.bending_stiffness, beam.shear_stiffness);
    let root = (foundation / bending).sqrt();
    (1.0 / root + bending / shear) / (2.0 * bending * (foundation / shear + 2.0 * root).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frequency::{ReceptancePoint, receptance};
    use crate::model::{Mesh, Support, TrackModel};
    use nalgebra::DMatrix;
    use tracktwin_parameters::{ParameterSet, TrackDesign};

    /// A support that carries nothing: the rail is a beam on its two ends.
    const NOTHING: Support = Support {
        railpad_stiffness: 0.0,
        railpad_damping: 0.0,
        ballast_stiffness: 0.0,
        ballast_damping: 0.0,
        sleeper_bending_stiffness: 5000.0,
    };

    fn track(design: &TrackDesign, mesh: &Mesh, support: Support) -> TrackModel {
        TrackModel::build(design, mesh, &vec![support; mesh.spans() - 1], &[]).unwrap()
    }

    /// Natural frequencies in rad/s of the rail alone, ascending.
    fn rail_frequencies(model: &TrackModel) -> Vec<f64> {
        let (matrices, size) = (model.matrices(), model.layout().rail_dofs());
        let mut mass = DMatrix::zeros(size, size);
        let mut stiffness = DMatrix::zeros(size, size);
        for (row, column, place) in matrices.places().filter(|&(i, j, _)| i < size && j < size) {
            mass[(row, column)] = matrices.mass()[place];
            stiffness[(row, column)] = matrices.stiffness()[place];
        }
        let inverse = mass.cholesky().unwrap().l().try_inverse().unwrap();
        let mut squares = (&inverse * stiffness * inverse.transpose()).symmetric_eigenvalues();
        squares.as_mut_slice().sort_by(f64::total_cmp);
        squares.iter().map(|square| square.sqrt()).collect()
    }

    #[test]
    fn natural_frequencies_converge_to_timoshenkos_beam_with_order_two() {
        let design = TrackDesign::v_track();
        let errors = |elements: usize| -> Vec<f64> {
            let model = track(&design, &Mesh::uniform(2, elements, 1), NOTHING);
            let (beam, length) = (model.layout().rail_elements()[0], model.layout().length_m());
            let found = rail_frequencies(&model);
            // The fourth is the thickness-shear mode, of the upper branch.
            (1..=3)
                .zip(found)
                .map(|(n, found)| found / simply_supported_frequency(&beam, length, n) - 1.0)
                .collect()
        };
        let (coarse, fine) = (errors(8), errors(16));
        for (mode, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
            let order = (coarse / fine).log2();
            // The element's shear is constant, the beam's is not: energy, and with it the square of
            // a frequency, converges from above with h^2 where shear matters.
            assert!((order - 2.0).abs() < 0.1, "mode {}: order {order}", mode + 1);
            // Without its term in h^2 the error is one in h^4: nothing but the exact frequency is
            // left at the limit.
            let limit = (4.0 * fine - coarse) / 3.0;
            assert!(*fine > 0.0 && limit.abs() < fine / 30.0, "mode {}: {limit}", mode + 1);
        }
    }

    #[test]
    fn a_long_track_sinks_like_a_beam_on_a_winkler_foundation() {
        let design = TrackDesign::v_track();
        let support = Support {
            railpad_stiffness: 2e6,
            ballast_stiffness: 2e6,
            // As good as rigid: the ballast is in series with the railpad.
            sleeper_bending_stiffness: 5e9,
            ..Support::from(&ParameterSet::nominal())
        };
        let model = track(&design, &Mesh::uniform(60, 2, 2), support);
        let middle = model.layout().length_m() / 2.0;
        let at = |x_m| {
            let place = ReceptancePoint::Rail(x_m);
            receptance(&model, place, place, &[0.0]).unwrap()[0].re
        };
        let spacing = design.sleeper.spacing_m;
        let mean = 0.5 * (at(middle) + at(middle + spacing / 2.0));
        let exact = winkler_deflection(&model.layout().rail_elements()[0], 1e6 / spacing);
        // Sleepers 0.125 m apart against a bending length of 0.48 m: smearing them out costs
        // about (0.125 / 0.48)^4 / 12 = 4e-4.
        assert!((mean / exact - 1.0).abs() < 2e-3, "{mean} against {exact}");
    }
}
