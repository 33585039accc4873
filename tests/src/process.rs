//! Programs that run in parallel to a test.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Interval of checking a condition.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A process that is killed when this value is dropped.
pub struct Process(Child);

impl Process {
    /// Starts a program. Its standard error is printed with the prefix `name`, so that it appears in the
    /// output of a failed test.
    ///
    /// # Panics
    /// Panics if the program cannot be started.
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

    /// Sends a signal, given by its name.
    ///
    /// # Panics
    /// Panics if the signal cannot be sent.
    pub fn signal(&self, name: &str) {
        let pid = self.0.id().to_string();
        let sent = Command::new("kill").args([&format!("-{name}"), &pid]).status();
        assert!(sent.expect("kill starts").success());
    }

    /// A TCP port on which the process listens; `None` if there is none yet.
    ///
    /// # Panics
    /// Panics if the system does not provide this information.
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

    /// Kills the process (SIGKILL).
    pub fn kill(self) {
        drop(self);
    }

    /// Whether the process is running.
    ///
    /// # Panics
    /// Panics if the system does not provide this information.
    pub fn runs(&mut self) -> bool {
        self.0.try_wait().expect("it is this process's").is_none()
    }

    /// Waits for the end of the process.
    ///
    /// # Panics
    /// Panics if the process does not end in time.
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

/// Waits until a condition is true.
///
/// # Panics
/// Panics if the condition does not become true in time.
pub fn until(what: &str, within: Duration, mut happened: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !happened() {
        assert!(begun.elapsed() < within, "not within {within:?}: {what}");
        std::thread::sleep(LOOK_EVERY);
    }
}
