//! Signals with known content, for tests.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use tracktwin_signal::recording::Recording;

/// Independent values of mean zero and variance one (Box and Muller).
pub(crate) fn noise(seed: u64, count: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut unit = move || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let mut normal = || (-2.0 * (1.0 - unit()).ln()).sqrt() * (TAU * unit()).cos();
    (0..count).map(|_| normal()).collect()
}

/// One of the shared recordings, unless they are absent.
pub(crate) fn shared(name: &str) -> Option<Recording> {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    if root.is_dir() {
        return Some(Recording::open(root.join("recordings").join(name)).unwrap());
    }
    assert!(std::env::var_os("TRACKTWIN_REQUIRE_SHARED").is_none(), "../shared is not there");
    println!("skipped: ../shared is not there");
    None
}
