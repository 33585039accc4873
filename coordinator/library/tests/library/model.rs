//! Results of two versions of the physics are not mixed in one campaign.

use crate::support::{CAMPAIGN, Home, finished, lease, message, on_both_databases};
use tracktwin_library::{Library, LibraryError, Report, Retry};

/// Stores results of the next cases, computed by a model.
async fn compute(library: &Library, cases: u32, model: &str) {
    let leased = lease(library, "w", cases, 0).await;
    let report = message("w", leased.iter().map(finished).collect());
    library.report(Report { model_hash: model.to_owned(), ..report }).await.unwrap();
}

on_both_databases! {
    async fn a_campaign_is_continued_with_the_model_that_began_it_only(home: &Home) {
        let library = home.library(4).await;
        library.check_model(CAMPAIGN, "new").await.unwrap();
        compute(&library, 2, "old").await;
        library.check_model(CAMPAIGN, "old").await.unwrap();
        let error = library.check_model(CAMPAIGN, "new").await.unwrap_err();
        assert!(matches!(error, LibraryError::OtherModel { .. }) && error.is_wrong_input());
        let told = error.to_string();
        for part in [CAMPAIGN, "model old", "model new", "campaign retry", "--other-model"] {
            assert!(told.contains(part), "{part} is not in {told}");
        }
    }

    async fn a_training_set_has_results_of_one_model(home: &Home) {
        let library = home.library(4).await;
        compute(&library, 2, "old").await;
        compute(&library, 2, "new").await;
        let error = library.training_set(CAMPAIGN, drop).await.unwrap_err();
        let LibraryError::MixedModels { one, other, index, .. } = &error else { panic!("{error}") };
        assert_eq!((one.as_str(), other.as_str(), *index), ("old", "new", 2));
        let findings = library.verify(|| ()).await.unwrap().findings;
        let found = findings.iter().find(|it| it.what.contains("another model"));
        assert_eq!(found.map(|it| (it.count, it.first_index)), Some((2, Some(2))));
    }

    async fn cases_of_another_model_are_computed_again_on_request(home: &Home) {
        let library = home.library(4).await;
        compute(&library, 3, "old").await;
        compute(&library, 1, "new").await;
        let own = || Retry::OtherModel("new".to_owned());
        assert_eq!(library.retry(CAMPAIGN, own()).await.unwrap(), 3);
        library.check_model(CAMPAIGN, "new").await.unwrap();
        let status = library.status(CAMPAIGN).await.unwrap();
        assert_eq!((status.waiting, status.finished), (3, 1));
        compute(&library, 3, "new").await;
        let mut entries = 0;
        library.training_set(CAMPAIGN, |_| entries += 1).await.unwrap();
        assert_eq!((entries, library.retry(CAMPAIGN, own()).await.unwrap()), (4, 0));
    }
}
