//! The coordinator: decides what is simulated, keeps the results and answers with them.
//!
//! - [`campaign`]: what is to be simulated; from an index to a case.
//! - [`dispatch`]: hands cases to workers and takes their results (gRPC).
//! - [`dashboard`]: pages and metrics for people and Prometheus.
//! - [`service`]: the coordinator on a port: certificates, tokens, starting and stopping.
//! - [`farm`]: coordinator and workers in one process.
//! - [`trial`]: blind trials of the diagnosis, in a folder.
//! - [`training`]: from a library to a training set.
//! - [`diagnosing`]: from a recording to its diagnosis, stage by stage.
//! - [`coverage`]: how often estimates hold and refusals are right, on simulated tracks.
//! - [`evaluating`]: from models and their library to what evaluates recordings.
//! - [`null_models`]: simulations of a track with nothing left out, kept in the library.
//! - [`reproducing`]: from a library and models to the paper's figures.
//! - [`provenance`]: what a library keeps of trainings, evaluations and diagnoses.
//! - [`commands`]: what `tracktwin` can be told to do; load, compute, store, report.
//!
//! The library, the surrogate, evaluation and reports are crates of their own beside `src`.

pub mod campaign;
pub mod commands;
pub mod coverage;
pub mod dashboard;
pub mod diagnosing;
pub mod dispatch;
pub mod evaluating;
pub mod farm;
pub mod null_models;
pub mod provenance;
pub mod reproducing;
pub mod service;
pub mod training;
pub mod trial;
