//! Several campaigns in one library: order of leasing, and control by the user.

use crate::support::{
    ATTEMPTS_MAX, CAMPAIGN, Home, failed, fill, finished, held, lease, message, on_both_databases,
    report, request,
};
use tracktwin_library::{
    CampaignState, Cause, LeaseRequest, Leased, LibraryError, Report, ReportVerdict, Retry, State,
    Status,
};

const OTHER: &str = "other-000000000000";

/// The campaign of a lease of up to `max` cases, and the number of cases.
async fn served(library: &tracktwin_library::Library, max: u32) -> Option<(String, usize)> {
    let lease = library.lease(request("w", max, 0)).await.unwrap();
    lease.map(|lease| (lease.campaign, lease.cases.len()))
}

on_both_databases! {
    async fn a_lease_is_of_one_campaign_the_oldest_until_it_has_no_more(home: &Home) {
        let library = home.library(3).await;
        // Creation times are told to the millisecond.
        let created = library.now_unix_ms();
        while library.now_unix_ms() == created {
            std::thread::yield_now();
        }
        fill(&library, OTHER, 2).await;
        assert_eq!(served(&library, 2).await, Some((CAMPAIGN.to_owned(), 2)));
        assert_eq!(served(&library, 2).await, Some((CAMPAIGN.to_owned(), 1)));
        assert_eq!(served(&library, 9).await, Some((OTHER.to_owned(), 2)));
        assert_eq!(served(&library, 9).await, None);
    }

    async fn priority_goes_before_age(home: &Home) {
        let library = home.library(2).await;
        fill(&library, OTHER, 2).await;
        library.set_priority(OTHER, 7).await.unwrap();
        assert_eq!(served(&library, 1).await, Some((OTHER.to_owned(), 1)));
        library.set_priority(OTHER, -7).await.unwrap();
        assert_eq!(served(&library, 1).await, Some((CAMPAIGN.to_owned(), 1)));
        let error = library.set_priority("nowhere", 1).await.unwrap_err();
        assert!(matches!(error, LibraryError::UnknownCampaign { .. }), "{error}");
    }

    async fn a_paused_campaign_hands_out_nothing_and_takes_what_comes(home: &Home) {
        let library = home.library(2).await;
        let leased = lease(&library, "w", 1, 0).await;
        library.pause(CAMPAIGN).await.unwrap();
        assert_eq!(served(&library, 1).await, None);
        assert_eq!(lease(&library, "w", 1, 0).await, []);
        // What is in work may be finished.
        assert_eq!(library.renew(CAMPAIGN, "w", vec![held(&leased[0])], 10).await.unwrap(), []);
        assert_eq!(report(&library, "w", vec![finished(&leased[0])]).await, [ReportVerdict::Stored]);
        library.resume(CAMPAIGN).await.unwrap();
        assert_eq!(served(&library, 1).await, Some((CAMPAIGN.to_owned(), 1)));
    }

    async fn a_cancelled_campaign_takes_its_leases_back_and_keeps_what_still_comes(home: &Home) {
        let library = home.library(3).await;
        let leased = lease(&library, "w", 2, 0).await;
        library.cancel(CAMPAIGN).await.unwrap();
        let all: Vec<_> = leased.iter().map(held).collect();
        assert_eq!(library.renew(CAMPAIGN, "w", all.clone(), 10).await.unwrap(), all);
        assert_eq!(report(&library, "w", vec![finished(&leased[0])]).await, [ReportVerdict::Stored]);
        assert_eq!(report(&library, "w", vec![failed(&leased[1])]).await, [ReportVerdict::Late]);
        let status = library.status(CAMPAIGN).await.unwrap();
        assert_eq!(status, Status { waiting: 2, finished: 1, ..Status::default() });
        let overview = library.overview().await.unwrap();
        assert_eq!(overview[0].state, CampaignState::Cancelled);
    }

    async fn cases_given_up_can_be_tried_again_one_by_one_or_all(home: &Home) {
        let library = home.library(3).await;
        for _ in 0..ATTEMPTS_MAX {
            let leased = lease(&library, "w", 3, 0).await;
            report(&library, "w", leased.iter().map(failed).collect()).await;
        }
        let causes = library.overview().await.unwrap().remove(0).causes;
        assert_eq!(causes, [Cause { error: "it does not stand".to_owned(), cases: 3 }]);
        assert_eq!(library.retry(CAMPAIGN, Retry::Cases(vec![1, 77])).await.unwrap(), 1);
        let record = library.case(CAMPAIGN, 1).await.unwrap().unwrap();
        assert_eq!((record.state, record.attempts, record.error), (State::Waiting, 0, None));
        assert_eq!(library.retry(CAMPAIGN, Retry::Failed).await.unwrap(), 2);
        // Attempts begin anew, epochs don't.
        assert_eq!(lease(&library, "w", 3, 0).await[2].epoch, ATTEMPTS_MAX + 1);
        let error = library.retry("nowhere", Retry::Failed).await.unwrap_err();
        assert!(matches!(error, LibraryError::UnknownCampaign { .. }), "{error}");
    }

    async fn the_rate_is_that_of_the_last_minute_or_since_the_first_results(home: &Home) {
        let library = home.library(5).await;
        let leased = lease(&library, "w", 5, 0).await;
        let now = library.now_unix_ms();
        let finish = async |case: &Leased, seconds_ago: i64| {
            let message = message("w", vec![finished(case)]);
            let now_unix_ms = now - 1000 * seconds_ago;
            library.report(Report { now_unix_ms, ..message }).await.unwrap();
            library.overview().await.unwrap().remove(0)
        };
        assert_eq!(library.overview().await.unwrap()[0].per_second, 0.0);
        // Counted in tens of seconds: what was 20 s ago may count from 30 s ago. And tests may be slow.
        let young = finish(&leased[0], 20).await;
        assert!((1.0 / 45.0..=1.0 / 20.0).contains(&young.per_second), "{young:?}");
        assert_eq!(young.mean_case_s, Some(0.25));
        finish(&leased[1], 75).await;
        finish(&leased[2], 3600).await;
        let old = finish(&leased[3], 0).await;
        assert!((2.0 / 85.0..=2.0 / 60.0).contains(&old.per_second), "{old:?}");
        assert_eq!(old.mean_case_s, Some(0.25));
    }

    async fn counts_follow_whatever_happens(home: &Home) {
        let library = home.library(6).await;
        let leased = lease(&library, "w", 4, 0).await;
        report(&library, "w", vec![finished(&leased[0]), failed(&leased[1])]).await;
        library.release(CAMPAIGN, "w", vec![held(&leased[2])]).await.unwrap();
        let expected = Status { waiting: 4, leased: 1, finished: 1, failed: 0 };
        assert_eq!(library.status(CAMPAIGN).await.unwrap(), expected);
        // Counted one by one.
        assert_eq!(library.status_of(CAMPAIGN, 5).await.unwrap().waiting, 3);
    }

    async fn a_campaign_asked_for_by_name_comes_before_all_others(home: &Home) {
        let library = home.library(1).await;
        fill(&library, OTHER, 1).await;
        library.set_priority(CAMPAIGN, 9).await.unwrap();
        let only = LeaseRequest { campaign: Some(OTHER.to_owned()), ..request("w", 1, 0) };
        assert_eq!(library.lease(only.clone()).await.unwrap().unwrap().campaign, OTHER);
        assert_eq!(library.lease(only).await.unwrap(), None);
    }
}
