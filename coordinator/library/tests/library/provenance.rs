//! Trainings, evaluations and diagnoses are stored once.

use crate::support::{CAMPAIGN, Home, on_both_databases};
use std::collections::BTreeMap;
use tracktwin_library::{
    DiagnosisRecord, EvaluationRecord, HypothesisRecord, MismatchRecord, SleeperRecord,
    StoredArray, SurrogateRecord, TrainingRecord,
};
use tracktwin_parameters::Parameter;

pub(crate) fn training() -> TrainingRecord {
    TrainingRecord {
        campaign: CAMPAIGN.to_owned(),
        library_digest: "d".to_owned(),
        cases: 3,
        seed: 1,
        code_version: "0.1.0".to_owned(),
        surrogates: vec![SurrogateRecord {
            feature: "GF".to_owned(),
            speeds_km_h: vec![7.0, 13.0],
            parameter: Parameter::BallastStiffness,
            mase_test: 0.05,
            mase_folds: 0.06,
            coverage_90_test: 0.9,
        }],
    }
}

pub(crate) fn evaluation() -> EvaluationRecord {
    let estimates = BTreeMap::from([(Parameter::BallastStiffness, [1.1e7, 6e5])]);
    EvaluationRecord {
        recording: "dev-01".to_owned(),
        method: "gp".to_owned(),
        campaign: CAMPAIGN.to_owned(),
        library_digest: "d".to_owned(),
        code_version: "0.1.0".to_owned(),
        document_json: "{}".to_owned(),
        sleepers: vec![SleeperRecord {
            id: "SN8".to_owned(),
            x_m: 1.125,
            estimates,
            flags: String::new(),
        }],
    }
}

pub(crate) fn diagnosis() -> DiagnosisRecord {
    DiagnosisRecord {
        recording: "dev-02".to_owned(),
        verdict: "left_out_physics".to_owned(),
        code_version: "0.1.0".to_owned(),
        document_json: "{}".to_owned(),
        mismatches: vec![MismatchRecord {
            x_m: [2.40, 2.48],
            frequency_hz: [900.0, 4000.0],
            level_db: 6.1,
            p_value: 0.002,
        }],
        hypotheses: vec![HypothesisRecord {
            physics: "rail_joint".to_owned(),
            probability: 0.93,
            x_m: Some([2.42, 2.46]),
            parameters_json: r#"{"dip_m": {"mean": 7.6e-5, "sd": 1e-5}}"#.to_owned(),
        }],
    }
}

on_both_databases! {
    async fn recording_the_same_again_changes_nothing(home: &Home) {
        let library = home.library(1).await;
        let first = library.record_training(training()).await.unwrap();
        assert_eq!(library.record_training(training()).await.unwrap(), first);
        let other = TrainingRecord { seed: 2, ..training() };
        assert_ne!(library.record_training(other).await.unwrap(), first);
        let first = library.record_evaluation(evaluation()).await.unwrap();
        assert_eq!(library.record_evaluation(evaluation()).await.unwrap(), first);
        let first = library.record_diagnosis(diagnosis()).await.unwrap();
        assert_eq!(library.record_diagnosis(diagnosis()).await.unwrap(), first);
    }

    async fn an_array_is_there_to_the_bit_under_its_key(home: &Home) {
        let library = home.library(0).await;
        let array = StoredArray {
            key: "k".to_owned(),
            kind: "null-campaign".to_owned(),
            meta_json: r#"{"shape": [5]}"#.to_owned(),
            numbers: vec![0.1, -0.0, f64::MIN_POSITIVE, 1e300, std::f64::consts::PI],
        };
        assert_eq!(library.array("k").await.unwrap(), None);
        library.store_array(array.clone()).await.unwrap();
        let other = StoredArray { numbers: vec![1.0], ..array.clone() };
        library.store_array(other).await.unwrap();
        let stored = library.array("k").await.unwrap().unwrap();
        assert_eq!(stored, array);
        assert!(stored.numbers[1].is_sign_negative());
    }
}
