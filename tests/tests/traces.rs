//! Traces received by an OpenTelemetry collector, from a lease to the rows stored for it.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{
    TraceService, TraceServiceServer,
};
use opentelemetry_proto::tonic::collector::trace::v1::{
    ExportTraceServiceRequest, ExportTraceServiceResponse,
};
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value::Value};
use opentelemetry_proto::tonic::trace::v1::{ResourceSpans, Span};
use std::collections::BTreeSet;
use std::net::Ipv4Addr;
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use system_tests::{COARSE_MODEL, Process, free_port, run};
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Request, Response, Status};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// Environment variable with the address to which a program sends its traces.
const ENDPOINT: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";

/// Time limit for a program to end.
const PATIENCE: Duration = Duration::from_mins(1);

/// Number of cases of the campaign.
const CASES: i64 = 24;

/// Stores the received traces.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<ResourceSpans>>>);

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        self.0.lock().unwrap().extend(request.into_inner().resource_spans);
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}

impl Collector {
    /// Starts a collector. Returns the collector and its address.
    async fn start() -> (Self, String) {
        let collector = Self::default();
        let listener = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let served = tonic::transport::Server::builder()
            .add_service(TraceServiceServer::new(collector.clone()))
            .serve_with_incoming(TcpListenerStream::new(listener));
        tokio::spawn(served);
        (collector, address)
    }

    /// All received spans, each with the name of its service.
    fn spans(&self) -> Vec<(String, Span)> {
        let service = |of: &ResourceSpans| {
            let attributes = &of.resource.as_ref().unwrap().attributes;
            match value(attributes, "service.name") {
                Some(Value::StringValue(name)) => name,
                other => panic!("{other:?}"),
            }
        };
        let mut spans = Vec::new();
        for of in self.0.lock().unwrap().iter() {
            let of_it = of.scope_spans.iter().flat_map(|it| it.spans.clone());
            spans.extend(of_it.map(|span| (service(of), span)));
        }
        spans
    }
}

fn named<'a>(spans: &'a [(String, Span)], name: &str) -> Vec<&'a Span> {
    spans.iter().map(|it| &it.1).filter(|span| span.name == name).collect()
}

fn value(attributes: &[KeyValue], key: &str) -> Option<Value> {
    attributes.iter().find(|it| it.key == key)?.value.as_ref()?.value.clone()
}

fn integer(span: &Span, key: &str) -> i64 {
    match value(&span.attributes, key) {
        Some(Value::IntValue(value)) => value,
        other => panic!("{key}: {other:?}"),
    }
}

fn indices(span: &Span) -> Vec<i64> {
    let Some(Value::ArrayValue(array)) = value(&span.attributes, "sobol_index") else { panic!() };
    let index = |it: Option<Value>| match it {
        Some(Value::IntValue(index)) => index,
        other => panic!("{other:?}"),
    };
    array.values.into_iter().map(|it| index(it.value)).collect()
}

/// Runs a small campaign with a coordinator and a worker that send their traces to `endpoint`.
fn run_campaign(endpoint: &str) {
    let folder = tempfile::tempdir().unwrap();
    let campaign = folder.path().join("campaign.toml").display().to_string();
    let text = format!("name = \"traces\"\ncases = {CASES}\n{COARSE_MODEL}");
    std::fs::write(&campaign, text).unwrap();
    let library = format!("sqlite:{}", folder.path().join("l.sqlite").display());
    let listen = format!("127.0.0.1:{}", free_port());
    let mut coordinator = Command::new(PROGRAM);
    coordinator.args(["coordinator", "--exit-when-done", "--listen", &listen]);
    coordinator.args(["--campaign", &campaign, "--library", &library]);
    let mut coordinator = Process::start(coordinator.env(ENDPOINT, endpoint), "coordinator");
    let mut worker = Command::new(WORKER);
    worker.args(["--coordinator", &format!("http://{listen}"), "--cores", "1"]);
    let mut worker = Process::start(worker.env(ENDPOINT, endpoint), "worker");
    assert_eq!(coordinator.ended(PATIENCE).code(), Some(0));
    worker.signal("TERM");
    assert_eq!(worker.ended(PATIENCE).code(), Some(0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trace_leads_from_a_lease_to_the_rows_it_became_through_both_programs() {
    let (collector, endpoint) = Collector::start().await;
    tokio::task::spawn_blocking(move || run_campaign(&endpoint)).await.unwrap();

    let spans = collector.spans();
    let parent = |of: &Span| spans.iter().find(|(_, span)| span.span_id == of.parent_span_id);
    // From each row back to its lease.
    for store in spans.iter().filter(|(_, span)| span.name == "store") {
        let way = std::iter::successors(Some(store), |(_, span)| parent(span));
        let way: Vec<_> = way
            .inspect(|(_, span)| assert_eq!(span.trace_id, store.1.trace_id))
            .map(|(service, span)| (service.as_str(), span.name.as_str()))
            .collect();
        assert_eq!(
            way,
            [
                ("tracktwin-coordinator", "store"),
                ("tracktwin-coordinator", "report"),
                ("tracktwin-worker", "hand in"),
                ("tracktwin-worker", "simulate"),
                ("tracktwin-coordinator", "lease"),
            ]
        );
    }
    let sum = |name, key| named(&spans, name).into_iter().map(|it| integer(it, key)).sum::<i64>();
    assert_eq!((sum("lease", "cases"), sum("store", "cases_stored")), (CASES, CASES));
    let simulated = named(&spans, "simulate");
    let cases: BTreeSet<_> = simulated.iter().flat_map(|span| indices(span)).collect();
    assert_eq!(cases, (0..CASES).collect());
    // Groups that were handed in together are linked.
    let handed_in = named(&spans, "hand in").into_iter().map(|span| 1 + span.links.len());
    assert_eq!(handed_in.sum::<usize>(), simulated.len());
}

#[test]
fn a_collector_that_is_away_stops_nobody() {
    run_campaign("http://127.0.0.1:9");
}

#[test]
fn an_address_that_is_none_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let library = format!("sqlite:{}", folder.path().join("l.sqlite").display());
    let programs = [
        (PROGRAM, vec!["coordinator", "--listen", "127.0.0.1:0", "--library", &library]),
        (WORKER, vec!["--coordinator", "http://127.0.0.1:9"]),
    ];
    for (program, arguments) in programs {
        let mut command = Command::new(program);
        let output = command.args(arguments).env(ENDPOINT, "not an address").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.lines().count() == 1 && said.contains(ENDPOINT), "{said}");
    }
    let answer = run(PROGRAM, &["status", "--library", &library]);
    assert_ne!(answer.code, Some(0), "nothing was made");
}
