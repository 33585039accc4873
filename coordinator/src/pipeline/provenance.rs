//! Conversion of trainings, evaluations and diagnoses to records of the library.

use tracktwin_diagnosis::Diagnosis;
use tracktwin_evaluation::{Evaluation, SleeperEvaluation};
use tracktwin_experiment::CODE_VERSION;
use tracktwin_library::{
    DiagnosisRecord, EvaluationRecord, HypothesisRecord, MismatchRecord, SleeperRecord,
    SurrogateRecord, TrainingRecord,
};
use tracktwin_surrogate::{ModelGroup, Trained};

/// Record of trained surrogates.
#[expect(clippy::missing_panics_doc, reason = "a case's index is a u32, and so is their number")]
pub fn training(trained: &Trained) -> TrainingRecord {
    TrainingRecord {
        campaign: trained.campaign().to_owned(),
        library_digest: trained.library_digest().to_owned(),
        cases: u32::try_from(trained.entries()).expect("an index of a case is a u32"),
        seed: trained.split_seed(),
        code_version: CODE_VERSION.to_owned(),
        surrogates: trained.groups().iter().flat_map(surrogates).collect(),
    }
}

fn surrogates(group: &ModelGroup) -> impl Iterator<Item = SurrogateRecord> {
    let key = group.key();
    group.models().iter().map(move |model| SurrogateRecord {
        feature: key.feature.clone(),
        speeds_km_h: key.speeds_km_h.clone(),
        parameter: model.parameter,
        mase_test: model.score.mase_test,
        mase_folds: model.score.mase_folds,
        coverage_90_test: model.score.coverage_90_test,
    })
}

/// Record of an evaluation with surrogates.
pub fn evaluation(evaluation: &Evaluation) -> EvaluationRecord {
    let provenance = &evaluation.provenance;
    EvaluationRecord {
        recording: evaluation.recording.clone(),
        method: evaluation.method.to_owned(),
        campaign: provenance.campaign.clone(),
        library_digest: provenance.library_digest.clone(),
        code_version: provenance.code_version.to_owned(),
        document_json: evaluation.to_json(),
        sleepers: evaluation.sleepers.iter().map(sleeper).collect(),
    }
}

fn sleeper(sleeper: &SleeperEvaluation) -> SleeperRecord {
    let estimates = sleeper.estimates.iter().map(|(&of, it)| (of, [it.mean, it.sd]));
    let flags: Vec<_> = sleeper.flags.iter().map(|flag| flag.label()).collect();
    SleeperRecord {
        id: sleeper.id.clone(),
        x_m: sleeper.x_m,
        estimates: estimates.collect(),
        flags: flags.join("; "),
    }
}

/// Record of a diagnosis; `document_json` is its document.
#[expect(clippy::missing_panics_doc, reason = "estimates by their names are plain JSON")]
pub fn diagnosis(diagnosis: &Diagnosis, document_json: String) -> DiagnosisRecord {
    let mismatches = diagnosis.mismatches.iter().map(|mismatch| MismatchRecord {
        x_m: mismatch.x_m,
        frequency_hz: mismatch.frequency_hz,
        level_db: mismatch.level_db,
        p_value: mismatch.p_value,
    });
    let hypotheses = diagnosis.hypotheses.iter().map(|hypothesis| HypothesisRecord {
        physics: hypothesis.physics.clone(),
        probability: hypothesis.probability,
        x_m: hypothesis.location.as_ref().map(|location| location.x_m),
        parameters_json: serde_json::to_string(&hypothesis.parameters)
            .expect("estimates by their names are plain JSON"),
    });
    DiagnosisRecord {
        recording: diagnosis.recording.clone(),
        verdict: diagnosis.verdict.name().to_owned(),
        code_version: CODE_VERSION.to_owned(),
        document_json,
        mismatches: mismatches.collect(),
        hypotheses: hypotheses.collect(),
    }
}
