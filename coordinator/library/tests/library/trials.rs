//! Blind trials: machines share the cases, and each question is answered once.

use crate::data::{Kept, copy};
use crate::provenance::diagnosis;
use crate::support::{Home, on_both_databases};
use std::collections::BTreeSet;
use tracktwin_library::{
    Cell, DiagnosisRecord, Library, LibraryError, Question, TrialAnswer, TrialRecord,
};

const LEASE_MS: i64 = 60_000;

fn trial(cases: usize) -> TrialRecord {
    TrialRecord {
        seed: 7,
        code_version: "0.1.0".to_owned(),
        model_hash: "m".to_owned(),
        seals: (0..cases).map(|number| format!("seal of {number}")).collect(),
    }
}

async fn sealed(home: &Home, cases: usize) -> (Library, String) {
    let library = Library::open_or_create(&home.url).await.unwrap();
    library.seal_trial(trial(cases)).await.unwrap();
    (library, trial(cases).id())
}

fn answer(number: u32, question: Question, score: &str) -> TrialAnswer {
    TrialAnswer { number, question, score_json: score.to_owned() }
}

async fn count(library: &Library, table: &str) -> Cell {
    let mut kept = Kept::default();
    library.query(&format!("select count(*) from {table}"), &mut kept).await.unwrap();
    kept.rows[0][0].clone()
}

on_both_databases! {
    async fn a_case_is_worked_on_by_one_node_at_a_time(home: &Home) {
        let (library, trial) = sealed(home, 3).await;
        let lease = async |node: &str, of: Vec<u32>, lease_ms| {
            library.lease_trial_case(&trial, node, of, lease_ms).await.unwrap()
        };
        assert_eq!(lease("a", vec![0, 2], LEASE_MS).await, Some(0));
        assert_eq!(lease("b", vec![0, 2], LEASE_MS).await, Some(2));
        assert_eq!(lease("c", vec![0, 2], LEASE_MS).await, None);
        // What it could not give back is its own.
        assert_eq!(lease("b", vec![0, 2], LEASE_MS).await, Some(2));
        // Only its holder gives it back.
        library.release_trial_case(&trial, "c", 0).await.unwrap();
        assert_eq!(lease("c", vec![0, 2], LEASE_MS).await, None);
        library.release_trial_case(&trial, "a", 0).await.unwrap();
        assert_eq!(lease("c", vec![0, 2], LEASE_MS).await, Some(0));
    }

    async fn a_node_that_falls_silent_loses_its_case(home: &Home) {
        let (library, trial) = sealed(home, 1).await;
        let lease = async |node: &str, lease_ms| {
            library.lease_trial_case(&trial, node, vec![0], lease_ms).await.unwrap()
        };
        assert_eq!(lease("a", 0).await, Some(0));
        assert_eq!(lease("b", LEASE_MS).await, Some(0));
        // What it says when it wakes up takes nothing from the other.
        library.renew_trial_case(&trial, "a", 0, 0).await.unwrap();
        library.release_trial_case(&trial, "a", 0).await.unwrap();
        assert_eq!(lease("c", LEASE_MS).await, None);
        library.renew_trial_case(&trial, "b", 0, 0).await.unwrap();
        assert_eq!(lease("c", LEASE_MS).await, Some(0));
    }

    async fn nodes_that_ask_at_once_get_cases_of_their_own(home: &Home) {
        let (library, trial) = sealed(home, 24).await;
        library.close().await;
        let take_all = async |node: String| {
            let library = Library::open(&home.url).await.unwrap();
            let mut taken = Vec::new();
            // A node that was overtaken asks again.
            for _ in 0..24 {
                let of = (0..24).filter(|number| !taken.contains(number)).collect();
                let one = library.lease_trial_case(&trial, &node, of, LEASE_MS).await.unwrap();
                taken.extend(one);
            }
            taken
        };
        let [a, b, c, d] = ["a", "b", "c", "d"].map(|node| take_all(node.to_owned()));
        let (a, b, c, d) = tokio::join!(a, b, c, d);
        let taken = [a, b, c, d].concat();
        assert_eq!(taken.len(), 24);
        assert_eq!(taken.into_iter().collect::<BTreeSet<_>>().len(), 24);
    }

    async fn a_question_is_answered_once(home: &Home) {
        let (library, trial) = sealed(home, 2).await;
        let record = async |answer: TrialAnswer, diagnosis: Option<DiagnosisRecord>| {
            library.record_trial_answer(&trial, "a", answer, diagnosis).await.unwrap();
        };
        let first = answer(1, Question::Catalogue, r#"{"right": true}"#);
        record(first.clone(), Some(diagnosis())).await;
        record(answer(1, Question::Catalogue, r#"{"right": false}"#), Some(diagnosis())).await;
        let paper = answer(1, Question::Paper, "null");
        record(paper.clone(), None).await;
        assert_eq!(library.trial_answers(&trial).await.unwrap(), [first, paper]);
        assert_eq!(count(&library, "diagnosis").await, Cell::Integer(1));
        let joined = "trial_answer join diagnosis on diagnosis_id = diagnosis.id";
        assert_eq!(count(&library, joined).await, Cell::Integer(1));
    }

    async fn a_seal_is_set_once(home: &Home) {
        let (library, _) = sealed(home, 2).await;
        library.seal_trial(trial(3)).await.unwrap();
        assert_eq!(count(&library, "trial_case").await, Cell::Integer(3));
        // A shorter trial is a part of it.
        library.seal_trial(trial(1)).await.unwrap();
        let mut other = trial(3);
        "another truth".clone_into(&mut other.seals[1]);
        let error = library.seal_trial(other).await.unwrap_err();
        assert!(matches!(error, LibraryError::OtherTruth { number: 1, .. }), "{error:?}");
        assert!(error.is_wrong_input());
        // Another program's trial is another one.
        let other = TrialRecord { model_hash: "n".to_owned(), seals: Vec::new(), ..trial(0) };
        assert_ne!(other.id(), trial(0).id());
        library.seal_trial(other).await.unwrap();
    }

    async fn answers_travel_and_leases_do_not(home: &Home) {
        let (library, trial) = sealed(home, 2).await;
        let first = answer(0, Question::Catalogue, "{}");
        library
            .record_trial_answer(&trial, "a", first.clone(), Some(diagnosis()))
            .await
            .unwrap();
        library.lease_trial_case(&trial, "a", vec![1], LEASE_MS).await.unwrap();
        let another = home.another();
        let there = Library::open_or_create(&another.url).await.unwrap();
        copy(&library, &there).await;
        assert_eq!(there.trial_answers(&trial).await.unwrap(), [first]);
        let lease = there.lease_trial_case(&trial, "b", vec![1], LEASE_MS).await.unwrap();
        assert_eq!(lease, Some(1));
    }
}
