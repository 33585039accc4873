//! The schema of a library in a file: numbered migrations, and views.

use super::schema_version::refuse_other_schema;
use super::views;
use crate::LibraryError;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection as _, SqliteConnection, SqliteExecutor};
use std::path::Path;

static MIGRATIONS: Migrator = sqlx::migrate!("../../migrations/sqlite");

/// Updates the schema to the newest version.
pub(super) async fn bring_up_to_date(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<(), LibraryError> {
    let known = newest();
    let newer = |error| match error {
        MigrateError::VersionMissing(found) if found > known => {
            LibraryError::NewerSchema { library: path.display().to_string(), found, known }
        }
        other => other.into(),
    };
    // Fails where there is no such table yet.
    let found = schema_version(&mut *connection).await.unwrap_or(0);
    if found >= known {
        MIGRATIONS.run(&mut *connection).await.map_err(newer)?;
        return views::made(renew_views(connection).await, &path.display().to_string());
    }
    if found > 0 {
        refuse_malformed(&mut *connection).await?;
    }
    // One of those who open it at once does it; the others wait, and find it done.
    let mut alone = connection.begin_with("begin immediate").await?;
    MIGRATIONS.run(&mut *alone).await.map_err(newer)?;
    sqlx::raw_sql(views::SQLITE).execute(&mut *alone).await?;
    Ok(alone.commit().await?)
}

/// Checks that this program can read the schema as it is. A schema that is damaged is not refused: verification and
/// salvage read what is there.
pub(super) async fn check_to_read(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<(), LibraryError> {
    let library = path.display().to_string();
    match versions(connection).await {
        Ok((schema, views)) => {
            refuse_other_schema(schema, newest(), &library)?;
            if views < views::VERSION {
                views::warn_of_earlier(&library);
            }
            Ok(())
        }
        Err(error) if error.is_of_the_database() => Ok(()),
        Err(error) => Err(error),
    }
}

/// Versions of the schema and of its views.
async fn versions(connection: &mut SqliteConnection) -> Result<(i64, i64), LibraryError> {
    Ok((schema_version(connection).await?, views_version(connection).await?))
}

/// Version of the newest schema that this program knows.
fn newest() -> i64 {
    MIGRATIONS.iter().map(|migration| migration.version).max().unwrap_or(0)
}

async fn schema_version(connection: &mut SqliteConnection) -> Result<i64, LibraryError> {
    let ask = sqlx::query_scalar("select max(version) from _sqlx_migrations");
    Ok(ask.fetch_one(connection).await?)
}

/// Creates the views again if the existing ones are of an earlier version.
async fn renew_views(connection: &mut SqliteConnection) -> Result<(), LibraryError> {
    if views_version(&mut *connection).await? >= views::VERSION {
        return Ok(());
    }
    refuse_malformed(&mut *connection).await?;
    let mut alone = connection.begin_with("begin immediate").await?;
    if views_version(&mut *alone).await? < views::VERSION {
        sqlx::raw_sql(views::SQLITE).execute(&mut *alone).await?;
    }
    Ok(alone.commit().await?)
}

/// Version of the existing views; 0 for those created by migrations.
async fn views_version<'c>(connection: impl SqliteExecutor<'c>) -> Result<i64, LibraryError> {
    Ok(sqlx::query_scalar("select user_version from pragma_user_version")
        .fetch_one(connection)
        .await?)
}

/// Checks that the pages of a file are consistent, before anything is written to the file.
///
/// # Errors
/// Returns [`LibraryError::Malformed`] with the first fault that `SQLite` finds.
pub(super) async fn refuse_malformed<'c>(
    connection: impl SqliteExecutor<'c>,
) -> Result<(), LibraryError> {
    let found: String = sqlx::query_scalar("pragma quick_check(1)").fetch_one(connection).await?;
    if found == "ok" {
        return Ok(());
    }
    let last = found.lines().last().unwrap_or_default();
    Err(LibraryError::Malformed { reason: last.to_owned() })
}

/// Kind, name and text of each object of the present schema.
pub(crate) async fn schema_objects() -> Result<Vec<(String, String, String)>, LibraryError> {
    let mut memory = SqliteConnectOptions::new().in_memory(true).connect().await?;
    MIGRATIONS.run(&mut memory).await?;
    sqlx::raw_sql(views::SQLITE).execute(&mut memory).await?;
    let ask = "select type, name, sql from sqlite_schema where sql is not null";
    let objects = sqlx::query_as(ask).fetch_all(&mut memory).await?;
    memory.close().await?;
    Ok(objects)
}
