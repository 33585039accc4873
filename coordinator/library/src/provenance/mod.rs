//! Provenance: trainings, evaluations and diagnoses made from the library's results.
//!
//! Each table has columns for queries, and some tables have the whole document as well. Storing the same
//! record again changes nothing, because the id of a record is a hash of its content.

mod diagnosis;
mod evaluation;
mod training;

pub use diagnosis::{DiagnosisRecord, HypothesisRecord, MismatchRecord};
pub use evaluation::{EvaluationRecord, SleeperRecord};
pub use training::{SurrogateRecord, TrainingRecord};

/// Hash of these texts in this order: 128 bits, in hexadecimal.
pub(crate) fn id(kind: &str, texts: &[&str]) -> String {
    let mut hasher = blake3::Hasher::new_derive_key(kind);
    for text in texts {
        // The length keeps neighbouring texts apart.
        hasher.update(&(text.len() as u64).to_be_bytes()).update(text.as_bytes());
    }
    hasher.finalize().to_hex()[..32].to_owned()
}
