//! Sleepers of a recording's track.

/// A sleeper and its position.
#[derive(Clone, Debug, PartialEq)]
pub struct Sleeper {
    /// Name of the sleeper, such as `SN8`.
    pub id: String,
    /// Position of the sleeper along the track in m, on the scale of the positions of the passes.
    pub x_m: f64,
}
