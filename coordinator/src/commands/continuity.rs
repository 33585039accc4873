//! Whether a campaign goes on with what a library holds, or begins anew beside it.

use super::Stop;
use crate::pipeline::lack::check_for_training;
use anyhow::anyhow;
use tracktwin_farm::campaign::{Campaign, Kinship};
use tracktwin_library::Library;

/// Refuses a campaign that would begin anew only because its number of cases changed the sequence of its
/// points; `tell`s which other campaigns of the library have its name, and in what they differ.
pub(super) async fn check(
    library: &Library,
    campaign: &Campaign,
    tell: impl Fn(&str),
) -> Result<(), Stop> {
    let all = library.campaigns().await?;
    let id = campaign.id();
    if all.iter().any(|it| it.id == id) {
        return Ok(());
    }
    for other in all.iter().filter(|it| it.name == campaign.name) {
        match campaign.kinship(&other.id, &other.definition_json) {
            Kinship::OtherSequence { remedy } => return Err(Stop::Input(anyhow!(remedy))),
            Kinship::Other { differences } => tell(&format!(
                "{id} begins from case 0, beside {}, which has the same name and differs in {differences}",
                other.id
            )),
        }
    }
    Ok(())
}

/// `tell`s what training will lack of a campaign, before it is simulated.
pub(super) fn tell_what_training_lacks(campaign: &Campaign, tell: impl Fn(&str)) {
    if let Err(lack) = check_for_training(campaign) {
        tell(&format!("the campaign can be simulated, but not trained on: {lack}"));
    }
}
