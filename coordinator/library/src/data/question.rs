//! Checks that a text is a single SQL statement that only reads.
//!
//! No statement can change a file that was opened read-only, or a database in a read-only transaction. But
//! `vacuum into` and `copy` write other files, and `SQLite` runs several statements in one call.

use crate::LibraryError;
use crate::engine::Dialect;

/// First keywords of statements that only read.
const ASKING: [&str; 4] = ["select", "with", "values", "explain"];

/// Further first keywords, for `SQLite` only.
const ASKING_SQLITE: [&str; 1] = ["pragma"];
const ASKING_POSTGRES: [&str; 2] = ["show", "table"];

/// Returns an error unless the text is a single statement that only reads.
pub(super) fn check(text: &str, dialect: Dialect) -> Result<(), LibraryError> {
    let bare = bare(text, dialect);
    let bare = bare.trim().trim_end_matches(';').trim();
    let refused = |reason: &str| LibraryError::BadQuery { reason: reason.to_owned() };
    // PostgreSQL takes one only, and has texts between dollars that are not understood here.
    if bare.contains(';') && matches!(dialect, Dialect::Sqlite) {
        return Err(refused("more than one statement; give one"));
    }
    let bare = bare.trim_start_matches(|it: char| it == '(' || it.is_whitespace());
    if bare.is_empty() {
        return Err(refused("the statement is empty"));
    }
    let word: String = bare.chars().take_while(char::is_ascii_alphabetic).collect();
    let more: &[&str] = match dialect {
        Dialect::Sqlite => &ASKING_SQLITE,
        Dialect::Postgres => &ASKING_POSTGRES,
    };
    if ASKING.iter().chain(more).any(|asking| asking.eq_ignore_ascii_case(&word)) {
        Ok(())
    } else {
        Err(LibraryError::OnlyReads)
    }
}

/// Returns the text without quoted parts and comments.
fn bare(text: &str, dialect: Dialect) -> String {
    let mut bare = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let (begin, end) = match first {
            // A doubled quote is one text's end and the next one's begin: the same to us.
            '\'' => ("'", "'"),
            '"' => ("\"", "\""),
            '`' => ("`", "`"),
            '[' => ("[", "]"),
            '-' if rest.starts_with("--") => ("--", "\n"),
            '/' if rest.starts_with("/*") => {
                rest = after_remark(rest, dialect);
                bare.push(' ');
                continue;
            }
            _ => {
                bare.push(first);
                rest = &rest[first.len_utf8()..];
                continue;
            }
        };
        rest = rest[begin.len()..].split_once(end).map_or("", |(_, after)| after);
        bare.push(' ');
    }
    bare
}

/// Returns the text after its leading comment. In PostgreSQL, comments can be nested.
fn after_remark(text: &str, dialect: Dialect) -> &str {
    let mut rest = &text[2..];
    let mut depth = 1;
    while depth > 0 {
        let Some(end) = rest.find("*/") else { return "" };
        let nested =
            rest.find("/*").filter(|begin| *begin < end && matches!(dialect, Dialect::Postgres));
        depth = if nested.is_some() { depth + 1 } else { depth - 1 };
        rest = &rest[nested.unwrap_or(end) + 2..];
    }
    rest
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
            "(select 1) union (select 2)",
        ] {
            for dialect in [Dialect::Sqlite, Dialect::Postgres] {
                assert!(check(text, dialect).is_ok(), "{text}");
            }
        }
        assert!(check("select $$;$$", Dialect::Postgres).is_ok());
        assert!(check("show search_path", Dialect::Postgres).is_ok());
    }

    #[test]
    fn anything_else_is_refused() {
        for text in [
            "",
            "-- nothing",
            "vacuum into 'x'",
            "copy (select 1) to program 'id'",
            "/* select */ vacuum",
            "/*/ select ' */ pragma query_only=off; vacuum into 'x' -- '",
        ] {
            for dialect in [Dialect::Sqlite, Dialect::Postgres] {
                assert!(check(text, dialect).is_err(), "{text}");
            }
        }
        for text in [
            "select 1; vacuum into 'x'",
            "select ''';'; vacuum",
            "/*/ select /*/ vacuum into 'x'",
            "/* /* */ vacuum /* select */",
        ] {
            assert!(check(text, Dialect::Sqlite).is_err(), "{text}");
        }
        let nested = "/* /* */ select */ copy campaign to '/tmp/x'";
        assert!(check(nested, Dialect::Postgres).is_err());
    }
}
