//! A network that is cut between worker and coordinator.

use crate::farm::{Engine, Farm};
use crate::proxy::Proxy;
use std::time::Duration;

fn network_is_cut(engine: Engine) {
    let Some(farm) = Farm::many(engine, 400) else { return };
    let mut coordinator = farm.coordinator(0);
    let cable = Proxy::to(farm.port(0));
    let far = Farm::worker_of(&format!("http://127.0.0.1:{}", cable.port));
    farm.reach(4);
    cable.cut();
    // Longer than the lease: what the far worker holds goes to the near one.
    let near = farm.worker();
    std::thread::sleep(Duration::from_secs(3));
    near.kill();
    assert!(!farm.is_done() && farm.leased_again() > 0, "nothing is left for the far worker");
    cable.mend();
    Farm::finish(&mut coordinator);
    drop(far);
    farm.assert_undisturbed();
}

#[test]
fn a_network_cut_for_longer_than_the_lease_loses_nothing_sqlite() {
    network_is_cut(Engine::Sqlite);
}

#[test]
fn a_network_cut_for_longer_than_the_lease_loses_nothing_postgres() {
    network_is_cut(Engine::Postgres);
}
