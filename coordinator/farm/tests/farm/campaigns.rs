//! Several campaigns at once, added and steered while they are served.

use crate::support::{CORES, Coordinator, coordinator_with, lease, registered, stand_in};
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use tracktwin_farm::campaign::{self, Campaign};
use tracktwin_farm::dispatch::Settings;
use tracktwin_farm::security::Security;
use tracktwin_worker::agent::{self, Config};

/// Another campaign than the built-in one.
fn other(cases: u32) -> Campaign {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.toml");
    let text = format!("name = \"other\"\nseed = 9\ncases = {cases}\nspeeds_km_h = [13]\n");
    std::fs::write(&path, text).unwrap();
    Campaign::read(&path, None).unwrap()
}

async fn serving() -> Coordinator {
    let settings = Settings { prepare: stand_in, ..Settings::default() };
    coordinator_with(settings, Security::default(), 20).await
}

async fn work(coordinator: &Coordinator) {
    let config = Config {
        prepare: stand_in,
        // Longer than a busy machine takes to add a campaign.
        idle_exit: Some(Duration::from_secs(4)),
        ..Config::new(coordinator.url.clone(), CORES)
    };
    let run = agent::run(config, CancellationToken::new());
    tokio::time::timeout(Duration::from_secs(20), run).await.unwrap().unwrap();
}

async fn finished(coordinator: &Coordinator, id: &str) -> u32 {
    coordinator.library.status(id).await.unwrap().finished
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_campaign_added_while_it_runs_is_served_with_the_others() {
    let coordinator = serving().await;
    let other = other(30);
    let (library, id) = (coordinator.library.clone(), other.id());
    let adds = tokio::spawn(async move {
        tokio::time::sleep(Duration::from_millis(200)).await;
        campaign::store_campaign(&library, &other).await.unwrap();
    });
    work(&coordinator).await;
    adds.await.unwrap();
    assert_eq!(finished(&coordinator, &coordinator.campaign.id()).await, 20);
    assert_eq!(finished(&coordinator, &id).await, 30);
}

#[tokio::test]
async fn the_most_urgent_campaign_goes_first_and_a_paused_one_waits() {
    let coordinator = serving().await;
    let other = other(30);
    campaign::store_campaign(&coordinator.library, &other).await.unwrap();
    let (first, second) = (coordinator.campaign.id(), other.id());
    let mut client = registered(&coordinator, "w").await;
    assert_eq!(lease(&mut client, "w").await.campaign_id, first, "the older one");
    coordinator.library.set_priority(&second, 5).await.unwrap();
    assert_eq!(lease(&mut client, "w").await.campaign_id, second);
    coordinator.library.pause(&second).await.unwrap();
    assert_eq!(lease(&mut client, "w").await.campaign_id, first);
    coordinator.library.pause(&first).await.unwrap();
    assert!(lease(&mut client, "w").await.cases.is_empty());
    // For a moment after it had nothing the library is not asked again.
    tokio::time::sleep(Duration::from_millis(150)).await;
    coordinator.library.resume(&second).await.unwrap();
    assert_eq!(lease(&mut client, "w").await.campaign_id, second);
}
