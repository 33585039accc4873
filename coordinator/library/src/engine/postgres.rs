//! A library on a PostgreSQL server.

use super::clock::Clock;
use super::schema_version::refuse_other_schema;
use super::{Access, Connection, Readers, views};
use crate::LibraryError;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{ConnectOptions, Connection as _, PgConnection};
use std::time::Duration;

static MIGRATIONS: Migrator = sqlx::migrate!("../../migrations/postgres");

/// Number of reading connections of one coordinator, in addition to the writing ones.
const READERS: u32 = 4;

/// Time limit of waiting for a free reading connection, or for the return of the server.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(10);

/// Time limit of connecting. Even a very distant server responds within one or two seconds.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Key of the advisory lock for creating views; an arbitrary unique number.
const VIEWS_LOCK: i64 = 0x7477_696e;

/// Opens the library in this database, and updates its schema unless it is only read. Also returns the server's
/// clock.
pub(super) async fn open(
    options: &PgConnectOptions,
    name: &str,
    access: Access,
) -> Result<(Readers, Clock), LibraryError> {
    let connected = within_bounds(options).await;
    let mut connection = connected.map_err(|error| unreachable(error, name))?;
    let is_there = refuse_foreign_database(&mut connection, name).await?;
    if !is_there && access != Access::Create {
        return Err(LibraryError::Empty { library: name.to_owned() });
    }
    if access == Access::Read {
        schema_to_read(&mut connection, name).await?;
    } else if migrate(&mut connection, name, is_there).await? {
        make_views(&mut connection).await?;
    } else if views_version(&mut connection).await? < views::VERSION {
        views::made(make_views(&mut connection).await, name)?;
    }
    let clock = Clock::server(unix_ms(&mut connection).await?);
    connection.close().await?;
    let readers = PgPoolOptions::new()
        .max_connections(READERS)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .connect_lazy_with(only_reading(options));
    Ok((Readers::Postgres(readers), clock))
}

/// Options of connections that the server lets read only.
pub(super) fn only_reading(options: &PgConnectOptions) -> PgConnectOptions {
    options.clone().options([("default_transaction_read_only", "on")])
}

/// Opens a writing connection.
pub(super) async fn connect(options: &PgConnectOptions) -> Result<Connection, LibraryError> {
    Ok(Connection::Postgres(within_bounds(options).await?))
}

/// Opens a connection, or returns an error after [`CONNECT_TIMEOUT`]. Without this limit, an address that
/// discards packets would block for minutes, and a port that accepts connections without a response would
/// block for ever.
async fn within_bounds(options: &PgConnectOptions) -> Result<PgConnection, sqlx::Error> {
    let silent = || {
        let reason = format!("no response within {} s", CONNECT_TIMEOUT.as_secs());
        sqlx::Error::Io(std::io::Error::new(std::io::ErrorKind::TimedOut, reason))
    };
    let connecting = tokio::time::timeout(CONNECT_TIMEOUT, options.connect());
    connecting.await.unwrap_or_else(|_| Err(silent()))
}

/// Classifies a connection error: wrong input, or a temporary failure.
fn unreachable(error: sqlx::Error, name: &str) -> LibraryError {
    let library = name.to_owned();
    match &error {
        // No such database; no such user; wrong password; not let in.
        sqlx::Error::Database(refusal)
            if ["3D000", "28000", "28P01", "42501"]
                .map(Some)
                .contains(&refusal.code().as_deref()) =>
        {
            let remedy = "correct the user, password or database in the URL";
            LibraryError::NotLetIn { library, reason: format!("{}; {remedy}", refusal.message()) }
        }
        _ => LibraryError::Unreachable { library, source: error },
    }
}

/// Whether the library's tables exist. Returns an error if the database contains other tables only.
async fn refuse_foreign_database(
    connection: &mut PgConnection,
    name: &str,
) -> Result<bool, LibraryError> {
    let (ours, tables): (i64, i64) = sqlx::query_as(
        "select count(*) filter (where table_name in ('campaign', 'campaign_case', 'result')),
            count(*) filter (where table_name <> '_sqlx_migrations')
        from information_schema.tables where table_schema = current_schema()",
    )
    .fetch_one(connection)
    .await?;
    match (ours, tables) {
        (3, _) => Ok(true),
        (_, 0) => Ok(false),
        _ => Err(LibraryError::NotALibrary { library: name.to_owned() }),
    }
}

/// Checks that this program can read the schema as it is.
async fn schema_to_read(connection: &mut PgConnection, name: &str) -> Result<(), LibraryError> {
    let found = schema_version(connection).await?;
    refuse_other_schema(found, newest(), name)?;
    if views_version(connection).await? < views::VERSION {
        views::warn_of_earlier(name);
    }
    Ok(())
}

/// Version of the newest schema that this program knows.
fn newest() -> i64 {
    MIGRATIONS.iter().map(|migration| migration.version).max().unwrap_or(0)
}

/// Version of the schema of a library that is there.
async fn schema_version(connection: &mut PgConnection) -> Result<i64, LibraryError> {
    let ask = sqlx::query_scalar("select max(version) from _sqlx_migrations");
    Ok(ask.fetch_one(connection).await?)
}

/// Updates the tables, and returns whether an update was needed. Without need for an update nothing is
/// written, so that a read-only role can open the library.
async fn migrate(
    connection: &mut PgConnection,
    name: &str,
    is_there: bool,
) -> Result<bool, LibraryError> {
    let known = newest();
    if is_there {
        let found = schema_version(&mut *connection).await?;
        if found > known {
            return Err(LibraryError::NewerSchema { library: name.to_owned(), found, known });
        }
        if found == known {
            return Ok(false);
        }
    }
    MIGRATIONS.run(connection).await.map(|()| true).map_err(|error| match error {
        // Another program was quicker.
        MigrateError::VersionMissing(found) if found > known => {
            LibraryError::NewerSchema { library: name.to_owned(), found, known }
        }
        other => other.into(),
    })
}

/// Creates the views of this program version, unless the existing views are of a later one.
async fn make_views(connection: &mut PgConnection) -> Result<(), LibraryError> {
    let mut alone = connection.begin().await?;
    // Of those who open it at once one makes them after the other.
    sqlx::query("select pg_advisory_xact_lock($1)").bind(VIEWS_LOCK).execute(&mut *alone).await?;
    if views_version(&mut alone).await? <= views::VERSION {
        sqlx::raw_sql(views::POSTGRES).execute(&mut *alone).await?;
    }
    Ok(alone.commit().await?)
}

/// Version of the existing views; 0 for those created by migrations. It is stored in a comment, which every
/// role can read.
async fn views_version(connection: &mut PgConnection) -> Result<i64, LibraryError> {
    let ask = "select coalesce(cast(substring(
            obj_description(to_regclass('campaign_status'), 'pg_class') from '[0-9]+$') as bigint), 0)";
    Ok(sqlx::query_scalar(ask).fetch_one(connection).await?)
}

/// Present time of the server, in ms since 1970.
pub(super) async fn unix_ms(connection: &mut PgConnection) -> Result<i64, LibraryError> {
    let ask = "select (extract(epoch from clock_timestamp()) * 1000)::bigint";
    Ok(sqlx::query_scalar(ask).fetch_one(connection).await?)
}
