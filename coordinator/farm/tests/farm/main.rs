//! The farm with real sockets and a stand-in for the track model: in one process, as a service, with
//! certificates and tokens, with several campaigns, and on an unreliable network.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod audits;
mod campaigns;
mod embedded;
mod network;
mod security;
mod service;
mod support;
