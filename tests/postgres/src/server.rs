//! The server. It is started once per test binary, and each test has a separate database.

use crate::installation::{as_somebody, programs};
use std::io::Write;
use std::net::{Ipv4Addr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};
use test_needs::{free_port, missing};

/// Text of the message if no server is installed.
const WITHOUT: &str = "tests on PostgreSQL; install postgresql, or set PG_BIN to its folder";

/// Time limit of starting the server.
const START_TIMEOUT: Duration = Duration::from_secs(30);

/// Shell script that runs the server until its standard input contains "keep" or ends, and then removes the
/// server's files. No files remain even if the test is killed.
const KEEPER: &str = "\"$0\" -D \"$1\" -p \"$2\" -c fsync=\"$3\" -c full_page_writes=\"$3\" \
    -c listen_addresses=127.0.0.1 -c unix_socket_directories= -c shared_buffers=64MB \
    -c max_connections=200 > \"$1/log\" 2>&1 & server=$!; \
    read -r word; kill -INT $server; wait $server; [ \"$word\" = keep ] || rm -rf \"$1\"";

/// Number of servers started by this process.
static SERVERS: AtomicU32 = AtomicU32::new(0);

/// Settings of a server.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settings {
    /// Whether a commit waits for the disk. Only needed where durability is tested or measured.
    pub durable: bool,
}

/// A PostgreSQL server for this process only, on the loopback interface.
pub struct Server {
    programs: PathBuf,
    data: PathBuf,
    port: u16,
    settings: Settings,
    keeper: Mutex<Option<(Child, ChildStdin)>>,
    databases: AtomicU32,
}

impl Server {
    /// Returns the server shared by the tests of this process. The first call starts it.
    ///
    /// Returns `None` and prints one line if PostgreSQL is not installed, so that skipped tests are
    /// visible.
    ///
    /// # Panics
    /// Panics if the server cannot be started, or if it is missing although `TRACKTWIN_REQUIRE_POSTGRES` is
    /// set.
    pub fn shared() -> Option<&'static Self> {
        static SHARED: OnceLock<Option<Server>> = OnceLock::new();
        SHARED.get_or_init(|| Self::start(Settings::default())).as_ref()
    }

    /// Starts a separate server, which the test can stop and start.
    ///
    /// # Panics
    /// As [`Server::shared`].
    pub fn start(settings: Settings) -> Option<Self> {
        Self::start_in(&std::env::temp_dir(), settings)
    }

    /// As [`Server::start`], with the server's files in a new folder below `folder`, which all users must
    /// be able to enter.
    ///
    /// # Panics
    /// As [`Server::shared`].
    pub fn start_in(folder: &Path, settings: Settings) -> Option<Self> {
        let Some(programs) = programs() else {
            missing("TRACKTWIN_REQUIRE_POSTGRES", WITHOUT);
            return None;
        };
        let number = SERVERS.fetch_add(1, Ordering::Relaxed);
        let name = format!("tracktwin-postgres-{}-{number}", std::process::id());
        let data = folder.join(name);
        initialise(&programs, &data);
        let (keeper, databases) = (Mutex::default(), AtomicU32::new(0));
        let server = Self { programs, data, port: free_port(), settings, keeper, databases };
        server.start_again();
        Some(server)
    }

    /// Creates a new, empty database and returns its URL.
    ///
    /// # Panics
    /// Panics if the database cannot be created.
    pub fn database(&self) -> String {
        let name = format!("test_{}", self.databases.fetch_add(1, Ordering::Relaxed));
        let mut command = Command::new(self.programs.join("createdb"));
        let port = self.port.to_string();
        command.args(["-h", "127.0.0.1", "-U", "postgres", "-p", &port, &name]);
        succeed(&mut command);
        format!("postgres://postgres@127.0.0.1:{port}/{name}")
    }

    /// Removes a database, even if clients are connected to it.
    ///
    /// # Panics
    /// Panics if the database cannot be removed.
    pub fn remove(&self, database: &str) {
        let name = database.rsplit('/').next().expect("a URL ends with its database");
        let mut command = Command::new(self.programs.join("dropdb"));
        let port = self.port.to_string();
        succeed(command.args(["-h", "127.0.0.1", "-U", "postgres", "-p", &port, "--force", name]));
    }

    /// Runs a checkpoint, which writes all data to the files of the tables, so that log files can be
    /// reused.
    ///
    /// # Panics
    /// Panics if the checkpoint fails.
    pub fn checkpoint(&self) {
        let mut command = Command::new(self.programs.join("psql"));
        let port = self.port.to_string();
        command.args(["-h", "127.0.0.1", "-U", "postgres", "-p", &port, "-qc", "checkpoint"]);
        succeed(&mut command);
    }

    /// Stops the server as an administrator does: connections are closed, and data are kept.
    ///
    /// # Panics
    /// Panics if the server cannot be stopped.
    pub fn stop(&self) {
        let keeper = self.keeper.lock().expect("nobody panics while holding it").take();
        let Some((mut keeper, mut input)) = keeper else { return };
        input.write_all(b"keep\n").expect("the keeper listens");
        keeper.wait().expect("the keeper ends");
    }

    /// Starts a stopped server with its previous data.
    ///
    /// # Panics
    /// Panics if the server does not respond in time.
    pub fn start_again(&self) {
        let fsync = if self.settings.durable { "on" } else { "off" };
        let mut keeper = as_somebody(Path::new("sh"));
        keeper.arg("-c").arg(KEEPER).arg(self.programs.join("postgres")).arg(&self.data);
        keeper.args([&self.port.to_string(), fsync]);
        // Elsewhere: its own folder may be one that the server's user may not enter.
        keeper.current_dir("/").stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut keeper = keeper.spawn().expect("a shell starts");
        let input = keeper.stdin.take().expect("it was asked for");
        *self.keeper.lock().expect("nobody panics while holding it") = Some((keeper, input));
        let begin = Instant::now();
        while !self.answers() {
            assert!(begin.elapsed() < START_TIMEOUT, "no PostgreSQL server: {}", self.log());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Whether the server accepts connections. It may listen before it accepts any.
    fn answers(&self) -> bool {
        let listens = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)).is_ok();
        let port = self.port.to_string();
        let mut ask = Command::new(self.programs.join("pg_isready"));
        ask.args(["-q", "-h", "127.0.0.1", "-p", &port]);
        listens && ask.status().is_ok_and(|status| status.success())
    }

    fn log(&self) -> String {
        std::fs::read_to_string(self.data.join("log")).unwrap_or_default()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let keeper = self.keeper.get_mut().ok().and_then(Option::take);
        if let Some((mut keeper, input)) = keeper {
            // The keeper sees the end of its input, and tidies up.
            drop(input);
            let _ = keeper.wait();
        } else {
            let _ = std::fs::remove_dir_all(&self.data);
        }
    }
}

fn initialise(programs: &Path, data: &Path) {
    let mut command = as_somebody(&programs.join("initdb"));
    command.args(["--no-sync", "--auth=trust", "--username=postgres", "--encoding=UTF8"]);
    succeed(command.args(["--locale=C", "-D"]).arg(data).current_dir("/"));
}

fn succeed(command: &mut Command) {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
}
