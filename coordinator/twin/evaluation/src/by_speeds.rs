//! What is computed from library and models for its speeds, or for a set of them, at its first use.

use crate::{Error, METHOD_FEATURE, ModelSpeeds};
use parking_lot::Mutex;
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};
use tracktwin_surrogate::{Domain, Stack, Trained, TrainingSet};

/// One value for each set of speeds, given by their indices among the speeds of the models.
type Cache<T> = Mutex<HashMap<Vec<usize>, Arc<T>>>;

/// Cache of what is computed once for one library: its mean features, domains and combinations of models.
#[derive(Default)]
pub struct BySpeeds {
    speeds: OnceLock<ModelSpeeds>,
    domains: Cache<Domain>,
    stacks: Cache<Stack>,
}

impl BySpeeds {
    /// Speeds of the library, with its mean ln-powers.
    pub(crate) fn speeds(&self, library: &TrainingSet) -> &ModelSpeeds {
        self.speeds.get_or_init(|| ModelSpeeds::of(library))
    }

    /// Domain of the library at these speeds.
    pub(crate) fn domain(
        &self,
        library: &TrainingSet,
        speeds: &[usize],
    ) -> Result<Arc<Domain>, Error> {
        kept(&self.domains, speeds, || Domain::of(library, speeds))
    }

    /// Combination of the models of these single speeds.
    pub(crate) fn stack(
        &self,
        models: &Trained,
        library: &TrainingSet,
        speeds: &[usize],
    ) -> Result<Arc<Stack>, Error> {
        kept(&self.stacks, speeds, || Stack::fit(models, library, speeds, METHOD_FEATURE))
    }
}

/// The value for these speeds; computed if the cache lacks it.
///
/// The cache is not locked meanwhile: a thread that waits for its share of `compute` may begin another evaluation.
fn kept<T>(
    cache: &Cache<T>,
    speeds: &[usize],
    compute: impl FnOnce() -> Result<T, tracktwin_surrogate::Error>,
) -> Result<Arc<T>, Error> {
    let known = cache.lock().get(speeds).cloned();
    if let Some(value) = known {
        return Ok(value);
    }
    let value = Arc::new(compute()?);
    // Another thread may have been faster; its value is the same.
    Ok(Arc::clone(cache.lock().entry(speeds.to_vec()).or_insert(value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_computed_without_the_lock_and_once() {
        let cache = Cache::default();
        let first = kept(&cache, &[0, 2], || {
            assert!(cache.try_lock().is_some(), "an evaluation inside would wait for itself");
            Ok(1)
        });
        let again = kept(&cache, &[0, 2], || panic!("it is known"));
        assert_eq!((*first.unwrap(), *again.unwrap()), (1, 1));
        assert_eq!(*kept(&cache, &[2], || Ok(2)).unwrap(), 2);
    }
}
