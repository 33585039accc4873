//! The network between worker and coordinator is interrupted.

use crate::farm::{Engine, Farm};
use crate::proxy::Proxy;

fn network_is_cut(engine: Engine) {
    let Some(farm) = Farm::many(engine, 400) else { return };
    let mut coordinator = farm.coordinator(0);
    let cable = Proxy::to(farm.port(0));
    let far = Farm::worker_of(&format!("http://127.0.0.1:{}", cable.port));
    farm.outlives_a_cut(|| cable.cut(), || farm.worker(), || cable.repair());
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
