//! The few phrases that the two databases spell differently.

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

    /// A table `held (held_index, held_epoch)` of two lists bound as `$N` and `$M`.
    pub(crate) fn held(self, indices: &str, epochs: &str) -> String {
        match self {
            Self::Sqlite => format!(
                "(select i.value as held_index, e.value as held_epoch
                from json_each({indices}) as i join json_each({epochs}) as e using (key)) as held"
            ),
            Self::Postgres => {
                format!("unnest({indices}, {epochs}) as held (held_index, held_epoch)")
            }
        }
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
