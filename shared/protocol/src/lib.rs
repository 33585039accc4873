//! The messages between coordinator and workers.
//!
//! Owns the code generated from `proto/farm/v1/farm.proto`, and the checked values that messages
//! become. Only this crate distrusts a message; who receives a checked value may rely on it.

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

/// Version of the protocol that this program speaks.
///
/// Raised whenever an older program would misunderstand a message, rather than merely miss a field
/// it can do without. 0 is what programs say that don't know of versions; since 2 a report has checksums.
pub const PROTOCOL_VERSION: u32 = 2;

/// Most cases that a worker may ask for, hold, renew or report in one message.
pub const CASES_MAX: usize = 4096;

/// Most bytes of a message: a hundred cases of ten speeds and a thousand bins.
///
/// A worker reports a few cases at a time, so this bounds what a stranger may make a coordinator
/// hold, not what a worker may find.
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
