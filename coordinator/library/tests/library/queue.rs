//! Leases: a case is leased to one worker at a time, and no case is lost.

use crate::support::{
    CAMPAIGN, Home, failed, finished, held, lease, on_both_databases, report, request,
};
use std::collections::HashSet;
use tokio::task::JoinSet;
use tracktwin_library::{Held, LeaseRequest, ReportVerdict, Retry, State, Status};

fn first_lease(index: u32) -> Held {
    Held { index, epoch: 1 }
}

on_both_databases! {
    async fn workers_that_ask_at_once_never_share_a_case_nor_exceed_their_limit(home: &Home) {
        let library = home.library(100).await;
        let mut workers = JoinSet::new();
        for worker in 0..20 {
            let library = library.clone();
            workers.spawn(async move { lease(&library, &format!("w{worker}"), 7, 0).await });
        }
        let leases = workers.join_all().await;
        assert!(leases.iter().all(|lease| lease.len() <= 7));
        let indices: Vec<_> = leases.iter().flatten().map(|leased| leased.case.index).collect();
        assert_eq!(indices.iter().collect::<HashSet<_>>().len(), indices.len());
        assert_eq!(indices.len(), 100);
    }

    async fn cases_are_handed_out_in_order_and_in_full(home: &Home) {
        let library = home.library(5).await;
        let leased = lease(&library, "w", 3, 0).await;
        assert_eq!(leased.iter().map(held).collect::<Vec<_>>(), [0, 1, 2].map(first_lease));
        assert_eq!(leased[2].case, crate::support::case(2));
    }

    async fn an_expired_lease_goes_to_another_worker_and_a_renewed_one_does_not(home: &Home) {
        let library = home.library(2).await;
        let mine = lease(&library, "a", 2, 0).await;
        let kept = vec![held(&mine[0])];
        assert_eq!(library.renew(CAMPAIGN, "a", kept, 5000).await.unwrap(), []);
        assert_eq!(lease(&library, "b", 2, 999).await, []);
        let theirs = lease(&library, "b", 2, 1000).await;
        assert_eq!(theirs.iter().map(held).collect::<Vec<_>>(), [Held { index: 1, epoch: 2 }]);
        let lost = library.renew(CAMPAIGN, "a", mine.iter().map(held).collect(), 9000).await.unwrap();
        assert_eq!(lost, [held(&mine[1])]);
    }

    async fn a_heartbeat_that_crosses_a_report_or_a_release_loses_nothing(home: &Home) {
        let library = home.library(5).await;
        let mine = lease(&library, "a", 5, 0).await;
        report(&library, "a", vec![finished(&mine[0]), failed(&mine[1])]).await;
        library.release(CAMPAIGN, "a", vec![held(&mine[2])]).await.unwrap();
        let all: Vec<_> = mine.iter().map(held).collect();
        // Sent before the answers came, it names what the worker has ended itself.
        assert_eq!(library.renew(CAMPAIGN, "a", all.clone(), 1000).await.unwrap(), []);
        // Another has the released one now, and a result of its own.
        let theirs = lease(&library, "b", 2, 999).await;
        report(&library, "b", theirs.iter().map(finished).collect()).await;
        assert_eq!(library.renew(CAMPAIGN, "a", all.clone(), 1000).await.unwrap(), []);
        // What expires is lost, and so is what is taken back.
        library.cancel(CAMPAIGN).await.unwrap();
        let lost = library.renew(CAMPAIGN, "a", all, 9000).await.unwrap();
        assert_eq!(lost, [held(&mine[3]), held(&mine[4])]);
    }

    async fn a_lease_that_is_known_to_be_held_does_not_end_however_late_its_heartbeat_is(home: &Home) {
        let library = home.library(4).await;
        let mine = lease(&library, "a", 2, 0).await;
        let ask = |held: Vec<Held>, now| LeaseRequest {
            campaign: Some(CAMPAIGN.to_owned()),
            held,
            ..request("a", 1, now)
        };
        let next = library.lease(ask(vec![held(&mine[0])], 5000)).await.unwrap().unwrap();
        // The first is held, the second was forgotten by its worker and has expired.
        assert_eq!(next.cases.iter().map(held).collect::<Vec<_>>(), [Held { index: 1, epoch: 2 }]);
        let lost = library.renew(CAMPAIGN, "a", mine.iter().map(held).collect(), 9000).await.unwrap();
        assert_eq!(lost, [held(&mine[1])]);
        // It lasts as any other from then on.
        let other = lease(&library, "b", 9, 9000).await;
        assert!(other.iter().any(|it| held(it) == Held { index: 0, epoch: 2 }), "{other:?}");
    }

    async fn many_leases_that_expire_at_once_end_each_with_its_own_count_of_attempts(home: &Home) {
        const CASES: u32 = 700;
        let library = home.library(CASES).await;
        crate::support::fill(&library, "other-000000000000", 3).await;
        // The first ten have lost a worker before.
        assert_eq!(lease(&library, "w", 10, 0).await.len(), 10);
        assert_eq!(lease(&library, "w", CASES, 1000).await.len(), CASES as usize);
        let other = LeaseRequest {
            campaign: Some("other-000000000000".to_owned()),
            ..request("w", 3, 1000)
        };
        assert_eq!(library.lease(other).await.unwrap().unwrap().cases.len(), 3);
        // More than end with one lease.
        let mut again = 0;
        for _ in 0..3 {
            again += lease(&library, "v", CASES, 2000).await.len();
        }
        assert_eq!(again, CASES as usize);
        for (index, attempts) in [(0, 2), (9, 2), (10, 1), (CASES - 1, 1)] {
            let case = library.case(CAMPAIGN, index).await.unwrap().unwrap();
            assert_eq!((case.state, case.attempts), (State::Leased, attempts), "case {index}");
        }
        let waiting = library.status("other-000000000000").await.unwrap();
        assert_eq!(waiting, Status { waiting: 3, ..Status::default() });
    }

    async fn a_heartbeat_of_an_ended_lease_keeps_none_that_followed(home: &Home) {
        let library = home.library(1).await;
        let first = lease(&library, "a", 1, 0).await;
        let second = lease(&library, "a", 1, 1000).await;
        for kept in [held(&first[0]), Held { index: 0, epoch: 3 }] {
            assert_eq!(library.renew(CAMPAIGN, "a", vec![kept], 9000).await.unwrap(), [kept]);
            library.release(CAMPAIGN, "a", vec![kept]).await.unwrap();
        }
        assert_eq!(lease(&library, "b", 1, 1999).await, []);
        assert_eq!(held(&second[0]), Held { index: 0, epoch: 2 });
        assert_eq!(held(&lease(&library, "b", 1, 2000).await[0]), Held { index: 0, epoch: 3 });
    }

    async fn a_case_that_loses_three_workers_is_given_up_with_the_reason(home: &Home) {
        let library = home.library(1).await;
        for attempt in 0..3 {
            assert_eq!(lease(&library, "w", 1, attempt * 1000).await.len(), 1);
        }
        assert_eq!(lease(&library, "w", 1, 3000).await, []);
        let failures = library.failures(CAMPAIGN, 10).await.unwrap();
        assert_eq!(failures[0].attempts, 3);
        assert_eq!(failures[0].error.as_deref(), Some("the lease expired: no heartbeat from its worker"));
    }

    async fn a_case_that_has_lost_workers_twice_goes_alone(home: &Home) {
        let library = home.library(4).await;
        // Case 1 takes its worker with it twice, the others are handed back.
        for now in [0, 1000] {
            let leased = lease(&library, "w", 4, now).await;
            let others = leased.iter().filter(|it| it.case.index != 1).map(held).collect();
            library.release(CAMPAIGN, "w", others).await.unwrap();
        }
        for (worker, indices) in [("a", vec![0, 2, 3]), ("b", vec![1])] {
            let request = LeaseRequest { alone_after: 2, ..request(worker, 4, 2000) };
            let cases = library.lease(request).await.unwrap().unwrap().cases;
            assert_eq!(cases.iter().map(|it| it.case.index).collect::<Vec<_>>(), indices);
        }
    }

    async fn a_case_that_fails_is_tried_again_and_then_given_up(home: &Home) {
        let library = home.library(1).await;
        for attempt in 1..=3 {
            let leased = lease(&library, "w", 1, 0).await;
            assert_eq!(report(&library, "w", vec![failed(&leased[0])]).await, [ReportVerdict::Stored]);
            // Said again, it does not count again.
            assert_eq!(report(&library, "w", vec![failed(&leased[0])]).await, [ReportVerdict::Late]);
            let record = library.case(CAMPAIGN, 0).await.unwrap().unwrap();
            assert_eq!(record.attempts, attempt);
            assert_eq!(record.error.as_deref(), Some("it does not stand"));
        }
        let status = library.status(CAMPAIGN).await.unwrap();
        assert_eq!(status, Status { failed: 1, ..Status::default() });
    }

    async fn a_case_that_has_lost_workers_may_fail_as_often_as_any(home: &Home) {
        let library = home.library(1).await;
        for now in [0, 1000] {
            lease(&library, "w", 1, now).await;
        }
        for (failures, state) in [(1, State::Waiting), (2, State::Waiting), (3, State::Failed)] {
            let leased = lease(&library, "w", 1, 2000).await;
            report(&library, "w", vec![failed(&leased[0])]).await;
            let record = library.case(CAMPAIGN, 0).await.unwrap().unwrap();
            assert_eq!((record.state, record.attempts), (state, 2 + failures));
        }
        // What was before a retry does not count.
        library.retry(CAMPAIGN, Retry::Failed).await.unwrap();
        let leased = lease(&library, "w", 1, 3000).await;
        report(&library, "w", vec![failed(&leased[0])]).await;
        let record = library.case(CAMPAIGN, 0).await.unwrap().unwrap();
        assert_eq!((record.state, record.attempts), (State::Waiting, 1));
    }

    async fn a_released_case_waits_without_an_attempt_counted(home: &Home) {
        let library = home.library(2).await;
        let leased = lease(&library, "a", 2, 0).await;
        // Not by somebody else, and not what was finished meanwhile.
        library.release(CAMPAIGN, "b", vec![held(&leased[0])]).await.unwrap();
        report(&library, "a", vec![finished(&leased[1])]).await;
        library.release(CAMPAIGN, "a", vec![held(&leased[1])]).await.unwrap();
        let status = library.status(CAMPAIGN).await.unwrap();
        assert_eq!(status, Status { leased: 1, finished: 1, ..Status::default() });

        library.release(CAMPAIGN, "a", vec![held(&leased[0])]).await.unwrap();
        let record = library.case(CAMPAIGN, 0).await.unwrap().unwrap();
        assert_eq!((record.state, record.attempts), (State::Waiting, 0));
        assert_eq!(lease(&library, "b", 2, 0).await[0].epoch, 2);
    }

    async fn what_waits_again_is_seen_within_a_part_of_a_lease_and_before_there_is_nothing(
        home: &Home
    ) {
        let library = home.library(6).await;
        let index = async |now| lease(&library, "w", 1, now).await[0].case.index;
        let first = lease(&library, "w", 2, 0).await;
        library.release(CAMPAIGN, "w", vec![held(&first[0])]).await.unwrap();
        // It looks on from where it was, and at everything every 41 ms.
        assert_eq!((index(40).await, index(41).await, index(42).await), (2, 0, 3));
        library.release(CAMPAIGN, "w", vec![held(&first[1])]).await.unwrap();
        assert_eq!((index(43).await, index(44).await, index(45).await), (4, 5, 1));
        assert_eq!(lease(&library, "w", 1, 46).await, []);
    }

    async fn a_new_coordinator_takes_back_what_died_with_the_old_one(home: &Home) {
        let library = home.library(4).await;
        lease(&library, "w", 3, 0).await;
        library.release_all(CAMPAIGN).await.unwrap();
        assert_eq!(library.status(CAMPAIGN).await.unwrap().waiting, 4);
    }
}
