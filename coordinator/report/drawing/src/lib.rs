//! Elements of pages: axes, charts as inline SVG, numbers with units, page frame.
//!
//! This crate defines the appearance of pages; its callers define their content. A page needs no external
//! file, font or script.

mod axis;
mod chart;
mod number;
mod page;

pub use axis::Axis;
pub use chart::Chart;
pub use number::{Shown, percent, significant};
pub use page::{CHART_STYLE, figure, page, page_with, sheet, stand_alone};
