//! The sample recordings bundled with the program: one of V-Track, one of a line.
//!
//! They were created with `tracktwin simulate`; `coordinator/sample/README.md` and
//! `coordinator/sample-line/README.md` contain the commands and the hidden parameters.

use super::super::Stop;
use super::super::files::{Force, check};
use std::path::Path;
use tracktwin_files::{FileName, FilesError, Kind, Output};
use tracktwin_parameters::TrackDesign;
use tracktwin_signal::recording::Recording;

/// A sample recording.
pub(super) struct Sample {
    /// Sleeper spacing of its track in m.
    spacing_m: f64,
    /// The manifest, then the passes.
    files: [(&'static str, &'static [u8]); 4],
}

static SAMPLES: [Sample; 2] = [
    Sample {
        spacing_m: 0.125,
        files: [
            ("recording.json", include_bytes!("../../../sample/recording.json")),
            ("pass-07kmh-1.parquet", include_bytes!("../../../sample/pass-07kmh-1.parquet")),
            ("pass-10kmh-1.parquet", include_bytes!("../../../sample/pass-10kmh-1.parquet")),
            ("pass-13kmh-1.parquet", include_bytes!("../../../sample/pass-13kmh-1.parquet")),
        ],
    },
    Sample {
        spacing_m: 0.6,
        files: [
            ("recording.json", include_bytes!("../../../sample-line/recording.json")),
            ("pass-40kmh-1.parquet", include_bytes!("../../../sample-line/pass-40kmh-1.parquet")),
            ("pass-60kmh-1.parquet", include_bytes!("../../../sample-line/pass-60kmh-1.parquet")),
            ("pass-80kmh-1.parquet", include_bytes!("../../../sample-line/pass-80kmh-1.parquet")),
        ],
    },
];

impl Sample {
    /// The sample whose sleeper spacing is nearest to that of a design.
    pub(super) fn nearest(design: &TrackDesign) -> &'static Self {
        let distance = |sample: &Self| (design.sleeper.spacing_m / sample.spacing_m).ln().abs();
        let [v_track, line] = &SAMPLES;
        if distance(line) < distance(v_track) { line } else { v_track }
    }

    /// Checks that the sample may be written.
    pub(super) fn check_files(&self, folder: &Path, force: Force) -> Result<(), FilesError> {
        check(folder, Kind::SimulatedRecording, force, &self.files.map(|(name, _)| name))
    }

    /// Writes the sample to `folder` and opens it.
    pub(super) fn open(&self, folder: &Path, force: Force) -> Result<Recording, Stop> {
        let mut output = Output::begin(folder, Kind::SimulatedRecording, force.force)?;
        let [manifest, passes @ ..] = self.files;
        for (name, bytes) in passes {
            output.add(&FileName::new(name)?, bytes)?;
        }
        output.add_manifest(&FileName::new(manifest.0)?, manifest.1)?;
        output.commit()?;
        Ok(Recording::open(folder)?)
    }
}
