//! `tracktwin certs`: what a farm needs to trust its own.

use super::files::Force;
use super::{OrInput, Stop, println_stdout};
use clap::Args;
use std::path::PathBuf;
use time::OffsetDateTime;
use tracktwin_farm::security::issue;

/// What `certs` is told.
#[derive(Args)]
pub(super) struct Arguments {
    /// Folder to write to; an authority and a token that are there stay.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Name or address by which workers reach a coordinator; may be repeated.
    #[arg(long = "host", value_name = "NAME", required = true)]
    hosts: Vec<String>,
    /// How long the certificates are valid; the authority is for ten years.
    #[arg(long, default_value_t = 365, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { folder, force, hosts, days } = arguments;
    issue(folder, hosts, *days, OffsetDateTime::now_utc(), force.force).or_input()?;
    let dir = folder.display();
    println_stdout(&format!(
        "{dir}: certificates for {}, valid for {days} days\n\
         keep {dir}/ca-key.pem; hand ca.pem, token and, for mutual TLS, worker*.pem to workers\n\
         coordinator: --tls-cert {dir}/coordinator.pem --tls-key {dir}/coordinator-key.pem \
         --token-file {dir}/token\n\
         worker:      --tls-ca {dir}/ca.pem --token-file {dir}/token",
        hosts.join(", ")
    ));
    Ok(())
}
