//! Differences of the SQL dialects for statements generated from columns. All other statements are
//! written in full: see [`super::Text`].

use std::fmt::Write as _;

/// The SQL dialect of a database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dialect {
    Sqlite,
    Postgres,
}

impl Dialect {
    /// SQL for `value in (list)`, with the list bound as `$N`.
    pub(crate) fn listed(self, list: &str) -> String {
        match self {
            Self::Sqlite => format!("in (select value from json_each({list}))"),
            Self::Postgres => format!("= any({list})"),
        }
    }

    /// Placeholders for `rows` rows, such as `(?, ?), (?, ?)`. They must be the only values of the
    /// statement.
    ///
    /// `SQLite` searches a named placeholder among all named ones. A statement with a thousand of `$1`,
    /// `$2`, ... therefore needs a million steps; question marks have no name.
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
