//! The recording of a command, and the channel of which it takes the passes.

use clap::Args;
use std::path::{Path, PathBuf};
use tracktwin_inspection::chain::with_equal_axles;
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

    /// The argument and options, as typed.
    pub(super) fn typed(&self) -> String {
        let option = |name: &str, value: &Option<String>| {
            value.as_ref().map(|value| format!(" --{name} {value}")).unwrap_or_default()
        };
        let Channel { rail, axle } = &self.channel;
        format!("{}{}{}", self.recording.display(), option("rail", rail), option("axle", axle))
    }
}
