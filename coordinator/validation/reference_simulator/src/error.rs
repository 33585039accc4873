//! Errors of scenes and recordings, one line each.

use tracktwin_files::FilesError;

/// A scene is invalid, or a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// A value is not allowed for its field.
    #[error("{field} is {value}; it must be {form}")]
    Value {
        /// Name of the field in files.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Allowed values, to follow "must be".
        form: &'static str,
    },
    /// A value is too large to be simulated.
    #[error("{field} is {value}; it must be at most {most}")]
    TooLarge {
        /// Name of the field in files.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Largest allowed value.
        most: f64,
    },
    /// The number of sleepers does not match the number of spans.
    #[error("a track of {spans} spans has one sleeper fewer, not {given}")]
    Sleepers {
        /// Number of given sleepers.
        given: usize,
        /// Number of spans of the track.
        spans: usize,
    },
    /// The recorded stretch is shorter than a span or too near to an end of the track.
    #[error(
        "{from_m} to {to_m} m cannot be recorded: record at least one span, at least \
             {end_m} m from the ends of the track of {length_m} m"
    )]
    Recorded {
        /// Start of the stretch in m.
        from_m: f64,
        /// End of the stretch in m.
        to_m: f64,
        /// Smallest distance from the ends of the track in m.
        end_m: f64,
        /// Length of the track in m.
        length_m: f64,
    },
    /// The scene is of a track that this simulator does not have.
    #[error("the reference simulator has no track but v-track; {preset} is of the second one")]
    NoTrack {
        /// Name of the preset.
        preset: &'static str,
    },
    /// The scene has no passes.
    #[error("the scene has no passes; add one")]
    NoPasses,
    /// A hidden effect is not on the track.
    #[error("{physics} must lie on the track of {length_m} m and {sleepers} sleepers")]
    Place {
        /// Name of the effect.
        physics: &'static str,
        /// Length of the track in m.
        length_m: f64,
        /// Number of sleepers of the track.
        sleepers: usize,
    },
    /// The motion became NaN or infinite: a part of the track is unsupported.
    #[error("the motion of the wheel diverges at {position_m} m")]
    Diverged {
        /// Position of the wheel in m.
        position_m: f64,
    },
    /// The place of a hammer hit is not on the rail.
    #[error("{x_m} m is not on the track of {length_m} m")]
    OffTrack {
        /// The place in m.
        x_m: f64,
        /// Length of the track in m.
        length_m: f64,
    },
    /// The receptance of a hidden effect cannot be computed.
    #[error("the receptance of a track with {physics} is not known")]
    NoReceptance {
        /// Name of the effect.
        physics: &'static str,
    },
    /// The recording cannot be written.
    #[error("{0}")]
    Files(#[from] FilesError),
}
