//! Plan of a ring recording: seed, laps, speeds and stretch.

use crate::RingError;
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};
use std::str::FromStr;

/// Sleepers of the ring (paper, section 2.1).
pub(crate) const SLEEPERS: usize = 100;

/// Fewest sleepers that can be evaluated (`docs/inversion.md`, limits).
const LEAST: usize = 6;

/// Speeds in km/h that can be simulated; V-Track runs at up to 40 km/h (paper, section 2.1).
const SPEEDS_KM_H: [f64; 2] = [3.0, 40.0];

/// A stretch of the ring: sleepers from the first to the last, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stretch {
    /// Number of the first sleeper, from 1.
    pub first: usize,
    /// Number of the last sleeper.
    pub last: usize,
}

impl Stretch {
    /// The whole ring.
    pub const WHOLE: Self = Self { first: 1, last: SLEEPERS };

    /// Number of sleepers of the stretch.
    pub const fn sleepers(self) -> usize {
        self.last + 1 - self.first
    }
}

impl FromStr for Stretch {
    type Err = RingError;

    fn from_str(text: &str) -> Result<Self, RingError> {
        let ends = text.split_once('-');
        let ends = ends.and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
        let Some((first, last)) = ends else {
            return Err(RingError::NoStretch { text: text.to_owned() });
        };
        if first < 1 || last > SLEEPERS || last < first || last - first + 1 < LEAST {
            return Err(RingError::Stretch { first, last, least: LEAST });
        }
        Ok(Self { first, last })
    }
}

impl Display for Stretch {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}-{}", self.first, self.last)
    }
}

/// All settings that determine the recording of a ring.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Seed of the variation of the sleepers, the surface and the measuring chain.
    pub seed: u64,
    /// Number of laps, each with one pass at every speed.
    pub laps: usize,
    /// Speeds in km/h, ascending.
    pub speeds_km_h: Vec<f64>,
    /// Recorded stretch of the ring.
    pub stretch: Stretch,
}

impl Plan {
    /// A plan with its speeds in order.
    ///
    /// # Errors
    /// [`RingError`] if there is no speed, if a speed is given twice, or if a speed is outside the range
    /// of V-Track.
    pub fn new(
        seed: u64,
        laps: usize,
        mut speeds_km_h: Vec<f64>,
        stretch: Stretch,
    ) -> Result<Self, RingError> {
        if speeds_km_h.is_empty() {
            return Err(RingError::NoSpeed);
        }
        let [low, high] = SPEEDS_KM_H;
        if let Some(&speed_km_h) = speeds_km_h.iter().find(|it| !(low..=high).contains(*it)) {
            return Err(RingError::Speed { speed_km_h });
        }
        speeds_km_h.sort_by(f64::total_cmp);
        if let Some(pair) = speeds_km_h.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(RingError::SpeedTwice { speed_km_h: pair[0] });
        }
        Ok(Self { seed, laps, speeds_km_h, stretch })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_is_read_as_it_is_written_and_refused_beyond_the_ring() {
        let stretch: Stretch = "86-98".parse().unwrap();
        assert_eq!((stretch.sleepers(), stretch.to_string().as_str()), (13, "86-98"));
        for wrong in ["", "86", "a-b", "0-20", "90-101", "20-10", "1-5"] {
            assert!(wrong.parse::<Stretch>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn speeds_are_put_in_order_and_refused_twice_or_beyond_the_rig() {
        let plan = |speeds: &[f64]| Plan::new(1, 2, speeds.to_vec(), Stretch::WHOLE);
        assert_eq!(plan(&[13.0, 7.0, 10.0]).unwrap().speeds_km_h, [7.0, 10.0, 13.0]);
        assert!(matches!(plan(&[]), Err(RingError::NoSpeed)));
        assert!(matches!(plan(&[7.0, 7.0]), Err(RingError::SpeedTwice { .. })));
        assert!(matches!(plan(&[7.0, f64::NAN]), Err(RingError::Speed { .. })));
    }
}
