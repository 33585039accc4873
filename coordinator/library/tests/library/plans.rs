//! The statements of a lease, a report and an audit, and the query plans of both databases.
//! docs/lease-protocol.md describes them in words.

use crate::snapshot::assert_kept;
use crate::support::{CAMPAIGN, Home, failed, fill, finished, lease, message, report, request};
use crate::workers::registration;
use sqlx::{AssertSqlSafe, Connection, PgConnection, Row, SqliteConnection};
use std::cell::RefCell;
use std::fmt::Write as _;
use std::sync::Once;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};
use tracktwin_library::{AuditFinding, Held, LeaseRequest, Library, Report};

/// The PostgreSQL version of the stored plans; another version may have other plans.
const POSTGRES_VERSION: &str = "15";

thread_local! {
    /// Statements of writing connections in the test of this thread.
    static STATEMENTS: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Statements of this thread since the last call.
fn taken() -> Vec<String> {
    STATEMENTS.take()
}

/// Stores the statements of each thread separately. It is the subscriber of the whole process, because the
/// filter of an event is evaluated only once, on an arbitrary thread.
struct Listener;

impl Subscriber for Listener {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "tracktwin_library::statements"
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        event.record(&mut Statements);
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

struct Statements;

impl Visit for Statements {
    fn record_debug(&mut self, _: &Field, _: &dyn std::fmt::Debug) {}

    fn record_str(&mut self, _: &Field, text: &str) {
        STATEMENTS.with_borrow_mut(|statements| statements.push(text.to_owned()));
    }
}

/// An operation with its statements.
struct Step {
    what: &'static str,
    statements: Vec<String>,
}

/// Runs all operations of the protocol in sequence.
struct Scenario {
    library: Library,
    steps: Vec<Step>,
}

impl Scenario {
    /// A library with some finished, some given-up, and mostly waiting cases.
    async fn new(home: &Home) -> Self {
        let library = home.library(2000).await;
        fill(&library, "other-000000000000", 100).await;
        for worker in ["a", "b", "c"] {
            library.register_worker(registration(worker, 0)).await.unwrap();
        }
        for _ in 0..4 {
            let leased = lease(&library, "a", 100, 0).await;
            report(&library, "a", leased.iter().map(finished).collect()).await;
        }
        taken();
        Self { library, steps: Vec::new() }
    }

    fn done(&mut self, what: &'static str) {
        self.steps.push(Step { what, statements: taken() });
    }

    async fn play(&mut self) {
        self.leases().await;
        self.heartbeats().await;
        self.reports().await;
        self.audits().await;
        self.library.cancel(CAMPAIGN).await.unwrap();
        self.done("a campaign is cancelled: its leases end");
    }

    async fn leases(&mut self) {
        let library = self.library.clone();
        let first = LeaseRequest { lease_ms: 240_000, ..request("b", 3, 1_000_000) };
        library.lease(first.clone()).await.unwrap().unwrap();
        self.done("a lease that looks at all: nothing has expired");
        library.lease(first.clone()).await.unwrap().unwrap();
        self.done("a lease that begins where the last one ended");
        let held = vec![Held { index: 400, epoch: 1 }];
        let campaign = Some(CAMPAIGN.to_owned());
        let later = LeaseRequest { campaign, held, now_unix_ms: 2_000_000, ..first };
        library.lease(later).await.unwrap().unwrap();
        self.done("a lease that ends expired ones, of a worker in the same process that holds one");
    }

    async fn heartbeats(&mut self) {
        let library = self.library.clone();
        library.heartbeat("c", 2_000_000).await.unwrap();
        self.done("a heartbeat: the worker was heard of");
        let mine = vec![Held { index: 400, epoch: 1 }];
        library.renew(CAMPAIGN, "b", mine.clone(), 3_000_000).await.unwrap();
        self.done("a heartbeat: leases that it names are renewed");
        let lost = vec![Held { index: 401, epoch: 1 }];
        assert_eq!(library.renew(CAMPAIGN, "b", lost.clone(), 3_000_000).await.unwrap(), lost);
        self.done("a heartbeat: one of its leases was lost");
        library.release(CAMPAIGN, "b", mine).await.unwrap();
        self.done("cases are handed back");
    }

    async fn reports(&mut self) {
        let library = self.library.clone();
        let leased = lease(&library, "c", 3, 2_100_000).await;
        let again = {
            let later = request("b", 1, 3_000_000);
            library.lease(later).await.unwrap().unwrap().cases.remove(0)
        };
        assert_eq!(again.case, leased[0].case);
        taken();
        let audited = Report { audit_share: 1.0, ..message("a", Vec::new()) };
        let cases = vec![finished(&lease(&library, "a", 1, 3_000_000).await[0])];
        taken();
        library.report(Report { cases, ..audited }).await.unwrap();
        self.done("a report of a result, drawn for an audit");
        let broken = lease(&library, "a", 1, 3_000_000).await;
        taken();
        report(&library, "a", vec![failed(&broken[0])]).await;
        self.done("a report of a case that could not be simulated");
        report(&library, "c", vec![finished(&leased[0])]).await;
        self.done("a report under an earlier lease, while a later one is held");
        report(&library, "c", vec![finished(&leased[0])]).await;
        self.done("the same report again");
    }

    async fn audits(&mut self) {
        let library = self.library.clone();
        let audits = library.audit_sample(CAMPAIGN, "b", 3, 1000).await.unwrap();
        self.done("an audit is handed out");
        let index = audits[0].case.index;
        library.renew_audits(CAMPAIGN, "b", vec![index], 1000).await.unwrap();
        self.done("a heartbeat: audits that it names are renewed");
        library.release_audits(CAMPAIGN, "b", vec![index]).await.unwrap();
        self.done("an audit is handed back");
        library.audit_sample(CAMPAIGN, "b", 3, 1000).await.unwrap();
        taken();
        let differs = AuditFinding { agrees: false, difference_db: 3.0 };
        let wrong = Some(("a", "its results differ"));
        library.audited(CAMPAIGN, index, "b", differs, wrong).await.unwrap();
        self.done("an audit that finds a worker wrong");
    }
}

/// Query plan of a statement, one line per step.
trait Plan {
    async fn plan(&mut self, statement: &str) -> Vec<String>;
}

impl Plan for SqliteConnection {
    async fn plan(&mut self, statement: &str) -> Vec<String> {
        let ask = AssertSqlSafe(format!("explain query plan {statement}"));
        let rows = sqlx::query(ask).fetch_all(self).await.unwrap();
        rows.iter().map(|row| row.get("detail")).collect()
    }
}

impl Plan for PgConnection {
    async fn plan(&mut self, statement: &str) -> Vec<String> {
        let prepare = AssertSqlSafe(format!("prepare planned as {statement}"));
        sqlx::raw_sql(prepare).execute(&mut *self).await.unwrap();
        let values = "select cardinality(parameter_types) from pg_prepared_statements
            where name = 'planned'";
        let values: i32 = sqlx::query_scalar(values).fetch_one(&mut *self).await.unwrap();
        let values = if values == 0 {
            String::new()
        } else {
            format!("({})", vec!["null"; values.unsigned_abs() as usize].join(", "))
        };
        let ask = format!("explain (costs off) execute planned{values}");
        let rows = sqlx::raw_sql(AssertSqlSafe(ask)).fetch_all(&mut *self).await.unwrap();
        sqlx::raw_sql("deallocate planned").execute(self).await.unwrap();
        rows.iter().map(|row| row.get(0)).collect()
    }
}

/// First and last statements of each step.
const BRACKETS: [&str; 3] = ["begin immediate", "begin", "commit"];

/// A statement without the indentation of the source code.
fn to_the_left(statement: &str) -> String {
    let lines = statement.trim_end().lines().filter(|line| !line.is_empty());
    let indent = |line: &str| line.len() - line.trim_start().len();
    let least = lines.clone().map(indent).min().unwrap_or(0);
    lines.map(|line| &line[least..]).collect::<Vec<_>>().join("\n")
}

/// Text of all steps with their statements; each statement has its plan at its first occurrence. A step is
/// one transaction.
async fn account(steps: Vec<Step>, database: &mut impl Plan) -> String {
    let mut account = String::new();
    let mut known: Vec<(String, String)> = Vec::new();
    for Step { what, statements } in steps {
        let _ = writeln!(account, "-- ## {what}\n");
        let inside = statements.iter().filter(|text| !BRACKETS.contains(&text.as_str()));
        for (number, text) in (1..).zip(inside) {
            let text = to_the_left(text);
            if let Some((_, place)) = known.iter().find(|(known, _)| *known == text) {
                let _ = writeln!(account, "-- {number}: {place}\n");
            } else {
                let _ = writeln!(account, "-- {number}\n{text};");
                for line in database.plan(&text).await {
                    let _ = writeln!(account, "--     {line}");
                }
                account.push('\n');
                known.push((text, format!("as {number} of \"{what}\"")));
            }
        }
    }
    account.trim_end().to_owned() + "\n"
}

/// Runs all operations of the protocol on a database.
async fn played(home: &Home) -> Vec<Step> {
    static LISTENING: Once = Once::new();
    LISTENING.call_once(|| tracing::subscriber::set_global_default(Listener).unwrap());
    let mut scenario = Scenario::new(home).await;
    scenario.play().await;
    scenario.library.close().await;
    scenario.steps
}

// One thread: it is the one that listens.
#[tokio::test]
async fn the_protocol_s_statements_and_their_plans_in_a_file_are_those_that_are_kept() {
    let home = Home::sqlite();
    let steps = played(&home).await;
    let mut file = SqliteConnection::connect(&home.url).await.unwrap();
    assert_kept("protocol.sqlite.sql", &account(steps, &mut file).await);
}

#[tokio::test]
async fn the_protocol_s_statements_and_their_plans_on_a_server_are_those_that_are_kept() {
    let Some(home) = Home::postgres() else { return };
    let steps = played(&home).await;
    let mut server = PgConnection::connect(&home.url).await.unwrap();
    let version: String =
        sqlx::query_scalar("show server_version").fetch_one(&mut server).await.unwrap();
    if !version.starts_with(POSTGRES_VERSION) {
        test_needs::skipped("plans of PostgreSQL 15; another version plans otherwise");
        return;
    }
    // Plans for any values, and by an index wherever there is one, however small the tables of this test are.
    let set = "analyze; set plan_cache_mode = force_generic_plan; set enable_seqscan = off";
    sqlx::raw_sql(set).execute(&mut server).await.unwrap();
    assert_kept("protocol.postgres.sql", &account(steps, &mut server).await);
}
