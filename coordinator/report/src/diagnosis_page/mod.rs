//! The page of a diagnosis, for a track engineer who has not read the paper.
//!
//! This module defines content, order and wording of the page. The diagnosis crate defines the meaning of
//! the numbers.

mod along;
pub(crate) mod confirmation;
mod fit;
mod fitted;
mod headline;
mod hypotheses;
mod levels;
mod mismatch_map;
mod place;
mod quantity;
mod style;
mod words;

use maud::{Markup, PreEscaped, html};
use tracktwin_diagnosis::Diagnosis;
use tracktwin_drawing::page_with;

/// Provenance of a diagnosis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Command line that repeats the diagnosis.
    pub command: String,
    /// Name and version of the program.
    pub version: String,
    /// The library or models used, or the reason for using none; empty if this is not relevant.
    pub library: String,
}

/// Returns the HTML page of a diagnosis: verdict, mismatches, hypotheses, and their effect on the
/// estimates.
pub fn diagnosis_page(diagnosis: &Diagnosis, origin: &Origin) -> String {
    let head = html! { style { (PreEscaped(style::STYLE)) } };
    let body = html! {
        (headline::headline(diagnosis))
        (headline::sections(diagnosis))
        (mismatch_map::section(diagnosis))
        (place::section(diagnosis))
        (hypotheses::section(diagnosis))
        (fitted::section(diagnosis))
        (along::section(diagnosis))
        (fit::section(diagnosis))
        (confirmation::section(diagnosis))
        (reproduce(diagnosis, origin))
    };
    let title = format!("Diagnosis of {}", diagnosis.recording);
    // A number stays with its per cent sign when the line breaks.
    let sentence = diagnosis.sentence.replace(" %", "\u{a0}%");
    page_with(&title, &sentence, &head, &body, &Markup::default())
}

fn reproduce(diagnosis: &Diagnosis, origin: &Origin) -> Markup {
    html! {
        h2 { "How to reproduce this diagnosis" }
        pre { (origin.command) }
        dl {
            dt { "recording" } dd { (diagnosis.recording) }
            dt { "program" } dd { (origin.version) }
            @if !origin.library.is_empty() { dt { "library" } dd { (origin.library) } }
            dt { "format" } dd { (diagnosis.format) ", beside this page in " code { "diagnosis.json" } }
        }
    }
}
