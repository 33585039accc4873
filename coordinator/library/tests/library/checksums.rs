//! Altered results are detected in every operation that reads them.

use crate::data::{copy, sql};
use crate::support::{
    CAMPAIGN, Home, case, features, finished, lease, on_both_databases, passes, report, reported,
};
use tracktwin_experiment::Outcome;
use tracktwin_library::{
    Cell, ContactLoss, Library, LibraryError, ReportVerdict, Retry, Status, Table,
};

const CASES: u32 = 3;

/// A library with three finished cases.
async fn whole(home: &Home) -> Library {
    let library = home.library(CASES).await;
    let leased = lease(&library, "w", CASES, 0).await;
    report(&library, "w", leased.iter().map(finished).collect()).await;
    library
}

/// Statements that alter one number of case 1, for `SQLite` and for PostgreSQL.
const ALTERED: [(&str, &str, &str); 8] = [
    (
        "a level",
        "update result set level_1000_Hz_dB = level_1000_Hz_dB + 3
            where sobol_index = 1 and speed_km_h = 13",
        "update case_result set levels_dB[34] = levels_dB[34] + 3 where sobol_index = 1",
    ),
    (
        "a bit of a series",
        "update result set log_power = cast(substr(log_power, 1, 15) || X'01' || substr(log_power, 17) as blob)
            where sobol_index = 1 and speed_km_h = 7",
        "update case_series set log_power = set_bit(log_power, 77, 1 - get_bit(log_power, 77))
            where speed_km_h = 7 and result_id = (select id from case_result where sobol_index = 1)",
    ),
    (
        "the length of a series",
        "update result set log_power = substr(log_power, 9) where sobol_index = 1 and speed_km_h = 7",
        "update case_series set log_power = substring(log_power from 9)
            where speed_km_h = 7 and result_id = (select id from case_result where sobol_index = 1)",
    ),
    (
        "a speed",
        "update result set speed_km_h = 8 where sobol_index = 1 and speed_km_h = 7",
        "update case_series set speed_km_h = 8
            where speed_km_h = 7 and result_id = (select id from case_result where sobol_index = 1);
        update case_result set speeds_km_h[1] = 8 where sobol_index = 1",
    ),
    (
        "a share of lost contact",
        "update result set contact_loss_share = 0.5 where sobol_index = 1 and speed_km_h = 13",
        "update case_result set contact_loss_shares[2] = 0.5 where sobol_index = 1",
    ),
    (
        "a parameter of the case",
        "update campaign_case set railpad_stiffness_N_m = 1.1 * railpad_stiffness_N_m
            where sobol_index = 1",
        "update campaign_case set railpad_stiffness_N_m = 1.1 * railpad_stiffness_N_m
            where sobol_index = 1",
    ),
    (
        "the seed of the case",
        "update campaign_case set surface_seed = surface_seed - 100 where sobol_index = 1",
        "update campaign_case set surface_seed = surface_seed - 100 where sobol_index = 1",
    ),
    (
        "the checksum itself",
        "update result set checksum = 'x' where sobol_index = 1 and speed_km_h = 13",
        "update case_result set checksum = 'x' where sobol_index = 1",
    ),
];

async fn alter(home: &Home, (_, sqlite, postgres): (&str, &'static str, &'static str)) {
    sql(home, if home.folder.is_some() { sqlite } else { postgres }).await;
}

/// Number and first index of results that do not match their checksum, according to `verify`.
async fn unlike_their_checksum(library: &Library) -> Option<(u64, Option<u32>)> {
    let findings = library.verify(|| ()).await.unwrap().findings;
    let finding = findings.iter().find(|it| it.what.contains("do not match their checksum"));
    finding.map(|it| (it.count, it.first_index))
}

on_both_databases! {
    async fn every_number_that_is_altered_is_found_and_not_trained_on(home: &Home) {
        for altered in ALTERED {
            let home = home.another();
            let library = whole(&home).await;
            let digest = library.digest(CAMPAIGN).await.unwrap();
            assert_eq!(unlike_their_checksum(&library).await, None);
            alter(&home, altered).await;
            let what = altered.0;
            assert_eq!(unlike_their_checksum(&library).await, Some((1, Some(1))), "{what}");
            let error = library.training_set(CAMPAIGN, drop).await.unwrap_err();
            assert!(matches!(error, LibraryError::Altered { index: 1 }), "{what}: {error:?}");
            // The digest is of what is there.
            let same = library.digest(CAMPAIGN).await.unwrap() == digest;
            assert_eq!(same, what == "the checksum itself", "{what}");
        }
    }

    async fn what_was_altered_is_not_read_out(home: &Home) {
        let results = Table::named("result").unwrap();
        let library = whole(home).await;
        for table in [results, Table::ENTRIES] {
            library.read_table(table, 2, async |_| Ok::<_, LibraryError>(())).await.unwrap();
        }
        alter(home, ALTERED[0]).await;
        for table in [results, Table::ENTRIES] {
            let read = library.read_table(table, 2, async |_| Ok::<_, LibraryError>(())).await;
            let error = read.unwrap_err();
            assert!(matches!(error, LibraryError::Altered { index: 1 }), "{error:?}");
        }
    }

    async fn rows_that_were_altered_elsewhere_are_refused_and_named(home: &Home) {
        let library = whole(home).await;
        let results = Table::named("result").unwrap();
        let mut rows = Vec::new();
        let keep = async |more: Vec<_>| {
            rows.extend(more);
            Ok::<(), LibraryError>(())
        };
        library.read_table(results, 9, keep).await.unwrap();
        let place = |name| results.columns.iter().position(|column| column.name == name).unwrap();
        for (column, cell) in [
            ("level_630_Hz_dB", Cell::Real(77.0)),
            ("log_power", Cell::Doubles(vec![0.0; 5])),
            ("contact_loss_share", Cell::Null),
            ("checksum", Cell::Text("x".to_owned())),
        ] {
            let mut altered = rows.clone();
            // The second pass of case 2.
            altered[5][place(column)] = cell;
            let home = home.another();
            let there = home.library(CASES).await;
            // Passes may come one by one.
            for row in &altered[..5] {
                there.write_table(results, vec![row.clone()]).await.unwrap();
            }
            let error = there.write_table(results, altered[5..].to_vec()).await.unwrap_err();
            let said = error.to_string();
            assert!(said.contains("case 2") && said.contains("checksum"), "{column}: {said}");
            assert!(error.is_wrong_input());
            assert_eq!(there.status(CAMPAIGN).await.unwrap().finished, 2);
            assert_eq!(there.count(results).await.unwrap(), 5);
        }
    }

    async fn cases_that_were_altered_elsewhere_are_refused(home: &Home) {
        let library = whole(home).await;
        let cases = Table::named("campaign_case").unwrap();
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        let keep = async |more: Vec<_>| {
            rows.extend(more);
            Ok::<(), LibraryError>(())
        };
        library.read_table(cases, 9, keep).await.unwrap();
        let place = cases.columns.iter().position(|it| it.name == "sleeper_EI_N_m2").unwrap();
        rows[2][place] = Cell::Real(1.0);
        let home = home.another();
        let there = home.library(0).await;
        let error = there.write_table(cases, rows).await.unwrap_err();
        assert!(error.to_string().contains("case 2"), "{error}");
    }

    async fn a_copy_of_what_is_whole_leaves_out_what_was_altered(home: &Home) {
        let library = whole(home).await;
        alter(home, ALTERED[1]).await;
        for there in [Some(Home::sqlite()), Home::postgres()].into_iter().flatten() {
            let there = Library::open_or_create(&there.url).await.unwrap();
            let left_out = salvage(&library, &there).await;
            assert!(left_out.iter().any(|it| it.contains("case 1")), "{left_out:?}");
            let expected = Status { finished: 2, waiting: 1, ..Status::default() };
            assert_eq!(there.status(CAMPAIGN).await.unwrap(), expected);
            assert_eq!(unlike_their_checksum(&there).await, None);
            // What is simulated anew finds its place.
            let leased = lease(&there, "w", 1, there.now_unix_ms()).await;
            assert_eq!(report(&there, "w", vec![finished(&leased[0])]).await, [ReportVerdict::Stored]);
            assert_eq!(there.status(CAMPAIGN).await.unwrap().finished, 3);
        }
    }

    async fn what_was_altered_is_simulated_anew(home: &Home) {
        let library = whole(home).await;
        let digest = library.digest(CAMPAIGN).await.unwrap();
        assert_eq!(library.retry(CAMPAIGN, Retry::Altered).await.unwrap(), 0);
        alter(home, ALTERED[0]).await;
        assert_eq!(library.retry(CAMPAIGN, Retry::Altered).await.unwrap(), 1);
        let leased = lease(&library, "w", 9, library.now_unix_ms()).await;
        assert_eq!(leased.len(), 1);
        report(&library, "w", vec![finished(&leased[0])]).await;
        assert_eq!(library.digest(CAMPAIGN).await.unwrap(), digest);
        let findings = library.verify(|| ()).await.unwrap().findings;
        // Its campaign's hashes are single letters.
        assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")), "{findings:?}");
    }

    async fn a_case_whose_parameters_were_altered_is_given_up_with_the_remedy_and_restored(home: &Home) {
        let library = home.library(CASES).await;
        let drawn = "{\"vehicle.mass_kg\":50.0}".to_owned();
        alter(home, ALTERED[5]).await;
        let leased = lease(&library, "w", CASES, 0).await;
        let verdicts = report(&library, "w", leased.iter().map(finished).collect()).await;
        let expected = [ReportVerdict::Stored, ReportVerdict::Refused, ReportVerdict::Stored];
        assert_eq!(verdicts, expected);
        let given_up = library.failures(CAMPAIGN, 9).await.unwrap();
        assert_eq!(given_up.iter().map(|it| it.case.index).collect::<Vec<_>>(), [1]);
        let error = given_up[0].error.as_deref().unwrap();
        assert!(error.contains("`tracktwin campaign retry --altered`"), "{error}");
        // The same report again changes nothing.
        assert_eq!(report(&library, "w", vec![finished(&leased[1])]).await, [ReportVerdict::Refused]);
        let altered = library.altered_cases(CAMPAIGN).await.unwrap();
        assert_eq!(altered.len(), 1);
        assert_eq!(altered[0].parameter_hash, case(1).parameter_hash());
        library.restore_cases(CAMPAIGN, vec![(case(1), Some(drawn.clone()))]).await.unwrap();
        assert_eq!(library.altered_cases(CAMPAIGN).await.unwrap(), []);
        let ask = "select drawn from campaign_case where sobol_index = 1";
        assert_eq!(crate::data::ask(&library, ask).await.rows, [[Cell::Text(drawn)]]);
        let expected = Status { finished: 2, waiting: 1, ..Status::default() };
        assert_eq!(library.status(CAMPAIGN).await.unwrap(), expected);
        let leased = lease(&library, "w", CASES, 0).await;
        assert_eq!(report(&library, "w", vec![finished(&leased[0])]).await, [ReportVerdict::Stored]);
        library.training_set(CAMPAIGN, drop).await.unwrap();
    }

    async fn results_that_are_thrown_away_leave_nothing_behind(home: &Home) {
        let library = whole(home).await;
        let flag = if home.folder.is_some() { "update result set flagged = 'x'" } else {
            "update case_result set flagged = 'x'"
        };
        sql(home, flag).await;
        assert_eq!(library.retry(CAMPAIGN, Retry::Flagged).await.unwrap(), 3);
        let findings = library.verify(|| ()).await.unwrap().findings;
        assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")), "{findings:?}");
    }

    async fn results_of_before_there_were_checksums_are_counted_and_pass(home: &Home) {
        let library = whole(home).await;
        let (sqlite, postgres) = (
            "update result set checksum = null where sobol_index < 2",
            "update case_result set checksum = null where sobol_index < 2",
        );
        alter(home, ("", sqlite, postgres)).await;
        let verified = library.verify(|| ()).await.unwrap();
        assert_eq!((verified.attested, verified.unattested), (1, 2));
        assert_eq!(unlike_their_checksum(&library).await, None);
        let mut entries = 0;
        library.training_set(CAMPAIGN, |_| entries += 1).await.unwrap();
        assert_eq!(entries, 3);
        let home = home.another();
        let there = home.library(0).await;
        copy(&library, &there).await;
        let verified = there.verify(|| ()).await.unwrap();
        assert_eq!((verified.attested, verified.unattested), (1, 2));
    }

    async fn cases_that_were_lost_are_filled_in_again(home: &Home) {
        let library = home.library(6).await;
        assert_eq!(library.cases_in_order(CAMPAIGN).await.unwrap(), 6);
        sql(home, "delete from campaign_case where sobol_index in (2, 4)").await;
        assert_eq!(library.cases_in_order(CAMPAIGN).await.unwrap(), 2);
        library.insert_cases(CAMPAIGN, &(2..6).map(case).collect::<Vec<_>>(), |_| None).await.unwrap();
        assert_eq!(library.cases_in_order(CAMPAIGN).await.unwrap(), 6);
        let findings = library.verify(|| ()).await.unwrap().findings;
        assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")), "{findings:?}");
    }

    async fn cases_whose_wheel_was_in_the_air_are_counted(home: &Home) {
        let library = home.library(4).await;
        let leased = lease(&library, "w", 4, 0).await;
        let shares = [[0.0, 0.0], [0.0, 0.25], [0.125, 0.5], [0.0, 0.0]];
        let cases = leased.iter().zip(shares).map(|(leased, shares)| {
            let mut passes = passes(features(leased.case.index));
            for (pass, share) in passes.iter_mut().zip(shares) {
                pass.contact_loss_share = Some(share);
            }
            reported(leased, Outcome::Finished(passes))
        });
        assert_eq!(library.contact_loss(CAMPAIGN).await.unwrap(), ContactLoss::default());
        report(&library, "w", cases.collect()).await;
        let expected = ContactLoss { cases: 2, largest_share: 0.5 };
        assert_eq!(library.contact_loss(CAMPAIGN).await.unwrap(), expected);
        let there = Home::sqlite();
        let there = there.library(0).await;
        copy(&library, &there).await;
        assert_eq!(there.contact_loss(CAMPAIGN).await.unwrap(), expected);
        assert_eq!(there.verify(|| ()).await.unwrap().attested, 4);
    }
}

/// Copies the intact rows, as `tracktwin library copy` does. Returns descriptions of the rows left out.
pub(crate) async fn salvage(from: &Library, to: &Library) -> Vec<String> {
    let mut left_out = Vec::new();
    for table in Table::ALL {
        let take = async |rows| {
            let (_, refused) = to.write_what_is_whole(table, rows).await?;
            left_out.extend(refused.iter().map(ToString::to_string));
            Ok::<(), LibraryError>(())
        };
        let lost = from.read_what_is_whole(table, 50, take).await.unwrap();
        left_out.extend(lost.map(|lost| format!("{}: {lost:?}", table.name)));
    }
    to.finish_complete_cases().await.unwrap();
    to.discard_incomplete().await.unwrap();
    left_out
}
