//! Pages of the coordinator: their content, the rights to use their controls, and their display in a
//! browser.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use headless_chrome::browser::default_executable;
use headless_chrome::{Browser, LaunchOptions, Tab};
use std::process::Command;
use std::time::Duration;
use system_tests::{COARSE_MODEL, Process, free_port, run};
use tempfile::TempDir;
use test_needs::skipped;
use ureq::http::Response;
use ureq::{Agent, Body};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// Time limit of an expected event.
const PATIENCE: Duration = Duration::from_mins(1);

/// A coordinator with a dashboard and 24 cases, and optionally a worker.
struct Farm {
    folder: TempDir,
    library: String,
    workers: String,
    pages: String,
    processes: Vec<Process>,
}

impl Farm {
    fn start(token: Option<&str>) -> Self {
        Self::start_with(token, &[])
    }

    /// Starts the farm with further arguments; `DIR` in them is replaced by the farm's folder of
    /// certificates.
    fn start_with(token: Option<&str>, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        let campaign = format!("name = \"pages\"\ncases = 24\n{COARSE_MODEL}");
        std::fs::write(path("campaign.toml"), campaign).unwrap();
        let library = format!("sqlite:{}", path("l.sqlite"));
        let [listen, dashboard] = [(); 2].map(|()| format!("127.0.0.1:{}", free_port()));
        let mut coordinator = Command::new(PROGRAM);
        coordinator.args(["coordinator", "--campaign", &path("campaign.toml")]);
        coordinator.args(["--library", &library, "--listen", &listen, "--dashboard", &dashboard]);
        if !more.is_empty() {
            run(PROGRAM, &["certs", &path("certs"), "--host", "127.0.0.1"]).succeeded();
            coordinator.args(more.iter().map(|argument| argument.replace("DIR", &path("certs"))));
        }
        if let Some(token) = token {
            std::fs::write(path("token"), token).unwrap();
            coordinator.args(["--token-file", &path("token")]);
        }
        let farm = Self {
            library,
            workers: format!("http://{listen}"),
            pages: format!("http://{dashboard}"),
            processes: vec![Process::start(&mut coordinator, "coordinator")],
            folder,
        };
        until("the pages are there", || farm.agent().get(farm.at("/healthz")).call().is_ok());
        farm
    }

    fn at(&self, path: &str) -> String {
        format!("{}{path}", self.pages)
    }

    /// An HTTP client that returns errors and redirections as responses.
    #[expect(clippy::unused_self, reason = "it speaks to this farm")]
    fn agent(&self) -> Agent {
        Agent::config_builder().http_status_as_error(false).max_redirects(0).build().into()
    }

    fn get(&self, path: &str) -> String {
        let mut answer = self.agent().get(self.at(path)).call().unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        answer.body_mut().read_to_string().unwrap()
    }

    fn post(&self, path: &str, form: [(&str, &str); 1], header: [&str; 2]) -> Response<Body> {
        let [name, value] = header;
        self.agent().post(self.at(path)).header(name, value).send_form(form).unwrap()
    }

    fn work(&mut self) {
        let mut worker = Command::new(WORKER);
        worker.args(["--coordinator", &self.workers, "--cores", "1"]);
        let token = self.folder.path().join("token");
        if token.exists() {
            worker.arg("--token-file").arg(token);
        }
        self.processes.push(Process::start(&mut worker, "worker"));
    }

    fn campaign(&self) -> serde_json::Value {
        let answer = run(PROGRAM, &["status", "--json", "--library", &self.library]).succeeded();
        let status: serde_json::Value = serde_json::from_str(&answer).unwrap();
        status["campaigns"][0].clone()
    }

    fn name(&self) -> String {
        self.campaign()["campaign"].as_str().unwrap().to_owned()
    }

    fn state(&self) -> String {
        self.campaign()["state"].as_str().unwrap().to_owned()
    }
}

/// Waits until a condition is true.
fn until(what: &str, happened: impl FnMut() -> bool) {
    system_tests::until(what, PATIENCE, happened);
}

/// A header without significance for the test.
const PLAIN: [&str; 2] = ["Accept", "text/html"];

#[test]
fn pages_and_numbers_tell_how_a_campaign_stands() {
    let mut farm = Farm::start(None);
    let name = farm.name();
    assert!(farm.get("/").contains("0 of 24 cases finished"));
    assert_eq!(farm.get("/healthz"), "serving\n");
    let cases =
        |state| format!("tracktwin_campaign_cases{{campaign=\"{name}\",state=\"{state}\"}}");
    let numbers = farm.get("/metrics");
    assert!(numbers.contains(&format!("{} 24\n", cases("waiting"))), "{numbers}");
    assert!(numbers.contains("tracktwin_queue_depth 24\n"), "{numbers}");
    farm.work();
    until("all is done", || farm.get("/view").contains("24 of 24 cases finished"));
    let (page, numbers) = (farm.get("/"), farm.get("/metrics"));
    assert!(page.contains("Local wavelet power spectra of the newest cases"), "{page}");
    assert!(numbers.contains(&format!("{} 24\n", cases("finished"))), "{numbers}");
    assert!(numbers.contains("tracktwin_queue_depth 0\n"), "{numbers}");
}

#[test]
fn buttons_are_pressed_by_those_who_have_shown_the_token_and_by_nobody_else() {
    let farm = Farm::start(Some("a-token-of-some-length\n"));
    let name = farm.name();
    let (chosen, nobody) = ([("campaign", name.as_str())], [("campaign", "nobody")]);
    assert_eq!(farm.post("/campaign/pause", chosen, PLAIN).status(), 403);
    assert_eq!(farm.post("/campaign/pause", chosen, ["Cookie", "tracktwin=1"]).status(), 403);
    assert_eq!(farm.post("/login", [("token", "another")], PLAIN).status(), 403);
    assert!(!farm.get("/").contains("campaign/pause"));
    assert_eq!(farm.state(), "running");

    let answer = farm.post("/login", [("token", "a-token-of-some-length")], PLAIN);
    assert_eq!(answer.status(), 303);
    let cookie = answer.headers()["set-cookie"].to_str().unwrap();
    let (shown, how) = cookie.split_once(';').unwrap();
    assert!(how.contains("HttpOnly") && how.contains("SameSite=Strict"), "{cookie}");
    assert!(!shown.contains("a-token"), "{cookie}");
    let cookie = ["Cookie", shown];
    assert_eq!(farm.post("/campaign/pause", chosen, cookie).status(), 303);
    assert_eq!(farm.state(), "paused");
    assert_eq!(farm.post("/campaign/resume", chosen, cookie).status(), 303);
    assert_eq!(farm.state(), "running");
    assert_eq!(farm.post("/campaign/retry", chosen, cookie).status(), 303);
    assert_eq!(farm.post("/campaign/explode", chosen, cookie).status(), 404);
    assert_eq!(farm.post("/campaign/pause", nobody, cookie).status(), 400);
    // Machines show the token itself.
    let token = ["Authorization", "Bearer a-token-of-some-length"];
    assert_eq!(farm.post("/campaign/pause", chosen, token).status(), 303);
    assert_eq!(farm.state(), "paused");
}

#[test]
fn where_workers_must_show_certificates_nobody_presses_buttons_without_a_token() {
    let pem = |what: &str, file: &str| [format!("--tls-{what}"), format!("DIR/{file}.pem")];
    let demand =
        [pem("cert", "coordinator"), pem("key", "coordinator-key"), pem("client-ca", "ca")];
    let demand: Vec<&str> = demand.iter().flatten().map(String::as_str).collect();
    let farm = Farm::start_with(None, &demand);
    let name = farm.name();
    let paused = farm.post("/campaign/pause", [("campaign", name.as_str())], PLAIN);
    assert_eq!(paused.status(), 403);
    assert!(!farm.get("/").contains("campaign/pause"));
    assert_eq!(farm.state(), "running");
}

#[test]
fn other_sites_and_other_names_are_turned_away() {
    let farm = Farm::start(None);
    let name = farm.name();
    let chosen = [("campaign", name.as_str())];
    // A page in a sandbox has no name.
    for elsewhere in ["http://elsewhere.example", "null"] {
        let answer = farm.post("/campaign/pause", chosen, ["Origin", elsewhere]);
        assert_eq!(answer.status(), 403, "{elsewhere}");
    }
    // A name of somebody else's that leads to this machine.
    for path in ["/", "/metrics", "/healthz"] {
        let named = farm.agent().get(farm.at(path)).header("Host", "elsewhere.example").call();
        assert_eq!(named.unwrap().status(), 403, "{path}");
    }
    assert_eq!(farm.state(), "running");
    let answer = farm.agent().get(farm.at("/")).call().unwrap();
    let policy = answer.headers()["content-security-policy"].to_str().unwrap();
    assert!(policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"));
}

/// Chromium; `None` if it is not installed.
fn browser() -> Option<Browser> {
    if default_executable().is_err() {
        skipped("the dashboard in a browser; install chromium");
        return None;
    }
    // As root in a container it can't have a sandbox, and it sees our own pages only.
    let options = LaunchOptions { sandbox: false, ..LaunchOptions::default() };
    Some(Browser::new(options).unwrap())
}

/// The visible text of the window; empty while a page is loading.
fn read(tab: &Tab) -> String {
    let text = tab.evaluate("document.body.innerText", false).ok().and_then(|it| it.value);
    text.and_then(|it| it.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Number of requests of the page whose address contains this path.
fn loaded(tab: &Tab, path: &str) -> u64 {
    let count = format!(
        "performance.getEntriesByType('resource').filter(it => it.name.includes('{path}')).length"
    );
    tab.evaluate(&count, false).unwrap().value.unwrap().as_u64().unwrap()
}

#[test]
fn a_browser_shows_a_campaign_as_it_goes_and_presses_its_buttons() {
    let Some(browser) = browser() else { return };
    let mut farm = Farm::start(Some("a-token"));
    let tab = browser.new_tab().unwrap();
    tab.navigate_to(&farm.at("/")).unwrap().wait_until_navigated().unwrap();
    assert!(read(&tab).contains("0 of 24 cases finished") && !read(&tab).contains("pause\n"));

    tab.wait_for_element("input[name=token]").unwrap().type_into("a-token").unwrap();
    tab.press_key("Enter").unwrap();
    let press = |label: &str| {
        let button = format!("//button[text()='{label}']");
        tab.wait_for_xpath(&button).unwrap().click().unwrap();
    };
    press("pause");
    until("it is paused", || farm.state() == "paused");
    press("resume");
    until("it runs", || farm.state() == "running");

    // Nobody loads the page again.
    farm.work();
    until("the page says so", || read(&tab).contains("24 of 24 cases finished"));
    until("the summary says so", || read(&tab).contains("Campaigns with work to do: 0 of 1"));
    assert!(tab.find_elements("svg").unwrap().len() >= 3, "spectra and parameter space");
    // Charts are not loaded again while nothing changes.
    let [charts, views] = ["/charts/", "/view"].map(|path| loaded(&tab, path));
    until("the page is updated twice", || loaded(&tab, "/view") >= views + 2);
    assert_eq!(loaded(&tab, "/charts/"), charts);
    assert!(tab.find_elements("svg").unwrap().len() >= 3, "charts are kept");
    let outside = "performance.getEntriesByType('resource').filter(\
        it => !it.name.startsWith(location.origin)).length";
    assert_eq!(tab.evaluate(outside, false).unwrap().value.unwrap(), 0);

    assert!(!read(&tab).contains("not up to date"));
    farm.processes.clear();
    until("the page says that it is old", || read(&tab).contains("not up to date"));
    assert!(read(&tab).contains("24 of 24 cases finished"), "what was known is kept");
}
