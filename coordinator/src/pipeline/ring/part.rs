//! Parts of a ring's recording: laps, speeds, and sections of sleepers.

use std::fmt::{Display, Formatter};
use std::ops::Range;
use tracktwin_signal::Signal;
use tracktwin_signal::recording::{Pass, Recording, Sleeper};

/// Number of sleepers in a section for one diagnosis, and number of sleepers shared by neighbouring
/// sections.
const LENGTH: usize = 30;
const OVERLAP: usize = 6;
/// Length of the passes beyond a section, in spans.
const BESIDE: f64 = 3.0;

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
        let passes = self.passes(recording).into_iter().cloned().collect();
        with(recording, passes, recording.sleepers.clone())
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

/// The recording with these passes and sleepers instead of its own.
fn with(recording: &Recording, passes: Vec<Pass>, sleepers: Vec<Sleeper>) -> Recording {
    Recording {
        name: recording.name.clone(),
        sample_rate_hz: recording.sample_rate_hz,
        channel: recording.channel.clone(),
        passes,
        sleepers,
        nominal: recording.nominal.clone(),
        spacing_m: recording.spacing_m,
        doubts: recording.doubts.clone(),
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

/// Sections of about equal length that cover this number of sleepers.
pub(super) fn sections(sleepers: usize) -> Vec<Range<usize>> {
    let length = sleepers.min(LENGTH);
    let count = sleepers.saturating_sub(OVERLAP).div_ceil(LENGTH - OVERLAP).max(1);
    let first = |number: usize| number * (sleepers - length) / (count - 1).max(1);
    (0..count).map(|number| first(number)..first(number) + length).collect()
}

/// Name of a stretch of sleepers: the first and the last of them.
pub(super) fn place(sleepers: &[Sleeper]) -> String {
    let [first, last] = [sleepers.first(), sleepers.last()]
        .map(|it| it.map(|sleeper| sleeper.id.as_str()).unwrap_or_default());
    format!("{first}-{last}")
}

/// The recording of a part, cut to a range of sleepers. The passes end a few spans beyond these sleepers.
pub(super) fn cut(recording: &Recording, part: Part, sleepers: Range<usize>) -> Recording {
    let kept = recording.sleepers[sleepers].to_vec();
    let beside_m = (0.5 + BESIDE) * recording.spacing_m;
    let ends = kept.iter().map(|sleeper| sleeper.x_m);
    let [from_m, to_m] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x_m| {
        [low.min(x_m - beside_m), high.max(x_m + beside_m)]
    });
    let shortened = |pass: &Pass| {
        let first = pass.position_m.iter().position(|x_m| *x_m >= from_m).unwrap_or(0);
        let last = pass.position_m.iter().rposition(|x_m| *x_m <= to_m);
        let range = first..last.map_or(first, |last| last + 1);
        let samples = pass.signal.samples()[range.clone()].to_vec();
        let signal = Signal::new(pass.signal.sample_rate_hz(), samples);
        Pass {
            file: pass.file.clone(),
            speed_km_h: pass.speed_km_h,
            signal: signal.expect("a part of a signal is one"),
            position_m: pass.position_m[range].to_vec(),
            contact_loss_share: pass.contact_loss_share,
        }
    };
    let passes = part.passes(recording).into_iter().map(shortened).collect();
    with(recording, passes, kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_ring::{Plan, Ring, Stretch};

    #[test]
    fn sections_cover_all_sleepers_and_overlap() {
        for sleepers in [13, 31, 54, 55, 100] {
            let all = sections(sleepers);
            assert_eq!((all[0].start, all.last().unwrap().end), (0, sleepers));
            assert!(all.windows(2).all(|pair| pair[1].start + OVERLAP <= pair[0].end), "{all:?}");
        }
        assert_eq!([13, 100].map(|sleepers| sections(sleepers).len()), [1, 4]);
    }

    #[test]
    fn a_lap_has_a_pass_of_each_speed_and_a_section_its_sleepers() {
        let stretch = Stretch { first: 86, last: 92 };
        let plan = Plan::new(1, 2, vec![10.0, 13.0], stretch).unwrap();
        let recording = Ring::new(plan).record().unwrap();
        let lap = Part::Lap(2).of(&recording);
        assert_eq!(lap.speeds_km_h(), [10.0, 13.0]);
        assert_eq!(lap.passes[0].signal, recording.passes[2].signal);
        assert_eq!(Part::Speed(13.0).of(&recording).passes.len(), 2);
        let section = cut(&recording, Part::All, 1..3);
        assert_eq!(section.sleepers[0].id, "SN87");
        let positions = &section.passes[0].position_m;
        let first_m = section.sleepers[0].x_m - 3.5 * recording.spacing_m;
        assert!(
            (positions[0] - first_m).abs() < 1e-3
                && positions.len() == section.passes[0].signal.len()
        );
    }
}
