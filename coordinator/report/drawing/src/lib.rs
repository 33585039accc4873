//! Elements of pages: axes, charts as inline SVG, numbers with units, page frame.
//!
//! Owns how things look; what is shown is left to others. No file, font or script from elsewhere.

mod axis;
mod chart;
mod number;
mod page;

pub use axis::Axis;
pub use chart::Chart;
pub use number::{Shown, percent, significant};
pub use page::{CHART_STYLE, figure, page, page_with, sheet, stand_alone};
