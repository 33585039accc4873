//! `tracktwin certs`: certificates and a token for a farm.

use super::files::Force;
use super::{OrInput, Stop, println_stdout};
use clap::Args;
use std::path::PathBuf;
use time::OffsetDateTime;
use tracktwin_farm::security::issue;

/// Arguments of `certs`.
#[derive(Args)]
#[command(after_help = "\
Example:
  tracktwin certs certs --host head --host 10.0.0.1

In DIR: ca.pem and ca-key.pem (the authority), coordinator.pem, coordinator-key.pem, worker.pem,
worker-key.pem and token. Keep ca-key.pem private. Coordinators need coordinator*.pem and token,
workers ca.pem and token. Repeat the command to renew certificates or to change the hosts.")]
pub(super) struct Arguments {
    /// Output folder; an existing authority and token are kept.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Host name or IP address under which workers reach a coordinator; may be repeated.
    #[arg(long = "host", value_name = "NAME", required = true)]
    hosts: Vec<String>,
    /// Validity of the certificates in days; the authority is valid for ten years.
    #[arg(long, default_value_t = 365, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { folder, force, hosts, days } = arguments;
    issue(folder, hosts, *days, OffsetDateTime::now_utc(), force.force).or_input()?;
    let dir = folder.display();
    println_stdout(&format!(
        "{dir}: certificates for {}, valid for {days} days\n\
         keep {dir}/ca-key.pem private; give ca.pem, token and, for mutual TLS, worker*.pem to the workers\n\
         coordinator: --tls-cert {dir}/coordinator.pem --tls-key {dir}/coordinator-key.pem \
         --token-file {dir}/token\n\
         worker:      --tls-ca {dir}/ca.pem --token-file {dir}/token",
        hosts.join(", ")
    ));
    Ok(())
}
