//! Views are created again from one file per database, and only if the existing ones are of an earlier
//! version.

use crate::data::{Kept, ask, sql};
use crate::support::{CAMPAIGN, Home, on_both_databases};
use tracktwin_library::{IntegrityFault, Library};
use tracktwin_parameters::Parameter;

/// Removes a view, and sets the version of the views.
async fn of_version(home: &Home, version: &'static str) {
    sql(home, "drop view if exists failed_case").await;
    let says = match home.folder {
        Some(_) => format!("pragma user_version = {version}"),
        None => format!("comment on view campaign_status is 'views of version {version}'"),
    };
    sql(home, says).await;
}

/// Whether the removed view exists.
async fn is_there(library: &Library) -> bool {
    library.query("select * from failed_case", &mut Kept::default()).await.is_ok()
}

on_both_databases! {
    async fn views_of_an_earlier_program_are_made_anew(home: &Home) {
        home.library(1).await.close().await;
        of_version(home, "0").await;
        let library = home.open().await;
        assert!(is_there(&library).await);
        let named = |it: &&IntegrityFault| it.what.contains("failed_case");
        assert_eq!(library.verify(|| ()).await.unwrap().findings.iter().find(named), None);
    }

    async fn views_of_this_program_or_a_later_one_are_left_alone(home: &Home) {
        home.library(1).await.close().await;
        for version in ["2", "99"] {
            of_version(home, version).await;
            let library = home.open().await;
            assert!(!is_there(&library).await, "{version}");
            library.close().await;
        }
    }

    async fn of_many_that_open_a_library_of_an_earlier_program_none_fails(home: &Home) {
        home.library(1).await.close().await;
        of_version(home, "0").await;
        let openings = (0..6).map(|_| {
            let url = home.url.clone();
            std::thread::spawn(move || {
                let runtime = tokio::runtime::Runtime::new().unwrap();
                runtime.block_on(async { Library::open(&url).await.map(drop) })
            })
        });
        for opening in openings.collect::<Vec<_>>() {
            opening.join().unwrap().unwrap();
        }
        assert!(is_there(&home.open().await).await);
    }

    async fn columns_of_parameters_are_those_of_the_catalogue(home: &Home) {
        let library = home.library(0).await;
        let columns = |of: Vec<String>| {
            let is_one = |name: &String| Parameter::from_name(name).is_some();
            of.into_iter().filter(is_one).collect::<Vec<_>>()
        };
        let catalogue: Vec<_> = Parameter::ALL.iter().map(|it| it.name().to_owned()).collect();
        for table in ["campaign_case", "result_with_parameters", "failed_case", "sleeper_estimate"] {
            let found = ask(&library, &format!("select * from {table}")).await.columns;
            assert_eq!(columns(found), catalogue, "{table}");
        }
    }
}

#[tokio::test]
async fn who_may_only_read_goes_on_with_the_views_of_an_earlier_program() {
    let Some(home) = Home::postgres() else { return };
    home.library(1).await.close().await;
    of_version(&home, "0").await;
    sql(
        &home,
        "drop role if exists views_reader; create role views_reader login;
        grant select on all tables in schema public to views_reader",
    )
    .await;
    let library = Library::open(&home.url.replace("postgres@", "views_reader@")).await.unwrap();
    assert_eq!(library.status(CAMPAIGN).await.unwrap().total(), 1);
    assert!(!is_there(&library).await);
    library.close().await;
    // Made by who may, and what the role may read stays so.
    home.open().await.close().await;
    let library = Library::open(&home.url.replace("postgres@", "views_reader@")).await.unwrap();
    assert_eq!(ask(&library, "select * from campaign_status").await.rows.len(), 1);
    library.close().await;
    sql(&home, "drop owned by views_reader; drop role views_reader").await;
}

#[tokio::test]
async fn views_of_others_that_read_ours_stay() {
    let Some(home) = Home::postgres() else { return };
    home.library(2).await.close().await;
    sql(&home, "create view mine as select cases from campaign_status").await;
    of_version(&home, "0").await;
    let library = home.open().await;
    assert!(is_there(&library).await);
    assert_eq!(ask(&library, "select * from mine").await.rows.len(), 1);
}
