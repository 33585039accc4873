//! Pages and Prometheus metrics of a farm over HTTP.
//!
//! Owns routes, the token of those who may press buttons, the way from the library to what is shown,
//! and how it looks.

mod metrics;
mod page;
mod routes;
mod status;
mod view;

pub use routes::{Dashboard, serve};
pub use status::{Farm, FarmCampaign, FarmWorker, duration};
pub use view::{Detail, farm};
