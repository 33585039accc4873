//! Extensions on the command line: `--extend` and `--extension`.

use super::super::files::read_text;
use super::super::{OrInput, Stop};
use anyhow::{Context, anyhow};
use clap::Args;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::PathBuf;
use tracktwin_track::extension::{ExtensionInstance, Kind, KindParameter};

/// Physics beyond the paper's model, and faults of the measuring chain.
#[derive(Args)]
pub(in crate::commands) struct Extensions {
    /// Extension: physics beyond the paper or a fault of the measuring chain, e.g.
    /// `sleeper_bolt:stiffness_N_per_m=3e7`, `hanging_sleeper@SN19-SN20:gap_m=2e-4`,
    /// `fastening_clamp@SN10-SN22/4:...`, `rail_joint@2.4375m:dip_m=8e-5`, `corrugation@2m-3m:...`;
    /// may be repeated. `--extend list` lists all kinds with their parameters.
    #[arg(long = "extend", value_name = "NAME[@PLACE][:PARAMETER=VALUE,...]")]
    extend: Vec<String>,
    /// TOML file with `[[extension]]` tables, each with `physics`, `x_m` or `sleepers`, and
    /// parameters; may be repeated.
    #[arg(long = "extension", value_name = "FILE.toml")]
    files: Vec<PathBuf>,
}

/// A file of extensions.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    extension: Vec<ExtensionInstance>,
}

impl Extensions {
    /// Whether only the list of all kinds is requested.
    pub(in crate::commands) fn asks_for_list(&self) -> bool {
        self.extend.iter().any(|text| text == "list")
    }

    /// The extensions of the files, then those of the command line.
    pub(in crate::commands) fn instances(&self) -> Result<Vec<ExtensionInstance>, Stop> {
        let mut instances = Vec::new();
        for path in &self.files {
            let shown = path.display();
            let text = read_text(path).context("--extension").or_input()?;
            let file: File = toml::from_str(&text)
                .map_err(|error| anyhow!("--extension: {shown}: {}", error.message()))
                .or_input()?;
            instances.extend(file.extension);
        }
        for text in &self.extend {
            let instance = text.parse().map_err(|error| anyhow!("--extend {text}: {error}"));
            instances.push(instance.or_input()?);
        }
        for instance in &instances {
            instance.check_numbers().or_input()?;
        }
        Ok(instances)
    }
}

/// All kinds with their parameters, on a track whose lengths are `length_ratio` times those of V-Track.
pub(in crate::commands) fn list(length_ratio: f64) -> String {
    let parameter = |parameter: &KindParameter| {
        let typical = rounded(parameter.scaled(parameter.typical, length_ratio));
        let given = parameter
            .default_at(length_ratio)
            .map_or(format!("required, e.g. {typical:e}"), |it| format!("default {}", rounded(it)));
        format!("\n  {}: {}; {given}", parameter.name, parameter.meaning)
    };
    let kind = |kind: &Kind| {
        let chain = if kind.measuring_chain { " (measuring chain)" } else { "" };
        let parameters: String = kind.parameters.iter().map(parameter).collect();
        format!("{}: {}{chain}\n  {}{parameters}", kind.physics, kind.summary, kind.place.form())
    };
    Kind::all().map(kind).collect::<Vec<_>>().join("\n")
}

/// The same as [`list`], as JSON.
pub(in crate::commands) fn list_json(length_ratio: f64) -> Value {
    let parameter = |parameter: &KindParameter| {
        let KindParameter { name, unit, meaning, typical, .. } = parameter;
        let typical = parameter.scaled(*typical, length_ratio);
        let default = parameter.default_at(length_ratio);
        json!({
            "name": name, "unit": unit, "meaning": meaning, "typical": typical, "default": default,
        })
    };
    let kind = |kind: &Kind| {
        let parameters: Value = kind.parameters.iter().map(parameter).collect();
        json!({
            "physics": kind.physics, "summary": kind.summary, "place": kind.place.form(),
            "measuring_chain": kind.measuring_chain, "parameters": parameters,
        })
    };
    Kind::all().map(kind).collect()
}

/// The value with two significant digits, for people.
fn rounded(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}
