//! The trained models of a command.

use super::{OrInput, Stop};
use anyhow::Context;
use std::path::Path;
use tracktwin_surrogate::{INDEX, Trained};

/// Reads the trained models in a folder.
pub(super) fn load_models(folder: &Path) -> Result<Trained, Stop> {
    let failed = || {
        let shown = folder.display();
        if folder.join(INDEX).exists() {
            format!("{shown}: the models cannot be read; create them again with `tracktwin train`")
        } else {
            format!("{shown}: no models found; create them with `tracktwin train`")
        }
    };
    Trained::load(folder).with_context(failed).or_input()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_models_are_no_missing_ones() {
        let folder = tempfile::tempdir().unwrap();
        let said = || match load_models(folder.path()) {
            Err(Stop::Input(error)) => format!("{error:#}"),
            other => panic!("{:?}", other.map(|_| ())),
        };
        assert!(said().contains("no models found"), "{}", said());
        std::fs::write(folder.path().join(INDEX), "{}").unwrap();
        let damaged = said();
        assert!(damaged.contains("cannot be read") && damaged.contains("format is missing"));
        assert!(!damaged.contains("no models found"), "{damaged}");
    }
}
