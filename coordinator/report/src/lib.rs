//! Self-contained HTML pages and SVG charts; they need no external file, font or script.
//!
//! This crate defines the appearance of results. Every function converts data to text. The caller supplies
//! the data and writes the text to a file.

mod along_track;
mod diagnosis_page;
mod evaluation_page;
mod hammer_page;
mod improvement_page;
mod inspection_page;
mod inversion_page;
mod map_picture;
mod models_page;
mod receptance;
mod reproduction_page;
mod ring_page;
mod spectrum_picture;
mod track_picture;

pub use diagnosis_page::{Origin, diagnosis_page};
pub use evaluation_page::evaluation_page;
pub use hammer_page::{hammer_chart, hammer_page};
pub use improvement_page::{ImprovedSleeper, Improvement, improvement_page};
pub use inspection_page::{Inspected, InspectedCurve, InspectionReport, inspection_page};
pub use inversion_page::{inversion_chart, inversion_page};
pub use models_page::models_page;
pub use receptance::{ReceptanceCurve, receptance_chart};
pub use reproduction_page::reproduction_page;
pub use ring_page::ring_page;
pub use track_picture::evaluation_chart;

/// Note on the meaning of a railpad stiffness, for a reader who has values from a test bench.
const UNDER_LOAD: &str = "Railpad stiffness is the dynamic stiffness under the load of the wheel. A railpad that stiffens with load is softer without it; recordings with one load do not show by how much.";

/// The text with a capital first letter.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Points of neighbouring items, stretch by stretch; an item without a point ends a stretch. A line through each
/// stretch does not cross the items between them.
fn valid_stretches<T, P: Clone>(items: &[T], point: impl Fn(&T) -> Option<P>) -> Vec<Vec<P>> {
    let points: Vec<Option<P>> = items.iter().map(point).collect();
    let stretches = points.split(Option::is_none).filter(|stretch| !stretch.is_empty());
    stretches.map(|stretch| stretch.iter().flatten().cloned().collect()).collect()
}

/// Lowest and highest of ascending frequencies.
fn range_hz(frequencies_hz: &[f64]) -> String {
    let [from, to] = [frequencies_hz.first(), frequencies_hz.last()]
        .map(|hz| hz.map_or_else(String::new, |hz| tracktwin_number::rounded(*hz, 4)));
    format!("{from} to {to} Hz")
}
