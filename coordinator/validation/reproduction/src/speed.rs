//! Fig. 10: the LWPS falls with the speed, its characteristic frequencies stay.

use crate::average::{Average, all};
use crate::picture::{Picture, Scale, Style};
use crate::spectrum::{DB, enough, log_power, mean_spectrum, points};
use crate::{ClaimVerdict, Compared, Error, Figure};
use std::f64::consts::SQRT_2;
use tracktwin_signal::FeatureSet;
use tracktwin_surrogate::TrainingSet;
use tracktwin_track::frequency::peaks;

/// A peak of a mean spectrum stands out by this much, in dB: less is no feature on the paper's
/// axis of several tens of dB.
const PROMINENCE_DB: f64 = 1.0;

/// Peaks nearer than this share of their frequency are one to the transform: the standard
/// deviation over frequency of the power of a Morlet wavelet centred at `centre_rad`.
pub(crate) fn resolution(centre_rad: f64) -> f64 {
    1.0 / (SQRT_2 * centre_rad)
}

/// Mean spectra of all cases at the library's speeds beside the paper's Fig. 10.
///
/// `centre_rad` is the centre of the wavelet.
///
/// # Errors
/// [`Error::OneSpeed`] or [`Error::TooFewCases`].
pub(crate) fn speed(set: &TrainingSet, centre_rad: f64) -> Result<Compared, Error> {
    let figure = Figure::Fig10;
    if set.speeds_km_h.len() < 2 {
        return Err(Error::OneSpeed { figure });
    }
    enough(set, figure, 1)?;
    let cases: Vec<usize> = (0..set.entries()).collect();
    let spectra: Vec<Vec<Average>> =
        (0..set.speeds_km_h.len()).map(|speed| mean_spectrum(set, speed, &cases)).collect();
    let caption = "Mean LWPS of all cases of the library, one curve per speed. Thin lines: the middle \
                   90 % of the cases at the highest speed.";
    let mut compared = Compared::new(figure, caption);
    magnitude(&mut compared, set);
    let found: Vec<Vec<f64>> =
        spectra.iter().map(|spectrum| peak_frequencies(&set.frequencies_hz, spectrum)).collect();
    frequencies(&mut compared, &found, resolution(centre_rad));
    local_features(&mut compared, &found);
    compared.pictures.push(picture(set, &spectra));
    Ok(compared)
}

fn magnitude(compared: &mut Compared, set: &TrainingSet) {
    let level = |speed: usize, case: usize| {
        let bins = log_power(set, speed, case);
        DB * bins.iter().sum::<f64>() / bins.len() as f64
    };
    let steps: Vec<(String, Average)> = (1..set.speeds_km_h.len())
        .map(|speed| {
            let [slow, fast] = [set.speeds_km_h[speed - 1], set.speeds_km_h[speed]];
            let rises: Vec<f64> = (0..set.entries())
                .map(|case| level(speed, case) - level(speed - 1, case))
                .collect();
            (format!("{slow} to {fast} km/h"), Average::of(&rises))
        })
        .collect();
    let ours = steps.iter().map(|(name, by)| format!("{name}: {:+.1} dB", by.mean));
    let ours = ours.collect::<Vec<_>>().join("; ");
    compared.row(
        "The magnitude of the LWPS falls with the speed",
        ["13 > 10 > 7 km/h".to_owned(), ours],
        all(steps.iter().map(|step| step.1.is_positive())),
        "mean over 50 to 4000 Hz of the difference of the same cases, beyond two standard errors",
    );
}

fn frequencies(compared: &mut Compared, found: &[Vec<f64>], share: f64) {
    let (Some(fastest), Some((_, slower))) = (found.last(), found.split_last()) else { return };
    let moved = |&peak: &f64| {
        let nearest = |peaks: &Vec<f64>| {
            peaks.iter().map(|other| (other / peak - 1.0).abs()).fold(f64::INFINITY, f64::min)
        };
        slower.iter().map(nearest).fold(0.0, f64::max)
    };
    let most = fastest.iter().map(moved).fold(0.0, f64::max);
    let shift = if most.is_finite() { format!("{:.1} %", 100.0 * most) } else { "lost".into() };
    let verdict =
        if fastest.is_empty() { ClaimVerdict::CannotTell } else { ClaimVerdict::of(most <= share) };
    compared.row(
        "The characteristic frequencies stay",
        ["constant".to_owned(), format!("{}; largest shift {shift}", hertz(fastest))],
        verdict,
        format!(
            "peaks of {PROMINENCE_DB} dB at the highest speed against the nearest at the others; \
             within {:.1} % the wavelet cannot tell two apart",
            100.0 * share
        ),
    );
}

fn local_features(compared: &mut Compared, found: &[Vec<f64>]) {
    let Some(fastest) = found.last() else { return };
    let sets = [FeatureSet::Lf1, FeatureSet::Lf2, FeatureSet::Lf3, FeatureSet::Lf4];
    let without: Vec<&str> = sets
        .iter()
        .filter(|set| {
            let [low, high] = set.range_hz();
            !fastest.iter().any(|peak| (low..=high).contains(peak))
        })
        .map(|set| set.name())
        .collect();
    let ours = if without.is_empty() {
        "a peak in each".to_owned()
    } else {
        format!("none in {}", without.join(", "))
    };
    compared.row(
        "The local features LF1 to LF4 lie about the first four characteristic frequencies",
        ["f1 to f4 at their centres".to_owned(), ours],
        ClaimVerdict::of(without.is_empty()),
        "a peak of the mean LWPS at the highest speed inside each; the paper's f1 to f4 are those of \
         one measured track with fastening clamps, a mean over all of Table D1 smears what moves \
         with the parameters",
    );
}

fn peak_frequencies(frequencies_hz: &[f64], spectrum: &[Average]) -> Vec<f64> {
    let magnitudes: Vec<f64> = spectrum.iter().map(|bin| 10.0_f64.powf(bin.mean / 20.0)).collect();
    let found = peaks(frequencies_hz, &magnitudes, PROMINENCE_DB);
    found.into_iter().map(|peak| peak.frequency_hz).collect()
}

fn picture(set: &TrainingSet, spectra: &[Vec<Average>]) -> Picture {
    let x = Scale::logarithmic("frequency in Hz");
    let mut picture = Picture::new("Mean LWPS by speed", x, Scale::linear("dB re 1 (m/s²)²"));
    picture.wide = true;
    let fastest = set.speeds_km_h.len() - 1;
    for share in [0.05, 0.95] {
        let levels = quantiles(set, fastest, share);
        let points = set.frequencies_hz.iter().copied().zip(levels).collect();
        picture = picture.with("", Style::Thin, points);
    }
    for (speed, spectrum) in set.speeds_km_h.iter().zip(spectra) {
        let points = points(&set.frequencies_hz, spectrum);
        picture = picture.with(format!("{speed} km/h"), Style::Line, points);
    }
    picture
}

/// Level in dB below which this share of the cases lies, a value a bin.
fn quantiles(set: &TrainingSet, speed: usize, share: f64) -> Vec<f64> {
    let of_bin = |bin: usize| {
        let mut levels: Vec<f64> =
            (0..set.entries()).map(|case| DB * log_power(set, speed, case)[bin]).collect();
        levels.sort_by(f64::total_cmp);
        levels[((levels.len() - 1) as f64 * share).round() as usize]
    };
    (0..set.frequencies_hz.len()).map(of_bin).collect()
}

/// Frequencies as a list.
pub(crate) fn hertz(frequencies: &[f64]) -> String {
    if frequencies.is_empty() {
        return "no peak".to_owned();
    }
    let list: Vec<_> = frequencies.iter().map(|f| format!("{f:.0}")).collect();
    format!("{} Hz", list.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Bump, library, verdicts};
    use ClaimVerdict::{Differs, Reproduced};

    const PEAKS_HZ: [f64; 4] = [550.0, 1100.0, 2000.0, 3200.0];

    /// Louder by `rise` at each speed, with bumps at the frequencies times `shift` to the speed.
    fn set(rise: f64, shift: f64) -> TrainingSet {
        library(&[7.0, 10.0, 13.0], 60, |speed, _, frequency_hz| {
            let moved = shift.powf(2.0 - speed as f64);
            let bumps = PEAKS_HZ.iter().map(|peak| Bump(peak * moved, 1.5).at(frequency_hz));
            rise * speed as f64 + bumps.sum::<f64>()
        })
    }

    #[test]
    fn a_spectrum_that_only_sinks_is_the_paper_s() {
        let compared = speed(&set(0.4, 1.0), 6.0).unwrap();
        assert_eq!(verdicts(&compared), [Reproduced; 3]);
        assert!(compared.rows[0].ours.contains("+1.7 dB"), "{}", compared.rows[0].ours);
        let curves = &compared.pictures[0].curves;
        let [low, high, .., mean] = &curves[..] else { panic!("{} curves", curves.len()) };
        let between = low.points.iter().zip(&high.points).zip(&mean.points);
        assert!(between.into_iter().all(|((low, high), mean)| low.1 < mean.1 && mean.1 < high.1));
    }

    #[test]
    fn one_that_grows_as_it_slows_or_slides_along_is_not() {
        assert_eq!(verdicts(&speed(&set(-0.4, 1.0), 6.0).unwrap())[0], Differs);
        assert_eq!(verdicts(&speed(&set(0.4, 1.15), 6.0).unwrap())[1], Differs);
    }

    #[test]
    fn one_speed_is_refused() {
        let alone = library(&[13.0], 60, |_, _, _| 0.0);
        assert!(speed(&alone, 6.0).unwrap_err().to_string().contains("fig10"));
    }
}
