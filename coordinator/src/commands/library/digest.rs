//! `tracktwin library digest`: one hash per campaign.

use super::{Stop, Which, open, print_answers};
use serde::Serialize;

#[derive(Serialize)]
struct Digest {
    campaign: String,
    digest: String,
}

pub(super) async fn run(which: &Which) -> Result<(), Stop> {
    let (library, campaigns) = open(&which.library).await?;
    let mut answers = Vec::new();
    for campaign in campaigns {
        let digest = library.digest(&campaign.id).await?;
        answers.push(Digest { campaign: campaign.id, digest });
    }
    print_answers(which.json, &answers, |Digest { campaign, digest }| {
        format!("{digest}  {campaign}")
    });
    Ok(())
}
