//! The few phrases that the two databases spell differently.

use std::fmt::Write as _;

/// Whose SQL is spoken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dialect {
    Sqlite,
    Postgres,
}

impl Dialect {
    /// Ends a selection of rows that only this transaction may take, passing over those that another
    /// has locked. `SQLite` has one writer, so nobody is in the way.
    pub(crate) const fn skipping_locked(self) -> &'static str {
        match self {
            Self::Sqlite => "",
            Self::Postgres => "for update skip locked",
        }
    }

    /// Follows `campaign_case` where its first waiting cases are asked for: `SQLite` without statistics would
    /// go through all that are finished.
    pub(crate) const fn by_state(self) -> &'static str {
        match self {
            Self::Sqlite => "indexed by campaign_case_by_state",
            Self::Postgres => "",
        }
    }

    /// Ends a selection of rows that nobody else may change before this transaction ends.
    pub(crate) const fn locking(self) -> &'static str {
        match self {
            Self::Sqlite => "",
            Self::Postgres => "for update",
        }
    }

    /// That a value is one of the list bound as `$N`.
    pub(crate) fn listed(self, list: &str) -> String {
        match self {
            Self::Sqlite => format!("in (select value from json_each({list}))"),
            Self::Postgres => format!("= any({list})"),
        }
    }

    /// So many rows of so many values each, the only values of their statement: `(?, ?), (?, ?)`.
    ///
    /// `SQLite` looks a named place up among all that have names, so that a statement with a thousand
    /// of `$1`, `$2`, ... takes a million steps; question marks have none.
    pub(crate) fn rows_of_values(self, rows: usize, values: usize) -> String {
        let mut text = String::with_capacity(rows * values * 4);
        for row in 0..rows {
            text.push_str(if row > 0 { ", (" } else { "(" });
            for value in 0..values {
                text.push_str(if value > 0 { ", " } else { "" });
                match self {
                    Self::Sqlite => text.push('?'),
                    Self::Postgres => drop(write!(text, "${}", row * values + value + 1)),
                }
            }
            text.push(')');
        }
        text
    }

    /// Who counts, in the tables that each writer counts in on its own.
    pub(crate) const fn writer(self) -> &'static str {
        match self {
            Self::Sqlite => "0",
            Self::Postgres => "pg_backend_pid()",
        }
    }

    /// The present instant as ISO 8601, by the database's clock.
    pub(crate) const fn now(self) -> &'static str {
        match self {
            Self::Sqlite => "strftime('%Y-%m-%dT%H:%M:%fZ', 'now')",
            Self::Postgres => {
                "to_char(clock_timestamp() at time zone 'utc', 'YYYY-MM-DD\"T\"HH24:MI:SS.MS\"Z\"')"
            }
        }
    }

    /// How many elements a text column that holds a JSON array has.
    pub(crate) fn json_length(self, column: &str) -> String {
        match self {
            Self::Sqlite => format!("json_array_length({column})"),
            Self::Postgres => format!("jsonb_array_length({column}::jsonb)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Dialect;

    #[test]
    fn rows_of_values_are_numbered_where_numbers_cost_nothing() {
        assert_eq!(Dialect::Sqlite.rows_of_values(2, 3), "(?, ?, ?), (?, ?, ?)");
        assert_eq!(Dialect::Postgres.rows_of_values(2, 2), "($1, $2), ($3, $4)");
    }
}
