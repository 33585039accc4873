//! Verification of a library's file and of its schema.

use super::Survey;
use crate::LibraryError;
use crate::engine::{schema_objects, sql};

impl<F: FnMut()> Survey<'_, F> {
    pub(super) async fn file(&mut self) -> Result<(), LibraryError> {
        self.integrity().await?;
        self.schema().await?;
        self.references().await
    }

    /// Faults found by `SQLite` itself.
    async fn integrity(&mut self) -> Result<(), LibraryError> {
        let name = self.library.name();
        let check = sql("select integrity_check as said from pragma_integrity_check");
        let rows = match self.library.readers().rows(check).await {
            Ok(rows) => rows,
            Err(error) => return self.unreadable(&name, "the file", error),
        };
        for row in rows {
            let said: String = row.get("said")?;
            // Its heads say which database is meant; there is one.
            for line in said.lines().filter(|line| *line != "ok" && !line.starts_with("***")) {
                self.add(&name, line, 1, None);
            }
        }
        Ok(())
    }

    /// Checks that the tables, views, indices and triggers are those of this program.
    async fn schema(&mut self) -> Result<(), LibraryError> {
        let name = self.library.name();
        let ask = sql("select type as kind, name, sql from sqlite_schema where sql is not null");
        let read = self.library.readers().rows(ask).await.and_then(|rows| {
            let object = |row: &crate::engine::Row| {
                Ok((row.get("kind")?, row.get("name")?, row.get::<String>("sql")?))
            };
            rows.iter().map(object).collect::<Result<Vec<(String, String, String)>, LibraryError>>()
        });
        let found = match read {
            Ok(found) => found,
            Err(error) => return self.unreadable(&name, "the schema", error),
        };
        for (kind, object, expected) in schema_objects().await? {
            match found.iter().find(|(_, name, _)| *name == object) {
                None => self.add(&name, format!("the {kind} {object} is missing"), 1, None),
                Some((_, _, sql)) if !same(sql, &expected) => {
                    self.add(
                        &name,
                        format!("the {kind} {object} differs from this program's"),
                        1,
                        None,
                    );
                }
                Some(_) => {}
            }
        }
        Ok(())
    }

    /// Finds rows that refer to missing rows. A program that does not check foreign keys may have left such
    /// rows.
    async fn references(&mut self) -> Result<(), LibraryError> {
        let name = self.library.name();
        let ask =
            sql("select \"table\" as child, parent, count(*) as n from pragma_foreign_key_check
            group by 1, 2");
        let rows = match self.library.readers().rows(ask).await {
            Ok(rows) => rows,
            Err(error) => return self.unreadable(&name, "references to other rows", error),
        };
        for row in rows {
            let (child, parent): (String, String) = (row.get("child")?, row.get("parent")?);
            let what = format!("orphaned rows of {child}: their row of {parent} is missing");
            self.add(&name, what, row.get_u32("n")?.into(), None);
        }
        Ok(())
    }
}

/// Whether two statements are equal except for white space.
fn same(a: &str, b: &str) -> bool {
    a.split_whitespace().eq(b.split_whitespace())
}
