//! Evaluation of samples while they are recorded: its rows equal those of `evaluate`, for every source of
//! samples.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use system_tests::{Answer, COARSE_MODEL, run};
use tempfile::TempDir;
use tracktwin_signal::recording::Recording;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");

/// Models of a small library, and a recording of one pass at their speed.
struct Prepared {
    folder: TempDir,
    /// Position in m and acceleration in m/s2 of the pass.
    samples: Vec<[f64; 2]>,
    rate_hz: f64,
}

/// Models and recording, created once for all tests.
fn prepared() -> &'static Prepared {
    static PREPARED: OnceLock<Prepared> = OnceLock::new();
    PREPARED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        let (campaign, library) = (path("campaign.toml"), library(&folder));
        fs::write(&campaign, format!("name = \"stream\"\ncases = 200\n{COARSE_MODEL}")).unwrap();
        run(PROGRAM, &["run", &campaign, "--out", &path("out"), "--library", &library]).succeeded();
        let coarse = ["--spans", "40", "--rail-elements", "2", "--sleeper-elements", "2"];
        let ride = path("ride");
        let simulate = ["simulate", "--out", &ride, "--speed", "13", "--time-step", "5e-5"];
        run(PROGRAM, &[&simulate[..], &coarse].concat()).succeeded();
        let recording = Recording::open(&ride).unwrap();
        let pass = &recording.passes[0];
        let pairs = pass.position_m.iter().zip(pass.signal.samples());
        let samples = pairs.map(|(&position, &acceleration)| [position, acceleration]).collect();
        Prepared { samples, rate_hz: recording.sample_rate_hz, folder }
    })
}

fn library(folder: &TempDir) -> String {
    format!("sqlite:{}", folder.path().join("library.sqlite").display())
}

impl Prepared {
    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// The pass as CSV with times.
    fn csv(&self) -> String {
        let mut text = "time_s,position_m,acceleration_m_s2\n".to_owned();
        for (index, [position, acceleration]) in self.samples.iter().enumerate() {
            let time = index as f64 / self.rate_hz;
            writeln!(text, "{time},{position},{acceleration}").unwrap();
        }
        text
    }

    fn command(&self, further: &[&str]) -> Command {
        let mut command = Command::new(PROGRAM);
        command.args(["stream", &self.path("ride"), "--models", &self.path("out/models")]);
        command.args(["--library", &library(&self.folder)]).args(further);
        command
    }

    fn start(&self, further: &[&str]) -> Child {
        let mut command = self.command(further);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// Output of the program for samples on its standard input.
    fn streamed(&self, further: &[&str], samples: &[u8]) -> Answer {
        let mut child = self.start(further);
        let mut input = child.stdin.take().unwrap();
        std::thread::scope(|scope| {
            // The program may end before it has read all.
            scope.spawn(move || drop(input.write_all(samples)));
            let output = child.wait_with_output().unwrap();
            Answer {
                code: output.status.code(),
                out: String::from_utf8(output.stdout).unwrap(),
                err: String::from_utf8(output.stderr).unwrap(),
            }
        })
    }
}

fn rows(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn rows_have_the_numbers_of_the_batch_and_binary_samples_those_of_csv() {
    let prepared = prepared();
    let answer = prepared.streamed(&[], prepared.csv().as_bytes());
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.err);
    assert!(answer.err.contains("sleepers evaluated"), "{}", answer.err);

    let (ride, models, out) =
        (prepared.path("ride"), prepared.path("out/models"), prepared.path("result"));
    let library = library(&prepared.folder);
    let with = ["--method", "gp", "--models", &models, "--library", &library, "--out", &out];
    run(PROGRAM, &[&["evaluate", &ride][..], &with].concat());
    let batch = fs::read_to_string(format!("{out}/evaluation.json")).unwrap();
    let batch: Value = serde_json::from_str(&batch).unwrap();
    let batch = batch["sleepers"].as_array().unwrap();
    let streamed = rows(&answer.out);
    assert_eq!(streamed.len(), batch.len());
    for (row, sleeper) in streamed.iter().zip(batch) {
        assert_eq!(row["format"], "tracktwin-stream/1");
        assert_eq!((&row["id"], &row["x_m"]), (&sleeper["id"], &sleeper["x_m"]));
        assert_eq!(row["selector"], sleeper["selector"]);
        assert_eq!(row["measured"], sleeper["measured"]);
        for (parameter, sd) in sleeper["sd_if_even"].as_object().unwrap() {
            let pairs = [
                (&row[parameter]["mean"], &sleeper[parameter]["mean"]),
                (&row["sd_if_even"][parameter], sd),
            ];
            for (found, expected) in pairs.map(|(a, b)| (a.as_f64().unwrap(), b.as_f64().unwrap()))
            {
                // Predictions of one and of many add in another order.
                assert!((found / expected - 1.0).abs() < 1e-9, "{parameter}: {found} {expected}");
            }
        }
    }

    let records = prepared.samples.iter().flat_map(|[position, acceleration]| {
        [f64::NAN, *position, *acceleration].map(f64::to_le_bytes).concat()
    });
    let binary = prepared.streamed(&["--format", "binary"], &records.collect::<Vec<u8>>());
    assert_eq!(binary.out, answer.out);
}

#[test]
fn a_burst_of_missing_samples_costs_the_sleepers_that_it_hides() {
    let prepared = prepared();
    let mut lines: Vec<String> = prepared.csv().lines().map(str::to_owned).collect();
    let middle = lines.len() / 2;
    // A window is 692 samples.
    for line in &mut lines[middle..middle + 900] {
        let (before, _) = line.rsplit_once(',').unwrap();
        *line = format!("{before},NaN");
    }
    let answer = prepared.streamed(&[], (lines.join("\n") + "\n").as_bytes());
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.err);
    let rows = rows(&answer.out);
    let hidden = rows.iter().filter(|row| row["reason"] == "not_finite").count();
    assert!((1..=2).contains(&hidden), "{hidden}");
    assert!(rows.len() > 20 && rows.iter().filter(|row| row["flags"].is_array()).count() > 20);
}

#[test]
fn garbage_ends_the_stream_with_its_line_after_the_rows_before_it() {
    let prepared = prepared();
    let mut lines: Vec<String> = prepared.csv().lines().map(str::to_owned).collect();
    let middle = lines.len() / 2;
    lines[middle] = "1.5,#VALUE!,3".to_owned();
    let answer = prepared.streamed(&[], (lines.join("\n") + "\n").as_bytes());
    assert_eq!(answer.code, Some(2));
    let expected = format!(
        "tracktwin: standard input: line {}: position_m: \"#VALUE!\" is not a number; write NaN where \
         a sample is missing\n",
        middle + 1
    );
    assert_eq!(answer.err, expected);
    assert!(rows(&answer.out).len() > 5);
}

#[test]
fn a_stream_that_ends_inside_a_line_or_is_not_read_to_its_end_is_no_error() {
    let prepared = prepared();
    let csv = prepared.csv();
    let cut = &csv[..csv.len() * 2 / 3];
    let answer = prepared.streamed(&[], cut.trim_end().as_bytes());
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.err);
    assert!(answer.err.contains("ends inside a line"), "{}", answer.err);
    let rows = rows(&answer.out);
    assert_eq!(rows.last().unwrap()["reason"], "not_covered");

    let mut child = prepared.start(&[]);
    let mut input = child.stdin.take().unwrap();
    let mut first = String::new();
    std::thread::scope(|scope| {
        scope.spawn(move || drop(input.write_all(csv.as_bytes())));
        let mut reader = BufReader::new(child.stdout.take().unwrap());
        reader.read_line(&mut first).unwrap();
        drop(reader);
        assert_eq!(child.wait().unwrap().code(), Some(0));
    });
    assert!(first.starts_with("{\"format\":\"tracktwin-stream/1\""), "{first}");
}

#[test]
fn samples_and_rows_go_over_tcp() {
    let prepared = prepared();
    let receiver = TcpListener::bind("127.0.0.1:0").unwrap();
    let to = receiver.local_addr().unwrap().to_string();
    let mut child = prepared.start(&["--listen", "127.0.0.1:0", "--to", &to]);
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("waiting for samples at ").unwrap();
    let mut sender = TcpStream::connect(address).unwrap();
    let (mut rows_in, _) = receiver.accept().unwrap();
    let mut received = String::new();
    std::thread::scope(|scope| {
        scope.spawn(move || sender.write_all(prepared.csv().as_bytes()).unwrap());
        rows_in.read_to_string(&mut received).unwrap();
    });
    assert!(matches!(child.wait().unwrap().code(), Some(0 | 1)));
    let expected = prepared.streamed(&[], prepared.csv().as_bytes());
    assert_eq!(received, expected.out);
}

#[test]
fn what_does_not_fit_the_models_is_refused_before_samples_are_read() {
    let prepared = prepared();
    let ride = fs::read_to_string(prepared.path("ride/recording.json")).unwrap();
    let mut stated: Value = serde_json::from_str(&ride).unwrap();
    stated.as_object_mut().unwrap().remove("passes");
    stated["nominal"]["wheel"]["mass_kg"] = 600.into();
    let section = prepared.path("section");
    fs::create_dir(&section).unwrap();
    fs::write(format!("{section}/recording.json"), stated.to_string()).unwrap();
    let (models, library) = (prepared.path("out/models"), library(&prepared.folder));
    let with = ["--models", &models, "--library", &library];
    let answer = run(PROGRAM, &[&["stream", &section][..], &with].concat());
    assert_eq!(answer.code, Some(2));
    assert!(answer.err.contains("600 kg"), "{}", answer.err);
    let folder = prepared.path("ride");
    let wrong: [&[&str]; 5] = [
        &["--input", "/no/such/file"],
        &["--input", &folder],
        &["--to", "localhost"],
        &["--listen", "0.0.0.0:0"],
        &["--insecure"],
    ];
    for further in wrong {
        let answer = prepared.command(further).output().unwrap();
        assert_eq!(answer.status.code(), Some(2), "{further:?}");
    }
}
