//! Endpoints of a worker for monitoring: `/healthz` and `/metrics`.

use crate::bounded_listener::serve_bounded;
use crate::counters::Counters;
use crate::session::Session;
use axum::Router;
use axum::extract::State;
use axum::routing::get;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// Time without a response of a coordinator after which `/healthz` reports it.
const SILENCE: Duration = Duration::from_secs(30);

/// State from which the responses are made.
#[derive(Clone)]
struct Watched {
    session: Arc<Session>,
    counters: Arc<Counters>,
}

/// Serves requests until the future is dropped.
pub(crate) async fn answer(port: TcpListener, session: Arc<Session>, counters: Arc<Counters>) {
    let routes = Router::new()
        .route("/healthz", get(healthz))
        .route("/metrics", get(metrics))
        .with_state(Watched { session, counters });
    if let Err(error) = serve_bounded(port, routes, CancellationToken::new()).await {
        tracing::warn!("the health endpoint has stopped: {error}");
    }
}

/// A worker that waits for its coordinator is healthy: a restart would not help.
async fn healthz(State(watched): State<Watched>) -> String {
    let silent = watched.session.coordinators.silent_for();
    if watched.session.shutdown.is_cancelled() {
        "stopping\n".to_owned()
    } else if silent >= SILENCE {
        format!("waiting: no response from a coordinator for {} s\n", silent.as_secs())
    } else if watched.session.holdings.is_empty() {
        "idle\n".to_owned()
    } else {
        "working\n".to_owned()
    }
}

async fn metrics(State(watched): State<Watched>) -> String {
    watched.counters.text()
}
