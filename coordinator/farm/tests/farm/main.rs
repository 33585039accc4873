//! The farm over real sockets, with a stand-in for the physics: in one process, as a service, with
//! certificates and tokens, with several campaigns, and over a network that misbehaves.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod audits;
mod campaigns;
mod embedded;
mod network;
mod security;
mod service;
mod support;
