//! Evaluation of samples while they are recorded, sleeper by sleeper.
//!
//! A feature depends only on the samples of its window and of a margin on either side. A sleeper is
//! therefore evaluated as soon as its right margin is complete, from the samples that begin with its left
//! margin. The features are identical, to the bit, to those of the whole pass. A gap or a sample that is
//! not finite ends a segment; the result is the same as for a recording with two passes.

mod recent;
mod row;
mod segment;
#[cfg(test)]
mod tests;

pub use row::{Evaluated, Outcome, Reason, Row};

use crate::check::check_sample_rate;
use crate::estimate::check_features;
use crate::speeds::{PassSpeed, SPEED_TOLERANCE};
use crate::{Error, ModelSpeeds, SleeperFeatures, Twin};
use recent::Recent;
use segment::Segment;
use std::collections::BTreeMap;
use std::ops::Range;
use tracktwin_signal::recording::{RATE_TOLERANCE, Recording, SleeperWindow};
use tracktwin_signal::samples::Sample;

/// The speed over a margin is compared with that over the window if at least this share of the margin is
/// there.
const PART_MIN: f64 = 0.25;
/// Share of the slowest model's speed; a window that takes longer than at this speed is given up.
const SLOWEST: f64 = 0.9;

/// Evaluates the sleepers of a section of track in the order in which a wheel rolls over them.
///
/// Memory is bounded by the window of the slowest model and two margins, and by a few sleepers.
pub struct Stream<'a> {
    section: &'a Recording,
    twin: Twin<'a>,
    speeds: &'a ModelSpeeds,
    /// Number of samples of a margin.
    margin: usize,
    /// Largest number of samples of a window with its margins.
    capacity: usize,
    segment: Segment,
    /// Index of the first sleeper without a row.
    next: usize,
    /// Index in the segment at which the window of `next` ends, after the wheel has passed it.
    end: Option<usize>,
    /// Sleepers that earlier segments cover in part, by index.
    open: BTreeMap<usize, Open>,
    recent: Recent<'a>,
}

/// A sleeper that has no row yet.
struct Open {
    features: SleeperFeatures,
    /// Reason why a segment gave no features.
    reason: Option<Reason>,
}

impl<'a> Stream<'a> {
    /// Makes a stream over the sleepers of `section`; the passes of `section` are not used. The function
    /// prepares the models of every speed, so that no row waits for them. The first row with a new number
    /// of samples takes longer, because its transform is planned then.
    ///
    /// # Errors
    /// [`Error::OtherFeatures`], [`Error::NoModel`], [`Error::Surrogate`], or [`Error::Rate`] if the sample
    /// rate of the section is too low for the features.
    pub fn new(section: &'a Recording, twin: Twin<'a>) -> Result<Self, Error> {
        check_features(&twin)?;
        twin.models.belongs_to(&twin.library.library_digest)?;
        let rate_hz = section.sample_rate_hz;
        check_sample_rate(twin.extractor, rate_hz)?;
        let speeds_km_h = twin.models.speeds_km_h();
        let slowest_m_s = speeds_km_h.iter().copied().fold(f64::INFINITY, f64::min) / 3.6;
        let fastest_m_s = speeds_km_h.iter().copied().fold(0.0, f64::max) / 3.6;
        let margin = twin.extractor.margin_samples(rate_hz);
        let window = (section.spacing_m / (SLOWEST * slowest_m_s) * rate_hz).ceil() as usize;
        Ok(Self {
            section,
            twin,
            speeds: twin.by_speeds.speeds(twin.library),
            margin,
            capacity: window + 2 * (margin + 1),
            segment: Segment::new(rate_hz, fastest_m_s),
            next: 0,
            end: None,
            open: BTreeMap::new(),
            recent: Recent::new(twin, section)?,
        })
    }

    /// Largest number of samples in memory.
    pub const fn samples_max(&self) -> usize {
        2 * self.capacity
    }

    /// Adds the next sample and returns the rows of the sleepers that this sample completes.
    ///
    /// # Errors
    /// [`Error::OtherSampleRate`], [`Error::Features`] or [`Error::Surrogate`].
    pub fn push(&mut self, sample: &Sample) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        if self.next == self.section.sleepers.len() {
            return Ok(rows);
        }
        let rate_hz = self.section.sample_rate_hz;
        check_rate(self.segment.count_time(sample.time_s), rate_hz)?;
        if let Some(reason) = self.segment.interruption(sample) {
            self.interrupt(reason, &mut rows)?;
            self.segment.restart(reason);
            self.end = None;
            if reason == Reason::NotFinite {
                return Ok(rows);
            }
        }
        self.segment.push(sample);
        while self.is_ready() {
            self.take(self.next, None)?;
            rows.push(self.row()?);
        }
        if self.segment.len() == self.samples_max() {
            self.make_room(&mut rows)?;
        }
        Ok(rows)
    }

    /// Ends the stream and returns the rows of all remaining sleepers.
    ///
    /// # Errors
    /// The errors of [`Self::push`].
    pub fn finish(mut self) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        self.interrupt(Reason::NotCovered, &mut rows)?;
        while self.next < self.section.sleepers.len() {
            rows.push(self.row()?);
        }
        Ok(rows)
    }

    fn window(&self, sleeper: usize) -> Option<SleeperWindow> {
        (sleeper < self.section.sleepers.len()).then(|| self.section.sleeper_window(sleeper))
    }

    /// Whether the segment has all samples that the next sleeper's features depend on.
    fn is_ready(&mut self) -> bool {
        let Some(window) = self.window(self.next) else { return false };
        let positions = self.segment.position_m();
        if self.end.is_none() && positions.last().is_some_and(|last| *last > window.to_m) {
            self.end = Some(positions.partition_point(|position| *position <= window.to_m));
        }
        // Also where the segment begins behind the window: one wrong position must not pass sleepers.
        self.end.is_some_and(|end| positions.len() >= end + self.margin)
    }

    /// At the end of a segment, takes the available features of every window that the segment covers in
    /// part, and adds the rows of the sleepers that the segment has passed. Windows before the segment wait
    /// for the next segment.
    fn interrupt(&mut self, reason: Reason, rows: &mut Vec<Row>) -> Result<(), Error> {
        let [Some(&first_m), Some(&last_m)] = self.segment.ends_m() else { return Ok(()) };
        let mut sleeper = self.next + self.count_before(first_m);
        while self.window(sleeper).is_some_and(|window| window.from_m <= last_m) {
            self.take(sleeper, Some(reason))?;
            sleeper += 1;
        }
        let is_passed = |window: SleeperWindow| (first_m..last_m).contains(&window.to_m);
        while self.window(self.next).is_some_and(is_passed) {
            rows.push(self.row()?);
        }
        Ok(())
    }

    /// Number of sleepers without a row whose windows end before a position in m.
    fn count_before(&self, position_m: f64) -> usize {
        let left = &self.section.sleepers[self.next..];
        let spacing_m = self.section.spacing_m;
        left.partition_point(|it| SleeperWindow::around(it.x_m, spacing_m).to_m < position_m)
    }

    /// Takes the features of a sleeper from the segment; `cut` is the reason if the segment was
    /// interrupted.
    fn take(&mut self, sleeper: usize, cut: Option<Reason>) -> Result<(), Error> {
        let window = self.section.sleeper_window(sleeper);
        let Self { segment, twin, open, .. } = self;
        let open = open.entry(sleeper).or_insert_with(|| Open::new(sleeper));
        let Some(samples) = window.samples(segment.position_m()) else {
            open.reason = open.reason.or(cut).or(segment.after());
            return Ok(());
        };
        check_rate(segment.observed_rate_hz(), self.section.sample_rate_hz)?;
        match speed(segment, &samples, self.margin, self.speeds) {
            Err(reason) => open.reason = Some(reason),
            Ok(speed) => {
                let (share, signal) = (window.share(segment.position_m()), segment.signal());
                let taken = open.features.take(twin.extractor, share, samples, &signal, &speed);
                taken.map_err(|source| Error::Features {
                    file: "of the stream".to_owned(),
                    sleeper: self.section.sleepers[sleeper].id.clone(),
                    source,
                })?;
            }
        }
        Ok(())
    }

    /// The row of the next sleeper.
    fn row(&mut self) -> Result<Row, Error> {
        let sleeper = self.next;
        let open = self.open.remove(&sleeper).unwrap_or_else(|| Open::new(sleeper));
        let reason = open.reason.or_else(|| self.reason_before()).unwrap_or(Reason::NotCovered);
        self.next += 1;
        self.end = None;
        if !open.features.speeds.is_empty() {
            let evaluated = self.recent.evaluate(self.section, open.features)?;
            return Ok(Row::new(Outcome::Evaluated(Box::new(evaluated))));
        }
        let place = &self.section.sleepers[sleeper];
        Ok(Row::new(Outcome::Unevaluated { id: place.id.clone(), x_m: place.x_m, reason }))
    }

    /// Reason of the interruption before the segment, if the next window lies before the segment.
    fn reason_before(&self) -> Option<Reason> {
        let [Some(first_m), _] = self.segment.ends_m() else { return None };
        self.segment.after().filter(|_| self.count_before(*first_m) > 0)
    }

    /// Drops samples that no window needs, and gives up windows that take too long.
    fn make_room(&mut self, rows: &mut Vec<Row>) -> Result<(), Error> {
        loop {
            let positions = self.segment.position_m();
            let first = match self.window(self.next) {
                Some(window) => positions.partition_point(|position| *position < window.from_m),
                None => positions.len(),
            };
            // One more than the margin: the share of the window is that of the whole segment.
            self.segment.drop_first(first.saturating_sub(self.margin + 1));
            self.end = None;
            let held = self.segment.len();
            if held <= self.capacity {
                return Ok(());
            }
            let speed_km_h = self.segment.speed_km_h(held - self.capacity..held);
            let next = self.next;
            let open = self.open.entry(next).or_insert_with(|| Open::new(next));
            open.reason = Some(Reason::OtherSpeed { speed_km_h });
            rows.push(self.row()?);
        }
    }
}

impl Open {
    const fn new(sleeper: usize) -> Self {
        Self { features: SleeperFeatures::none(sleeper), reason: None }
    }
}

/// The speed of the models for window and margins; an error if the speed changes or no model is for it.
fn speed(
    segment: &Segment,
    samples: &Range<usize>,
    margin: usize,
    known: &ModelSpeeds,
) -> Result<PassSpeed, Reason> {
    let before = samples.start.saturating_sub(margin)..samples.start;
    let after = samples.end..(samples.end + margin).min(segment.len());
    let whole = before.start..after.end;
    let is_long = |part: &Range<usize>| part.len() as f64 >= PART_MIN * margin as f64;
    let parts = [before, after].into_iter().filter(is_long).chain([samples.clone()]);
    let speeds = parts.map(|part| segment.speed_km_h(part)).filter(|speed| !speed.is_nan());
    let ends = |[low, high]: [f64; 2], speed: f64| [low.min(speed), high.max(speed)];
    let [low, high] = speeds.fold([f64::INFINITY, 0.0], ends);
    if high > (1.0 + 2.0 * SPEED_TOLERANCE) * low {
        return Err(Reason::SpeedChanges { speeds_km_h: [low, high] });
    }
    let speed_km_h = segment.speed_km_h(whole);
    let speed = known.of_pass(speed_km_h).ok_or(Reason::OtherSpeed { speed_km_h })?;
    if segment.is_coarse(samples.clone()) { Err(Reason::CoarsePosition) } else { Ok(speed) }
}

/// Returns an error if the observed sample rate (in Hz, with its relative uncertainty) contradicts the
/// declared one.
fn check_rate(observed: Option<(f64, f64)>, declared_hz: f64) -> Result<(), Error> {
    match observed {
        Some((observed_hz, uncertainty))
            if (observed_hz / declared_hz - 1.0).abs() > RATE_TOLERANCE.max(uncertainty) =>
        {
            Err(Error::OtherSampleRate { observed_hz, declared_hz })
        }
        _ => Ok(()),
    }
}
