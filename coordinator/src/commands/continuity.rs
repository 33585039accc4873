//! Checks whether a campaign continues one in the library or is a new one, and whether this program may
//! continue it.

use super::Stop;
use crate::pipeline::lack::check_for_training;
use anyhow::anyhow;
use tracktwin_experiment::MODEL_HASH;
use tracktwin_farm::campaign::{Campaign, Kinship};
use tracktwin_library::Library;

/// Returns an error if another version of the physics has computed results of the campaign, or if it
/// would be a new one only because its number of cases changed its sampling sequence; passes other
/// campaigns of the same name, with their differences, to `tell`.
pub(super) async fn check(
    library: &Library,
    campaign: &Campaign,
    tell: impl Fn(&str),
) -> Result<(), Stop> {
    let all = library.campaigns().await?;
    let id = campaign.id();
    if all.iter().any(|it| it.id == id) {
        return Ok(library.check_model(&id, MODEL_HASH).await?);
    }
    for other in all.iter().filter(|it| it.name == campaign.name) {
        match campaign.kinship(&other.id, &other.definition_json) {
            Kinship::OtherSequence { remedy } => return Err(Stop::Input(anyhow!(remedy))),
            Kinship::Other { differences } => tell(&format!(
                "{id} starts from case 0: {} has the same name and differs in {differences}",
                other.id
            )),
        }
    }
    Ok(())
}

/// Passes to `tell`, before the simulation, why models cannot be trained on a campaign.
pub(super) fn tell_what_training_lacks(campaign: &Campaign, tell: impl Fn(&str)) {
    if let Err(lack) = check_for_training(campaign) {
        tell(&format!("the campaign can be simulated, but models cannot be trained on it: {lack}"));
    }
}
