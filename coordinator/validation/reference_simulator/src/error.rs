//! Why a scene gives no recording, in one line each.

use tracktwin_files::FilesError;

/// A scene that cannot be, or a recording that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// A value is no number of its kind.
    #[error("{field} is {value}; it must be {form}")]
    Value {
        /// The field's name in files.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        form: &'static str,
    },
    /// A value is beyond what can be simulated.
    #[error("{field} is {value}; it must be at most {most}")]
    TooLarge {
        /// The field's name in files.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The largest that can be.
        most: f64,
    },
    /// There are not as many sleepers as the spans have between them.
    #[error("a track of {spans} spans has one sleeper fewer, not {given}")]
    Sleepers {
        /// Sleepers given.
        given: usize,
        /// Spans of the track.
        spans: usize,
    },
    /// What is recorded is shorter than a span or too near to an end of the track.
    #[error(
        "{from_m} to {to_m} m cannot be recorded: record at least one span, at least \
             {end_m} m from the ends of the track of {length_m} m"
    )]
    Recorded {
        /// Begin in m.
        from_m: f64,
        /// End in m.
        to_m: f64,
        /// Least distance from the ends in m.
        end_m: f64,
        /// Length of the track in m.
        length_m: f64,
    },
    /// There is nothing to record.
    #[error("the scene has no passes; add one")]
    NoPasses,
    /// A hidden effect is not on the track.
    #[error("{physics} must lie on the track of {length_m} m and {sleepers} sleepers")]
    Place {
        /// Name of the effect.
        physics: &'static str,
        /// Length of the track in m.
        length_m: f64,
        /// Sleepers of the track.
        sleepers: usize,
    },
    /// The motion is not finite any more: something carries nothing.
    #[error("the motion of the wheel diverges at {position_m} m")]
    Diverged {
        /// Where in m.
        position_m: f64,
    },
    /// A place that is struck is not on the rail.
    #[error("{x_m} m is not on the track of {length_m} m")]
    OffTrack {
        /// The place in m.
        x_m: f64,
        /// Length of the track in m.
        length_m: f64,
    },
    /// A hidden effect that receptances do not hold.
    #[error("the receptance of a track with {physics} is not known")]
    NoReceptance {
        /// Name of the effect.
        physics: &'static str,
    },
    /// The recording cannot be written.
    #[error("{0}")]
    Files(#[from] FilesError),
}
