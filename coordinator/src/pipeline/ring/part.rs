//! Parts of a ring's recording: laps and speeds.

use std::fmt::{Display, Formatter};
use tracktwin_signal::recording::{Pass, Recording};

/// Selection of passes of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    /// All passes.
    All,
    /// The passes of one lap, counted from 1: one pass at each speed.
    Lap(usize),
    /// The passes at one speed in km/h.
    Speed(f64),
}

impl Part {
    /// Name of the folder of this part.
    pub(super) fn name(&self) -> String {
        match self {
            Self::All => "all".to_owned(),
            Self::Lap(lap) => format!("lap-{lap}"),
            Self::Speed(speed_km_h) => format!("{speed_km_h}kmh"),
        }
    }

    /// The recording with the selected passes only.
    pub(super) fn of(self, recording: &Recording) -> Recording {
        Recording {
            name: recording.name.clone(),
            sample_rate_hz: recording.sample_rate_hz,
            channel: recording.channel.clone(),
            passes: self.passes(recording).into_iter().cloned().collect(),
            sleepers: recording.sleepers.clone(),
            nominal: recording.nominal.clone(),
            spacing_m: recording.spacing_m,
            doubts: recording.doubts.clone(),
        }
    }

    /// The selected passes.
    fn passes(self, recording: &Recording) -> Vec<&Pass> {
        let all = recording.passes.iter();
        match self {
            Self::All => all.collect(),
            Self::Lap(lap) => {
                let mut seen = Vec::new();
                let is_of_lap = |pass: &&Pass| {
                    seen.push(pass.speed_km_h);
                    seen.iter().filter(|speed| **speed == pass.speed_km_h).count() == lap
                };
                all.filter(is_of_lap).collect()
            }
            Self::Speed(speed_km_h) => all.filter(|pass| pass.speed_km_h == speed_km_h).collect(),
        }
    }
}

impl Display for Part {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::All => f.write_str("all passes"),
            Self::Lap(lap) => write!(f, "lap {lap}"),
            Self::Speed(speed_km_h) => write!(f, "{speed_km_h} km/h"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_ring::{Plan, Ring, Stretch};

    #[test]
    fn a_lap_has_a_pass_of_each_speed() {
        let stretch = Stretch { first: 86, last: 92 };
        let plan = Plan::new(1, 2, vec![10.0, 13.0], stretch).unwrap();
        let recording = Ring::new(plan).record().unwrap();
        let lap = Part::Lap(2).of(&recording);
        assert_eq!(lap.speeds_km_h(), [10.0, 13.0]);
        assert_eq!(lap.passes[0].signal, recording.passes[2].signal);
        assert_eq!(Part::Speed(13.0).of(&recording).passes.len(), 2);
    }
}
