//! The track that a command uses: from a file, from a recording, or a preset.

use super::{OrInput, Stop};
use anyhow::anyhow;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};
use tracktwin_parameters::{Preset, Track};
use tracktwin_signal::recording::{Recording, StatedTrack};

/// Maximum number of keys of `recording.json` that a note lists individually.
const LISTED: usize = 4;

/// The option that describes a track.
#[derive(Args, Clone, Debug)]
pub(super) struct TrackOption {
    /// Description of track and vehicle, as `tracktwin new` writes it [default: what recording.json
    /// states under `nominal`].
    #[arg(long, value_name = "FILE")]
    pub(super) track: Option<PathBuf>,
}

impl TrackOption {
    /// Returns the track with which a recording is compared, and notes on assumed values.
    pub(super) fn of(&self, recording: &Recording) -> Result<(Track, Vec<String>), Stop> {
        match &self.track {
            Some(path) => Ok((read(path)?, Vec::new())),
            None => Ok(stated(recording)),
        }
    }
}

/// The options that choose a track where there is no recording.
#[derive(Args, Clone, Debug)]
pub(super) struct TrackChoice {
    /// Preset that gives the nominal track.
    #[arg(long, value_name = "NAME", default_value = Preset::VTrack.name(), value_parser = preset_parser())]
    preset: Preset,
    /// Description of track and vehicle, as `tracktwin new` writes it, instead of a preset.
    #[arg(long, value_name = "FILE", conflicts_with = "preset")]
    track: Option<PathBuf>,
}

impl TrackChoice {
    /// Returns the selected track.
    pub(super) fn track(&self) -> Result<Track, Stop> {
        self.track.as_deref().map_or_else(|| Ok(self.preset.track()), read)
    }
}

/// Parses the name of a preset.
pub(super) fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    parser_of(|_| true)
}

/// Parses the name of one of the presets that `is_possible` selects.
pub(super) fn parser_of(
    is_possible: impl Fn(Preset) -> bool,
) -> impl TypedValueParser<Value = Preset> {
    let possible = Preset::ALL.iter().filter(|preset| is_possible(**preset));
    PossibleValuesParser::new(possible.map(|preset| preset.name()))
        .map(|name| Preset::from_name(&name).expect("only names of presets are possible"))
}

/// Reads a track file.
pub(super) fn read(path: &Path) -> Result<Track, Stop> {
    let text = tracktwin_files::read_text(path).or_input()?;
    Track::parse(&text).map_err(|error| anyhow!("{}: {error}", path.display())).or_input()
}

/// Returns the track described in a recording, and a note on missing values.
pub(super) fn stated(recording: &Recording) -> (Track, Vec<String>) {
    let StatedTrack { track, preset, assumed } = recording.stated_track();
    // On the rig a recording states what is its own; its track is known.
    let is_rig = preset == Preset::VTrack && track == Preset::VTrack.track();
    if assumed.is_empty() || is_rig {
        return (track, Vec::new());
    }
    let more = match assumed.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let listed = assumed.iter().take(LISTED).cloned().collect::<Vec<_>>().join(", ");
    let note = format!(
        "recording.json does not state {listed}{more}: the values of {} are assumed; write what you \
         know with `tracktwin new DIR --from RECORDING` and pass the file with --track",
        track.name
    );
    (track, vec![note])
}
