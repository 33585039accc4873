//! Fig. 8: power spectral density of the track irregularity by level.

use crate::agreement::allowed;
use crate::average::Average;
use crate::picture::{Picture, Scale, Style};
use crate::spectrum::SPEED_KM_H;
use crate::{ClaimVerdict, Compared, Error, Figure};
use rayon::prelude::*;
use std::f64::consts::TAU;
use tracktwin_experiment::Experiment;
use tracktwin_parameters::Preset;
use tracktwin_signal::{PowerSpectrum, Signal};
use tracktwin_track::model::{Mesh, Roughness, Support, TrackModel};

/// Levels of irregularity (paper, Table D1).
const LEVELS: [f64; 5] = [1.0, 2.0, 3.0, 4.0, 5.0];

/// Surfaces of each level.
const SURFACES: u64 = 40;

/// Samples on the shortest wave.
const SAMPLES_A_WAVE: f64 = 4.0;

/// Frequencies in Hz of the paper's figure.
const RANGE_HZ: [f64; 2] = [10.0, 1e4];

/// One-third octaves with centres at `10^(n/10)` Hz.
const CENTRES: std::ops::RangeInclusive<i32> = 10..=40;

/// Constants of eq. B.6: `k`, `Omega_c` in rad/m, and level 1 in m2 rad/m (paper, Table D1).
const FACTOR: f64 = 0.25;
const CUTOFF_RAD_M: f64 = 0.8242;
const LEVEL_UNIT: f64 = 1e-4;

/// The mean density of a one-third octave beside eq. B.6.
struct Band {
    centre_hz: f64,
    /// Estimated from the surfaces, in m2/Hz.
    estimated: Average,
    /// Eq. B.6 at the same bins, in m2/Hz.
    expected: f64,
}

/// Spectra of generated surfaces beside eq. B.6 (paper, Fig. 8), as frequencies at 13 km/h.
///
/// # Errors
/// [`Error::Model`], [`Error::Signal`] or [`Error::Spectrum`].
pub(crate) fn irregularity_spectrum(experiment: &Experiment) -> Result<Compared, Error> {
    let supports = vec![Support::from(&Preset::VTrack.nominal()); experiment.spans - 1];
    let model = TrackModel::build(
        &experiment.design,
        &Mesh::uniform(experiment.spans, 1, 1),
        &supports,
        &[],
    )?;
    let spectrum = |(at, &level): (usize, &f64)| {
        let seeds = SURFACES * at as u64..SURFACES * (at as u64 + 1);
        bands(&model, &Roughness::between(level, experiment.wavelengths_m), seeds)
    };
    let levels: Vec<Vec<Band>> =
        LEVELS.par_iter().enumerate().map(spectrum).collect::<Result<_, _>>()?;
    let caption = format!(
        "Power spectral density of {SURFACES} generated surfaces at each level, in one-third \
         octaves (dots), and eq. B.6 (lines); frequency at {SPEED_KM_H} km/h."
    );
    let mut compared = Compared::new(Figure::Fig8, &caption);
    equation(&mut compared, &levels);
    range(&mut compared, experiment.wavelengths_m);
    measured(&mut compared);
    compared.pictures.push(picture(&levels));
    Ok(compared)
}

/// One-third octaves of surfaces with these seeds.
fn bands(
    model: &TrackModel,
    roughness: &Roughness,
    seeds: std::ops::Range<u64>,
) -> Result<Vec<Band>, Error> {
    let step_m = roughness.shortest_m / SAMPLES_A_WAVE;
    let count = (model.layout().length_m() / step_m) as usize;
    let rate_hz = SPEED_KM_H / 3.6 / step_m;
    let spectrum = |seed: u64| {
        let surface = model.surface(roughness, seed);
        let heights = (0..count).map(|sample| surface.height(sample as f64 * step_m)).collect();
        Ok(PowerSpectrum::welch(&Signal::new(rate_hz, heights)?, count)?)
    };
    let spectra = seeds.map(spectrum).collect::<Result<Vec<_>, Error>>()?;
    let width_hz = rate_hz / count as f64;
    let band = |n: i32| {
        let centre_hz = 10.0_f64.powf(0.1 * f64::from(n));
        let [low_hz, high_hz] = [-0.05, 0.05].map(|half: f64| centre_hz * 10.0_f64.powf(half));
        let densities: Option<Vec<f64>> =
            spectra.iter().map(|of| of.mean_density(low_hz, high_hz)).collect();
        let bin = |frequency_hz: f64| (frequency_hz / width_hz).ceil() as usize;
        let bins = bin(low_hz)..bin(high_hz);
        let width = bins.len() as f64;
        let equation = bins.map(|bin| density(bin as f64 * width_hz, roughness.level));
        let expected = equation.sum::<f64>() / width;
        Some(Band { centre_hz, estimated: Average::of(&densities?), expected })
    };
    Ok(CENTRES.filter_map(band).collect())
}

/// Eq. B.6 as a density over frequency at 13 km/h, in m2/Hz.
fn density(frequency_hz: f64, level: f64) -> f64 {
    let a_hertz = TAU / (SPEED_KM_H / 3.6);
    let (omega, cutoff) = ((a_hertz * frequency_hz).powi(2), CUTOFF_RAD_M.powi(2));
    FACTOR * LEVEL_UNIT * level * cutoff / ((omega + cutoff) * omega) * a_hertz
}

fn equation(compared: &mut Compared, levels: &[Vec<Band>]) {
    let ratio = |band: &Band| band.estimated.times(1.0 / band.expected);
    let mean = |(level, bands): (&f64, &Vec<Band>)| {
        let sum: f64 = bands.iter().map(|band| ratio(band).mean).sum();
        format!("{:.3} at {level}", sum / bands.len() as f64)
    };
    let means: Vec<String> = LEVELS.iter().zip(levels).map(mean).collect();
    let all: Vec<Average> = levels.iter().flatten().map(ratio).collect();
    let beyond = all.iter().filter(|ratio| ratio.plus(-1.0).differs_from_zero()).count();
    let (inside, total, allowed) = (all.len() - beyond, all.len(), allowed(all.len()));
    compared.row(
        "The irregularity has the density of eq. B.6 at levels 1 to 5",
        [
            "eq. B.6".to_owned(),
            format!(
                "{inside} of {total} one-third octaves agree; mean ratio by level: {}",
                means.join(", ")
            ),
        ],
        ClaimVerdict::of(beyond <= allowed),
        format!(
            "one-third octaves of 10 to 10,000 Hz at 13 km/h, within two standard errors of the \
             mean of {SURFACES} surfaces; chance alone leaves more than {allowed} of {total} \
             outside once in twenty times at most"
        ),
    );
}

fn range(compared: &mut Compared, wavelengths_m: [f64; 2]) {
    let [high_hz, low_hz] = wavelengths_m.map(|wavelength_m| SPEED_KM_H / 3.6 / wavelength_m);
    let [low, high] = RANGE_HZ;
    compared.check(
        "The irregularity covers the frequencies of the figure",
        [format!("{low} to {high} Hz"), format!("{low_hz:.1} to {high_hz:.0} Hz at 13 km/h")],
        ClaimVerdict::of(low_hz <= low && high_hz >= high),
        "input of the program: the surface has no waves outside the wavelengths of the campaign",
    );
}

fn measured(compared: &mut Compared) {
    compared.row(
        "Levels 1 to 5 enclose the density measured between SN91 and SN95",
        ["enclosed".to_owned(), "not measured here".to_owned()],
        ClaimVerdict::CannotTell,
        "the paper's measured irregularity is not available",
    );
}

fn picture(levels: &[Vec<Band>]) -> Picture {
    let x = Scale::logarithmic("frequency at 13 km/h in Hz");
    let mut picture =
        Picture::new("Irregularity by level", x, Scale::logarithmic("density in m²/Hz"));
    picture.wide = true;
    let equation = levels.iter().map(|bands| {
        (String::new(), Style::Truth, bands.iter().map(|of| (of.centre_hz, of.expected)).collect())
    });
    let estimates = LEVELS.iter().zip(levels).map(|(level, bands)| {
        let points = bands.iter().map(|of| (of.centre_hz, of.estimated.mean)).collect();
        (format!("A_irr {level}"), Style::Points, points)
    });
    // Estimates first: the colours follow the order.
    estimates
        .chain(equation)
        .fold(picture, |picture, (name, style, points)| picture.with(name, style, points))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::verdicts;
    use ClaimVerdict::{CannotTell, Differs, Fails, Holds, Reproduced};
    use tracktwin_parameters::TrackDesign;

    #[test]
    fn generated_surfaces_follow_the_equation_at_every_level() {
        let compared = irregularity_spectrum(&Experiment::new(TrackDesign::v_track())).unwrap();
        assert_eq!(verdicts(&compared), [Reproduced, Holds, CannotTell], "{:#?}", compared.rows);
        assert_eq!(compared.pictures[0].curves.len(), 10);
    }

    #[test]
    fn another_level_or_another_slope_differs() {
        let band = |ratio: f64| Band {
            centre_hz: 100.0,
            estimated: Average { mean: ratio, error: 0.05 },
            expected: 1.0,
        };
        let mut compared = Compared::new(Figure::Fig8, "");
        let agree: Vec<Band> = (0..31).map(|at| band(if at < 2 { 1.2 } else { 1.0 })).collect();
        let steep = (0..31).map(|at| band(0.7 + 0.02 * f64::from(at))).collect();
        let twice = (0..31).map(|_| band(2.0)).collect();
        equation(&mut compared, &[agree]);
        equation(&mut compared, &[steep]);
        equation(&mut compared, &[twice]);
        assert_eq!(verdicts(&compared), [Reproduced, Differs, Differs]);
        range(&mut compared, [1e-3, 1.0]);
        assert_eq!(compared.rows[3].verdict, Fails, "{:?}", compared.rows[3]);
    }

    #[test]
    fn the_equation_falls_with_the_fourth_power_above_its_cut_off() {
        assert!((density(1000.0, 2.0) / density(100.0, 2.0) * 1e4 - 1.0).abs() < 1e-4);
        assert!((density(1000.0, 5.0) / density(1000.0, 1.0) - 5.0).abs() < 1e-12);
    }
}
