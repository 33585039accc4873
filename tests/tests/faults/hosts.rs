//! A worker on another host: in a separate network, with certificates and a token, and with an interrupted
//! connection.

use crate::farm::{Engine, Farm, PROGRAM, WORKER};
use std::process::{Command, id};
use system_tests::{Process, free_port, run};
use test_needs::skipped;

/// A host, simulated by a network namespace with a virtual cable to this host.
struct Host {
    name: String,
    /// Address of this host on the virtual cable.
    here: String,
}

impl Host {
    /// Creates host number `number`; `None` if namespaces are not allowed.
    fn new(number: u32) -> Option<Self> {
        // Addresses kept for tests of networks (RFC 2544).
        let network = format!("198.18.{}", 2 * (id() % 100) + number);
        let host = Self { name: format!("tt{}-{number}", id()), here: format!("{network}.1") };
        let Self { name, .. } = &host;
        let made = succeeds(&format!("netns add {name}"))
            && succeeds(&format!("link add {name}h type veth peer name {name}n netns {name}"))
            && succeeds(&format!("addr add {network}.1/30 dev {name}h"))
            && succeeds(&format!("link set {name}h up"))
            && succeeds(&format!("-n {name} addr add {network}.2/30 dev {name}n"))
            && succeeds(&format!("-n {name} link set {name}n up"));
        if !made {
            skipped("several hosts; no network namespace may be made here (iproute2, as root)");
        }
        made.then_some(host)
    }

    /// Interrupts the connection: blocks all traffic without closing connections.
    fn unplug(&self) {
        assert!(succeeds(&format!("-n {0} link set {0}n down", self.name)));
    }

    fn plug(&self) {
        assert!(succeeds(&format!("-n {0} link set {0}n up", self.name)));
    }

    /// Command that runs a program on this host.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.name, program]);
        command
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // The cable ends with it.
        succeeds(&format!("netns del {}", self.name));
    }
}

/// Runs `ip` with these arguments. Returns whether it succeeds.
fn succeeds(arguments: &str) -> bool {
    let done = Command::new("ip").args(arguments.split(' ')).output();
    done.is_ok_and(|output| output.status.success())
}

fn cable_is_pulled(engine: Engine, number: u32) {
    let Some(host) = Host::new(number) else { return };
    let Some(farm) = Farm::many(engine, 400) else { return };
    let folder = tempfile::tempdir().unwrap();
    run(PROGRAM, &["certs", &folder.path().display().to_string(), "--host", &host.here])
        .succeeded();
    let certs = |name: &str| folder.path().join(name).display().to_string();
    let listen = format!("{}:{}", host.here, free_port());
    let (token, url) = (certs("token"), format!("https://{listen}"));
    let mut coordinator = farm.coordinating(&listen);
    coordinator.args(["--tls-cert", &certs("coordinator.pem"), "--token-file", &token]);
    coordinator.args(["--tls-key", &certs("coordinator-key.pem")]);
    let mut coordinator = Process::start(&mut coordinator, "coordinator");
    let credentials = ["--tls-ca", &certs("ca.pem"), "--token-file", &token];
    let worker = |mut command: Command| {
        command.args(["--coordinator", &url, "--cores", "1"]).args(credentials);
        Process::start(&mut command, "worker")
    };
    let far = worker(host.command(WORKER));
    farm.outlives_a_cut(|| host.unplug(), || worker(Command::new(WORKER)), || host.plug());
    Farm::finish(&mut coordinator);
    drop(far);
    farm.assert_undisturbed();
}

#[test]
fn a_cable_pulled_between_hosts_for_longer_than_the_lease_loses_nothing_sqlite() {
    cable_is_pulled(Engine::Sqlite, 0);
}

#[test]
fn a_cable_pulled_between_hosts_for_longer_than_the_lease_loses_nothing_postgres() {
    cable_is_pulled(Engine::Postgres, 1);
}
