//! `tracktwin library verify`: whether the library is what it says it is.

use super::{Stop, Which, open};
use crate::commands::say;
use tracktwin_library::Finding;

pub(super) async fn run(which: &Which) -> Result<(), Stop> {
    let (library, campaigns) = open(&which.library).await?;
    let findings = library.verify().await?;
    if which.json {
        let findings: Vec<_> = findings.iter().map(json).collect();
        say(&format!("{:#}", serde_json::Value::from(findings)));
    } else {
        for finding in &findings {
            say(&text(finding));
        }
    }
    if findings.is_empty() {
        if !which.json {
            let campaigns = match campaigns.len() {
                1 => "1 campaign".to_owned(),
                count => format!("{count} campaigns"),
            };
            say(&format!("nothing is wrong with {} ({campaigns})", library.name()));
        }
        return Ok(());
    }
    Err(Stop::Negative)
}

fn text(finding: &Finding) -> String {
    let Finding { place, what, count, first_index } = finding;
    let first = first_index.map(|index| format!(" (the first is case {index})"));
    format!("{place}: {count} x {what}{}", first.unwrap_or_default())
}

fn json(finding: &Finding) -> serde_json::Value {
    let Finding { place, what, count, first_index } = finding;
    serde_json::json!({ "place": place, "what": what, "count": count, "first_index": first_index })
}
