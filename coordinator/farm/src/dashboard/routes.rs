//! HTTP routes of the dashboard, and the rights that each of them requires.

use super::metrics;
use super::page::{charts, farm_page};
use super::status::Farm;
use super::view::{Detail, drawn, farm};
use crate::dispatch::Counts;
use crate::security::{Guard, Security};
use axum::extract::{Form, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use serde::Deserialize;
use std::net::SocketAddr;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracktwin_library::{Library, LibraryError, Retry};
use tracktwin_worker::serve_bounded;

/// Name of the cookie of a user who has given the token.
const COOKIE: &str = "tracktwin";

/// Content security policy: no content from other sites, and no framing.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
                      connect-src 'self'; form-action 'self'; frame-ancestors 'none'";

/// State of the routes.
#[derive(Clone)]
pub struct Dashboard(Arc<Inner>);

struct Inner {
    library: Library,
    counts: Counts,
    guard: Guard,
    /// Value of the cookie: a hash of the token. The token itself is not kept.
    key: Option<String>,
    /// Whether every caller may use the controls.
    open: bool,
    /// Whether the port is reachable from this machine only.
    loopback: bool,
}

impl Dashboard {
    /// Creates the pages of a library. The controls require the token. If workers need certificates and
    /// there is no token, the controls are disabled.
    pub fn new(library: Library, counts: Counts, security: &Security, address: SocketAddr) -> Self {
        let token = security.token.as_deref();
        let open = token.is_none() && security.client_ca_pem.is_none();
        let key =
            |token: &str| blake3::derive_key("tracktwin dashboard 1", token.trim().as_bytes());
        let key = token.map(|token| blake3::Hash::from_bytes(key(token)).to_hex().to_string());
        let (guard, loopback) = (Guard::new(token), address.ip().is_loopback());
        Self(Arc::new(Inner { library, counts, guard, key, open, loopback }))
    }

    /// Whether the caller may use the controls: the request has the cookie or the token itself.
    ///
    /// Without token and certificates, the port is local or the network is trusted; then every caller may.
    fn admits(&self, headers: &HeaderMap) -> bool {
        let Some(key) = &self.0.key else { return self.0.open };
        let authorization = headers.get(header::AUTHORIZATION).map(HeaderValue::as_bytes);
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|it| it.to_str().ok());
        let mut cookies = cookies.flat_map(|it| it.split(';')).map(str::trim);
        let shown = cookies.find_map(|it| it.strip_prefix(COOKIE)?.strip_prefix('='));
        // Hashes are compared in constant time.
        let same = |shown: &str| blake3::hash(shown.as_bytes()) == blake3::hash(key.as_bytes());
        authorization.is_some_and(|it| self.0.guard.admits(Some(it))) || shown.is_some_and(same)
    }
}

/// Serves the pages on a port until `stop` is cancelled.
pub async fn serve(listener: TcpListener, dashboard: Dashboard, stop: CancellationToken) {
    let routes = Router::new()
        .route("/", get(page))
        .route("/view", get(view))
        .route("/charts/{campaign}", get(campaign_charts))
        .route("/login", post(login))
        .route("/campaign/{action}", post(control))
        .route("/metrics", get(numbers))
        .route("/healthz", get(healthz))
        .layer(middleware::from_fn_with_state(dashboard.clone(), same_origin))
        .with_state(dashboard);
    if let Err(error) = serve_bounded(listener, routes, stop).await {
        tracing::error!("the dashboard has stopped: {error}");
    }
}

/// Refuses requests from pages of other sites, and records whether the caller may use the controls.
async fn same_origin(
    State(dashboard): State<Dashboard>,
    mut request: Request,
    next: Next,
) -> Response {
    let headers = request.headers();
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let host = text(header::HOST).unwrap_or_default();
    // `null`, of a page in a sandbox, is another site as well.
    let ours = |origin: &HeaderValue| {
        let origin = origin.to_str().ok().and_then(|it| it.split_once("://"));
        origin.is_some_and(|(_, origin)| origin == host)
    };
    if headers.get(header::ORIGIN).is_some_and(|origin| !ours(origin)) {
        return (StatusCode::FORBIDDEN, "from another site\n").into_response();
    }
    // A host name other than this machine's may belong to an attacker (DNS rebinding).
    let local = |host: &str| {
        let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
        name == "localhost" || name.trim_matches(['[', ']']).parse::<std::net::IpAddr>().is_ok()
    };
    if dashboard.0.loopback && !local(host) {
        return (StatusCode::FORBIDDEN, "not a name of this machine\n").into_response();
    }
    let may_control = MayControl(dashboard.admits(headers));
    request.extensions_mut().insert(may_control);
    let mut response = next.run(request).await;
    let policy = HeaderValue::from_static(POLICY);
    response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, policy);
    response
}

/// Whether the caller may use the controls.
#[derive(Clone, Copy)]
struct MayControl(bool);

async fn page(
    State(dashboard): State<Dashboard>,
    Extension(MayControl(may_control)): Extension<MayControl>,
) -> Result<Html<String>, Failed> {
    whole_page(&dashboard, Detail::Pictures, may_control).await
}

/// The page without charts, for updates.
async fn view(
    State(dashboard): State<Dashboard>,
    Extension(MayControl(may_control)): Extension<MayControl>,
) -> Result<Html<String>, Failed> {
    whole_page(&dashboard, Detail::Counts, may_control).await
}

async fn whole_page(
    dashboard: &Dashboard,
    detail: Detail,
    may_control: bool,
) -> Result<Html<String>, Failed> {
    let farm = farm(&dashboard.0.library, detail).await?;
    Ok(Html(farm_page(&Farm { may_control, ..farm })))
}

async fn campaign_charts(
    State(dashboard): State<Dashboard>,
    Path(campaign): Path<String>,
) -> Result<Html<String>, Failed> {
    let campaign = drawn(&dashboard.0.library, campaign).await?;
    Ok(Html(charts(&campaign).into_string()))
}

#[derive(Deserialize)]
struct Login {
    token: String,
}

async fn login(State(dashboard): State<Dashboard>, Form(login): Form<Login>) -> Response {
    let header = format!("Bearer {}", login.token.trim());
    let key =
        dashboard.0.key.as_ref().filter(|_| dashboard.0.guard.admits(Some(header.as_bytes())));
    let Some(key) = key else {
        tracing::warn!("the dashboard was given a wrong token");
        return (StatusCode::FORBIDDEN, "the token is wrong\n").into_response();
    };
    let cookie = format!("{COOKIE}={key}; HttpOnly; SameSite=Strict; Path=/");
    ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response()
}

#[derive(Deserialize)]
struct Chosen {
    campaign: String,
}

async fn control(
    State(dashboard): State<Dashboard>,
    Extension(MayControl(may_control)): Extension<MayControl>,
    Path(action): Path<String>,
    Form(Chosen { campaign }): Form<Chosen>,
) -> Result<Response, Failed> {
    if !may_control {
        return Ok((StatusCode::FORBIDDEN, "enter the token first\n").into_response());
    }
    let library = &dashboard.0.library;
    match action.as_str() {
        "pause" => library.pause(&campaign).await?,
        "resume" => library.resume(&campaign).await?,
        "retry" => library.retry(&campaign, Retry::Failed).await.map(drop)?,
        _ => return Ok((StatusCode::NOT_FOUND, "unknown action\n").into_response()),
    }
    tracing::info!(campaign, action, "requested on the dashboard");
    Ok(Redirect::to("/").into_response())
}

async fn numbers(State(dashboard): State<Dashboard>) -> Result<String, Failed> {
    let library = &dashboard.0.library;
    let farm = farm(library, Detail::Counts).await?;
    let mut audits = Vec::with_capacity(farm.campaigns.len());
    for campaign in &farm.campaigns {
        audits.push(library.audits(&campaign.id).await?);
    }
    Ok(metrics::text(&farm, &audits, &dashboard.0.counts))
}

/// Health check: succeeds if the library responds.
async fn healthz(State(dashboard): State<Dashboard>) -> Result<&'static str, Failed> {
    dashboard.0.library.overview().await?;
    Ok("serving\n")
}

/// The library does not respond.
struct Failed(LibraryError);

impl From<LibraryError> for Failed {
    fn from(error: LibraryError) -> Self {
        Self(error)
    }
}

impl IntoResponse for Failed {
    fn into_response(self) -> Response {
        let code = if self.0.is_wrong_input() {
            StatusCode::BAD_REQUEST
        } else {
            StatusCode::SERVICE_UNAVAILABLE
        };
        (code, format!("{}\n", self.0)).into_response()
    }
}
