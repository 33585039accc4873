//! The schemas after all migrations, compared with files stored beside the tests.

use crate::data::ask;
use crate::snapshot::{assert_kept, kept};
use crate::support::Home;
use std::path::Path;
use tracktwin_library::{Cell, Library};

/// Tables, indexes and triggers as stored in the file, and the columns of views.
const SQLITE: &str = "
    select sql || ';' as text from sqlite_schema
    where sql is not null and type <> 'view' and name <> '_sqlx_migrations'
    union all
    select 'view ' || schema.name || ' (' || group_concat(columns.name, ', ') || ')'
    from sqlite_schema as schema join pragma_table_info(schema.name) as columns
    where schema.type = 'view' group by schema.name";

/// Tables with columns and constraints, indexes, triggers, functions, and the columns of views. The text of
/// views and functions is left out, because it depends on the version of the server.
const POSTGRES: &str = "
    with relation as (
        select oid, relname, relkind from pg_class
        where relnamespace = current_schema()::regnamespace and relname <> '_sqlx_migrations'),
    col as (
        select attrelid, attnum, attname,
            attname || ' ' || format_type(atttypid, atttypmod)
            || case when collname is null or collname = 'default' then ''
                else ' collate \"' || collname || '\"' end
            || case when attidentity <> '' then ' generated always as identity' else '' end
            || case when attnotnull then ' not null' else '' end
            || coalesce(' default ' || pg_get_expr(adbin, adrelid), '') as text
        from pg_attribute left join pg_attrdef on adrelid = attrelid and adnum = attnum
        left join pg_collation on pg_collation.oid = attcollation
        where attnum > 0 and not attisdropped)
    select 'table ' || relname || E' (\\n' || (
            select string_agg('    ' || text, E',\\n' order by attnum) from col where attrelid = oid)
        || coalesce((select string_agg(
                E',\\n    constraint ' || conname || ' ' || pg_get_constraintdef(pg_constraint.oid), ''
                order by conname)
            from pg_constraint where conrelid = relation.oid and contype in ('c', 'f', 'p', 'u')), '')
        || E'\\n)' || coalesce((select ' with (' || array_to_string(reloptions, ', ') || ')'
            from pg_class where pg_class.oid = relation.oid), '') || ';' as text
    from relation where relkind = 'r'
    union all
    select 'view ' || relname || ' (' || (
        select string_agg(attname, ', ' order by attnum) from col where attrelid = oid) || ')'
    from relation where relkind = 'v'
    union all
    select pg_get_indexdef(indexrelid) || ';' from pg_index join relation on oid = indrelid
    where not exists (select 1 from pg_constraint where conindid = indexrelid)
    union all
    select pg_get_triggerdef(pg_trigger.oid) || ';' from pg_trigger join relation on relation.oid = tgrelid
    where not tgisinternal
    union all
    select 'function ' || cast(oid::regprocedure as text) from pg_proc
    where pronamespace = current_schema()::regnamespace";

async fn schema(home: &Home, ask_for: &str) -> String {
    let library = Library::open_or_create(&home.url).await.unwrap();
    let text = |row: Vec<Cell>| match &row[..] {
        // Names of schemas are a database's own.
        [Cell::Text(text)] => text.replace("public.", ""),
        other => panic!("{other:?}"),
    };
    let mut objects: Vec<_> = ask(&library, ask_for).await.rows.into_iter().map(text).collect();
    library.close().await;
    objects.sort();
    objects.join("\n\n") + "\n"
}

#[tokio::test]
async fn the_schema_of_a_file_is_the_one_that_is_kept() {
    assert_kept("schema.sqlite.sql", &schema(&Home::sqlite(), SQLITE).await);
}

#[tokio::test]
async fn the_schema_of_a_server_is_the_one_that_is_kept() {
    let Some(home) = Home::postgres() else { return };
    assert_kept("schema.postgres.sql", &schema(&home, POSTGRES).await);
}

/// The stored text is `VERSION HASH-OF-SQLITE'S-FILE HASH-OF-POSTGRESQL'S`.
#[tokio::test]
async fn who_changes_a_view_raises_the_version_of_the_views() {
    let home = Home::sqlite();
    let library = Library::open_or_create(&home.url).await.unwrap();
    let version = ask(&library, "pragma user_version").await.rows.remove(0);
    let Cell::Integer(version) = version[0] else { panic!("{version:?}") };
    let hash = |database| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../migrations");
        let text = std::fs::read(folder.join(database).join("views.sql")).unwrap();
        blake3::hash(&text).to_hex().to_string()
    };
    let now = format!("{version} {} {}\n", hash("sqlite"), hash("postgres"));
    let before = kept("views.txt");
    assert!(
        now == before || !before.starts_with(&format!("{version} ")),
        "a view was changed: raise the version in both views.sql and in engine/views.rs"
    );
    assert_kept("views.txt", &now);
}
