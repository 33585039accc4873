//! The model library: campaigns, their cases, and what came out of each, in SQL.
//!
//! Owns the schema's use and every statement; nothing else in the program speaks SQL. It stores and
//! counts but decides nothing: what becomes of a case whose attempt ended is asked of a [`Policy`],
//! and what time it is comes in as an argument where anything depends on it.

mod array;
mod attempt;
mod audit;
mod bins;
mod campaign;
mod case;
mod control;
mod data;
mod digest;
mod engine;
mod error;
mod lease;
mod library;
mod overview;
mod pace;
mod provenance;
mod recent;
mod report;
mod result;
mod state;
mod tally;
mod trial;
mod worker;

pub use array::StoredArray;
pub use audit::{Audit, AuditCounts, AuditFinding};
pub use campaign::CampaignRecord;
pub use case::{CaseRecord, Status};
pub use control::Retry;
pub use data::{Answer, Cell, Column, ColumnKind, Finding, Lost, Table, Verified};
pub use engine::without_password;
pub use error::LibraryError;
pub use lease::{Held, Lease, LeaseRequest, Leased};
pub use library::{Claim, Library};
pub use overview::{CampaignOverview, Cause};
pub use provenance::{
    DiagnosisRecord, EvaluationRecord, HypothesisRecord, MismatchRecord, SleeperRecord,
    SurrogateRecord, TrainingRecord,
};
pub use report::{Report, Verdict};
pub use result::{ContactLoss, LibraryEntry};
pub use state::{CampaignState, Ending, Policy, State};
pub use trial::{Question, TrialAnswer, TrialRecord};
pub use worker::{Registration, WorkerRecord, WorkerState};
