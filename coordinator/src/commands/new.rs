//! `tracktwin new`: writes the description of a track, to be changed and passed on with `--track`.

use super::files::{Force, check, make_folder};
use super::track::{preset_parser, stated};
use super::{OrInput, Stop, println_stderr, println_stdout};
use clap::Args;
use std::path::PathBuf;
use tracktwin_files::{FileName, Kind, Output};
use tracktwin_parameters::Preset;
use tracktwin_signal::recording::Recording;

/// Name of the file.
const FILE: &str = "track.toml";

/// Arguments of `new`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tracktwin new line --preset 60E1-concrete
  tracktwin new line --from ride

Next: `tracktwin check line/track.toml`, then pass the file with --track to `simulate`, `receptance`,
`evaluate` or `diagnose`.")]
pub(super) struct Arguments {
    /// Folder for track.toml, created if missing.
    folder: PathBuf,
    /// Preset to start from.
    #[arg(long, value_name = "NAME", value_parser = preset_parser(), required_unless_present = "from")]
    preset: Option<Preset>,
    /// Recording whose `nominal` is described; what it does not state comes from a preset.
    #[arg(long, value_name = "RECORDING", conflicts_with = "preset")]
    from: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Stop> {
    let Arguments { folder, preset, from, force } = arguments;
    check(folder, Kind::Description, *force, &[FILE])?;
    let text = match (preset, from) {
        (Some(preset), _) => preset.text(),
        (None, Some(from)) => {
            let (track, notes) = stated(&Recording::without_passes(from).or_input()?);
            for note in &notes {
                println_stderr(note);
            }
            track.to_toml()
        }
        (None, None) => Preset::VTrack.text(),
    };
    make_folder(folder)?;
    let mut output = Output::begin(folder, Kind::Description, force.force)?;
    output.add(&FileName::new(FILE)?, text.as_bytes())?;
    output.commit()?;
    println_stdout(&format!("track: {}", folder.join(FILE).display()));
    Ok(())
}
