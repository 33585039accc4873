//! Streams of random numbers: one for each thing that is drawn, from the scene's seed.

use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

/// Sets the streams apart from those of other programs with the same seed.
const SALT: u64 = 0x5ec0_4d51_a117_0e11;

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Topic {
    /// Small deviations of rig and channel.
    Nuisances,
    /// The surface that all passes share.
    Surface,
    /// Waves of rougher rails that all passes share.
    Rough,
    /// How corrugation drifts.
    Drift,
    /// Surface of a pass alone.
    PassSurface,
    /// Waves of rougher rails of a pass alone.
    PassRough,
    /// Speed, wheel and odometer of a pass.
    Pass,
    /// Noise and hum of a pass.
    Noise,
}

/// Random numbers of one topic.
#[derive(Debug)]
pub(crate) struct Random(ChaCha12Rng);

impl Random {
    /// Of a scene's topic; `pass` is 0 for what all passes share.
    pub(crate) fn new(seed: u64, topic: Topic, pass: usize) -> Self {
        let mut generator = ChaCha12Rng::seed_from_u64(seed ^ SALT);
        generator.set_stream(((topic as u64) << 32) + pass as u64);
        Self(generator)
    }

    /// Normal, of mean 0 and deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Evenly from `low` to `high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit: f64 = StandardUniform.sample(&mut self.0);
        low + (high - low) * unit
    }

    /// An angle in rad.
    pub(crate) fn angle(&mut self) -> f64 {
        self.between(0.0, std::f64::consts::TAU)
    }
}
