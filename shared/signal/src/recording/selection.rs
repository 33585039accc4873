//! Passes of one rail and of one axle, among those of a recording with several measuring channels.

use super::error::{Fault, RecordingError};
use super::manifest::PassEntry;
use std::path::Path;

/// The passes of a recording that a user selects. A vehicle measures on both rails and on several axles at
/// once; each such channel is a pass of its own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Name of the rail. `None` if all passes are over one rail.
    pub rail: Option<String>,
    /// Name of the axle. `None` for all axles.
    pub axle: Option<String>,
}

/// Why a selection is refused.
#[derive(Debug, thiserror::Error)]
pub enum SelectionFault {
    /// The passes are over several rails, and none is selected.
    #[error(
        "are over several rails ({rails}); each is evaluated for itself: select one with --rail"
    )]
    SeveralRails {
        /// Names of the rails.
        rails: String,
    },
    /// No pass is of the selected rail or axle.
    #[error("none is of the {what} `{name}`; known are: {known}")]
    NoSuchChannel {
        /// `rail` or `axle`.
        what: &'static str,
        /// The selected name.
        name: String,
        /// Names in the file.
        known: String,
    },
}

impl Selection {
    /// Numbers and entries of the selected passes.
    ///
    /// # Errors
    /// [`RecordingError`] if no pass is selected, or if the passes are over several rails and none is
    /// selected.
    pub(super) fn of<'a>(
        &self,
        manifest: &Path,
        passes: &'a [PassEntry],
    ) -> Result<Vec<(usize, &'a PassEntry)>, RecordingError> {
        let fail = |fault| Err(RecordingError::new(manifest, "passes", Fault::Selection(fault)));
        let stated = |pass: &'a PassEntry| pass.rail.as_deref().or(Some("not stated"));
        let different = names(passes.iter().map(stated));
        if self.rail.is_none() && different.len() > 1 {
            return fail(SelectionFault::SeveralRails { rails: different.join(", ") });
        }
        let rails = names(passes.iter().map(|pass| pass.rail.as_deref()));
        let is_of = |pass: &PassEntry| {
            let alike = |asked: &Option<String>, stated: &Option<String>| {
                asked.is_none() || asked == stated
            };
            alike(&self.rail, &pass.rail) && alike(&self.axle, &pass.axle)
        };
        let selected: Vec<_> = passes.iter().enumerate().filter(|(_, pass)| is_of(pass)).collect();
        if selected.is_empty() && !passes.is_empty() {
            let of_rail = |pass: &&PassEntry| self.rail.is_none() || self.rail == pass.rail;
            let axles = names(passes.iter().filter(of_rail).map(|pass| pass.axle.as_deref()));
            return fail(match (&self.rail, &self.axle) {
                (Some(rail), _) if !rails.contains(&rail.as_str()) => {
                    SelectionFault::NoSuchChannel {
                        what: "rail",
                        name: rail.clone(),
                        known: known(&rails),
                    }
                }
                (_, axle) => SelectionFault::NoSuchChannel {
                    what: "axle",
                    name: axle.clone().unwrap_or_default(),
                    known: known(&axles),
                },
            });
        }
        Ok(selected)
    }

    /// Text after the name of a recording: `, rail left, axle 1`.
    pub(super) fn suffix(&self) -> String {
        let part = |what: &str, name: &Option<String>| {
            name.as_ref().map(|name| format!(", {what} {name}")).unwrap_or_default()
        };
        part("rail", &self.rail) + &part("axle", &self.axle)
    }
}

/// The different names, in their order.
fn names<'a>(of: impl Iterator<Item = Option<&'a str>>) -> Vec<&'a str> {
    let mut names = Vec::new();
    for name in of.flatten() {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn known(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn passes() -> Vec<PassEntry> {
        let pass = |rail: &str, axle: &str| PassEntry {
            file: format!("{rail}-{axle}.parquet"),
            speed_km_h: 80.0,
            rail: Some(rail.to_owned()),
            axle: Some(axle.to_owned()),
            contact_loss_share: None,
        };
        vec![pass("left", "1"), pass("right", "1"), pass("left", "2"), pass("right", "2")]
    }

    fn select(rail: Option<&str>, axle: Option<&str>) -> Result<Vec<usize>, String> {
        let passes = passes();
        let selection = Selection { rail: rail.map(str::to_owned), axle: axle.map(str::to_owned) };
        let selected = selection.of(Path::new("recording.json"), &passes);
        selected
            .map(|selected| selected.into_iter().map(|(index, _)| index).collect())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn one_rail_is_selected_with_all_its_axles_or_one() {
        assert_eq!(select(Some("right"), None), Ok(vec![1, 3]));
        assert_eq!(select(Some("left"), Some("2")), Ok(vec![2]));
    }

    #[test]
    fn two_rails_are_never_mixed_and_unknown_names_are_refused_with_the_known_ones() {
        let refused = select(None, Some("1")).unwrap_err();
        assert!(refused.contains("left, right") && refused.contains("--rail"), "{refused}");
        let refused = select(Some("middle"), None).unwrap_err();
        assert!(refused.contains("rail `middle`") && refused.contains("left, right"), "{refused}");
        let refused = select(Some("left"), Some("3")).unwrap_err();
        assert!(refused.contains("axle `3`") && refused.contains("1, 2"), "{refused}");
    }

    #[test]
    fn passes_that_state_no_rail_are_of_one() {
        let mut passes = passes();
        for pass in &mut passes {
            (pass.rail, pass.axle) = (None, None);
        }
        let path = Path::new("recording.json");
        assert_eq!(Selection::default().of(path, &passes).unwrap().len(), 4);
        let left = Selection { rail: Some("left".to_owned()), axle: None };
        let refused = left.of(path, &passes).unwrap_err().to_string();
        assert!(refused.contains("known are: none"), "{refused}");
    }
}
