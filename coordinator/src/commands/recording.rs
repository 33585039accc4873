//! The recording of a command, and the channel of which it takes the passes.

use super::shell::{quoted, quoted_path};
use super::{OrInput, Stop, println_stderr};
use anyhow::anyhow;
use clap::Args;
use std::path::{Path, PathBuf};
use tracktwin_inspection::chain::{self, with_equal_axles};
use tracktwin_signal::recording::{Recording, RecordingError, Selection};

/// The argument that names a recording, and its channel.
#[derive(Args, Clone, Debug)]
pub(super) struct RecordingArgument {
    /// The recording: a folder with `recording.json` and one file per pass.
    recording: PathBuf,
    #[command(flatten)]
    channel: Channel,
}

/// The options that select passes of a recording with several channels.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct Channel {
    /// Only passes over this rail, by its name in recording.json; needed if the recording has passes over
    /// several rails.
    #[arg(long, value_name = "NAME", requires = "recording")]
    rail: Option<String>,
    /// Only passes of this axle, by its name in recording.json [default: all axles].
    #[arg(long, value_name = "NAME", requires = "recording")]
    axle: Option<String>,
}

impl Channel {
    /// Reads the passes of this channel of the recording in a folder. Of several axles, the sensors get one
    /// sensitivity.
    pub(super) fn open(&self, folder: &Path) -> Result<Recording, RecordingError> {
        let selection = Selection { rail: self.rail.clone(), axle: self.axle.clone() };
        Recording::open_selected(folder, &selection).map(with_equal_axles)
    }
}

impl RecordingArgument {
    /// The folder.
    pub(super) fn folder(&self) -> &Path {
        &self.recording
    }

    /// The channel.
    pub(super) const fn channel(&self) -> &Channel {
        &self.channel
    }

    /// Reads the passes of the channel.
    pub(super) fn open(&self) -> Result<Recording, RecordingError> {
        self.channel.open(&self.recording)
    }

    /// The argument and options, as typed in a shell.
    pub(super) fn typed(&self) -> String {
        let option = |name: &str, value: &Option<String>| {
            value.as_ref().map(|value| format!(" --{name} {}", quoted(value))).unwrap_or_default()
        };
        let Channel { rail, axle } = &self.channel;
        format!("{}{}{}", quoted_path(&self.recording), option("rail", rail), option("axle", axle))
    }
}

/// Reads the passes of a channel of the recording in a folder.
pub(super) fn open(folder: &Path, channel: &Channel) -> Result<Recording, Stop> {
    let recording = channel.open(folder).or_input()?;
    check_sleepers(folder, &recording)?;
    usable(&recording)?;
    Ok(recording)
}

/// Returns an error for a recording without sleepers; `folder` is its path.
pub(super) fn check_sleepers(folder: &Path, recording: &Recording) -> Result<(), Stop> {
    if recording.sleepers.is_empty() {
        return Err(Stop::Input(anyhow!(
            "{}/recording.json: sleepers: the list is empty; add the positions of the sleepers, \
             or import with --sleeper",
            folder.display()
        )));
    }
    Ok(())
}

/// The usable part of a recording, and notes on its defects. The notes are also printed.
pub(super) fn usable_with_notes(recording: &Recording) -> Result<(Recording, Vec<String>), Stop> {
    let (recording, left_out) = usable(recording)?;
    let notes = [recording.doubts.clone(), left_out].concat();
    for line in &notes {
        println_stderr(line);
    }
    Ok((recording, notes))
}

/// The recording without unusable passes, and a note for each of them.
fn usable(recording: &Recording) -> Result<(Recording, Vec<String>), Stop> {
    let (kept, pass_defects) = chain::usable(recording);
    if let (true, Some(first)) = (kept.passes.is_empty(), pass_defects.first()) {
        return Err(Stop::Input(anyhow!("{}: no pass is usable: {first}", recording.name)));
    }
    Ok((kept, pass_defects.iter().map(|why| format!("left out: {why}")).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_whose_path_contains_a_blank_is_typed_in_quotes() {
        let channel = Channel { rail: Some("left rail".to_owned()), axle: Some("1".to_owned()) };
        let argument = RecordingArgument { recording: "my runs/day-1".into(), channel };
        assert_eq!(argument.typed(), "'my runs/day-1' --rail 'left rail' --axle 1");
    }
}
