//! A campaign's definition and its cases.
//!
//! Owns the campaign file and the way from an index to a case. Pure but for `store`; running cases is the
//! worker's.

mod design;
mod kinship;
mod spec;
mod store;

pub use design::{case, cases};
pub use kinship::Kinship;
pub use spec::{Campaign, DEFAULT, Definition, SpecError, Surfaces};
pub use store::{StoreError, add_cases, insert_campaign, store_campaign};
