//! Reports: the first result of a case is kept, and the digest does not depend on the history.

use crate::support::{
    CAMPAIGN, Home, case, failed, features, finished, lease, on_both_databases, passes, report,
    reported,
};
use tracktwin_experiment::Outcome;
use tracktwin_library::{LibraryEntry, LibraryError, ReportVerdict, Table};
use tracktwin_protocol::CaseReport;

on_both_databases! {
    async fn a_second_report_changes_nothing(home: &Home) {
        let library = home.library(2).await;
        let leased = lease(&library, "w", 2, 0).await;
        let reports: Vec<_> = leased.iter().map(finished).collect();
        assert_eq!(report(&library, "w", reports.clone()).await, [ReportVerdict::Stored; 2]);
        let digest = library.digest(CAMPAIGN).await.unwrap();
        let mut other = passes(features(0));
        other[0].features.log_power[0] += 1.0;
        let other = reported(&leased[0], Outcome::Finished(other));
        assert_eq!(report(&library, "w", vec![other]).await, [ReportVerdict::Duplicate]);
        assert_eq!(report(&library, "w", vec![failed(&leased[1])]).await, [ReportVerdict::Duplicate]);
        assert_eq!(library.digest(CAMPAIGN).await.unwrap(), digest);
        assert_eq!(library.status(CAMPAIGN).await.unwrap().finished, 2);
    }

    async fn a_late_result_is_stored_if_it_is_the_first(home: &Home) {
        let library = home.library(1).await;
        let slow = lease(&library, "slow", 1, 0).await;
        let quick = lease(&library, "quick", 1, 1000).await;
        assert_eq!(report(&library, "slow", vec![failed(&slow[0])]).await, [ReportVerdict::Late]);
        assert_eq!(report(&library, "slow", vec![finished(&slow[0])]).await, [ReportVerdict::Stored]);
        assert_eq!(report(&library, "quick", vec![finished(&quick[0])]).await, [ReportVerdict::Duplicate]);
    }

    async fn results_of_cases_never_leased_or_of_other_parameters_are_refused(home: &Home) {
        let library = home.library(2).await;
        let leased = lease(&library, "w", 1, 0).await;
        let good = finished(&leased[0]);
        let refused = vec![
            CaseReport { index: 1, ..good.clone() },
            CaseReport { index: 7, ..good.clone() },
            CaseReport { epoch: 0, ..good.clone() },
            CaseReport { epoch: 2, ..good.clone() },
            CaseReport { parameter_hash: "0".to_owned(), ..good.clone() },
        ];
        assert_eq!(report(&library, "w", refused).await, [ReportVerdict::Refused; 5]);
        assert_eq!(library.status(CAMPAIGN).await.unwrap().finished, 0);
    }

    async fn the_digest_does_not_depend_on_order_worker_or_attempts(home: &Home) {
        let mut digests = Vec::new();
        for reversed in [false, true] {
                let home = home.another();
            let library = home.library(9).await;
            if reversed {
                lease(&library, "lost", 5, 0).await;
            }
            let worker = if reversed { "b" } else { "a" };
            let mut reports: Vec<_> =
                lease(&library, worker, 9, 1000).await.iter().map(finished).collect();
            if reversed {
                reports.reverse();
            }
            for case in reports {
                report(&library, worker, vec![case]).await;
            }
            digests.push(library.digest(CAMPAIGN).await.unwrap());
        }
        assert_eq!(digests[0], digests[1]);
    }

    async fn the_digest_notices_one_bit(home: &Home) {
        let mut digests = Vec::new();
        for nudged in [false, true] {
                let home = home.another();
            let library = home.library(1).await;
            let leased = lease(&library, "w", 1, 0).await;
            let mut passes = passes(features(0));
            if nudged {
                let value = &mut passes[1].features.log_power[4];
                *value = value.next_up();
            }
            report(&library, "w", vec![reported(&leased[0], Outcome::Finished(passes))]).await;
            digests.push(library.digest(CAMPAIGN).await.unwrap());
        }
        assert_ne!(digests[0], digests[1]);
    }

    async fn the_training_set_is_what_was_reported_to_the_bit(home: &Home) {
        let library = home.library(4).await;
        let leased = lease(&library, "w", 4, 0).await;
        // One case is left out.
        for index in [3, 0, 2] {
            report(&library, "w", vec![finished(&leased[index])]).await;
        }
        let mut entries = Vec::new();
        let digest = library.training_set(CAMPAIGN, |entry| entries.push(entry)).await.unwrap();
        assert_eq!(digest, library.digest(CAMPAIGN).await.unwrap());
        let expected =
            [0, 2, 3].map(|index| LibraryEntry { case: case(index), features: features(index) });
        assert_eq!(entries, expected);
    }

    async fn a_pass_that_an_interrupted_copy_left_is_replaced_by_the_report_of_its_case(home: &Home) {
        let from = home.library(1).await;
        let leased = lease(&from, "w", 1, 0).await;
        report(&from, "w", vec![finished(&leased[0])]).await;
        let results = Table::named("result").unwrap();
        let mut passes = Vec::new();
        let keep = async |rows| {
            passes.extend(rows);
            Ok::<(), LibraryError>(())
        };
        from.read_table(results, 9, keep).await.unwrap();
        let home = home.another();
        let library = home.library(2).await;
        // The copy ended between the two passes of the case.
        assert_eq!(library.write_table(results, passes[..1].to_vec()).await.unwrap(), 1);
        let leased = lease(&library, "v", 2, 0).await;
        let reports = leased.iter().map(finished).collect();
        assert_eq!(report(&library, "v", reports).await, [ReportVerdict::Stored; 2]);
        assert_eq!(library.status(CAMPAIGN).await.unwrap().finished, 2);
        assert_eq!(library.count(results).await.unwrap(), 4);
        let findings = library.verify(|| ()).await.unwrap().findings;
        // Its campaign's hashes are single letters.
        assert!(findings.iter().all(|it| it.what.ends_with("does not match its hash")), "{findings:?}");
    }

    async fn an_unknown_campaign_is_named(home: &Home) {
        let library = home.library(1).await;
        let error = library.digest("nowhere-1").await.unwrap_err();
        assert!(matches!(&error, LibraryError::UnknownCampaign { id } if id == "nowhere-1"), "{error}");
    }
}
