//! Parameters of the accepted hypotheses, with units and intervals.

use super::quantity::{interval, mean};
use super::words::{accepted, physics};
use maud::{Markup, html};
use tracktwin_diagnosis::{Diagnosis, Estimate, Hypothesis};
use tracktwin_track::extension::{Bound, Kind, KindParameter};

/// The table; empty if no hypothesis with parameters was accepted.
pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    let has_any = |hypothesis: &&Hypothesis| {
        !(hypothesis.parameters.is_empty() && hypothesis.assumed.is_empty())
    };
    let with: Vec<&Hypothesis> = accepted(diagnosis).filter(has_any).collect();
    if with.is_empty() {
        return Markup::default();
    }
    html! {
        h2 { "Estimated parameters" }
        div.scroll { table {
            thead { tr { th { "of" } th.words { "parameter" } th { "estimate" } th { "95 % interval" } th { "name" } } }
            tbody {
                @for hypothesis in with {
                    @for (name, estimate) in &hypothesis.parameters {
                        @let known = known(hypothesis, name);
                        tr {
                            td { (physics(&hypothesis.physics)) }
                            td.words { (meaning(known, name)) }
                            td { (mean(name, *estimate)) }
                            td { (interval(name, *estimate, is_positive(known))) }
                            td { code { (name) } }
                        }
                    }
                    @for (name, &value) in &hypothesis.assumed {
                        tr {
                            td { (physics(&hypothesis.physics)) }
                            td.words { (meaning(known(hypothesis, name), name)) }
                            td { (mean(name, Estimate { mean: value, sd: 0.0 })) }
                            td { "assumed" }
                            td { code { (name) } }
                        }
                    }
                }
            }
        } }
        p.note { "Interval: two standard deviations on either side; the stiffness at every sleeper \
             is fitted at the same time. Assumed: a value that was tried, not fitted." }
    }
}

fn known(hypothesis: &Hypothesis, name: &str) -> Option<&'static KindParameter> {
    Kind::from_name(&hypothesis.physics)?.parameter(name)
}

fn meaning(known: Option<&KindParameter>, name: &str) -> String {
    known.map_or_else(|| physics(name), |parameter| parameter.meaning.to_owned())
}

/// Whether the parameter cannot be negative.
fn is_positive(known: Option<&KindParameter>) -> bool {
    known.is_some_and(|parameter| parameter.bound != Bound::Any)
}
