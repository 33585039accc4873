//! The model library: campaigns, their cases and the results of the cases, in SQL.
//!
//! This crate contains the schema and every statement; no other crate contains SQL. It stores and counts
//! records. The caller decides on policies and passes them as arguments. Examples are the time and the number
//! of attempts after which a case is given up ([`AttemptsMax`]).
//!
//! # Example
//!
//! ```
//! use tracktwin_library::{Library, StoredArray};
//!
//! # let folder = tempfile::tempdir()?;
//! # tokio::runtime::Runtime::new()?.block_on(async {
//! let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
//! let library = Library::open_or_create(&url).await?;
//! let levels = StoredArray {
//!     key: "ride-1".to_owned(),
//!     kind: "levels".to_owned(),
//!     meta_json: r#"{"unit": "dB"}"#.to_owned(),
//!     numbers: vec![12.5, 9.75],
//! };
//! library.store_array(levels.clone()).await?;
//! library.close().await;
//!
//! let library = Library::open(&url).await?;
//! assert_eq!(library.array("ride-1").await?, Some(levels));
//! assert!(library.campaigns().await?.is_empty());
//! # library.close().await;
//! # Ok::<(), tracktwin_library::LibraryError>(())
//! # })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod array;
mod attempt;
mod audit;
mod audit_lease;
mod bins;
mod campaign;
mod case;
mod control;
mod data;
mod digest;
mod engine;
mod error;
mod error_class;
mod error_code;
mod lease;
mod library;
mod model;
mod overview;
mod provenance;
mod quarantine;
mod recent;
mod report;
mod restore;
mod result;
mod state;
mod tally;
mod throughput;
mod trial;
mod worker;

pub use array::StoredArray;
pub use audit::{Audit, AuditCounts, AuditFinding};
pub use campaign::CampaignRecord;
pub use case::{CaseRecord, Status};
pub use control::Retry;
pub use data::{Answer, Cell, Column, ColumnKind, IntegrityFault, Lost, Table, Verified};
pub use engine::without_password;
pub use error::LibraryError;
pub use lease::{Held, Lease, LeaseRequest, Leased};
pub use library::{Claim, Library};
pub use overview::{CampaignOverview, Cause};
pub use provenance::{
    DiagnosisRecord, EvaluationRecord, HypothesisRecord, MismatchRecord, SleeperRecord,
    SurrogateRecord, TrainingRecord,
};
pub use report::{Report, ReportVerdict};
pub use restore::AlteredCase;
pub use result::{ContactLoss, LibraryEntry};
pub use state::{AttemptsMax, CampaignState, State};
pub use trial::{Question, TrialAnswer, TrialRecord};
pub use worker::{Registration, WorkerRecord, WorkerState};
