//! The model library: campaigns, their cases, and what came out of each, in SQL.
//!
//! Owns the schema's use and every statement; nothing else in the program speaks SQL. It stores and
//! counts but decides nothing: what becomes of a case whose attempt ended is asked of a [`Policy`],
//! and the clock comes in as an argument.

mod campaign;
mod case;
mod digest;
mod error;
mod lease;
mod library;
mod report;
mod result;
mod state;
mod url;
mod writer;

pub use campaign::CampaignRecord;
pub use case::{CaseRecord, Status};
pub use error::LibraryError;
pub use lease::{Held, LeaseRequest, Leased};
pub use library::{Claim, Library};
pub use report::{CaseReport, Report, Verdict};
pub use result::LibraryEntry;
pub use state::{Ending, Policy, State};
