//! Layout of a hammer test: the estimated sleepers, and the modelled stretch of track around them.

use tracktwin_parameters::TrackDesign;

/// Largest number of sleepers in one estimation.
pub const SLEEPERS_MAX: usize = 300;

/// Number of spans beyond the estimated sleepers on either side, so that reflections from the ends of the
/// model decay before they return. On V-Track, 40 spans leave an error of 2.7 dB, 120 spans one of 0.2 dB.
/// On a line, 40 spans are enough.
const MARGIN: usize = 120;

/// Numbers of rail elements of a span where the rail may be hit, and beyond.
const STRUCK_ELEMENTS: usize = 8;
const RAIL_ELEMENTS: usize = 2;

/// Largest distance of a sleeper from a hit position that belongs to it, in sleeper spacings: slightly
/// beyond midspan.
const NEAR: f64 = 0.6;

/// Number of sleepers on either side of the reported ones that have their own values.
const BESIDE: i64 = 1;

/// Stretch of track. Sleepers have numbers; sleeper 0 is the one with known position.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Sleeper spacing in m.
    pub spacing_m: f64,
    /// Position of sleeper 0 in m.
    pub sleeper_at_m: f64,
    /// Number of the first reported sleeper.
    pub first: i64,
    /// Number of reported sleepers.
    pub reported: usize,
}

/// Reason why no layout exists.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// There is no hit position.
    #[error("no receptance is left to be fitted")]
    Nothing,
    /// The hit positions are too far apart.
    #[error(
        "the receptances lie at {from_m} to {to_m} m, over {sleepers} sleepers; evaluate at most \
         {SLEEPERS_MAX} sleepers at once"
    )]
    TooLong {
        /// First position in m.
        from_m: f64,
        /// Last position in m.
        to_m: f64,
        /// Number of sleepers between the positions.
        sleepers: i64,
    },
}

impl Layout {
    /// Makes the layout for hit positions `struck_m` in m, on a track with a sleeper at `sleeper_at_m`.
    ///
    /// # Errors
    /// [`LayoutError::Nothing`] without a position; [`LayoutError::TooLong`] for more than [`SLEEPERS_MAX`]
    /// sleepers.
    pub fn new(
        design: &TrackDesign,
        sleeper_at_m: f64,
        struck_m: impl Iterator<Item = f64> + Clone,
    ) -> Result<Self, LayoutError> {
        let spacing_m = design.sleeper.spacing_m;
        let from_m = struck_m.clone().fold(f64::INFINITY, f64::min);
        let to_m = struck_m.fold(f64::NEG_INFINITY, f64::max);
        if !(from_m.is_finite() && to_m.is_finite()) {
            return Err(LayoutError::Nothing);
        }
        let first = ((from_m - sleeper_at_m) / spacing_m - NEAR).ceil() as i64;
        let last = ((to_m - sleeper_at_m) / spacing_m + NEAR).floor() as i64;
        let sleepers = last.saturating_sub(first).saturating_add(1).max(1);
        let reported = usize::try_from(sleepers).ok().filter(|count| *count <= SLEEPERS_MAX);
        let reported = reported.ok_or(LayoutError::TooLong { from_m, to_m, sleepers })?;
        Ok(Self { spacing_m, sleeper_at_m, first, reported })
    }

    /// Number of spans of the modelled track.
    pub(crate) fn spans(&self) -> usize {
        self.own() + 2 * MARGIN + 1
    }

    /// Number of sleepers with their own values; all other sleepers have the mean values.
    pub(crate) const fn own(&self) -> usize {
        self.reported + 2 * BESIDE.unsigned_abs() as usize
    }

    /// Index in the model of the first sleeper with its own values.
    pub(crate) const fn first_own() -> usize {
        MARGIN
    }

    /// Position of the start of the model in m.
    pub(crate) fn origin_m(&self) -> f64 {
        self.place_m(self.first - BESIDE) - (MARGIN + 1) as f64 * self.spacing_m
    }

    /// Index of the reported sleeper `index` among the sleepers with their own values.
    pub(crate) const fn own_index(index: usize) -> usize {
        index + BESIDE.unsigned_abs() as usize
    }

    /// Position in m of the sleeper with this number.
    pub fn place_m(&self, number: i64) -> f64 {
        self.sleeper_at_m + number as f64 * self.spacing_m
    }

    /// Indices of the reported sleepers to which the position `x_m` in m belongs.
    pub(crate) fn near(&self, x_m: f64) -> impl Iterator<Item = usize> + '_ {
        let reach_m = NEAR * self.spacing_m;
        let numbers = (0..self.reported).zip(self.first..);
        let is_near = move |number: i64| (self.place_m(number) - x_m).abs() <= reach_m;
        numbers.filter_map(move |(index, number)| is_near(number).then_some(index))
    }

    /// Number of rail elements of every span; the mesh is fine where the rail may be hit.
    pub(crate) fn rail_elements(&self) -> Vec<usize> {
        let fine = MARGIN - 1..self.spans() - MARGIN + 1;
        (0..self.spans())
            .map(|span| if fine.contains(&span) { STRUCK_ELEMENTS } else { RAIL_ELEMENTS })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(struck_m: &[f64]) -> Result<Layout, LayoutError> {
        Layout::new(&TrackDesign::v_track(), 1.0, struck_m.iter().copied())
    }

    #[test]
    fn sleepers_beside_a_struck_place_are_reported() {
        let above = layout(&[1.25]).unwrap();
        assert_eq!((above.first, above.reported), (2, 1));
        let between = layout(&[1.0625]).unwrap();
        assert_eq!((between.first, between.reported), (0, 2));
        assert_eq!(between.near(1.0625).collect::<Vec<_>>(), [0, 1]);
        let before = layout(&[0.5, 1.0]).unwrap();
        assert_eq!((before.first, before.reported), (-4, 5));
    }

    #[test]
    fn the_model_covers_the_struck_places_with_a_margin() {
        let layout = layout(&[1.0, 2.0]).unwrap();
        let first_m = layout.origin_m() + (Layout::first_own() + 1) as f64 * layout.spacing_m;
        assert!((first_m - 0.875).abs() < 1e-9, "{first_m}");
        assert_eq!(layout.spans(), 11 + 2 * MARGIN + 1);
        assert_eq!(layout.rail_elements().len(), layout.spans());
    }

    #[test]
    fn nothing_and_too_much_are_refused() {
        assert_eq!(layout(&[]), Err(LayoutError::Nothing));
        assert!(layout(&[0.0, 1e4]).unwrap_err().to_string().contains("at most 300"));
    }
}
