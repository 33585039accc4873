//! Possible ports of an unknown dynamic stiffness.

use crate::section::Section;
use tracktwin_track::extension::EffectFamily;

/// Longest period of a pattern of sleepers, in sleepers.
const EVERY_MAX: usize = 5;

/// Port of an unknown dynamic stiffness.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortPlace {
    /// Under the rail seats of these compared sleepers, with the same stiffness under each: one, two
    /// neighbours, every second to fifth, or all.
    Seats(Vec<usize>),
    /// Between the rail seats of two neighbouring compared sleepers.
    Between([usize; 2]),
    /// Between wheel and ground.
    Wheel,
}

impl PortPlace {
    /// Name of the port in a diagnosis.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Seats(_) => "rail_seat",
            Self::Between(_) => "between_rail_seats",
            Self::Wheel => "wheel",
        }
    }

    /// Family of the unknown physics.
    pub const fn family(&self) -> EffectFamily {
        match self {
            Self::Seats(_) | Self::Between(_) => EffectFamily::UnknownStructure,
            Self::Wheel => EffectFamily::UnknownWheel,
        }
    }

    /// The measurement that would identify the element at this port.
    pub const fn would_separate(&self) -> &'static str {
        match self {
            Self::Seats(_) => "a hammer test at the place: its receptance names the element",
            Self::Between(_) => {
                "a hammer test from one sleeper to the other: its receptance names the element"
            }
            Self::Wheel => "a tap test on the wheel: its receptance names the element",
        }
    }
}

/// Groups of sleepers that may have the same unknown stiffness: indices of the compared ones, and indices
/// in the whole track. A periodic group ends at the compared sleepers, or continues beyond them.
pub(super) fn seats_together(section: &Section) -> Vec<(Vec<usize>, Vec<usize>)> {
    let count = section.sleepers();
    let single = (0..count).map(|sleeper| vec![sleeper]);
    let pairs = (1..count).map(|sleeper| vec![sleeper - 1, sleeper]);
    // A pattern is one where it comes back twice.
    let steps = (1..=EVERY_MAX).filter(|step| 3 * step <= count);
    let patterns = steps.flat_map(|step| (0..step).map(move |first| (first, step)));
    let of_step = |(first, step): (usize, usize)| (first..count).step_by(step).collect();
    let here = single.chain(pairs).chain(patterns.clone().map(of_step)).map(|compared| {
        let in_track = compared.iter().map(|&sleeper| section.in_track(sleeper)).collect();
        (compared, in_track)
    });
    let beyond = patterns.map(|(first, step)| {
        let begins = section.in_track(first) % step;
        (of_step((first, step)), (begins..section.spans() - 1).step_by(step).collect())
    });
    here.chain(beyond).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn a_pattern_ends_with_the_section_or_goes_on_through_the_track() {
        let section = Section::new(TrackDesign::v_track(), 7, 1.0);
        let all = seats_together(&section);
        let last = section.spans() - 1;
        let in_track = |first: usize| first + section.in_track(0);
        let of = |compared: &[usize]| -> Vec<&[usize]> {
            let those = all.iter().filter(|(known, _)| known == compared);
            those.map(|(_, in_track)| &in_track[..]).collect()
        };
        assert_eq!(of(&[3]), [[in_track(3)]]);
        assert_eq!(of(&[3, 4]), [[in_track(3), in_track(4)]]);
        let every: Vec<usize> = (0..last).collect();
        assert_eq!(of(&[0, 1, 2, 3, 4, 5, 6]), [&every[in_track(0)..=in_track(6)], &every[..]]);
        let second = of(&[1, 3, 5]);
        assert_eq!(second[0], [1, 3, 5].map(in_track));
        assert_eq!(second[1].len(), every[in_track(1) % 2..].iter().step_by(2).count());
        assert!(second[0].iter().all(|sleeper| second[1].contains(sleeper)));
        // A third would come but once or twice.
        assert!(of(&[0, 3, 6]).is_empty());
    }
}
