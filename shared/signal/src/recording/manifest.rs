//! `recording.json`. The reader ignores unknown fields and checks the required fields strictly.

use super::error::{Fault, RecordingError};
use super::sleeper::Sleeper;
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use std::path::Path;
use tracktwin_files::FilesError;

/// The name of the file inside a recording's folder.
pub(super) const FILE_NAME: &str = "recording.json";
const FORMAT: &str = "aba-recording/1";

/// Content of `recording.json`.
pub(super) struct Manifest {
    pub sample_rate_hz: f64,
    pub channel: String,
    pub passes: Vec<PassEntry>,
    pub sleepers: Vec<Sleeper>,
    pub nominal: Map<String, Value>,
    /// Corrections and doubts of the import.
    pub notes: Vec<String>,
}

/// One pass of `recording.json`.
#[derive(Clone, Debug)]
pub(super) struct PassEntry {
    pub file: String,
    pub speed_km_h: f64,
    /// Name of the rail.
    pub rail: Option<String>,
    /// Name of the axle.
    pub axle: Option<String>,
    /// Of a simulated pass, the share of the time without contact between wheel and rail.
    pub contact_loss_share: Option<f64>,
}

impl Manifest {
    /// Reads and checks the file at `path`.
    pub(super) fn read(path: &Path) -> Result<Self, RecordingError> {
        Self::of_file(path, true)
    }

    /// The same, but for its passes, which may be missing.
    pub(super) fn read_without_passes(path: &Path) -> Result<Self, RecordingError> {
        Self::of_file(path, false)
    }

    fn of_file(path: &Path, with_passes: bool) -> Result<Self, RecordingError> {
        let fail = |fault| RecordingError::new(path, "file", fault);
        if !path.is_file() {
            return Err(fail(Fault::NoSuchFile));
        }
        let unreadable = |error: FilesError| fail(Fault::Unreadable { reason: error.to_string() });
        let text = tracktwin_files::read_text(path).map_err(unreadable)?;
        let root: Value = serde_json::from_str(&text)
            .map_err(|error| fail(Fault::NotJson { reason: error.to_string() }))?;
        Self::parse(&Fields { path, place: String::new(), value: &root }, with_passes)
    }

    fn parse(root: &Fields<'_>, with_passes: bool) -> Result<Self, RecordingError> {
        let format = root.text("format", "\"aba-recording/1\"")?;
        if format != FORMAT {
            let fault = Fault::WrongFormat { found: format!("\"{format}\""), expected: FORMAT };
            return Err(root.fault("format", fault));
        }
        let expected = "a list of {file, speed_km_h}";
        let passes = if with_passes { root.list("passes", expected)? } else { Vec::new() };
        // An empty list means that their positions are unknown; then the spacing is required.
        let none_known = root.get("sleepers").and_then(Value::as_array).is_some_and(Vec::is_empty);
        let sleepers =
            if none_known { Vec::new() } else { root.list("sleepers", "a list of {id, x_m}")? };
        Ok(Self {
            sample_rate_hz: root.positive("sample_rate_Hz", "the sample rate in Hz")?,
            channel: root.get("channel").and_then(Value::as_str).unwrap_or_default().to_owned(),
            passes: passes.iter().map(PassEntry::parse).collect::<Result<_, _>>()?,
            sleepers: sleepers_along_the_track(root, &sleepers)?,
            nominal: root.get("nominal").and_then(Value::as_object).cloned().unwrap_or_default(),
            notes: root.texts("notes", "a list of texts")?,
        })
    }

    /// The text of the file.
    pub(super) fn to_json(&self) -> String {
        let passes: Vec<_> = self.passes.iter().map(PassEntry::to_json).collect();
        let sleepers: Vec<_> = self
            .sleepers
            .iter()
            .map(|sleeper| json!({"id": sleeper.id, "x_m": sleeper.x_m}))
            .collect();
        let mut root = json!({
            "format": FORMAT,
            "sample_rate_Hz": self.sample_rate_hz,
            "channel": self.channel,
            "passes": passes,
            "sleepers": sleepers,
            "nominal": self.nominal,
        });
        if !self.notes.is_empty() {
            root["notes"] = json!(self.notes);
        }
        format!("{root:#}\n")
    }
}

impl PassEntry {
    fn parse(fields: &Fields<'_>) -> Result<Self, RecordingError> {
        let file = fields.text("file", "the file name of the pass")?.to_owned();
        let speed_km_h = fields.positive("speed_km_h", "the nominal speed in km/h")?;
        let contact_loss_share = fields.get("contact_loss_share").and_then(Value::as_f64);
        let rail = fields.name("rail", "the name of the rail, such as \"left\"")?;
        let axle = fields.name("axle", "the name or number of the axle")?;
        Ok(Self { file, speed_km_h, rail, axle, contact_loss_share })
    }

    fn to_json(&self) -> Value {
        let mut entry = json!({"file": self.file, "speed_km_h": self.speed_km_h});
        for (key, name) in [("rail", &self.rail), ("axle", &self.axle)] {
            if let Some(name) = name {
                entry[key] = json!(name);
            }
        }
        if let Some(share) = self.contact_loss_share {
            entry["contact_loss_share"] = json!(share);
        }
        entry
    }
}

fn sleepers_along_the_track(
    root: &Fields<'_>,
    entries: &[Fields<'_>],
) -> Result<Vec<Sleeper>, RecordingError> {
    let mut sleepers = Vec::with_capacity(entries.len());
    let mut ids = HashSet::new();
    for entry in entries {
        let id = entry.text("id", "the id of the sleeper")?.to_owned();
        if !ids.insert(id.clone()) {
            return Err(root.fault("sleepers", Fault::SleeperTwice { id }));
        }
        sleepers.push(Sleeper { id, x_m: entry.number("x_m", "its position in m")? });
    }
    sleepers.sort_by(|a, b| a.x_m.total_cmp(&b.x_m));
    Ok(sleepers)
}

/// An object of the file with its path, for messages.
struct Fields<'a> {
    path: &'a Path,
    place: String,
    value: &'a Value,
}

impl<'a> Fields<'a> {
    fn get(&self, name: &str) -> Option<&'a Value> {
        self.value.get(name)
    }

    fn fault(&self, name: &str, fault: Fault) -> RecordingError {
        RecordingError::new(self.path, format!("{}{name}", self.place), fault)
    }

    fn needed(&self, name: &str, expected: &'static str) -> Result<&'a Value, RecordingError> {
        self.get(name)
            .ok_or_else(|| self.fault(name, Fault::NoField { remedy: format!("add {expected}") }))
    }

    fn wrong(&self, name: &str, found: &Value, expected: &'static str) -> RecordingError {
        let text: String = found.to_string().chars().take(40).collect();
        self.fault(name, Fault::WrongValue { found: text, expected })
    }

    fn text(&self, name: &str, expected: &'static str) -> Result<&'a str, RecordingError> {
        let value = self.needed(name, expected)?;
        value.as_str().ok_or_else(|| self.wrong(name, value, expected))
    }

    /// A name: text, or a whole number. `None` if the field is missing.
    fn name(&self, name: &str, expected: &'static str) -> Result<Option<String>, RecordingError> {
        match self.get(name) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) if !text.is_empty() => Ok(Some(text.clone())),
            Some(Value::Number(number)) if number.is_u64() => Ok(Some(number.to_string())),
            Some(other) => Err(self.wrong(name, other, expected)),
        }
    }

    fn number(&self, name: &str, expected: &'static str) -> Result<f64, RecordingError> {
        let value = self.needed(name, expected)?;
        value.as_f64().ok_or_else(|| self.wrong(name, value, expected))
    }

    fn positive(&self, name: &str, expected: &'static str) -> Result<f64, RecordingError> {
        let number = self.number(name, expected)?;
        if number > 0.0 {
            return Ok(number);
        }
        Err(self.fault(name, Fault::WrongValue { found: number.to_string(), expected }))
    }

    /// A list of texts. Empty if the field is missing.
    fn texts(&self, name: &str, expected: &'static str) -> Result<Vec<String>, RecordingError> {
        let Some(value) = self.get(name).filter(|value| !value.is_null()) else {
            return Ok(Vec::new());
        };
        let text = |entry: &Value| entry.as_str().map(str::to_owned);
        let texts = value.as_array().and_then(|entries| entries.iter().map(text).collect());
        texts.ok_or_else(|| self.wrong(name, value, expected))
    }

    fn list(&self, name: &str, expected: &'static str) -> Result<Vec<Fields<'a>>, RecordingError> {
        let value = self.needed(name, expected)?;
        let entries = value.as_array().filter(|entries| !entries.is_empty());
        let entries = entries.ok_or_else(|| self.wrong(name, value, expected))?;
        let field = |(index, value)| Fields {
            path: self.path,
            place: format!("{}{name}[{index}].", self.place),
            value,
        };
        Ok(entries.iter().enumerate().map(field).collect())
    }
}
