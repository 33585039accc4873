//! Simulation of a hammer test with the track model, as test data for the evaluation.

use crate::measured::PointReceptance;
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write as _;
use tracktwin_parameters::TrackDesign;
use tracktwin_track::frequency::RailReceptances;
use tracktwin_track::model::{Mesh, ModelError, Support, TrackModel};

/// Numbers of rail elements per span, where the rail is struck and beyond, and of elements per half
/// sleeper; the mesh is finer than that of the fit.
const STRUCK_ELEMENTS: usize = 10;
const RAIL_ELEMENTS: usize = 6;
const SLEEPER_ELEMENTS: usize = 8;
/// Number of spans beyond the tested sleepers on either side; the fit has another one, so that the ends of
/// the rail do not agree.
const BESIDE: usize = 200;

/// Sleepers and noise of a simulated hammer test.
#[derive(Clone, Debug, PartialEq)]
pub struct HammerTest {
    /// Supports of the tested sleepers; sleeper 0 comes first.
    pub supports: Vec<Support>,
    /// Support of all other sleepers.
    pub others: Support,
    /// Frequencies in Hz.
    pub frequencies_hz: Vec<f64>,
    /// Number of averaged hits per position.
    pub hits: usize,
    /// Standard deviation of the noise of one hit divided by the receptance, for the real and the imaginary
    /// part.
    pub noise: f64,
    /// Random seed of the noise.
    pub seed: u64,
}

impl HammerTest {
    /// Receptances above every tested sleeper and at midspan after it. Sleeper `i` has the position `i`
    /// times the spacing.
    ///
    /// # Errors
    /// [`ModelError`] if the track cannot be built.
    pub fn receptances(&self, design: &TrackDesign) -> Result<Vec<PointReceptance>, ModelError> {
        let struck = self.supports.len();
        let mut supports = vec![self.others; struck + 2 * BESIDE];
        supports[BESIDE..BESIDE + struck].copy_from_slice(&self.supports);
        let spacing_m = design.sleeper.spacing_m;
        // The span with this index begins at the first tested sleeper.
        let first = BESIDE + 1;
        let fine = first..first + struck;
        let rail_elements = (0..=supports.len())
            .map(|span| if fine.contains(&span) { STRUCK_ELEMENTS } else { RAIL_ELEMENTS })
            .collect();
        let mesh = Mesh { rail_elements, sleeper_elements: SLEEPER_ELEMENTS };
        let model = TrackModel::build(design, &mesh, &supports, &[])?;
        let direct = RailReceptances::new(&model, &self.frequencies_hz, None).direct;
        let of = |half: usize| {
            let node = first * RAIL_ELEMENTS + half * STRUCK_ELEMENTS / 2;
            let exact: Vec<Complex64> = direct.iter().map(|nodes| nodes[node]).collect();
            self.measured(0.5 * half as f64 * spacing_m, &exact, half)
        };
        Ok((0..2 * struck).map(of).collect())
    }

    /// Adds the noise that remains after averaging, and its coherence.
    fn measured(&self, position_m: f64, exact: &[Complex64], half: usize) -> PointReceptance {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        // Stream 0 of the seed draws the unevenness.
        random.set_stream(1 + half as u64);
        let deviation = self.noise / (self.hits as f64).sqrt();
        let noisy = |value: &Complex64| {
            let mut normal = || StandardNormal.sample(&mut random);
            let error: [f64; 2] = [normal(), normal()];
            value * Complex64::new(1.0 + deviation * error[0], deviation * error[1])
        };
        // The inverse of `PointReceptance::deviation` for one hit.
        let coherence = 1.0 / (1.0 + 2.0 * self.noise * self.noise);
        PointReceptance {
            position_m,
            frequencies_hz: self.frequencies_hz.clone(),
            values: exact.iter().map(noisy).collect(),
            coherence: Some(vec![coherence; exact.len()]),
            hits: Some(self.hits),
        }
    }
}

/// The receptances as the text of a CSV table that [`crate::read`] accepts.
pub fn table(points: &[PointReceptance]) -> String {
    let mut text =
        "position_m,frequency_Hz,receptance_real_m_N,receptance_imag_m_N,coherence,hits\n"
            .to_owned();
    for point in points {
        for (index, (hz, value)) in point.frequencies_hz.iter().zip(&point.values).enumerate() {
            let coherence = point.coherence.as_ref().map_or(1.0, |it| it[index]);
            let hits = point.hits.unwrap_or(1);
            let _ = writeln!(
                text,
                "{},{hz:.4},{:e},{:e},{coherence:.6},{hits}",
                point.position_m, value.re, value.im
            );
        }
    }
    text
}

/// The true values of the tested sleepers as the text of a CSV table, with units in the column names.
pub fn truth(test: &HammerTest, design: &TrackDesign) -> String {
    let mut text = "id,x_m,railpad_stiffness_N_m,ballast_stiffness_N_m,sleeper_EI_N_m2,railpad_damping_N_s_m,ballast_damping_N_s_m\n".to_owned();
    for (number, support) in test.supports.iter().enumerate() {
        let _ = writeln!(
            text,
            "SN{number},{},{},{},{},{},{}",
            number as f64 * design.sleeper.spacing_m,
            support.railpad_stiffness,
            support.ballast_stiffness,
            support.sleeper_bending_stiffness,
            support.railpad_damping,
            support.ballast_damping
        );
    }
    text
}
