//! Checksum of the outcome of a case. The worker computes it; message reader and library check it.
//!
//! `docs/checksums.md` describes the hashed bytes, so that programs in any language can compute the
//! checksum.

use tracktwin_experiment::{Outcome, PassFeatures};

/// Identifies the hashed encoding. Another encoding has another number.
const CONTEXT: &str = "tracktwin case result 1";

/// Number of hexadecimal digits of a checksum: 128 bits, as for hashes of parameters.
const DIGITS: usize = 32;

/// BLAKE3 (32 hexadecimal digits) of a case's index, the hash of its parameters and seed, and its outcome.
///
/// The checksum does not depend on the worker, the time or the lease.
pub fn checksum(index: u32, parameter_hash: &str, outcome: &Outcome) -> String {
    match outcome {
        Outcome::Finished(passes) => checksum_of_passes(index, parameter_hash, passes),
        Outcome::Failed { reason } => {
            let mut bytes = begun(index, parameter_hash, 0, reason.len());
            text(&mut bytes, reason);
            hash(&bytes)
        }
    }
}

/// [`checksum`] of a finished case.
pub fn checksum_of_passes(index: u32, parameter_hash: &str, passes: &[PassFeatures]) -> String {
    let of_pass = |pass: &PassFeatures| {
        8 * (5 + pass.features.log_power.len() + pass.features.band_levels_db.len())
    };
    let length = passes.iter().map(of_pass).sum();
    let mut bytes = begun(index, parameter_hash, passes.len(), length);
    for it in passes {
        pass(&mut bytes, it);
    }
    hash(&bytes)
}

/// The header, with capacity for the given number of bytes.
fn begun(index: u32, parameter_hash: &str, passes: usize, length: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(64 + length);
    bytes.extend(index.to_be_bytes());
    text(&mut bytes, parameter_hash);
    count(&mut bytes, passes);
    bytes
}

fn hash(bytes: &[u8]) -> String {
    let mut hasher = blake3::Hasher::new_derive_key(CONTEXT);
    hasher.update(bytes);
    hasher.finalize().to_hex()[..DIGITS].to_owned()
}

fn pass(bytes: &mut Vec<u8>, pass: &PassFeatures) {
    bytes.extend(big_endian(pass.speed_km_h));
    numbers(bytes, pass.contact_loss_share.as_slice());
    numbers(bytes, &pass.features.band_levels_db);
    numbers(bytes, &pass.features.log_power);
}

/// Appends the number of values and each value, so that consecutive lists are unambiguous.
fn numbers(bytes: &mut Vec<u8>, numbers: &[f64]) {
    count(bytes, numbers.len());
    bytes.extend(numbers.iter().copied().map(big_endian).collect::<Vec<_>>().as_flattened());
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    count(bytes, text.len());
    bytes.extend(text.as_bytes());
}

fn count(bytes: &mut Vec<u8>, count: usize) {
    bytes.extend((count as u64).to_be_bytes());
}

/// Negative zero is zero, as `SQLite` stores it.
fn big_endian(number: f64) -> [u8; 8] {
    (number + 0.0).to_be_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_signal::Features;

    fn passes() -> Vec<PassFeatures> {
        let pass = |speed_km_h, contact_loss_share| PassFeatures {
            speed_km_h,
            features: Features { log_power: vec![-1.5, 0.1], band_levels_db: vec![30.0, -0.0] },
            contact_loss_share,
        };
        vec![pass(7.0, None), pass(13.0, Some(0.25))]
    }

    fn of(passes: Vec<PassFeatures>) -> String {
        checksum(5, "ab", &Outcome::Finished(passes))
    }

    #[test]
    fn the_checksum_is_what_another_program_makes_of_the_described_bytes() {
        // By the Python program in docs/checksums.md.
        assert_eq!(of(passes()), "6515178a279eba8a56b367fb8a26bc3d");
        let failed = Outcome::Failed { reason: "it floats".to_owned() };
        assert_eq!(checksum(5, "ab", &failed), "d4bcc80d552a55b2340ce718784d67c9");
    }

    #[test]
    fn every_part_of_a_result_changes_its_checksum() {
        let whole = of(passes());
        let changed = |change: fn(&mut Vec<PassFeatures>)| {
            let mut passes = passes();
            change(&mut passes);
            of(passes)
        };
        for (part, altered) in [
            ("speed", changed(|it| it[1].speed_km_h = it[1].speed_km_h.next_up())),
            ("level", changed(|it| it[0].features.band_levels_db[0] += 3.0)),
            (
                "bin",
                changed(|it| {
                    let bin = &mut it[1].features.log_power[1];
                    *bin = bin.next_up();
                }),
            ),
            ("share", changed(|it| it[1].contact_loss_share = Some(0.5))),
            ("no share", changed(|it| it[1].contact_loss_share = None)),
            ("lost pass", changed(|it| it.truncate(1))),
            ("order", changed(|it| it.reverse())),
            (
                "moved end",
                changed(|it| {
                    let features = &mut it[0].features;
                    features.log_power.insert(0, features.band_levels_db.pop().unwrap_or_default());
                }),
            ),
            ("index", checksum(6, "ab", &Outcome::Finished(passes()))),
            ("parameters", checksum(5, "ac", &Outcome::Finished(passes()))),
            ("nothing", checksum(5, "ab", &Outcome::Finished(Vec::new()))),
        ] {
            assert_ne!(altered, whole, "{part}");
        }
    }

    #[test]
    fn negative_zero_is_zero() {
        let mut positive = passes();
        for pass in &mut positive {
            pass.features.band_levels_db[1] = 0.0;
        }
        assert_eq!(of(positive), of(passes()));
    }
}
