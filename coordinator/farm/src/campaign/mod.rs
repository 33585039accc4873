//! A campaign's definition and its cases.
//!
//! This module contains the campaign file and derives a case from its index. Only `store` uses the library;
//! the worker simulates the cases.

mod design;
mod kinship;
mod spec;
mod store;

pub use design::{case, cases};
pub use kinship::Kinship;
pub use spec::{Campaign, DEFAULT, Definition, SpecError, Surfaces};
pub use store::{StoreError, add_cases, insert_campaign, store_campaign};
