//! Fig. 3: LWPS at six sleepers and its characteristic frequencies.

use crate::average::{Average, DEVIATIONS};
use crate::example::Example;
use crate::example_track::RecordedExample;
use crate::picture::{Picture, Scale, Style};
use crate::spectrum::{DB, SPEED_KM_H};
use crate::speed::{hertz, resolution};
use crate::{ClaimVerdict, Compared, Error, Figure};
use std::ops::RangeInclusive;
use tracktwin_experiment::Experiment;
use tracktwin_signal::recording::Recording;
use tracktwin_signal::{Extractor, FeatureDefinition, FeatureSet};
use tracktwin_track::frequency::peaks;

/// Sleepers that are shown, counted from 1: the paper shows SN91 to SN96.
pub(crate) const SHOWN: RangeInclusive<usize> = 2..=7;

/// Frequencies in Hz of the paper's figure, and instants a second that suffice for the highest.
const RANGE_HZ: [f64; 2] = [100.0, 1e4];
const INSTANTS_HZ: f64 = 1e5;

/// Characteristic frequencies that the paper marks.
const MARKED: usize = 5;

/// The LWPS of one sleeper in dB re 1 (m/s2)2, a value a bin.
type Levels = Vec<f64>;

/// LWPS over six sleepers of the nominal track beside the paper's Fig. 3.
///
/// # Errors
/// [`Error::NoSpeed`], [`Error::Features`] or [`Error::NotCovered`].
pub(crate) fn local_spectra(
    experiment: &Experiment,
    passes: &[RecordedExample],
) -> Result<Compared, Error> {
    let figure = Figure::Fig3;
    let [lowest_hz, highest_hz] = RANGE_HZ;
    let definition = FeatureDefinition {
        lowest_hz,
        highest_hz,
        instant_rate_hz: INSTANTS_HZ,
        ..experiment.features.clone()
    };
    let extractor = Extractor::new(&definition)?;
    let spectrum = |(recording, sleeper): (&Recording, usize)| -> Result<Levels, Error> {
        let pass = pass_index(recording, figure)?;
        let window = recording.window(pass, sleeper - 1);
        let window = window.ok_or(Error::NotCovered { figure, sleeper })?;
        let features = extractor.extract(&recording.passes[pass].signal, window)?;
        Ok(features.log_power.into_iter().map(|ln| DB * ln).collect())
    };
    let windows = passes.iter().flat_map(|of| SHOWN.map(move |sleeper| (&of.1, sleeper)));
    let spectra = windows.map(spectrum).collect::<Result<Vec<_>, _>>()?;
    Ok(compare(&definition.frequencies_hz(), &spectra, definition.wavelet_centre_rad))
}

/// Index of the pass at the paper's speed.
pub(crate) fn pass_index(recording: &Recording, figure: Figure) -> Result<usize, Error> {
    let known = recording.speeds_km_h();
    let found = recording.passes.iter().position(|pass| pass.speed_km_h == SPEED_KM_H);
    found.ok_or(Error::NoSpeed { figure, wanted: SPEED_KM_H, known })
}

/// From the LWPS of the shown sleepers, pass after pass.
fn compare(frequencies_hz: &[f64], spectra: &[Levels], centre_rad: f64) -> Compared {
    let width = resolution(centre_rad);
    let smooth: Vec<Levels> =
        spectra.iter().map(|of| smoothed(frequencies_hz, of, width)).collect();
    let bin = |bin: usize| Average::of(&smooth.iter().map(|of| of[bin]).collect::<Vec<_>>());
    let mean: Vec<Average> = (0..frequencies_hz.len()).map(bin).collect();
    let least_db = DEVIATIONS * root_mean_square(mean.iter().map(|bin| bin.error));
    let found = characteristic(frequencies_hz, &mean, least_db);
    let caption = format!(
        "LWPS at 13 km/h over six sleepers of one pass over the nominal track (colours), and the \
         mean of {} windows of all passes, smoothed by the width of the wavelet (dark); lines at \
         the characteristic frequencies that were found in the mean.",
        spectra.len()
    );
    let mut compared = Compared::new(Figure::Fig3, &caption);
    count(&mut compared, &found, least_db, spectra.len());
    for (number, range_hz) in (1..).zip(ranges()) {
        one(&mut compared, &found, number, range_hz);
    }
    variation(&mut compared, &smooth);
    compared.pictures = pictures(frequencies_hz, spectra, &mean, &found);
    compared
}

/// Ranges in Hz of the paper's f1 to f5: the local features lie about the first four (section
/// 2.5.3), the fifth above the range of the features (Fig. 10).
fn ranges() -> [[f64; 2]; 5] {
    let local = |feature: FeatureSet| feature.range_hz();
    let [_, above_hz] = FeatureSet::Gf.range_hz();
    [
        local(FeatureSet::Lf1),
        local(FeatureSet::Lf2),
        local(FeatureSet::Lf3),
        local(FeatureSet::Lf4),
        [above_hz, RANGE_HZ[1]],
    ]
}

/// Power averaged over neighbouring bins by a normal distribution of relative width `share`, for
/// and as values in dB.
fn smoothed(frequencies_hz: &[f64], levels_db: &[f64], share: f64) -> Levels {
    let at = |centre: &f64| {
        let weights =
            frequencies_hz.iter().map(|f| (-0.5 * ((f / centre).ln() / share).powi(2)).exp());
        let sums = weights.zip(levels_db).fold([0.0, 0.0], |[sum, all], (weight, level)| {
            [sum + weight * 10.0_f64.powf(0.1 * level), all + weight]
        });
        10.0 * (sums[0] / sums[1]).log10()
    };
    frequencies_hz.iter().map(at).collect()
}

fn root_mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    (values.map(|value| value * value).sum::<f64>() / count).sqrt()
}

/// All peaks in Hz, ascending, that stand out by at least so much.
fn characteristic(frequencies_hz: &[f64], mean: &[Average], least_db: f64) -> Vec<f64> {
    let magnitudes: Vec<f64> = mean.iter().map(|bin| 10.0_f64.powf(bin.mean / 20.0)).collect();
    let found = peaks(frequencies_hz, &magnitudes, least_db);
    let mut found: Vec<f64> = found.into_iter().map(|peak| peak.frequency_hz).collect();
    found.sort_by(f64::total_cmp);
    found
}

fn count(compared: &mut Compared, found: &[f64], least_db: f64, windows: usize) {
    compared.row(
        "The LWPS has five major frequency components from 100 to 10,000 Hz",
        [format!("{MARKED}, f1 to f{MARKED}"), hertz(found)],
        ClaimVerdict::of(found.len() == MARKED),
        format!(
            "peaks of the smoothed mean of {windows} windows that stand out by {least_db:.1} dB, \
             twice its standard error. The paper's are of a measured track with \
             fastening clamps and with faults, ours of the nominal track, whose sleepers are all \
             alike"
        ),
    );
}

fn one(compared: &mut Compared, found: &[f64], number: usize, [low, high]: [f64; 2]) {
    let inside: Vec<f64> =
        found.iter().copied().filter(|peak| (low..=high).contains(peak)).collect();
    let place = if number < MARKED {
        format!("inside the range of LF{number}")
    } else {
        "above the range of the features".to_owned()
    };
    compared.row(
        format!("Characteristic frequency f{number}"),
        [format!("{low} to {high} Hz"), hertz(&inside)],
        ClaimVerdict::of(!inside.is_empty()),
        format!("a marked peak {place}; the text of the paper gives no number"),
    );
}

fn variation(compared: &mut Compared, smooth: &[Levels]) {
    let bins = 0..smooth[0].len();
    let error = |bin| Average::of(&smooth.iter().map(|of| of[bin]).collect::<Vec<_>>()).error;
    let deviation = root_mean_square(bins.map(error)) * (smooth.len() as f64).sqrt();
    compared.row(
        "The LWPS varies clearly between sleepers, which tells their stiffness apart",
        [
            "clear variations".to_owned(),
            format!("standard deviation {deviation:.1} dB where all sleepers are alike"),
        ],
        ClaimVerdict::CannotTell,
        "after smoothing, over 100 to 10,000 Hz; the surface alone makes this much, so a variation \
         is no evidence of stiffness unless it is larger or found again in other passes",
    );
}

fn pictures(
    frequencies_hz: &[f64],
    spectra: &[Levels],
    mean: &[Average],
    found: &[f64],
) -> Vec<Picture> {
    let points = |levels: &[f64]| -> Vec<(f64, f64)> {
        frequencies_hz.iter().copied().zip(levels.iter().copied()).collect()
    };
    let mean: Vec<f64> = mean.iter().map(|bin| bin.mean).collect();
    let shown = &spectra[..SHOWN.count()];
    let half = shown.len() / 2;
    let picture = |(first, part): (usize, &[Levels])| {
        let names: Vec<usize> = SHOWN.skip(first).take(part.len()).collect();
        let title = format!("Sleepers {} to {}", names[0], names[names.len() - 1]);
        let x = Scale::logarithmic("frequency in Hz");
        let mut picture = Picture::new(title, x, Scale::linear("dB re 1 (m/s²)²"));
        picture.wide = true;
        picture.marks = found.to_vec();
        for (name, levels) in names.iter().zip(part) {
            picture = picture.with(Example::sleeper(*name), Style::Line, points(levels));
        }
        picture.with("mean of all", Style::Truth, points(&mean))
    };
    [(0, &shown[..half]), (half, &shown[half..])].map(picture).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Bump, random, verdicts};
    use ClaimVerdict::{CannotTell, Differs, Reproduced};

    fn frequencies_hz() -> Vec<f64> {
        (0..319).map(|bin| 100.0 * 2.0_f64.powf(f64::from(bin) / 48.0)).collect()
    }

    /// Six spectra with bumps of this height at these frequencies, and noise.
    fn spectra(peaks_hz: &[f64], height_db: f64) -> Vec<Levels> {
        let level = |sleeper: usize, bin: usize, f: f64| {
            let bumps = peaks_hz.iter().map(|&peak| Bump(peak, height_db).at(f));
            bumps.sum::<f64>() + 6.0 * random(1000 * sleeper + bin)
        };
        let frequencies = frequencies_hz();
        let one = |sleeper: usize| {
            frequencies.iter().enumerate().map(|(bin, &f)| level(sleeper, bin, f)).collect()
        };
        (0..6).map(one).collect()
    }

    #[test]
    fn five_bumps_in_the_paper_s_ranges_are_found_and_marked() {
        let peaks_hz = [550.0, 1100.0, 2000.0, 3200.0, 6000.0];
        let compared = compare(&frequencies_hz(), &spectra(&peaks_hz, 20.0), 6.0);
        let expected = [&[Reproduced; 6][..], &[CannotTell]].concat();
        assert_eq!(verdicts(&compared), expected, "{:#?}", compared.rows);
        for (mark, peak) in compared.pictures[1].marks.iter().zip(peaks_hz) {
            assert!((mark / peak - 1.0).abs() < 0.05, "{mark} {peak}");
        }
    }

    #[test]
    fn noise_alone_has_no_five_peaks_and_others_are_not_the_paper_s() {
        let none = compare(&frequencies_hz(), &spectra(&[], 0.0), 6.0);
        assert_eq!(none.rows[0].verdict, Differs, "{:#?}", none.rows);
        let other = compare(&frequencies_hz(), &spectra(&[150.0, 750.0, 2000.0], 20.0), 6.0);
        let found = verdicts(&other);
        assert_eq!(found[..4], [Differs, Differs, Differs, Reproduced], "{:#?}", other.rows);
    }
}
