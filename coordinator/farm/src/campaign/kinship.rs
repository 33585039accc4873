//! Relation of a campaign to another of the same name.

use super::Campaign;
use serde_json::Value;
use tracktwin_parameters::{OWEN_POINTS_MAX, Sequence};

/// Maximum number of differences listed; the message only counts the others.
const LISTED_MAX: usize = 4;

/// Relation of a campaign to one in the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kinship {
    /// Only the sampling sequence differs. The file does not name a sequence; the number of cases
    /// determines it.
    OtherSequence {
        /// The problem and its remedy, as text.
        remedy: String,
    },
    /// The definition differs: it is another campaign.
    Other {
        /// The differences as text: `simulation.time_step_s (1e-5, was 2e-5)`.
        differences: String,
    },
}

impl Campaign {
    /// Relation to the stored campaign `id` with the definition `definition_json`.
    pub fn kinship(&self, id: &str, definition_json: &str) -> Kinship {
        let own = serde_json::from_str(&self.definition_json()).unwrap_or(Value::Null);
        let other = serde_json::from_str(definition_json).unwrap_or(Value::Null);
        let mut paths = Vec::new();
        compare("", &own, &other, &mut paths);
        match &paths[..] {
            [only] if self.sequence_by_cases && only.starts_with("sequence ") => {
                Kinship::OtherSequence { remedy: self.other_sequence(id) }
            }
            _ => {
                let listed = paths.iter().take(LISTED_MAX).map(String::as_str).collect::<Vec<_>>();
                let rest = match paths.len().saturating_sub(LISTED_MAX) {
                    0 => String::new(),
                    more => format!(" and {more} more"),
                };
                Kinship::Other { differences: format!("{}{rest}", listed.join(", ")) }
            }
        }
    }

    fn other_sequence(&self, id: &str) -> String {
        let cases = self.cases;
        let (name, go_on) = match self.definition.sequence {
            Sequence::Rotated => (
                "rotated",
                format!(
                    "the points of {id} in the library end at case {OWEN_POINTS_MAX}: to continue it, \
                         use `--cases {OWEN_POINTS_MAX}`"
                ),
            ),
            Sequence::OwenScrambled => (
                "owen_scrambled",
                format!(
                    "{id} in the library has the sequence `rotated`: to continue it, write `sequence = \
                         \"rotated\"` into the campaign file"
                ),
            ),
        };
        format!(
            "cases: {cases} cases use the sequence `{name}` and would start another campaign \
                 from case 0; {go_on}. To start a new campaign, write `sequence = \"{name}\"` into \
                 the campaign file (`tracktwin run --print-campaign` prints the built-in one)"
        )
    }
}

/// Collects the paths of `own` at which `other` has a different value; short values are added to the path.
fn compare(path: &str, own: &Value, other: &Value, paths: &mut Vec<String>) {
    if own == other {
        return;
    }
    if let (Value::Object(ours), Value::Object(theirs)) = (own, other) {
        let names = ours.keys().chain(theirs.keys().filter(|name| !ours.contains_key(*name)));
        for name in names {
            let value =
                |of: &serde_json::Map<String, Value>| of.get(name).cloned().unwrap_or(Value::Null);
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            compare(&path, &value(ours), &value(theirs), paths);
        }
        return;
    }
    let is_short = |value: &Value| !value.is_object() && !value.is_array();
    paths.push(if is_short(own) && is_short(other) {
        format!("{path} ({own}, was {other})")
    } else {
        path.to_owned()
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::DEFAULT;

    fn built_in(cases: u32) -> Campaign {
        Campaign::built_in(Some(cases)).unwrap()
    }

    #[test]
    fn a_sequence_that_the_number_of_cases_changed_is_told_with_the_way_to_go_on() {
        let (few, many) = (built_in(100), built_in(OWEN_POINTS_MAX + 1));
        for (own, other, remedy_part) in
            [(&many, &few, "--cases 65536"), (&few, &many, "sequence = \"rotated\"")]
        {
            let Kinship::OtherSequence { remedy } = own.kinship("x", &other.definition_json())
            else {
                panic!("{:?}", own.kinship("x", &other.definition_json()))
            };
            assert!(remedy.contains(remedy_part) && !remedy.contains('\n'), "{remedy}");
        }
        let asked = format!("sequence = \"rotated\"\n{DEFAULT}");
        let asked = Campaign::parse(&asked, "c.toml", None).unwrap();
        let kinship = asked.kinship("x", &few.definition_json());
        assert!(matches!(kinship, Kinship::Other { .. }), "who asks for it gets it: {kinship:?}");
    }

    #[test]
    fn what_differs_is_named_with_its_values() {
        let other = DEFAULT.replace("seed = 1", "seed = 2");
        let other = Campaign::parse(&other, "c.toml", None).unwrap();
        let Kinship::Other { differences } = built_in(10).kinship("x", &other.definition_json())
        else {
            panic!("the sequence is the same")
        };
        assert_eq!(differences, "seed (1, was 2)");
        let Kinship::Other { differences } = built_in(10).kinship("x", "{}") else {
            panic!("it is another altogether")
        };
        assert!(differences.contains(" more"), "{differences}");
    }
}
