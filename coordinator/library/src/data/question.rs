//! Whether a text is one statement that asks.
//!
//! A file that is opened for reading can't be changed, whatever the statement; but `vacuum into` writes
//! another file, and `SQLite` runs statements one after the other where several are given.

use crate::LibraryError;

/// Words that statements begin with that only ask.
const ASKING: [&str; 5] = ["select", "with", "values", "explain", "pragma"];

/// Refuses what is not a single asking statement.
pub(super) fn check(text: &str) -> Result<(), LibraryError> {
    let bare = bare(text);
    let bare = bare.trim().trim_end_matches(';').trim();
    let refused = |reason: &str| LibraryError::BadQuery { reason: reason.to_owned() };
    if bare.contains(';') {
        return Err(refused("one statement at a time"));
    }
    if bare.is_empty() {
        return Err(refused("there is no statement"));
    }
    let word: String = bare.chars().take_while(char::is_ascii_alphabetic).collect();
    if ASKING.contains(&word.to_lowercase().as_str()) {
        Ok(())
    } else {
        Err(LibraryError::OnlyReads)
    }
}

/// The text without what stands in quotes and in remarks.
fn bare(text: &str) -> String {
    let mut bare = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let inside = &rest[first.len_utf8()..];
        let end = match first {
            // A doubled quote is one text's end and the next one's begin: the same to us.
            '\'' => Some("'"),
            '"' => Some("\""),
            '`' => Some("`"),
            '[' => Some("]"),
            '-' if rest.starts_with("--") => Some("\n"),
            '/' if rest.starts_with("/*") => Some("*/"),
            _ => None,
        };
        if let Some(end) = end {
            rest = inside.split_once(end).map_or("", |(_, after)| after);
            bare.push(' ');
        } else {
            rest = inside;
            bare.push(first);
        }
    }
    bare
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_is_one_statement_whatever_stands_in_its_texts() {
        for text in [
            "select 1",
            " SELECT ';' as \"a;b\" ;\n",
            "-- why; not\nwith a as (select 1) select * from a /* ; */",
            "values (1), ('it''s; fine')",
        ] {
            assert!(check(text).is_ok(), "{text}");
        }
    }

    #[test]
    fn anything_else_is_refused() {
        for text in [
            "",
            "-- nothing",
            "vacuum into 'x'",
            "/* select */ vacuum",
            "select 1; vacuum into 'x'",
            "select ''';'; vacuum",
        ] {
            assert!(check(text).is_err(), "{text}");
        }
    }
}
