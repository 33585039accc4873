//! Progress of long work: a bar in a terminal, otherwise periodic lines.

use super::println_stderr;
use crate::pipeline::diagnose_sections::At;
use crate::pipeline::models::group_name;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use parking_lot::Mutex;
use std::cell::RefCell;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Interval of the lines without a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Steps of the bar of a stage that reports shares.
const STEPS: u64 = 100;

/// The progress of one stage of a command, on standard error.
pub(super) struct Progress {
    stage: &'static str,
    bar: ProgressBar,
    /// Time of the last line; without a terminal only.
    last_line: Option<Instant>,
    begun: Instant,
    begun_at: u64,
}

impl Progress {
    /// Starts a stage of `total` steps, `done` of which are already done.
    pub(super) fn begin(stage: &'static str, done: u64, total: u64) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target =
            if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let style = "{prefix:12} {wide_bar} {pos}/{len}  {per_sec:>8}  {eta:>4} left {msg}";
        let bar = ProgressBar::with_draw_target(Some(total), target)
            .with_prefix(stage)
            .with_style(ProgressStyle::with_template(style).expect("the template is well formed"));
        bar.set_position(done);
        bar.reset_eta();
        let begun = Instant::now();
        let last_line = (!terminal).then_some(begun);
        Self { stage, bar, last_line, begun, begun_at: done }
    }

    /// Shows the number of steps done, and a remark.
    pub(super) fn at(&mut self, done: u64, remark: &str) {
        self.bar.set_position(done);
        self.bar.set_message(remark.to_owned());
        if self.last_line.is_some_and(|last| last.elapsed() >= LINE_EVERY) {
            self.last_line = Some(Instant::now());
            self.line(done, remark);
        }
    }

    /// Ends the stage.
    pub(super) fn end(self) {
        self.bar.finish_and_clear();
        if self.last_line.is_some() {
            let seconds = self.begun.elapsed().as_secs_f64();
            println_stderr(&format!("{}: done in {seconds:.1} s", self.stage));
        }
    }

    fn line(&self, done: u64, remark: &str) {
        let total = self.bar.length().unwrap_or(done);
        let fresh = done.saturating_sub(self.begun_at);
        let left = match fresh {
            0 => "?".to_owned(),
            fresh => {
                let a_step = self.begun.elapsed().as_secs_f64() / fresh as f64;
                format!("{:.0} s", a_step * total.saturating_sub(done) as f64)
            }
        };
        println_stderr(&format!("{}: {done} of {total}, {left} left {remark}", self.stage));
    }
}

/// Line or bar of the current stage; it ends when the next stage begins.
#[derive(Default)]
pub(super) struct Stages(Mutex<Option<(&'static str, Progress)>>);

impl Stages {
    /// Shows the share of a stage that is done.
    pub(super) fn at(&self, stage: &'static str, share: f64) {
        let mut shown = self.0.lock();
        if shown.as_ref().is_none_or(|(known, _)| *known != stage) {
            if let Some((_, progress)) = shown.take() {
                progress.end();
            }
            *shown = Some((stage, Progress::begin(stage, 0, STEPS)));
        }
        if let Some((_, progress)) = shown.as_mut() {
            progress.at((share * STEPS as f64) as u64, "");
        }
    }

    /// Ends the current stage; another may begin.
    pub(super) fn end(&self) {
        if let Some((_, progress)) = self.0.lock().take() {
            progress.end();
        }
    }
}

/// Progress of a diagnosis: a line for each section of a long track, and the stages of a section.
#[derive(Default)]
pub(super) struct SectionStages {
    stages: Stages,
    /// Number of the current section, and the time at which the first one began.
    section: Mutex<Option<(usize, Instant)>>,
}

impl SectionStages {
    /// Shows the section and the share of its stage that is done.
    pub(super) fn at(&self, At { section, sections, place, stage, share }: At<'_>) {
        if sections > 1 {
            let mut known = self.section.lock();
            let begun = known.map_or_else(Instant::now, |(_, begun)| begun);
            if known.is_none_or(|(number, _)| number != section) {
                self.stages.end();
                let done = section - 1;
                let left = match done {
                    0 => String::new(),
                    done => {
                        let each = begun.elapsed().as_secs_f64() / done as f64;
                        let minutes = each * (sections - done) as f64 / 60.0;
                        format!(", about {} min left", minutes.ceil())
                    }
                };
                println_stderr(&format!("section {section} of {sections}, {place}{left}"));
            }
            *known = Some((section, begun));
        }
        if !stage.is_empty() {
            self.stages.at(stage, share);
        }
    }

    /// Ends the current stage.
    pub(super) fn end(&self) {
        self.stages.end();
    }
}

/// Progress of training; the first step states the number of groups.
#[derive(Default)]
pub(super) struct TrainingBar(RefCell<Option<Progress>>);

impl TrainingBar {
    /// Shows the group of models that is being trained.
    pub(super) fn at(&self, at: &tracktwin_surrogate::Progress<'_>) {
        let mut bar = self.0.borrow_mut();
        let bar = bar.get_or_insert_with(|| Progress::begin("training", 0, at.groups as u64));
        bar.at(at.finished as u64, &at.next.map(group_name).unwrap_or_default());
    }

    /// Ends the stage.
    pub(super) fn end(self) {
        self.0.into_inner().into_iter().for_each(Progress::end);
    }
}
