//! Workers as shared by all coordinators, and their quarantine.

use crate::data::{ask, copy};
use crate::support::{CAMPAIGN, Home, failed, finished, lease, message, on_both_databases, report};
use tracktwin_library::{
    AuditCounts, AuditFinding, Library, LibraryError, Registration, Report, ReportVerdict, Retry,
    State, WorkerState,
};
use tracktwin_protocol::CaseReport;

pub(crate) fn registration(worker: &str, now_unix_ms: i64) -> Registration {
    Registration {
        worker: worker.to_owned(),
        code_version: "0.1.0".to_owned(),
        model_hash: "m".to_owned(),
        cores: 4,
        now_unix_ms,
    }
}

/// Finishes `count` cases, all of which are marked for an audit.
async fn work_audited(library: &Library, worker: &str, count: u32) {
    let leased = lease(library, worker, count, 0).await;
    let message = message(worker, leased.iter().map(finished).collect());
    library.report(Report { audit_share: 1.0, ..message }).await.unwrap();
}

on_both_databases! {
    async fn what_a_worker_does_is_counted_for_all_coordinators(home: &Home) {
        let library = home.library(5).await;
        let state = library.register_worker(registration("w", 1000)).await.unwrap();
        assert_eq!(state, WorkerState::Active);
        assert_eq!(library.heartbeat("stranger", 2000).await.unwrap(), None);
        library.heartbeat("w", 2000).await.unwrap().unwrap();
        let leased = lease(&library, "w", 5, 0).await;
        let reports = [failed(&leased[0]), finished(&leased[1]), failed(&leased[2])];
        report(&library, "w", reports.to_vec()).await;
        report(&library, "w", vec![failed(&leased[3])]).await;
        let other = home.open().await;
        let worker = other.worker("w").await.unwrap().unwrap();
        assert_eq!((worker.cases_finished, worker.cases_failed), (1, 3));
        assert_eq!(worker.failures_in_a_row, 2);
        assert_eq!(worker.mean_case_s(), Some(0.25));
        assert_eq!(worker.registered_unix_ms, 1000);
        // The report's clock.
        assert_eq!(worker.last_seen_unix_ms, 1_700_000_000_000);
        assert_eq!(other.workers(1_700_000_000_001).await.unwrap(), []);
        assert_eq!(other.workers(0).await.unwrap(), [worker]);
        report(&library, "w", vec![finished(&leased[4])]).await;
        assert_eq!(library.worker("w").await.unwrap().unwrap().failures_in_a_row, 0);
    }

    async fn a_worker_in_quarantine_gets_nothing_until_it_is_pardoned(home: &Home) {
        let library = home.library(2).await;
        library.register_worker(registration("w", 0)).await.unwrap();
        library.flag_worker("w", "nine failures in a row").await.unwrap();
        assert_eq!(lease(&library, "w", 1, 0).await, []);
        // It comes again under its name, perhaps to another coordinator.
        let state = library.register_worker(registration("w", 9)).await.unwrap();
        assert_eq!(state, WorkerState::Quarantined);
        let record = library.heartbeat("w", 10).await.unwrap().unwrap();
        assert_eq!(record.reason.as_deref(), Some("nine failures in a row"));
        library.pardon_worker("w").await.unwrap();
        assert_eq!(lease(&library, "w", 1, 0).await.len(), 1);
        let error = library.flag_worker("stranger", "why not").await.unwrap_err();
        assert!(matches!(error, LibraryError::UnknownWorker { .. }), "{error}");
    }

    async fn a_worker_writes_only_what_it_holds_or_held(home: &Home) {
        let library = home.library(2).await;
        let leased = lease(&library, "honest", 2, 0).await;
        let stolen = report(&library, "thief", vec![finished(&leased[0])]).await;
        assert_eq!(stolen, [ReportVerdict::Refused]);
        // An epoch that another had.
        lease(&library, "late", 1, 1000).await;
        assert_eq!(report(&library, "late", vec![finished(&leased[0])]).await, [ReportVerdict::Refused]);
        assert_eq!(report(&library, "honest", vec![finished(&leased[0])]).await, [ReportVerdict::Stored]);
        let again = CaseReport { epoch: 2, ..finished(&leased[0]) };
        assert_eq!(report(&library, "late", vec![again]).await, [ReportVerdict::Duplicate]);
    }

    async fn an_audit_goes_to_another_worker_and_is_kept(home: &Home) {
        let library = home.library(3).await;
        work_audited(&library, "first", 2).await;
        assert_eq!(library.audit_sample(CAMPAIGN, "first", 9, 1000).await.unwrap(), []);
        let audits = library.audit_sample(CAMPAIGN, "second", 9, 1000).await.unwrap();
        assert_eq!(audits.len(), 2);
        assert_eq!((audits[0].case.index, audits[0].worker.as_str()), (0, "first"));
        // They are the second's for now.
        assert_eq!(library.audit_sample(CAMPAIGN, "third", 9, 1000).await.unwrap(), []);
        let agrees = AuditFinding { agrees: true, difference_db: 1e-12 };
        let differs = AuditFinding { agrees: false, difference_db: 3.0 };
        assert_eq!(library.audited(CAMPAIGN, 0, "third", differs, None).await.unwrap(), None);
        let whose = library.audited(CAMPAIGN, 0, "second", agrees, None).await.unwrap();
        assert_eq!(whose.as_deref(), Some("first"));
        library.audited(CAMPAIGN, 1, "second", differs, None).await.unwrap();
        // Said again, it is over.
        assert_eq!(library.audited(CAMPAIGN, 1, "second", agrees, None).await.unwrap(), None);
        let counts = library.audits(CAMPAIGN).await.unwrap();
        assert_eq!(counts, AuditCounts { open: 0, agree: 1, differ: 1 });
    }

    async fn an_audit_whose_worker_falls_silent_goes_to_the_next(home: &Home) {
        let library = home.library(1).await;
        work_audited(&library, "first", 1).await;
        assert_eq!(library.audit_sample(CAMPAIGN, "second", 1, -1).await.unwrap().len(), 1);
        assert_eq!(library.audit_sample(CAMPAIGN, "third", 1, 1000).await.unwrap().len(), 1);
    }

    async fn who_is_wrong_by_an_audit_is_put_into_quarantine_with_it(home: &Home) {
        let library = home.library(2).await;
        for worker in ["first", "second"] {
            library.register_worker(registration(worker, 0)).await.unwrap();
        }
        work_audited(&library, "first", 2).await;
        library.audit_sample(CAMPAIGN, "second", 2, 1000).await.unwrap();
        let differs = AuditFinding { agrees: false, difference_db: 3.0 };
        let wrong = Some(("first", "differs by 3 dB"));
        // Who was not asked blames nobody.
        library.audited(CAMPAIGN, 0, "third", differs, wrong).await.unwrap();
        assert_eq!(library.worker("first").await.unwrap().unwrap().state, WorkerState::Active);
        library.audited(CAMPAIGN, 0, "second", differs, wrong).await.unwrap();
        let first = library.worker("first").await.unwrap().unwrap();
        assert_eq!(first.state, WorkerState::Quarantined);
        assert_eq!(library.retry(CAMPAIGN, Retry::Flagged).await.unwrap(), 2);
    }

    async fn audits_wait_for_their_campaign_and_for_somebody_who_can_do_them(home: &Home) {
        let library = home.library(1).await;
        library.register_worker(registration("first", 0)).await.unwrap();
        work_audited(&library, "first", 1).await;
        assert_eq!(library.audits_to_do(CAMPAIGN, 0).await.unwrap(), 0, "not the first itself");
        library.register_worker(registration("second", 0)).await.unwrap();
        assert_eq!(library.audits_to_do(CAMPAIGN, 0).await.unwrap(), 1);
        library.pause(CAMPAIGN).await.unwrap();
        assert_eq!(library.audit_sample(CAMPAIGN, "second", 1, 1000).await.unwrap(), []);
        library.resume(CAMPAIGN).await.unwrap();
        assert_eq!(library.audit_sample(CAMPAIGN, "second", 1, 1000).await.unwrap().len(), 1);
        // What is given back is the next one's at once.
        library.release_audits(CAMPAIGN, "second", vec![0]).await.unwrap();
        assert_eq!(library.audit_sample(CAMPAIGN, "third", 1, 1000).await.unwrap().len(), 1);
    }

    async fn what_a_worker_in_quarantine_still_hands_in_is_flagged(home: &Home) {
        let library = home.library(1).await;
        library.register_worker(registration("bad", 0)).await.unwrap();
        let leased = lease(&library, "bad", 1, 0).await;
        library.flag_worker("bad", "differs by 3 dB").await.unwrap();
        assert_eq!(report(&library, "bad", vec![finished(&leased[0])]).await, [ReportVerdict::Stored]);
        assert_eq!(library.retry(CAMPAIGN, Retry::Flagged).await.unwrap(), 1);
    }

    async fn flagged_results_are_counted_found_and_not_trained_on(home: &Home) {
        let library = home.library(3).await;
        library.register_worker(registration("bad", 0)).await.unwrap();
        work_audited(&library, "good", 1).await;
        work_audited(&library, "bad", 2).await;
        assert_eq!(library.flagged(CAMPAIGN).await.unwrap(), 0);
        library.training_set(CAMPAIGN, drop).await.unwrap();
        library.flag_worker("bad", "differs by 3 dB").await.unwrap();
        assert_eq!(library.flagged(CAMPAIGN).await.unwrap(), 2);
        let error = library.training_set(CAMPAIGN, drop).await.unwrap_err();
        assert!(error.is_wrong_input(), "{error:?}");
        for part in ["case 1", "differs by 3 dB", "campaign retry test-000000000000 --flagged"] {
            assert!(error.to_string().contains(part), "{part} is not in {error}");
        }
        let findings = library.verify(|| ()).await.unwrap().findings;
        let found = findings.iter().find(|it| it.what.contains("retry --flagged"));
        assert_eq!(found.map(|it| (it.count, it.first_index)), Some((2, Some(1))));
    }

    async fn a_continued_copy_has_the_quarantine_the_flags_and_the_counts_that_came_since(home: &Home) {
        let library = home.library(4).await;
        for worker in ["bad", "good"] {
            library.register_worker(registration(worker, 0)).await.unwrap();
        }
        work_audited(&library, "bad", 2).await;
        let home = home.another();
        let there = Library::open_or_create(&home.url).await.unwrap();
        assert!(copy(&library, &there).await > 0);
        work_audited(&library, "good", 1).await;
        library.audit_sample(CAMPAIGN, "good", 1, 1000).await.unwrap();
        let differs = AuditFinding { agrees: false, difference_db: 3.0 };
        let wrong = Some(("bad", "differs by 3 dB"));
        library.audited(CAMPAIGN, 0, "good", differs, wrong).await.unwrap();
        copy(&library, &there).await;
        for worker in ["bad", "good"] {
            assert_eq!(there.worker(worker).await.unwrap(), library.worker(worker).await.unwrap());
        }
        assert_eq!(there.flagged(CAMPAIGN).await.unwrap(), 2);
        assert_eq!(there.audits(CAMPAIGN).await.unwrap(), library.audits(CAMPAIGN).await.unwrap());
        let finished = "select sum(finished) as n from progress";
        assert_eq!(ask(&there, finished).await.rows, ask(&library, finished).await.rows);
        assert_eq!(copy(&library, &there).await, 0, "nothing came since");
        // What the target knows later is kept.
        there.heartbeat("good", i64::MAX / 2).await.unwrap();
        assert_eq!(copy(&library, &there).await, 0);
    }

    async fn flagged_results_are_computed_again_when_asked_for(home: &Home) {
        let library = home.library(3).await;
        library.register_worker(registration("bad", 0)).await.unwrap();
        work_audited(&library, "bad", 2).await;
        work_audited(&library, "good", 1).await;
        // Two cases at two speeds.
        assert_eq!(library.flag_worker("bad", "differs by 3 dB").await.unwrap(), 4);
        assert_eq!(library.worker("bad").await.unwrap().unwrap().state, WorkerState::Quarantined);
        assert_eq!(library.retry(CAMPAIGN, Retry::Flagged).await.unwrap(), 2);
        assert_eq!(library.flagged(CAMPAIGN).await.unwrap(), 0);
        let state = library.case(CAMPAIGN, 0).await.unwrap().unwrap().state;
        assert_eq!(state, State::Waiting);
        assert_eq!(library.audits(CAMPAIGN).await.unwrap().open, 1);
        let leased = lease(&library, "good", 3, 0).await;
        let verdicts = report(&library, "good", leased.iter().map(finished).collect()).await;
        assert_eq!(verdicts, [ReportVerdict::Stored; 2]);
    }
}
