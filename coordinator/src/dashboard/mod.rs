//! What people and Prometheus see of a farm: pages and metrics over HTTP.
//!
//! Owns routes, the token of those who may press buttons, and the way from the library to what is
//! shown. How it looks is the report's.

mod metrics;
mod routes;
mod view;

pub use routes::{Dashboard, serve};
pub use view::{Detail, farm};
