//! Self-contained pages and pictures: no file, font or script from elsewhere.
//!
//! Owns how results look; every function goes from data to text. What the data mean, and where
//! the text is written, is left to others.

mod axis;
mod chart;
mod diagnosis_page;
mod evaluation_page;
mod farm;
mod farm_page;
mod inspection_page;
mod map_picture;
mod models_page;
mod number;
mod page;
mod receptance;
mod reproduction_page;
mod spectrum_picture;
mod track_picture;

pub use diagnosis_page::{Origin, diagnosis_page};
pub use evaluation_page::evaluation_page;
pub use farm::{Farm, FarmCampaign, FarmWorker, duration};
pub use farm_page::{farm_page, farm_view};
pub use inspection_page::{Inspected, InspectedCurve, Inspection, inspection_page};
pub use models_page::{Tested, models_page};
pub use number::percent;
pub use receptance::{ReceptanceCurve, receptance_chart};
pub use reproduction_page::reproduction_page;
