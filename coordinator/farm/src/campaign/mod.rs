//! A campaign's definition and its cases.
//!
//! This module contains the campaign file and derives a case from its index. Only `store` and `restore` use the
//! library; the worker simulates the cases.

mod design;
mod kinship;
mod restore;
mod spec;
mod store;

pub use design::{case, cases};
pub use kinship::Kinship;
pub use restore::restore_cases;
pub use spec::{Campaign, DEFAULT, Definition, SpecError, Surfaces};
pub use store::{StoreError, add_cases, insert_campaign, store_campaign};

use store::drawn;
