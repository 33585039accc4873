//! The farm on a simulated network in simulated time, with delays, cuts, crashes, and messages that are
//! repeated, late or damaged. A run with the same seed is identical.
//!
//! `TRACKTWIN_SEEDS=1000` runs this number of seeds; `TRACKTWIN_SEED=7` runs this seed only.

use crate::support::{CORES, library_at, stand_in, undisturbed};
use prost::Message;
use std::future::{Future, ready};
use std::pin::{Pin, pin};
use std::sync::{Arc, Mutex, OnceLock};
use std::task::{Context, Poll, Wake, Waker};
use std::thread::Thread;
use std::time::Duration;
use test_postgres::Server as Postgres;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::runtime::Runtime;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::transport::server::Connected;
use tonic::transport::{Channel, Endpoint, Server, Uri};
use tonic::{Request, Response, Status};
use tracktwin_farm::campaign::Campaign;
use tracktwin_farm::dispatch::{Counts, Dispatch, Settings};
use tracktwin_library::Library;
use tracktwin_protocol::farm::farm_server::{Farm, FarmServer};
use tracktwin_protocol::farm::{self as messages};
use tracktwin_worker::Credentials;
use tracktwin_worker::agent::{self, Config, Seams};
use turmoil::net::{TcpListener, TcpStream};

/// Seeds of an ordinary test run; each takes a few tenths of a second.
const SEEDS: u64 = 8;

/// Cases of each campaign: five groups for three workers.
const CASES: u32 = 40;

const PORT: u16 = 7700;
const WORKERS: [&str; 3] = ["worker-0", "worker-1", "worker-2"];

/// Limit of the simulated time; a farm that is not done then has failed.
const PATIENCE: Duration = Duration::from_mins(30);

/// Simulated time during which faults are injected.
const TROUBLE: Duration = Duration::from_mins(2);

type Answer<T> = Result<Response<T>, Status>;

/// Random number generator; equal seeds give equal numbers (splitmix64).
#[derive(Clone)]
struct Chance(Arc<Mutex<u64>>);

impl Chance {
    fn new(seed: u64) -> Self {
        Self(Arc::new(Mutex::new(seed)))
    }

    /// A random number below `bound`.
    fn below(&self, bound: u64) -> u64 {
        let mut state = self.0.lock().unwrap();
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = *state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % bound
    }
}

/// Waits for a future while simulated time stands still, because databases are not simulated.
fn at_once<F: Future>(future: F) -> F::Output {
    struct Parked(Thread);
    impl Wake for Parked {
        fn wake(self: Arc<Self>) {
            self.0.unpark();
        }
    }
    let waker = Waker::from(Arc::new(Parked(std::thread::current())));
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(output) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
            return output;
        }
        std::thread::park();
    }
}

/// The service with faults: requests may be repeated, even much later, and requests and responses damaged.
struct Troubled {
    dispatch: Dispatch,
    chance: Chance,
    reports: Mutex<Vec<messages::ReportRequest>>,
    releases: Mutex<Vec<messages::ReleaseRequest>>,
}

impl Troubled {
    /// Sometimes an earlier message instead of the newest one.
    fn earlier<T: Clone>(&self, all: &Mutex<Vec<T>>, newest: &T) -> Option<T> {
        let mut all = all.lock().unwrap();
        all.push(newest.clone());
        let count = all.len() as u64;
        (self.chance.below(4) == 0).then(|| all[self.chance.below(count) as usize].clone())
    }

    /// The message, sometimes with one inverted bit, as after an error of a network without TLS.
    fn damaged<M: Message + Default>(&self, message: M) -> Result<M, Status> {
        if self.chance.below(8) > 0 {
            return Ok(message);
        }
        let mut bytes = message.encode_to_vec();
        let bit = self.chance.below(8 * bytes.len().max(1) as u64) as usize;
        if let Some(byte) = bytes.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
        // As tonic says it.
        M::decode(&*bytes).map_err(|error| Status::internal(error.to_string()))
    }
}

#[tonic::async_trait]
impl Farm for Troubled {
    async fn register(
        &self,
        request: Request<messages::RegisterRequest>,
    ) -> Answer<messages::RegisterResponse> {
        ready(at_once(self.dispatch.register(request))).await
    }

    async fn lease(
        &self,
        request: Request<messages::LeaseRequest>,
    ) -> Answer<messages::LeaseResponse> {
        if self.chance.below(20) == 0 {
            // Nobody gets what this one leases.
            let twin = Request::new(request.get_ref().clone());
            let _ = at_once(self.dispatch.lease(twin));
        }
        let answer = at_once(self.dispatch.lease(request));
        answer.and_then(|answer| self.damaged(answer.into_inner())).map(Response::new)
    }

    async fn renew(
        &self,
        request: Request<messages::RenewRequest>,
    ) -> Answer<messages::RenewResponse> {
        ready(at_once(self.dispatch.renew(request))).await
    }

    async fn report(
        &self,
        request: Request<messages::ReportRequest>,
    ) -> Answer<messages::ReportResponse> {
        if let Some(earlier) = self.earlier(&self.reports, request.get_ref()) {
            let _ = at_once(self.dispatch.report(Request::new(earlier)));
        }
        let request = Request::new(self.damaged(request.into_inner())?);
        let answer = at_once(self.dispatch.report(request));
        if self.chance.below(10) == 0 {
            // Stored, but the answer is lost.
            return Err(Status::unavailable("the answer was lost"));
        }
        answer
    }

    async fn release(
        &self,
        request: Request<messages::ReleaseRequest>,
    ) -> Answer<messages::ReleaseResponse> {
        if let Some(earlier) = self.earlier(&self.releases, request.get_ref()) {
            let _ = at_once(self.dispatch.release(Request::new(earlier)));
        }
        ready(at_once(self.dispatch.release(request))).await
    }
}

/// A simulated connection in the form that the server requires.
struct Accepted(TcpStream);

impl Connected for Accepted {
    type ConnectInfo = ();
    fn connect_info(&self) {}
}

impl AsyncRead for Accepted {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.0).poll_read(context, buffer)
    }
}

impl AsyncWrite for Accepted {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        Pin::new(&mut self.0).poll_write(context, bytes)
    }

    fn poll_flush(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.0).poll_flush(context)
    }

    fn poll_shutdown(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.0).poll_shutdown(context)
    }
}

/// Program of the coordinator's host, run at each start of the host.
async fn coordinate(library: Library, campaign: String, chance: Chance) -> turmoil::Result {
    let clock = || turmoil::sim_elapsed().map_or(0, |it| i64::try_from(it.as_millis()).unwrap());
    let settings =
        Settings { clock: Some(Arc::new(clock)), prepare: stand_in, ..Settings::default() };
    let dispatch = Dispatch::new(library, settings, Counts::default());
    {
        // Read here and now: the database's own tasks must not end with a host that crashes.
        let _real = runtime().enter();
        at_once(dispatch.check(&campaign))?;
    }
    let (reports, releases) = (Mutex::default(), Mutex::default());
    let service = FarmServer::new(Troubled { dispatch, chance, reports, releases });
    let listener = TcpListener::bind((std::net::Ipv4Addr::UNSPECIFIED, PORT)).await?;
    let (accepted, incoming) = mpsc::channel::<std::io::Result<Accepted>>(16);
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            if accepted.send(Ok(Accepted(stream))).await.is_err() {
                break;
            }
        }
    });
    let mut server = Server::builder().http2_keepalive_interval(Some(Duration::from_secs(5)));
    server.add_service(service).serve_with_incoming(ReceiverStream::new(incoming)).await?;
    Ok(())
}

/// Program of a worker's host.
async fn work(name: &'static str) -> turmoil::Result {
    let config = Config {
        worker: name.to_owned(),
        credentials: Credentials { insecure: true, ..Credentials::default() },
        prepare: stand_in,
        seams: Seams { dial, inline: true, ..Seams::default() },
        ..Config::new(format!("http://coordinator:{PORT}"), CORES)
    };
    agent::run(config, CancellationToken::new()).await?;
    Ok(())
}

fn dial(endpoint: &Endpoint) -> Channel {
    endpoint.connect_with_connector_lazy(tower::service_fn(async |uri: Uri| {
        let host = uri.host().unwrap_or_default().to_owned();
        let stream = TcpStream::connect((host, PORT)).await?;
        Ok::<_, std::io::Error>(hyper_util::rt::TokioIo::new(stream))
    }))
}

/// Cuts, delays or repairs a connection, or crashes a host, at random.
fn inject_fault(sim: &mut turmoil::Sim<'_>, chance: &Chance) {
    let worker = WORKERS[chance.below(3) as usize];
    match chance.below(12) {
        0 | 1 => sim.partition(worker, "coordinator"),
        2 => sim.partition_oneway("coordinator", worker),
        3 | 4 => sim.hold(worker, "coordinator"),
        5..=7 => repair(sim),
        8 => sim.bounce(worker),
        9 if chance.below(3) == 0 => sim.bounce("coordinator"),
        _ => {}
    }
}

fn repair(sim: &turmoil::Sim<'_>) {
    for worker in WORKERS {
        sim.repair(worker, "coordinator");
        sim.release(worker, "coordinator");
    }
}

/// Runs a farm with faults drawn from `seed`, on a new library at this address. Returns the digest and the
/// simulated time.
fn misbehaving(real: &Runtime, library: &str, seed: u64) -> (String, Duration) {
    let campaign = Campaign::built_in(Some(CASES)).unwrap();
    let id = campaign.id();
    let library = real.block_on(library_at(library, &campaign));
    let chance = Chance::new(seed);
    let mut sim = turmoil::Builder::new()
        .rng_seed(seed)
        .tick_duration(Duration::from_millis(10))
        .min_message_latency(Duration::from_millis(1))
        .max_message_latency(Duration::from_millis(1 + chance.below(300)))
        .simulation_duration(PATIENCE)
        .build();
    let (served, name, luck) = (library.clone(), id.clone(), chance.clone());
    sim.host("coordinator", move || coordinate(served.clone(), name.clone(), luck.clone()));
    for worker in WORKERS {
        sim.host(worker, move || work(worker));
    }
    loop {
        sim.step().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let elapsed = sim.elapsed();
        if !elapsed.as_millis().is_multiple_of(500) {
            continue;
        }
        let status = real.block_on(library.status(&id)).unwrap();
        if status.done() == status.total() {
            assert_eq!(status.failed, 0, "seed {seed}: a case was given up");
            let digest = real.block_on(library.digest(&id)).unwrap();
            drop(sim);
            real.block_on(library.close());
            return (digest, elapsed);
        }
        assert!(elapsed < PATIENCE, "seed {seed}: {status:?} after {elapsed:?}");
        match elapsed.cmp(&TROUBLE) {
            std::cmp::Ordering::Less => inject_fault(&mut sim, &chance),
            std::cmp::Ordering::Equal => repair(&sim),
            std::cmp::Ordering::Greater => {}
        }
    }
}

fn runtime() -> &'static Runtime {
    static REAL: OnceLock<Runtime> = OnceLock::new();
    REAL.get_or_init(|| {
        let mut builder = tokio::runtime::Builder::new_multi_thread();
        builder.worker_threads(2).enable_all().build().unwrap()
    })
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect("a number"))
}

/// Runs many seeds, each with a separate library, which is removed afterwards.
fn all_misbehave(new: impl Fn() -> String, remove: impl Fn(&str)) {
    let real = runtime();
    let campaign = Campaign::built_in(Some(CASES)).unwrap();
    let expected = real.block_on(undisturbed(&campaign));
    let seeds = match number("TRACKTWIN_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("TRACKTWIN_SEEDS").unwrap_or(SEEDS),
    };
    let mut longest = Duration::ZERO;
    for seed in seeds.clone() {
        let library = new();
        let (digest, took) = misbehaving(real, &library, seed);
        assert_eq!(digest, expected, "seed {seed}");
        longest = longest.max(took);
        remove(&library);
    }
    eprintln!("{seeds:?}: every digest is right; the longest took {longest:?} of simulated time");
}

#[test]
fn whatever_network_and_hosts_do_the_digest_is_that_of_an_undisturbed_run_sqlite() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path().join("of a seed");
    let new = || {
        std::fs::create_dir(&home).unwrap();
        format!("sqlite:{}", home.join("l.sqlite").display())
    };
    all_misbehave(new, |_| std::fs::remove_dir_all(&home).unwrap());
}

#[test]
fn whatever_network_and_hosts_do_the_digest_is_that_of_an_undisturbed_run_postgres() {
    let Some(server) = Postgres::shared() else { return };
    all_misbehave(|| server.database(), |library| server.remove(library));
}

#[test]
fn the_same_seed_does_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let took = |name| {
        let library = format!("sqlite:{}", folder.path().join(name).display());
        misbehaving(runtime(), &library, 3).1
    };
    assert_eq!(took("one"), took("the other"));
}
