//! Numbers of elements of rail and sleepers.

/// Elements of the rail, span by span, and of every sleeper.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mesh {
    /// Number of rail elements in each span, one entry per span.
    pub rail_elements: Vec<usize>,
    /// Number of elements of every half sleeper.
    pub sleeper_elements: usize,
}

impl Mesh {
    /// The same mesh in all spans.
    pub fn uniform(spans: usize, rail_elements: usize, sleeper_elements: usize) -> Self {
        Self { rail_elements: vec![rail_elements; spans], sleeper_elements }
    }

    /// Number of spans of the track.
    pub fn spans(&self) -> usize {
        self.rail_elements.len()
    }
}
