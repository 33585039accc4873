//! A hammer test of the track model itself: a table to try the evaluation with.

use crate::measured::PointReceptance;
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::fmt::Write as _;
use tracktwin_parameters::TrackDesign;
use tracktwin_track::frequency::{FrequencyError, ReceptancePoint, receptance};
use tracktwin_track::model::{Mesh, ModelError, Support, TrackModel};

/// Rail elements of a span and elements of a half sleeper: finer than those of the fit.
const RAIL_ELEMENTS: usize = 10;
const SLEEPER_ELEMENTS: usize = 8;
/// Spans beside the struck sleepers on either side.
pub(crate) const BESIDE: usize = 50;

/// What is struck, and how noisy it is.
#[derive(Clone, Debug, PartialEq)]
pub struct HammerTest {
    /// Supports of the struck sleepers, sleeper 0 first.
    pub supports: Vec<Support>,
    /// Support of all other sleepers.
    pub others: Support,
    /// Frequencies in Hz.
    pub frequencies_hz: Vec<f64>,
    /// Hits that are averaged at a place.
    pub hits: usize,
    /// Standard deviation of the noise of one hit over the receptance, in its real and imaginary part.
    pub noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Why no test can be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulateError {
    /// The track cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The track has no receptance.
    #[error(transparent)]
    Frequency(#[from] FrequencyError),
}

impl HammerTest {
    /// Receptances above every struck sleeper and at midspan behind it; sleeper `i` stands at `i`
    /// spacings.
    ///
    /// # Errors
    /// [`SimulateError`] for a track that cannot be built or has no receptance.
    pub fn receptances(&self, design: &TrackDesign) -> Result<Vec<PointReceptance>, SimulateError> {
        let struck = self.supports.len();
        let mut supports = vec![self.others; struck + 2 * BESIDE];
        supports[BESIDE..BESIDE + struck].copy_from_slice(&self.supports);
        let spacing_m = design.sleeper.spacing_m;
        let mesh = Mesh::uniform(supports.len() + 1, RAIL_ELEMENTS, SLEEPER_ELEMENTS);
        let model = TrackModel::build(design, &mesh, &supports, &[])?;
        let first_m = (BESIDE + 1) as f64 * spacing_m;
        let of = |half: usize| {
            let position_m = 0.5 * half as f64 * spacing_m;
            let place = ReceptancePoint::Rail(first_m + position_m);
            let exact = receptance(&model, place, place, &self.frequencies_hz)?;
            Ok(self.measured(position_m, &exact, half))
        };
        (0..2 * struck).into_par_iter().map(of).collect()
    }

    /// With the noise that remains after averaging, and its coherence.
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

/// Receptances as a table that [`crate::read`] reads.
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

/// The true values of the struck sleepers as a table.
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
