//! Scores from the answers in the library, and the questions that are still open.

use super::{Trial, TrialError};
use serde::Serialize;
use std::collections::BTreeMap;
use tracktwin_library::{DiagnosisRecord, Question, TrialAnswer};
use tracktwin_trial::CaseScore;

/// Stored scores, by number of the case.
pub(super) type Scores = BTreeMap<u32, Answered>;

/// Stored scores of one case, and the answered questions.
pub(super) struct Answered {
    pub(super) score: CaseScore,
    questions: Vec<Question>,
}

impl Trial {
    /// The unanswered questions of a case that can be asked now, in their order.
    pub(super) fn unanswered(&self, answered: Option<&Answered>) -> Vec<Question> {
        let Some(Answered { score, questions }) = answered else {
            return vec![Question::Catalogue];
        };
        let asked = [
            (Question::Paper, self.paper.is_some()),
            (Question::KnockedOut, self.knock_out && score.can_be_knocked_out()),
            (Question::Shuffled, self.shuffle && score.can_be_shuffled()),
        ];
        let open =
            asked.into_iter().filter(|(question, asked)| *asked && !questions.contains(question));
        open.map(|(question, _)| question).collect()
    }

    /// Reads the scores that all machines have stored for this trial.
    pub(super) async fn scores(&self) -> Result<Scores, TrialError> {
        let mut answers = self.library.trial_answers(&self.id()).await?;
        answers.retain(|answer| answer.number < self.cases);
        let mut scores = Scores::new();
        for answer in answers.iter().filter(|answer| answer.question == Question::Catalogue) {
            let questions = vec![Question::Catalogue];
            scores.insert(answer.number, Answered { score: parsed(answer)?, questions });
        }
        for answer in &answers {
            let Some(Answered { score, questions }) = scores.get_mut(&answer.number) else {
                continue;
            };
            match answer.question {
                Question::Catalogue => continue,
                Question::KnockedOut => score.knocked_out = Some(parsed(answer)?),
                Question::Shuffled => score.shuffled = Some(parsed(answer)?),
                Question::Paper => score.paper = parsed(answer)?,
            }
            questions.push(answer.question);
        }
        Ok(scores)
    }

    /// Stores an answer in the shared library.
    pub(super) async fn keep(
        &self,
        number: u32,
        question: Question,
        score: &(impl Serialize + Sync),
        diagnosis: Option<DiagnosisRecord>,
    ) -> Result<(), TrialError> {
        let score_json = serde_json::to_string(score).expect("plain data is plain JSON");
        let answer = TrialAnswer { number, question, score_json };
        Ok(self.library.record_trial_answer(&self.id(), &self.node, answer, diagnosis).await?)
    }
}

fn parsed<T: serde::de::DeserializeOwned>(answer: &TrialAnswer) -> Result<T, TrialError> {
    serde_json::from_str(&answer.score_json).map_err(|source| TrialError::Json {
        path: format!("the library, case {}", answer.number),
        source,
    })
}
