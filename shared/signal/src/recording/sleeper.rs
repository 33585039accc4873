//! Sleepers of a recording's track.

/// A sleeper and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Sleeper {
    /// Its name, such as `SN8`.
    pub id: String,
    /// Its place along the track in m, on the scale of the passes' positions.
    pub x_m: f64,
}
