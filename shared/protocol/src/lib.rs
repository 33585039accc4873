//! The messages between coordinator and workers.
//!
//! This crate contains the code generated from `proto/farm/v1/farm.proto`, and the checked types of the
//! messages. Only this crate checks messages; other crates can rely on checked values.

mod check;
mod checksum;
mod lease;
mod register;
mod report;

pub use check::{BadMessage, name};
pub use checksum::{checksum, checksum_of_passes};
pub use lease::{CaseLease, Lease, LeasedCase, held_from_messages, held_to_messages};
pub use register::Registration;
pub use report::{CaseReport, Shape};

/// Version of the protocol of this program.
///
/// The version is raised if an older program would misinterpret a message. A new optional field does not
/// change it. Programs without a version send 0. Since version 2, reports have checksums.
pub const PROTOCOL_VERSION: u32 = 2;

/// Largest number of cases that a worker may request, hold, renew or report in one message.
pub const CASES_MAX: usize = 4096;

/// Largest size of a message in bytes: a hundred cases with ten speeds and a thousand bins.
///
/// A worker reports only a few cases at a time. The limit bounds the memory that an unknown client can
/// make a coordinator use, not the results of a worker.
pub const MESSAGE_BYTES_MAX: usize = 16 << 20;

/// Window of HTTP/2 flow control in bytes, on both sides.
///
/// With the default of 64 KiB a batch of results waits for several round trips.
pub const WINDOW_BYTES: u32 = 4 << 20;

/// Generated from `proto/farm/v1/farm.proto`.
pub mod farm {
    #![allow(
        missing_docs,
        unreachable_pub,
        clippy::pedantic,
        clippy::allow_attributes,
        reason = "generated code; its documentation stands in the proto file"
    )]
    tonic::include_proto!("farm.v1");
}
