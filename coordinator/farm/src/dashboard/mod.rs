//! Pages and Prometheus metrics of a farm over HTTP.
//!
//! This module contains the routes, the check of the token for the controls, the queries of the library,
//! and the layout of the pages.

mod metrics;
mod page;
mod routes;
mod status;
mod view;

pub use routes::{Dashboard, serve};
pub use status::{Farm, FarmCampaign, FarmWorker, duration};
pub use view::{Detail, farm};
