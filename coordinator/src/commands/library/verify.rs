//! `tracktwin library verify`: integrity of a library.

use super::{Stop, Which};
use crate::commands::progress::Progress;
use crate::commands::{print_json, println_stderr, println_stdout};
use tracktwin_library::{IntegrityFault, Library, LibraryError, Verified};

/// Data that no checksum or hash covers.
const UNCHECKED: &str = "not checked: worker, time and duration of a case; attempts, audits, workers, progress; \
                         scores of trainings; contents of estimates, findings and trials";

pub(super) async fn run(which: &Which) -> Result<(), Stop> {
    let (name, verified) = match which.library.open_to_read().await {
        Ok(library) => (library.name(), verify(&library).await?),
        Err(Stop::Input(error) | Stop::Failure(error)) if says_what_is_there(&error) => {
            let (place, what) = (which.library.name(), format!("{error:#}"));
            let finding = IntegrityFault { place, what, count: 1, first_index: None };
            (String::new(), Verified { findings: vec![finding], ..Verified::default() })
        }
        Err(stop) => return Err(stop),
    };
    tell(which.json, &name, &verified);
    if verified.findings.is_empty() { Ok(()) } else { Err(Stop::Negative) }
}

async fn verify(library: &Library) -> Result<Verified, Stop> {
    // The counts may be wrong; the verification checks them.
    let mut cases = 0;
    for campaign in library.campaigns().await.unwrap_or_default() {
        cases += library.status(&campaign.id).await.map_or(0, |it| u64::from(it.finished));
    }
    let mut progress = Progress::begin("verifying", 0, cases);
    let mut done = 0;
    let looked_at = || {
        done += 1;
        progress.at(done, "cases");
    };
    let verified = library.verify(looked_at).await?;
    progress.end();
    Ok(verified)
}

/// Whether a library cannot be opened because of its content, and not because it is missing or unavailable.
fn says_what_is_there(error: &anyhow::Error) -> bool {
    error.downcast_ref().is_some_and(|error| {
        matches!(
            error,
            LibraryError::Empty { .. }
                | LibraryError::NotALibrary { .. }
                | LibraryError::Malformed { .. }
                | LibraryError::Migration(_)
                | LibraryError::Damaged { .. }
        )
    })
}

fn tell(json: bool, name: &str, verified: &Verified) {
    let Verified { findings, attested, unattested, notes } = verified;
    if json {
        print_json(&findings.iter().map(self::json).collect::<Vec<_>>());
    } else {
        for finding in findings {
            println_stdout(&text(finding));
        }
        if findings.is_empty() {
            println_stdout(&format!(
                "{name}: no faults found ({attested} cases match their checksums)"
            ));
        }
    }
    if *unattested > 0 {
        println_stderr(&format!(
            "{unattested} cases have results without a checksum (stored before schema 8): no \
                 test shows whether they were altered"
        ));
    }
    for note in notes.iter().map(String::as_str).chain([UNCHECKED]) {
        self::println_stderr(note);
    }
}

fn text(finding: &IntegrityFault) -> String {
    let IntegrityFault { place, what, count, first_index } = finding;
    let first = first_index.map(|index| format!(" (the first is case {index})"));
    format!("{place}: {count} x {what}{}", first.unwrap_or_default())
}

fn json(finding: &IntegrityFault) -> serde_json::Value {
    let IntegrityFault { place, what, count, first_index } = finding;
    serde_json::json!({ "place": place, "what": what, "count": count, "first_index": first_index })
}
