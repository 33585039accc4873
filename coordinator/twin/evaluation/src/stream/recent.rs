//! The sleepers evaluated last, which are the reference for the next one.

use super::row::Evaluated;
use crate::estimate::{estimates, evaluated};
use crate::evaluation::Estimates;
use crate::matches::Matcher;
use crate::outside::judge_last;
use crate::{Error, SleeperFeatures, SpeedFeatures, Twin, Unevenness};
use tracktwin_signal::recording::Recording;

/// Number of sleepers, including the current one, that determine unevenness and domain check.
///
/// This is enough for the running windows of the domain check and for a variance within a third.
pub(super) const RECENT_MAX: usize = 25;

/// Evaluates sleepers one by one. Each is treated as the last sleeper of a recording of at most
/// [`RECENT_MAX`] sleepers.
pub(super) struct Recent<'a> {
    twin: Twin<'a>,
    matcher: Matcher<'a>,
    features: Vec<SleeperFeatures>,
    /// Estimates with the standard deviations of an even track.
    estimates: Vec<Estimates>,
    outside: Vec<bool>,
}

impl<'a> Recent<'a> {
    /// Makes the evaluator without sleepers and prepares the models of every single speed.
    ///
    /// # Errors
    /// The errors of [`Self::evaluate`].
    pub(super) fn new(twin: Twin<'a>, section: &Recording) -> Result<Self, Error> {
        let mut recent = Self {
            twin,
            matcher: Matcher::new(twin.library),
            features: Vec::new(),
            estimates: Vec::new(),
            outside: Vec::new(),
        };
        if !section.sleepers.is_empty() {
            recent.prepare(section)?;
        }
        Ok(recent)
    }

    /// Evaluates entries of the library, so that factors, domains and their limits are computed in advance.
    fn prepare(&mut self, section: &Recording) -> Result<(), Error> {
        let library = self.twin.library;
        let bins = library.frequencies_hz.len();
        for (speed, table) in library.log_power.iter().enumerate() {
            for log_power in table.chunks(bins).take(RECENT_MAX) {
                let known = SpeedFeatures { speed, passes: 1, log_power: log_power.to_vec() };
                let features = SleeperFeatures { speeds: vec![known], ..SleeperFeatures::none(0) };
                self.evaluate(section, features)?;
            }
            self.features.clear();
            self.estimates.clear();
            self.outside.clear();
        }
        Ok(())
    }

    /// Evaluates the next sleeper of the section from its features, which must have at least one speed.
    ///
    /// # Errors
    /// Errors of the models and of the library.
    pub(super) fn evaluate(
        &mut self,
        section: &Recording,
        features: SleeperFeatures,
    ) -> Result<Evaluated, Error> {
        let Twin { library, by_speeds, .. } = self.twin;
        if self.features.len() == RECENT_MAX {
            self.features.remove(0);
            self.estimates.remove(0);
            self.outside.remove(0);
        }
        let mut estimate = estimates(std::slice::from_ref(&features), &self.twin)?.remove(0);
        self.features.push(features.clone());
        self.estimates.push(estimate.clone());
        let test = judge_last(&self.features, library, by_speeds)?;
        self.outside.push(test.outside);
        let told = self.estimates.iter().zip(&self.outside).filter(|(_, outside)| !**outside);
        let unevenness = Unevenness::of(&told.map(|(estimate, _)| estimate).collect::<Vec<_>>());
        let even = unevenness.widen(&mut estimate);
        let matcher = &mut self.matcher;
        let mut sleeper = evaluated(section, &self.twin, matcher, features, (estimate, even))?;
        sleeper.flags.extend(test.flag());
        Ok(Evaluated { sleeper, unevenness: unevenness.scatter })
    }
}
