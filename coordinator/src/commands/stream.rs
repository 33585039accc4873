//! `tracktwin stream`: estimates of the track parameters while a pass is recorded.

use super::library_url::LibraryUrl;
use super::models::load_models;
use super::recording::check_sleepers;
use super::{OrInput, Stop, println_stderr, write_stdout};
use crate::pipeline::compute::compute;
use crate::pipeline::evaluate::Evaluator;
use crate::pipeline::stream::{Streamed, StreamingError, run as stream_rows};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tracktwin_evaluation::{Row, check_recording};
use tracktwin_signal::recording::Recording;
use tracktwin_signal::samples::{Framing, SampleReader};

/// Maximum number of bytes read at once; it corresponds to some ten milliseconds of samples at 100 kHz.
const BUFFER_BYTES: usize = 1 << 16;

/// A connection that sends nothing for this time counts as closed.
const SILENCE: Duration = Duration::from_secs(30);

/// Arguments of `stream`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  recorder | tracktwin stream section --models out/models --library sqlite:out/library.sqlite
  tracktwin stream section --models out/models --library sqlite:out/library.sqlite \\
      --listen 127.0.0.1:7790 --to 127.0.0.1:7791

Samples as csv: the first line names the columns position_m, acceleration_m_s2 and, if known, time_s;
a line per sample; an empty value or NaN is a missing sample. As binary: records of three
little-endian 64-bit numbers, time_s (NaN: not known), position_m, acceleration_m_s2.

Rows are lines of JSON, one per sleeper, with the fields of the sleepers in evaluation.json, or with
the reason why there are no estimates. The time per sleeper is printed on standard error at the end.

Exit codes: 0 done, 1 done, but most sleepers have no valid estimates, 2 wrong input, 3 failure.")]
pub(super) struct Arguments {
    /// Folder with the `recording.json` of the section of track: sample rate, sleepers and track; it
    /// needs no passes.
    section: PathBuf,
    /// Folder of trained models, written by `train` or `run`.
    #[arg(long, value_name = "DIR")]
    models: PathBuf,
    #[command(flatten)]
    library: LibraryUrl,
    /// File or pipe to read samples from [default: standard input].
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
    /// Address, as IP:PORT, at which one TCP connection is awaited that sends samples; plain text,
    /// without a password. A connection that is silent for 30 s counts as closed.
    #[arg(long, value_name = "ADDR", conflicts_with = "input")]
    listen: Option<SocketAddr>,
    /// Allow --listen at an address that other machines can reach, on a trusted network.
    #[arg(long, requires = "listen")]
    insecure: bool,
    /// Format of the samples.
    #[arg(long, value_enum, default_value_t = Format::Csv)]
    format: Format,
    /// Send rows to this TCP address, as HOST:PORT, instead of standard output.
    #[arg(long, value_name = "ADDR", value_parser = host_and_port)]
    to: Option<String>,
}

/// Formats of samples on the command line.
#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Lines of CSV.
    Csv,
    /// Records of three little-endian 64-bit numbers.
    Binary,
}

impl Format {
    const fn framing(self) -> Framing {
        match self {
            Self::Csv => Framing::Csv,
            Self::Binary => Framing::Binary,
        }
    }
}

pub(super) async fn run(arguments: Arguments) -> Result<(), Stop> {
    let Arguments { section, models, library, input, listen, insecure, format, to } = arguments;
    listen.filter(|_| !insecure).map_or(Ok(()), check_address)?;
    let section = open(&section)?;
    let library = library.open_whole().await?;
    let models = load_models(&models)?;
    let evaluator = Evaluator::new(models, &library).await.map_err(super::evaluate::stop)?;
    for note in evaluator.notes() {
        println_stderr(&note);
    }
    let design = evaluator.design_for(&section);
    check_recording(&section, &design, &evaluator.set().speeds_km_h).or_input()?;
    let mut rows = Rows::open(to.as_deref())?;
    let streamed = compute(|| -> Result<Streamed, Stop> {
        let stream = evaluator.stream(&section).or_input()?;
        // Models are ready before a sender may connect: what it sends is read at once.
        let (name, input) = samples(input, listen)?;
        let mut reader = SampleReader::new(input, format.framing());
        let ended = stream_rows(&mut reader, stream, &mut |row| rows.write(row));
        ended.map_err(|error| stop(&name, &error))
    })?;
    rows.end()?;
    conclude(&streamed)
}

/// Reads the `recording.json` of the section of track.
fn open(folder: &Path) -> Result<Recording, Stop> {
    let section = Recording::without_passes(folder).or_input()?;
    check_sleepers(folder, &section)?;
    Ok(section)
}

/// Returns an error if other machines can connect to this address and `--insecure` is not given.
fn check_address(address: SocketAddr) -> Result<(), Stop> {
    if address.ip().is_loopback() {
        return Ok(());
    }
    Err(Stop::Input(anyhow!(
        "--listen: {address} is reachable from other machines, but requires no certificate and no \
         password; use 127.0.0.1, or use --insecure on a trusted network"
    )))
}

/// Checks that a text has the form HOST:PORT.
fn host_and_port(text: &str) -> Result<String, &'static str> {
    match text.rsplit_once(':') {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
            Ok(text.to_owned())
        }
        _ => Err("give HOST:PORT, such as 127.0.0.1:7791"),
    }
}

/// Opens the source of the samples; the text is its name in error messages.
fn samples(
    input: Option<PathBuf>,
    listen: Option<SocketAddr>,
) -> Result<(String, Box<dyn BufRead>), Stop> {
    if let Some(address) = listen {
        let failed = || format!("--listen {address}");
        let listener = TcpListener::bind(address).with_context(failed)?;
        println_stderr(&format!("waiting for samples at {}", listener.local_addr()?));
        let (connection, sender) = listener.accept().with_context(failed)?;
        connection.set_read_timeout(Some(SILENCE)).with_context(failed)?;
        let reader = BufReader::with_capacity(BUFFER_BYTES, Sender(connection));
        return Ok((sender.to_string(), Box::new(reader)));
    }
    let Some(path) = input else {
        let reader = BufReader::with_capacity(BUFFER_BYTES, std::io::stdin());
        return Ok(("standard input".to_owned(), Box::new(reader)));
    };
    let name = path.display().to_string();
    if path.is_dir() {
        return Err(Stop::Input(anyhow!("--input {name}: is a folder; give a file or a pipe")));
    }
    let file = File::open(&path).with_context(|| name.clone()).or_input()?;
    Ok((name, Box::new(BufReader::with_capacity(BUFFER_BYTES, file))))
}

/// A connection that sends samples. A silence of [`SILENCE`] ends it like the end of the connection.
struct Sender(TcpStream);

impl Read for Sender {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.0.read(buffer) {
            // Systems differ in how they name a timeout.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                let seconds = SILENCE.as_secs();
                println_stderr(&format!("no samples for {seconds} s: the stream counts as ended"));
                Ok(0)
            }
            read => read,
        }
    }
}

/// Destination of the rows.
enum Rows {
    Stdout,
    Tcp { connection: TcpStream, name: String, error: Option<std::io::Error> },
}

impl Rows {
    fn open(to: Option<&str>) -> Result<Self, Stop> {
        let Some(name) = to else { return Ok(Self::Stdout) };
        let failed = || format!("--to {name}");
        let connection = TcpStream::connect(name).with_context(failed)?;
        // Rows are short and are sent one by one.
        connection.set_nodelay(true).with_context(failed)?;
        Ok(Self::Tcp { connection, name: name.to_owned(), error: None })
    }

    /// Writes a row immediately. Returns `Break` if the receiver no longer reads.
    fn write(&mut self, row: &Row) -> ControlFlow<()> {
        let line = row.to_json() + "\n";
        let is_read = match self {
            Self::Stdout => write_stdout(line.as_bytes()),
            Self::Tcp { connection, error, .. } => {
                *error = connection.write_all(line.as_bytes()).err();
                error.is_none()
            }
        };
        if is_read { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    /// Ends the output. A receiver that ends the connection is no error; any other fault is a failure.
    fn end(self) -> Result<(), Stop> {
        match self {
            Self::Tcp { name, error: Some(error), .. }
                if !matches!(error.kind(), ErrorKind::BrokenPipe | ErrorKind::ConnectionReset) =>
            {
                Err(Stop::Failure(anyhow!("--to {name}: {error}")))
            }
            _ => Ok(()),
        }
    }
}

/// Converts an error: invalid samples are wrong input, a failing source is a failure.
fn stop(name: &str, error: &StreamingError) -> Stop {
    let is_failure = matches!(error, StreamingError::Samples(samples) if !samples.is_wrong_input());
    let error = anyhow!("{name}: {error}");
    if is_failure { Stop::Failure(error) } else { Stop::Input(error) }
}

/// Prints a summary with the computing times.
fn conclude(streamed: &Streamed) -> Result<(), Stop> {
    let Streamed { rows, evaluated, outside, not_tested, computing, longest, .. } = *streamed;
    if streamed.is_left {
        return Ok(());
    }
    if streamed.is_cut {
        println_stderr("the stream ends inside a line or record, which is left out");
    }
    let each_ms = 1e3 * computing.as_secs_f64() / evaluated.max(1) as f64;
    let longest_ms = 1e3 * longest.as_secs_f64();
    let not_tested = match not_tested {
        0 => String::new(),
        sleepers => format!(", {sleepers} not tested against it, because no window was whole"),
    };
    println_stderr(&format!(
        "{evaluated} of {rows} sleepers evaluated, {outside} outside the library{not_tested}; \
         {each_ms:.1} ms of computation each, at most {longest_ms:.1} ms for the rows of one sample"
    ));
    if streamed.is_negative() { Err(Stop::Negative) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_that_others_reach_is_refused_with_the_remedy() {
        assert!(check_address("127.0.0.1:7790".parse().unwrap()).is_ok());
        assert!(check_address("[::1]:7790".parse().unwrap()).is_ok());
        for address in ["0.0.0.0:7790", "10.0.0.7:7790"] {
            let Err(Stop::Input(error)) = check_address(address.parse().unwrap()) else {
                panic!("{address}");
            };
            let text = error.to_string();
            assert!(text.contains(address) && text.contains("--insecure"), "{text}");
        }
    }

    #[test]
    fn a_receiver_needs_a_host_and_a_port() {
        assert!(["localhost:1", "[::1]:65535"].iter().all(|text| host_and_port(text).is_ok()));
        for text in ["localhost", ":7791", "localhost:", "localhost:70000", "127.0.0.1"] {
            assert!(host_and_port(text).is_err(), "{text}");
        }
    }
}
