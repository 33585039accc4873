//! Several campaigns at the same time, added and controlled while they are served.

use crate::support::{
    CORES, Coordinator, coordinator_with, lease, registered, report, stand_in, until, with_checksum,
};
use tokio_util::sync::CancellationToken;
use tracktwin_farm::campaign::{self, Campaign};
use tracktwin_farm::dispatch::Settings;
use tracktwin_farm::security::Security;
use tracktwin_protocol::farm::LeaseRequest;
use tracktwin_worker::agent::{self, Config};

/// A campaign other than the built-in one.
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

async fn finished(coordinator: &Coordinator, id: &str) -> u32 {
    coordinator.library.status(id).await.unwrap().finished
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_campaign_added_while_it_runs_is_served_with_the_others() {
    let coordinator = serving().await;
    let other = other(30);
    let (first, second) = (coordinator.campaign.id(), other.id());
    let stop = CancellationToken::new();
    let config = Config { prepare: stand_in, ..Config::new(coordinator.url.clone(), CORES) };
    let worker = tokio::spawn(agent::run(config, stop.clone()));
    until("work has begun", async || finished(&coordinator, &first).await > 0).await;
    campaign::store_campaign(&coordinator.library, &other).await.unwrap();
    until("all of the other is done", async || finished(&coordinator, &second).await == 30).await;
    until("so is the first", async || finished(&coordinator, &first).await == 20).await;
    stop.cancel();
    worker.await.unwrap().unwrap();
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
    coordinator.library.resume(&second).await.unwrap();
    // For a moment after it had nothing the library is not asked again.
    let mut answer = lease(&mut client, "w").await;
    until("there is work again", async || {
        if answer.cases.is_empty() {
            answer = lease(&mut client, "w").await;
        }
        !answer.cases.is_empty()
    })
    .await;
    assert_eq!(answer.campaign_id, second);
}

#[tokio::test]
async fn the_first_lease_of_a_campaign_does_not_have_the_size_of_another_campaign_s_leases() {
    let coordinator = serving().await;
    let other = other(600);
    campaign::store_campaign(&coordinator.library, &other).await.unwrap();
    let mut client = registered(&coordinator, "w").await;
    let leased = lease(&mut client, "w").await;
    let mut quick = report(&leased, "w");
    for case in &mut quick.cases {
        case.duration_s = 1e-4;
        *case = with_checksum(case.clone());
    }
    client.report(quick).await.unwrap();
    let all = LeaseRequest { worker: "w".to_owned(), cases_max: 1024 };
    let rest = client.lease(all.clone()).await.unwrap().into_inner();
    assert_eq!((&rest.campaign_id, rest.cases.len()), (&coordinator.campaign.id(), 16));
    let first = client.lease(all).await.unwrap().into_inner();
    assert_eq!((&first.campaign_id, first.cases.len()), (&other.id(), 8));
}
