//! Hashes the golden features: they are the version of the physics.

use std::error::Error;

const GOLDEN: &str = "golden.json";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={GOLDEN}");
    let mut hasher = blake3::Hasher::new_derive_key("tracktwin physics 2");
    let hash = hasher.update(&std::fs::read(GOLDEN)?).finalize().to_hex();
    println!("cargo::rustc-env=TRACKTWIN_MODEL_HASH={}", &hash[..32]);
    Ok(())
}
