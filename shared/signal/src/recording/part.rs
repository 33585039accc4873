//! Part of a recording: some of its sleepers, and its passes near them.

use super::folder::{Pass, Recording};
use crate::Signal;
use std::ops::Range;

impl Recording {
    /// The recording of a range of its sleepers. The passes end `beside_spans` sleeper spacings beyond the
    /// first and the last of these sleepers.
    #[must_use]
    pub fn part(&self, sleepers: Range<usize>, beside_spans: f64) -> Self {
        let sleepers = self.sleepers[sleepers].to_vec();
        let beside_m = beside_spans * self.spacing_m;
        let ends = sleepers.iter().map(|sleeper| sleeper.x_m);
        let [from_m, to_m] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x_m| {
            [low.min(x_m - beside_m), high.max(x_m + beside_m)]
        });
        // A pass that does not reach these sleepers has no samples, and no signal, there.
        let shortened = |pass: &Pass| {
            let first = pass.position_m.partition_point(|x_m| *x_m < from_m);
            let end = pass.position_m.partition_point(|x_m| *x_m <= to_m).max(first);
            let samples = pass.signal.samples()[first..end].to_vec();
            Some(Pass {
                file: pass.file.clone(),
                speed_km_h: pass.speed_km_h,
                axle: pass.axle.clone(),
                signal: Signal::new(pass.signal.sample_rate_hz(), samples).ok()?,
                position_m: pass.position_m[first..end].to_vec(),
                contact_loss_share: pass.contact_loss_share,
            })
        };
        Self {
            name: self.name.clone(),
            sample_rate_hz: self.sample_rate_hz,
            channel: self.channel.clone(),
            passes: self.passes.iter().filter_map(shortened).collect(),
            sleepers,
            nominal: self.nominal.clone(),
            spacing_m: self.spacing_m,
            doubts: self.doubts.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Sleeper;
    use super::*;

    #[test]
    fn a_part_has_its_sleepers_and_the_passes_near_them() {
        let sleeper =
            |number: usize| Sleeper { id: format!("SN{number}"), x_m: 0.625 * number as f64 };
        let pass = |metres: usize| Pass {
            file: format!("{metres}.csv"),
            speed_km_h: 80.0,
            axle: None,
            signal: Signal::new(100.0, (0..8 * metres).map(|it| it as f64).collect()).unwrap(),
            position_m: (0..8 * metres).map(|it| 0.125 * it as f64).collect(),
            contact_loss_share: None,
        };
        let whole = Recording {
            name: "line".to_owned(),
            sample_rate_hz: 100.0,
            channel: String::new(),
            passes: vec![pass(30), pass(3)],
            sleepers: (0..50).map(sleeper).collect(),
            nominal: serde_json::Map::new(),
            spacing_m: 0.625,
            doubts: Vec::new(),
        };
        let part = whole.part(10..12, 2.0);
        assert_eq!([&part.sleepers[0].id, &part.sleepers[1].id], ["SN10", "SN11"]);
        // From 6.25 - 1.25 to 6.875 + 1.25 m; the short pass ends before.
        assert_eq!(part.passes.len(), 1);
        let (positions, samples) = (&part.passes[0].position_m, part.passes[0].signal.samples());
        assert_eq!([positions[0], positions[positions.len() - 1]], [5.0, 8.125]);
        assert_eq!((samples[0], samples.len()), (40.0, positions.len()));
    }
}
