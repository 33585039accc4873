//! How finely rail and sleepers are divided.

/// Elements of the rail, span by span, and of every sleeper.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mesh {
    /// Rail elements in each span; as many entries as the track has spans.
    pub rail_elements: Vec<usize>,
    /// Elements of every half sleeper.
    pub sleeper_elements: usize,
}

impl Mesh {
    /// The same mesh in all spans.
    pub fn uniform(spans: usize, rail_elements: usize, sleeper_elements: usize) -> Self {
        Self { rail_elements: vec![rail_elements; spans], sleeper_elements }
    }

    /// How many spans the track has.
    pub fn spans(&self) -> usize {
        self.rail_elements.len()
    }
}
