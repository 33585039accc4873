//! Domain check of a recording: the sleepers whose features are outside the library.
//!
//! A track outside the library is outside at many sleepers, and the mean over these sleepers is more
//! significant than a single one. The check therefore tests running windows of one, three, seven and all
//! sleepers. A sleeper is outside if any window that contains it is outside.

use crate::{BySpeeds, Error, Flag, SleeperFeatures};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use tracktwin_parameters::Parameter;
use tracktwin_surrogate::{Beyond, Domain, Judgement, Side, TrainingSet};

/// False-alarm rate: share of the library's own tracks in which at least one sleeper may be flagged.
const FALSE_RATE: f64 = 0.01;
/// Numbers of sleepers in a running window; the whole track is tested in addition.
const SIZES: [usize; 3] = [1, 3, 7];
/// An end is reported if it explains at least this share of the sleepers outside.
const NAMED_FROM: f64 = 0.2;

/// Part of a recording outside the library.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct OutsideLibrary {
    /// Share of the evaluated sleepers, 0 to 1.
    pub share: f64,
    /// Share of the evaluated sleepers that could not be tested, 0 to 1.
    pub not_tested: f64,
    /// Parameters whose range must be wider, sorted by the number of sleepers they explain, largest first.
    pub widen: Vec<Parameter>,
    /// The ends of ranges that the track exceeds.
    pub ends: Vec<BeyondEnd>,
    /// Number of sleepers outside that no range explains.
    pub unexplained: usize,
}

/// An end of a parameter range that some sleepers exceed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeyondEnd {
    /// The parameter.
    pub parameter: Parameter,
    /// The end of the range.
    pub side: Side,
    /// Value of the library at this end, in the parameter's unit.
    pub value: f64,
    /// Number of sleepers beyond this end.
    pub sleepers: usize,
}

/// Result of the domain check of a sleeper: whether it is outside, and the end that it exceeds.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DomainTest {
    pub(crate) outside: bool,
    is_tested: bool,
    beyond: Option<Beyond>,
    /// Sleepers in the window that is outside.
    window: usize,
}

impl DomainTest {
    /// Adds the result of a window; larger windows determine the exceeded range more reliably.
    fn take(&mut self, judgement: &Judgement, window: usize) {
        self.is_tested = true;
        if !judgement.is_outside() {
            return;
        }
        self.outside = true;
        if judgement.beyond.is_some() && window >= self.window {
            self.beyond = judgement.beyond;
            self.window = window;
        }
    }

    /// The flag of the sleeper, if it needs one.
    pub(crate) const fn flag(&self) -> Option<Flag> {
        if self.outside {
            Some(Flag::OutsideLibrary)
        } else if self.is_tested {
            None
        } else {
            Some(Flag::DomainNotTested)
        }
    }
}

/// Domain check of every sleeper, in the order of `sleepers`.
///
/// Sleepers with incomplete windows take the result of the whole track only. If the windows of all sleepers with
/// the same speeds are incomplete, none of these is tested.
///
/// # Errors
/// Errors of [`Domain`].
pub(crate) fn judge(
    sleepers: &[SleeperFeatures],
    library: &TrainingSet,
    cache: &BySpeeds,
) -> Result<Vec<DomainTest>, Error> {
    let mut tests = vec![DomainTest::default(); sleepers.len()];
    let grouped = by_speeds(sleepers);
    let groups = grouped.len();
    for (speeds, members) in grouped {
        let windows = Windows::of(sleepers, members, cache.domain(library, &speeds)?)?;
        for size in windows.sizes() {
            for first in 0..=windows.whole.len() - size {
                let judgement = windows.judge(first, size, groups)?;
                for &index in windows.held(first, size) {
                    tests[index].take(&judgement, size);
                }
            }
        }
    }
    Ok(tests)
}

/// Domain check of the last sleeper only, with the rules of [`judge`].
///
/// # Errors
/// Errors of [`Domain`].
pub(crate) fn judge_last(
    sleepers: &[SleeperFeatures],
    library: &TrainingSet,
    cache: &BySpeeds,
) -> Result<DomainTest, Error> {
    let mut test = DomainTest::default();
    let grouped = by_speeds(sleepers);
    let groups = grouped.len();
    let last = sleepers.len().wrapping_sub(1);
    for (speeds, members) in grouped {
        if members.last() != Some(&last) {
            continue;
        }
        let windows = Windows::of(sleepers, members, cache.domain(library, &speeds)?)?;
        for size in windows.sizes() {
            let first = windows.whole.len() - size;
            if windows.held(first, size).last() == Some(&last) {
                test.take(&windows.judge(first, size, groups)?, size);
            }
        }
    }
    Ok(test)
}

/// Indices of the sleepers, grouped by their speeds.
pub(crate) fn by_speeds(sleepers: &[SleeperFeatures]) -> BTreeMap<Vec<usize>, Vec<usize>> {
    let mut by_speeds: BTreeMap<Vec<usize>, Vec<usize>> = BTreeMap::new();
    for (index, sleeper) in sleepers.iter().enumerate() {
        let key = sleeper.speeds.iter().map(|known| known.speed).collect();
        by_speeds.entry(key).or_default().push(index);
    }
    by_speeds
}

/// Running windows over the sleepers that have the same speeds.
struct Windows {
    domain: Arc<Domain>,
    members: Vec<usize>,
    /// The members whose own windows are complete.
    whole: Vec<usize>,
    /// Coordinates of each sleeper in `whole`.
    coordinates: Vec<Vec<f64>>,
}

impl Windows {
    fn of(
        sleepers: &[SleeperFeatures],
        members: Vec<usize>,
        domain: Arc<Domain>,
    ) -> Result<Self, Error> {
        let whole: Vec<usize> =
            members.iter().copied().filter(|&index| is_whole(&sleepers[index])).collect();
        let coordinates = whole
            .iter()
            .map(|&index| {
                let speeds = &sleepers[index].speeds;
                let observed: Vec<f64> =
                    speeds.iter().flat_map(|known| known.log_power.iter().copied()).collect();
                domain.coordinates(&observed)
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self { domain, members, whole, coordinates })
    }

    /// Sleepers in a window, in ascending order; the last size is the whole track.
    fn sizes(&self) -> Vec<usize> {
        let count = self.whole.len();
        let mut sizes: Vec<usize> =
            SIZES.into_iter().filter(|&size| size < count).chain([count]).collect();
        sizes.retain(|&size| size > 0);
        sizes
    }

    /// Tests the window of `size` sleepers that begins with the `first`; the `groups` sets of speeds share
    /// the false-alarm rate.
    fn judge(&self, first: usize, size: usize, groups: usize) -> Result<Judgement, Error> {
        let windows = self.whole.len() + 1 - size;
        let probability = FALSE_RATE / (groups * self.sizes().len() * windows) as f64;
        Ok(self.domain.judge(&mean(&self.coordinates[first..first + size]), size, probability)?)
    }

    /// The sleepers to which the result of a window applies.
    fn held(&self, first: usize, size: usize) -> &[usize] {
        if size == self.whole.len() { &self.members } else { &self.whole[first..first + size] }
    }
}

fn is_whole(sleeper: &SleeperFeatures) -> bool {
    !sleeper.flags.iter().any(|flag| matches!(flag, Flag::IncompleteWindow | Flag::ShortMargin))
}

fn mean(rows: &[Vec<f64>]) -> Vec<f64> {
    let mut mean = vec![0.0; rows[0].len()];
    let share = 1.0 / rows.len() as f64;
    for row in rows {
        mean.iter_mut().zip(row).for_each(|(sum, value)| *sum += share * value);
    }
    mean
}

impl OutsideLibrary {
    /// Summary of the domain checks of a recording.
    pub(crate) fn of(tests: &[DomainTest], library: &TrainingSet) -> Self {
        let outside: Vec<&DomainTest> = tests.iter().filter(|test| test.outside).collect();
        let mut counts: BTreeMap<Beyond, usize> = BTreeMap::new();
        for beyond in outside.iter().filter_map(|test| test.beyond) {
            *counts.entry(beyond).or_default() += 1;
        }
        let least = (NAMED_FROM * outside.len() as f64).ceil() as usize;
        let mut ends: Vec<BeyondEnd> = counts
            .into_iter()
            .filter(|&(_, sleepers)| sleepers >= least)
            .map(|(Beyond { parameter, side }, sleepers)| {
                let value = end_of_range(library, parameter, side);
                BeyondEnd { parameter, side, value, sleepers }
            })
            .collect();
        ends.sort_by_key(|end| std::cmp::Reverse(end.sleepers));
        let mut widen: Vec<Parameter> = Vec::new();
        for end in &ends {
            if !widen.contains(&end.parameter) {
                widen.push(end.parameter);
            }
        }
        let unexplained = outside.iter().filter(|test| test.beyond.is_none()).count();
        let share_of = |count: usize| count as f64 / tests.len().max(1) as f64;
        let not_tested = share_of(tests.iter().filter(|test| !test.is_tested).count());
        Self { share: share_of(outside.len()), not_tested, widen, ends, unexplained }
    }

    /// Whether most sleepers are outside or not tested; the recording as a whole then has no valid result.
    pub fn is_most(&self) -> bool {
        self.share + self.not_tested > 0.5
    }

    /// Sentences on the sleepers outside or not tested, and the remedy; empty if all are inside.
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        if self.not_tested > 0.0 {
            sentences.push(format!(
"{:.0} % of the sleepers are not tested against the library, because no pass covers a whole window with its margins: nothing says whether their estimates are valid. Record longer passes without gaps.",
                (100.0 * self.not_tested).ceil()
            ));
        }
        if self.share > 0.0 {
            sentences.push(format!(
                "{:.0} % of the sleepers are outside the library: their estimates are not valid.",
                (100.0 * self.share).ceil()
            ));
        }
        sentences.extend(self.ends.iter().map(BeyondEnd::sentence));
        if self.unexplained > 0 {
            sentences.push(format!(
"{} {} outside in a way that a step beyond one end does not explain: a parameter lies far beyond its range, or physics, vehicle or surface differ; compare the ranges in the campaign with what is known of the track, and see `tracktwin diagnose`.",
                self.unexplained,
                if self.unexplained == 1 { "sleeper is" } else { "sleepers are" }
            ));
        }
        sentences
    }
}

impl BeyondEnd {
    /// A sentence on the end and its remedy.
    fn sentence(&self) -> String {
        let Self { parameter, side, value, sleepers } = self;
        let than = match side {
            Side::Low => "lower than",
            Side::High => "higher than",
        };
        let whose =
            if *sleepers == 1 { "1 sleeper".to_owned() } else { format!("{sleepers} sleepers") };
        format!(
            "{} at {whose} is {than} the library's {} {}: widen `{parameter}` in the campaign, then simulate and train again.",
            parameter.label(),
            rounded(*value),
            parameter.unit()
        )
    }
}

/// `value` with three significant digits.
fn rounded(value: f64) -> String {
    let text = format!("{value:.2e}");
    match text.parse::<f64>() {
        Ok(number) if (1e-3..1e5).contains(&number.abs()) => number.to_string(),
        Ok(number) => format!("{number:e}"),
        Err(_) => text,
    }
}

fn end_of_range(library: &TrainingSet, parameter: Parameter, side: Side) -> f64 {
    let column = library.varied.iter().position(|&varied| varied == parameter);
    column.map_or(f64::NAN, |column| {
        let [low, high] = library.range(column);
        match side {
            Side::Low => low,
            Side::High => high,
        }
    })
}
