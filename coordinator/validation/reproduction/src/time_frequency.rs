//! Fig. 2: a stretch of axle-box acceleration, its CWT and its SSWT.

use crate::average::{Average, DEVIATIONS};
use crate::example_track::{ExampleTrack, RecordedExample};
use crate::local_spectra::{SHOWN, pass_index};
use crate::picture::{Picture, Scale, Style};
use crate::speed::hertz;
use crate::{ClaimVerdict, Compared, Error, Figure};
use tracktwin_experiment::Experiment;
use tracktwin_signal::{Extractor, TimeFrequencyMap};
use tracktwin_track::frequency::peaks;

/// Columns of a map.
const COLUMNS: usize = 900;

/// Points of the drawn signal: its lowest and highest value in each of these parts.
const SIGNAL_PARTS: usize = 900;

/// Share of the ridge's frequency within which power counts as on the ridge.
const NEAR: f64 = 0.05;

/// The paper's major frequency components in Hz.
const COMPONENTS_HZ: [[f64; 2]; 3] = [[100.0, 200.0], [500.0, 620.0], [950.0, 1200.0]];

/// Signal and maps of five bays beside the paper's Fig. 2.
///
/// # Errors
/// [`Error::NoSpeed`], [`Error::Features`] or [`Error::NotCovered`].
pub(crate) fn time_frequency(
    experiment: &Experiment,
    passes: &[RecordedExample],
) -> Result<Compared, Error> {
    let figure = Figure::Fig2;
    let recording = &passes[0].1;
    let extractor = Extractor::new(&experiment.features)?;
    let pass = &recording.passes[pass_index(recording, figure)?];
    let track = ExampleTrack::new(experiment);
    let ends_m = [*SHOWN.start(), *SHOWN.end()].map(|sleeper| track.x_m(sleeper));
    let [from, to] = ends_m.map(|x_m| pass.position_m.partition_point(|&at| at < x_m));
    if to >= pass.position_m.len() {
        return Err(Error::NotCovered { figure, sleeper: *SHOWN.end() });
    }
    let cwt = extractor.cwt_map(&pass.signal, from..to, COLUMNS)?;
    let sswt = extractor.sswt_map(&pass.signal, from..to, COLUMNS)?;
    let caption = "Axle-box acceleration at 13 km/h over five bays of the nominal track, and the \
                   power of its CWT and SSWT; lines at the sleepers.";
    let mut compared = Compared::new(figure, caption);
    let bays = SHOWN.count() - 1;
    sharper(&mut compared, &cwt, &sswt, bays);
    let found = components(&cwt, bays);
    for range_hz in COMPONENTS_HZ {
        component(&mut compared, &found, range_hz);
    }
    let marks: Vec<f64> = SHOWN.map(|sleeper| track.x_m(sleeper)).collect();
    let samples = &pass.signal.samples()[from..to];
    compared.pictures = vec![
        signal_picture(samples, ends_m, &marks),
        map_picture("CWT power", cwt, ends_m, &marks),
        map_picture("SSWT power", sswt, ends_m, &marks),
    ];
    Ok(compared)
}

/// Share of the power in each column of a map that lies near the column's strongest bin, weighted
/// by the columns' power; a value a bay.
fn near_the_ridge(map: &TimeFrequencyMap, bays: usize) -> Vec<f64> {
    let columns = map.times_s.len();
    let power = |bin: usize, column: usize| map.magnitudes[bin * columns + column].powi(2);
    let bins = 0..map.frequencies_hz.len();
    let sums = |column: usize| {
        let strongest = bins.clone().max_by(|&a, &b| power(a, column).total_cmp(&power(b, column)));
        let ridge_hz = map.frequencies_hz[strongest.unwrap_or(0)];
        let near = |&bin: &usize| (map.frequencies_hz[bin] / ridge_hz - 1.0).abs() <= NEAR;
        let sum = |bins: &mut dyn Iterator<Item = usize>| -> f64 {
            bins.map(|bin| power(bin, column)).sum()
        };
        [sum(&mut bins.clone().filter(near)), sum(&mut bins.clone())]
    };
    let bay = |bay: usize| {
        let columns = bay * columns / bays..(bay + 1) * columns / bays;
        let [near, all] = columns.map(sums).fold([0.0, 0.0], |a, b| [a[0] + b[0], a[1] + b[1]]);
        near / all
    };
    (0..bays).map(bay).collect()
}

fn sharper(compared: &mut Compared, cwt: &TimeFrequencyMap, sswt: &TimeFrequencyMap, bays: usize) {
    let [wide, sharp] = [cwt, sswt].map(|map| near_the_ridge(map, bays));
    let by: Vec<f64> = sharp.iter().zip(&wide).map(|(sharp, wide)| sharp - wide).collect();
    let percent = |of: &[f64]| 100.0 * Average::of(of).mean;
    compared.row(
        "The SSWT concentrates the power on ridges more than the CWT",
        [
            "sharpened".to_owned(),
            format!(
                "{:.0} % of the power within 5 % of the strongest frequency, CWT {:.0} %",
                percent(&sharp),
                percent(&wide)
            ),
        ],
        Average::of(&by).is_positive(),
        "at every instant, averaged over a bay; difference of the same five bays beyond two \
         standard errors",
    );
}

/// Peaks in Hz of the mean CWT power of the bays that stand out by twice its standard error.
fn components(map: &TimeFrequencyMap, bays: usize) -> Vec<f64> {
    let columns = map.times_s.len();
    let level = |bin: usize, bay: usize| {
        let row = &map.row(bin)[bay * columns / bays..(bay + 1) * columns / bays];
        10.0 * (row.iter().map(|of| of * of).sum::<f64>() / row.len() as f64).log10()
    };
    let bin = |bin: usize| Average::of(&(0..bays).map(|bay| level(bin, bay)).collect::<Vec<_>>());
    let mean: Vec<Average> = (0..map.frequencies_hz.len()).map(bin).collect();
    let squares: f64 = mean.iter().map(|bin| bin.error.powi(2)).sum();
    let least_db = DEVIATIONS * (squares / mean.len() as f64).sqrt();
    let magnitudes: Vec<f64> = mean.iter().map(|bin| 10.0_f64.powf(bin.mean / 20.0)).collect();
    let found = peaks(&map.frequencies_hz, &magnitudes, least_db);
    found.into_iter().map(|peak| peak.frequency_hz).collect()
}

fn component(compared: &mut Compared, found: &[f64], [low, high]: [f64; 2]) {
    let inside: Vec<f64> =
        found.iter().copied().filter(|peak| (low..=high).contains(peak)).collect();
    compared.row(
        format!("Major frequency component of {low} to {high} Hz"),
        [format!("{low} to {high} Hz"), format!("{}; all peaks: {}", hertz(&inside), hertz(found))],
        ClaimVerdict::of(!inside.is_empty()),
        "a peak of the mean CWT power of the five bays that stands out by twice its standard \
         error; the paper's signal was measured between SN91 and SN96, where a railpad and bolts \
         were missing, ours is simulated over the nominal track",
    );
}

fn signal_picture(samples: &[f64], [from_m, to_m]: [f64; 2], marks: &[f64]) -> Picture {
    let size = samples.len().div_ceil(SIGNAL_PARTS);
    let place = |sample: usize| from_m + (to_m - from_m) * sample as f64 / samples.len() as f64;
    let ends = |(part, values): (usize, &[f64])| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        [(place(part * size), low), (place(part * size), high)]
    };
    let points = samples.chunks(size).enumerate().flat_map(ends).collect();
    let y = Scale::linear("acceleration in m/s²");
    let mut picture = Picture::new("Axle-box acceleration", Scale::linear("position in m"), y);
    (picture.wide, picture.marks) = (true, marks.to_vec());
    picture.with("", Style::Line, points)
}

fn map_picture(
    title: &str,
    map: TimeFrequencyMap,
    [from_m, to_m]: [f64; 2],
    marks: &[f64],
) -> Picture {
    let hz = &map.frequencies_hz;
    let corners = vec![(from_m, hz[0]), (to_m, hz[hz.len() - 1])];
    let y = Scale::logarithmic("frequency in Hz");
    let mut picture = Picture::new(title, Scale::linear("position in m"), y);
    (picture.wide, picture.marks) = (true, marks.to_vec());
    picture.with("", Style::Map(map), corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{random, verdicts};
    use ClaimVerdict::{CannotTell, Differs, Reproduced};

    /// A map of 100 columns whose ridges have this relative width.
    fn map(ridges_hz: &[f64], width: f64) -> TimeFrequencyMap {
        let frequencies_hz: Vec<f64> =
            (0..304).map(|bin| 50.0 * 2.0_f64.powf(f64::from(bin) / 48.0)).collect();
        let magnitude = |f: f64, column: usize| {
            let ridges = ridges_hz.iter().enumerate().map(|(at, ridge)| {
                let height = 1.0 + 0.2 * random(7 * column + at);
                height * (-((f / ridge).ln() / width).powi(2)).exp()
            });
            0.01 + ridges.sum::<f64>()
        };
        let rows = frequencies_hz.iter().flat_map(|&f| (0..100).map(move |at| (f, at)));
        let magnitudes = rows.map(|(f, column)| magnitude(f, column)).collect();
        let times_s = (0..100).map(|column| 1e-3 * f64::from(column)).collect();
        TimeFrequencyMap { times_s, frequencies_hz, magnitudes }
    }

    #[test]
    fn a_sharper_map_has_more_of_its_power_on_the_ridge() {
        let (wide, sharp) = (map(&[150.0], 0.15), map(&[150.0], 0.03));
        let mut compared = Compared::new(Figure::Fig2, "");
        sharper(&mut compared, &wide, &sharp, 5);
        sharper(&mut compared, &sharp, &wide, 5);
        sharper(&mut compared, &wide, &wide, 5);
        assert_eq!(verdicts(&compared), [Reproduced, Differs, CannotTell]);
        // Of a normal distribution of power with standard deviation 0.075, within 0.05.
        let shares = near_the_ridge(&wide, 5);
        assert!(shares.iter().all(|share| (share - 0.49).abs() < 0.05), "{shares:?}");
    }

    #[test]
    fn components_are_the_ridges_and_missing_ones_differ() {
        let found = components(&map(&[150.0, 560.0, 2000.0], 0.12), 5);
        assert_eq!(found.len(), 3, "{found:?}");
        let mut compared = Compared::new(Figure::Fig2, "");
        for range_hz in COMPONENTS_HZ {
            component(&mut compared, &found, range_hz);
        }
        assert_eq!(verdicts(&compared), [Reproduced, Reproduced, Differs]);
    }
}
