//! Processing of one case: recorded, diagnosed without access to its truth, unsealed, scored.

use super::{SEALS, Trial, TrialError, file, sealed, text};
use crate::pipeline;
use crate::pipeline::compute::compute;
use crate::pipeline::diagnose::{Compared, Diagnosed, Setting};
use crate::pipeline::provenance;
use rustix::time::{ClockId, clock_gettime};
use std::path::PathBuf;
use tracktwin_diagnosis::{Diagnosis, Verdict};
use tracktwin_evaluation::check_recording;
use tracktwin_files::replace;
use tracktwin_library::{DiagnosisRecord, Question};
use tracktwin_signal::recording::Recording;
use tracktwin_trial::{KnockedOut, Paper, Plan, Seals, detectability, score};

impl Trial {
    /// Computes the missing answers of a leased case, and releases it.
    pub(super) async fn work_on(&self, number: u32) -> Result<(), TrialError> {
        let renewal = self.renewal(number);
        let answered = self.answer_case(number).await;
        drop(renewal);
        answered.and(self.release(number).await)
    }

    async fn answer_case(&self, number: u32) -> Result<(), TrialError> {
        let track = self.preset.track();
        let setting =
            Setting { track: &track, library: Some(&self.library), without: &[], shuffle: None };
        while let Some(question) = self.next_question(number).await? {
            let recording = self.record_case(number)?;
            match question {
                Question::Catalogue => self.diagnosed(number, &recording, setting).await?,
                Question::KnockedOut => self.knocked_out(number, &recording, setting).await?,
                Question::Shuffled => self.shuffled(number, &recording, setting).await?,
                Question::Paper => self.asked_of_the_paper(number, &recording).await?,
            }
        }
        self.discard(number)
    }

    /// The first unanswered question. It is read from the library, because another machine may have stored
    /// answers.
    async fn next_question(&self, number: u32) -> Result<Option<Question>, TrialError> {
        let answered = self.scores().await?.remove(&number);
        Ok(self.unanswered(answered.as_ref()).first().copied())
    }

    /// Answers the question [`Question::Catalogue`]: diagnosis with the whole catalogue.
    async fn diagnosed(
        &self,
        number: u32,
        recording: &Recording,
        setting: Setting<'_>,
    ) -> Result<(), TrialError> {
        let before = cpu_s();
        let (diagnosis, Compared { prepared, search, .. }) =
            diagnose(number, recording, setting).await?;
        let cpu_s = cpu_s() - before;
        let record = self.written(number, "", &diagnosis)?;
        let plan = self.opened(number)?;
        let scene = &plan.scene;
        let length = |hidden| detectability(recording, &prepared, &search, scene, hidden);
        let lengths: Vec<Option<f64>> =
            compute(|| scene.left_out.iter().map(length).collect::<Result<_, _>>())?;
        let score = score(&plan, &diagnosis, &lengths, cpu_s);
        self.keep(number, Question::Catalogue, &score, Some(record)).await
    }

    /// Answers the question [`Question::KnockedOut`]: diagnosis without the hidden kind in the catalogue.
    async fn knocked_out(
        &self,
        number: u32,
        recording: &Recording,
        setting: Setting<'_>,
    ) -> Result<(), TrialError> {
        let plan = self.opened(number)?;
        let without: Vec<String> =
            plan.scene.left_out.iter().map(|hidden| hidden.physics().to_owned()).collect();
        let setting = Setting { without: &without, ..setting };
        let (diagnosis, _) = diagnose(number, recording, setting).await?;
        let record = self.written(number, "-knocked-out", &diagnosis)?;
        let unknown = diagnosis.verdict == Verdict::UnknownPhysics;
        let place = tracktwin_trial::placed(&plan.scene, &diagnosis);
        let score = KnockedOut { verdict: diagnosis.verdict, unknown, place };
        self.keep(number, Question::KnockedOut, &score, Some(record)).await
    }

    /// Answers the question [`Question::Shuffled`]: diagnosis with shuffled sleepers at each speed.
    async fn shuffled(
        &self,
        number: u32,
        recording: &Recording,
        setting: Setting<'_>,
    ) -> Result<(), TrialError> {
        let orders = |speeds, sleepers| tracktwin_trial::orders(self.seed, speeds, sleepers);
        let setting = Setting { shuffle: Some(&orders), ..setting };
        let (diagnosis, _) = diagnose(number, recording, setting).await?;
        let record = self.written(number, "-shuffled", &diagnosis)?;
        self.keep(number, Question::Shuffled, &diagnosis.verdict, Some(record)).await
    }

    /// Answers the question [`Question::Paper`]: evaluation with surrogates and model selector.
    async fn asked_of_the_paper(
        &self,
        number: u32,
        recording: &Recording,
    ) -> Result<(), TrialError> {
        let Some(evaluator) = &self.paper else { return Ok(()) };
        let speeds = &evaluator.set().speeds_km_h;
        let evaluation = check_recording(recording, &evaluator.design_for(recording), speeds)
            .and_then(|()| compute(|| evaluator.evaluate(recording)))
            .map_err(|source| TrialError::Paper { number, source })?;
        let paper = Paper::of(&self.opened(number)?.scene, &evaluation);
        self.keep(number, Question::Paper, &paper, None).await
    }

    /// The case's recording, created if missing.
    fn record_case(&self, number: u32) -> Result<Recording, TrialError> {
        let folder = self.recording(number);
        if !folder.try_exists().map_err(|source| file(&folder, source))? {
            // Whoever is stopped meanwhile leaves no half recording under its name.
            let unfinished = folder.with_extension("unfinished");
            let _ = std::fs::remove_dir_all(&unfinished);
            let plan = self.plan(number);
            compute(|| plan.making.record(&plan.scene, &unfinished))?;
            std::fs::rename(&unfinished, &folder).map_err(|source| file(&folder, source))?;
        }
        Ok(Recording::open(folder)?)
    }

    fn discard(&self, number: u32) -> Result<(), TrialError> {
        let folder = self.recording(number);
        if !self.discard_recordings || !folder.exists() {
            return Ok(());
        }
        std::fs::remove_dir_all(&folder).map_err(|source| file(&folder, source))
    }

    /// Writes a diagnosis to its file. Returns the library's record of it.
    fn written(
        &self,
        number: u32,
        control: &str,
        diagnosis: &Diagnosis,
    ) -> Result<DiagnosisRecord, TrialError> {
        let path = self.folder.join(format!("diagnoses/{number:04}{control}.json"));
        let document = text(diagnosis);
        replace(&path, document.as_bytes())?;
        let record = provenance::diagnosis(diagnosis, document);
        Ok(DiagnosisRecord {
            recording: format!("trial {} case {number}{control}", self.seed),
            ..record
        })
    }

    /// The truth of a case, after a check of its seal.
    fn opened(&self, number: u32) -> Result<Plan, TrialError> {
        let path = self.folder.join(sealed(number));
        let content = std::fs::read(&path).map_err(|source| file(&path, source))?;
        let path = self.folder.join(SEALS);
        let seals = std::fs::read_to_string(&path).map_err(|source| file(&path, source))?;
        Seals::from_text(&seals)?.open(&sealed(number), &content)?;
        Ok(self.plan(number))
    }

    fn recording(&self, number: u32) -> PathBuf {
        self.folder.join(format!("recordings/{number:04}"))
    }
}

async fn diagnose(
    number: u32,
    recording: &Recording,
    setting: Setting<'_>,
) -> Result<(Diagnosis, Compared), TrialError> {
    let diagnosed = pipeline::diagnose::diagnose(recording, setting, &|_, _| ()).await;
    let Diagnosed { diagnosis, compared } =
        diagnosed.map_err(|source| TrialError::Diagnosis { number, source })?;
    Ok((diagnosis, compared.ok_or(TrialError::NoTrack { number })?))
}

/// CPU time used by this process, in s.
fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
