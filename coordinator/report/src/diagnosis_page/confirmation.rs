//! Passes withheld from the search, compared with time-domain simulations.

use maud::{Markup, html};
use tracktwin_diagnosis::{Confirmation, Diagnosis};

/// The table of the comparison; empty if no pass was withheld.
pub(crate) fn section(diagnosis: &Diagnosis) -> Markup {
    let Some(confirmation) = &diagnosis.confirmation else { return Markup::default() };
    let Confirmation { passes, speeds, sleepers, gain_nats, is_confirmed } = confirmation;
    html! {
        h2 { "Confirmation on withheld passes" }
        p {
            "The passes " (passes.join(", ")) " were not used to find or to fit anything. What was accepted was \
             simulated in time and compared with them at the " (sleepers) " sleepers where it is felt. "
            @if *is_confirmed { "They confirm it: " } @else { "They do not confirm it: " }
            "with it, the withheld passes are "
            @if *gain_nats >= 0.0 { "more probable by " } @else { "less probable by " }
            (format!("{:.0}", gain_nats.abs())) " nats."
        }
        div.scroll { table {
            thead { tr {
                th { "speed" } th { "difference without it" } th { "difference with it" }
            } }
            tbody {
                @for speed in speeds {
                    tr {
                        td { (format!("{:.0} km/h", speed.speed_km_h)) }
                        td { (format!("{:.1} dB", speed.before_db)) }
                        td { (format!("{:.1} dB", speed.after_db)) }
                    }
                }
            }
        } }
        p.note { "Difference: root mean square of measured minus simulated level over bands and sleepers. One \
             pass varies at random by some decibels, so that the difference does not come to zero. Withheld passes \
             run over the same surface: they show that the finding repeats, not that this surface does not \
             imitate it by chance. Speeds that were held out test that." }
    }
}
