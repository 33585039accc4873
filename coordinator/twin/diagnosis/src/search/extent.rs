//! Extent of an effect along the sleepers, and its reach.

use crate::candidate::Candidate;
use crate::port_scan::PortPlace;
use crate::section::Section;

/// Reach of a local effect on either side, in spans.
const REACH_SPANS: f64 = 2.0;

/// Start and end of an effect, in spacings from the first compared sleeper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    from: f64,
    to: f64,
}

impl Extent {
    /// Extent of a candidate.
    pub(crate) fn of(candidate: &Candidate, section: &Section) -> Self {
        match (&candidate.extension.sleepers, candidate.extension.x_m) {
            (Some(sleepers), _) => Self::of_sleepers(sleepers, section),
            (None, Some(x_m)) => {
                let [from, to] = x_m.map(|x_m| section.spans_from_first(x_m));
                Self { from, to }
            }
            (None, None) => Self::everywhere(section),
        }
    }

    /// Extent of unknown physics.
    pub(super) fn of_port(place: &PortPlace, section: &Section) -> Self {
        match place {
            PortPlace::Seats(seats) => Self::of_sleepers(seats, section),
            PortPlace::Between(pair) => Self::of_sleepers(pair, section),
            PortPlace::Wheel => Self::everywhere(section),
        }
    }

    fn of_sleepers(sleepers: &[usize], section: &Section) -> Self {
        let Self { from: first, to: last } = Self::everywhere(section);
        let sleepers = sleepers.iter().map(|&sleeper| sleeper as f64);
        let wider = |Self { from, to }, at: f64| Self { from: at.min(from), to: at.max(to) };
        sleepers.fold(Self { from: last, to: first }, wider)
    }

    fn everywhere(section: &Section) -> Self {
        Self { from: 0.0, to: (section.sleepers() - 1) as f64 }
    }

    /// The extent including its reach on either side.
    pub(crate) fn with_reach(self) -> Self {
        Self { from: self.from - REACH_SPANS, to: self.to + REACH_SPANS }
    }

    /// Start and end in spacings from the first compared sleeper.
    pub(crate) const fn spacings(self) -> [f64; 2] {
        [self.from, self.to]
    }

    pub(super) fn length(self) -> f64 {
        self.to - self.from
    }

    /// Whether the two extents overlap.
    pub(super) fn meets(self, other: Self) -> bool {
        self.from <= other.to && other.from <= self.to
    }

    /// Whether the two extents are equal within one spacing at either end.
    pub(super) fn is_about(self, other: Self) -> bool {
        (self.from - other.from).abs() <= 1.0 && (self.to - other.to).abs() <= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::testing::section_with_candidates;

    #[test]
    fn a_port_is_about_where_a_sleeper_beside_it_is() {
        let (section, all) = section_with_candidates();
        let on = |sleeper: usize| {
            let is_it = |candidate: &&crate::Candidate| {
                candidate.extension.sleepers.as_deref() == Some(&[sleeper][..])
            };
            Extent::of(all.iter().find(is_it).unwrap(), &section)
        };
        let between = Extent::of_port(&PortPlace::Between([3, 4]), &section);
        assert!([2, 3, 4, 5].iter().all(|&sleeper| on(sleeper).with_reach().meets(between)));
        assert!(on(3).is_about(between) && on(4).is_about(between) && !on(5).is_about(between));
        assert!(!on(7).with_reach().meets(between) && on(6).with_reach().meets(between));
        let wheel = Extent::of_port(&PortPlace::Wheel, &section);
        let all_seats = Extent::of_port(&PortPlace::Seats((0..24).collect()), &section);
        assert!(wheel == all_seats && wheel.meets(between) && !wheel.is_about(between));
    }
}
