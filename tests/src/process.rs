//! Programs that run while a test goes on.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How often is looked whether something has happened.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A process that ends with its handle.
pub struct Process(Child);

impl Process {
    /// Starts a program; what it says to standard error is passed on under this name, so that a
    /// failed test tells it.
    ///
    /// # Panics
    /// When it can't be started.
    pub fn start(command: &mut Command, name: &'static str) -> Self {
        let command = command.stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        let pid = child.id();
        let said = BufReader::new(child.stderr.take().expect("it was asked for"));
        std::thread::spawn(move || {
            for line in said.lines().map_while(Result::ok) {
                eprintln!("{name} {pid}: {line}");
            }
        });
        Self(child)
    }

    /// Sends a signal by its name.
    ///
    /// # Panics
    /// When it can't be sent.
    pub fn signal(&self, name: &str) {
        let pid = self.0.id().to_string();
        let sent = Command::new("kill").args([&format!("-{name}"), &pid]).status();
        assert!(sent.expect("kill starts").success());
    }

    /// A TCP port on which it listens, once there is one.
    ///
    /// # Panics
    /// When the system doesn't say.
    pub fn port(&self) -> Option<u16> {
        let proc = |what: &str| format!("/proc/{}/{what}", self.0.id());
        let files = std::fs::read_dir(proc("fd")).expect("it runs").flatten();
        let files = files.filter_map(|file| std::fs::read_link(file.path()).ok());
        let files: Vec<String> = files.map(|it| it.display().to_string()).collect();
        let sockets = std::fs::read_to_string(proc("net/tcp")).expect("it runs");
        // Of proc(5)'s `net/tcp`: local address (field 1), state (3, 0A listens) and inode (9).
        sockets.lines().map(|line| line.split_whitespace().collect::<Vec<_>>()).find_map(|it| {
            let ours = it.get(3) == Some(&"0A") && files.contains(&format!("socket:[{}]", it[9]));
            ours.then(|| it[1].split_once(':'))
                .flatten()
                .map(|(_, port)| u16::from_str_radix(port, 16).expect("ports are hexadecimal"))
        })
    }

    /// Ends it at once (SIGKILL).
    pub fn kill(self) {
        drop(self);
    }

    /// Whether it runs.
    ///
    /// # Panics
    /// When the system doesn't say.
    pub fn runs(&mut self) -> bool {
        self.0.try_wait().expect("it is this process's").is_none()
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// When it has not ended in time.
    pub fn ended(&mut self, within: Duration) -> ExitStatus {
        until("it ends", within, || !self.runs());
        self.0.wait().expect("it is this process's")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until something happens.
///
/// # Panics
/// When it has not happened in time.
pub fn until(what: &str, within: Duration, mut happened: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !happened() {
        assert!(begun.elapsed() < within, "not within {within:?}: {what}");
        std::thread::sleep(LOOK_EVERY);
    }
}
