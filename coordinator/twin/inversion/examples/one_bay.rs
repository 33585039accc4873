//! What the samples of one sleeper spacing at 13 km/h can tell of a track: the exact likelihood of a Gaussian signal on
//! time simulations, without features.
//!
//! `cargo run --release -p tracktwin-inversion --example one_bay -- [TRACKS] [CASES]`
//!
//! Tracks are Sobol points of Table D1 (Shen et al. 2023) whose covariance matrices follow from the frequency domain.
//! Cases are other points, simulated in the time domain, each over a surface of its own.
//! `docs/decisions/0034-inputs-of-the-regression.md` shows what comes out.

#![expect(clippy::print_stdout, reason = "an example shows its numbers")]

use faer::linalg::solvers::SelfAdjointEigen;
use faer::{Mat, Par, Side};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::slice;
use tracktwin_experiment::{Experiment, metres_per_second};
use tracktwin_parameters::{Parameter, ParameterSet, Preset, Sequence, TrackDesign};
use tracktwin_track::frequency::RailReceptances;
use tracktwin_track::model::{HertzContact, Mesh, Roughness, Support, TrackModel};
use tracktwin_track::time::{self, Pass};

type Failure = Box<dyn std::error::Error + Send + Sync>;

const SPEED_KM_H: f64 = 13.0;
const SPANS: usize = 25;
/// Compared band in Hz.
const BAND_HZ: [f64; 2] = [50.0, 3700.0];
/// Every twelfth sample of the low-pass filtered signal is compared.
const STEP: usize = 12;
/// The filter: a windowed sinc of this cut-off in Hz, with this number of samples on either side of the middle.
const CUT_OFF_HZ: f64 = 3900.0;
const HALF_FILTER: usize = 60;
/// Spectral lines of the covariance, up to 6.5 kHz: distance in Hz and number. What the filter leaves above half the sample rate is
/// aliased in model and signal alike.
const LINE_HZ: f64 = 14.4;
const LINES: u32 = 451;
/// Number of levels on which the posterior is evaluated, at the middles of equal parts of the range.
const LEVELS: usize = 41;
/// Standard deviations of the sensor's white noise in m/s2, known to the observer.
const NOISES: [f64; 3] = [0.03, 0.1, 0.3];
const SEEDS: [u64; 2] = [7, 11];

/// The compared samples of one spacing, as coordinates in a basis of functions that lie in the band.
struct Bay {
    experiment: Experiment,
    /// Frequencies of the lines in Hz.
    lines_hz: Vec<f64>,
    filter: Vec<f64>,
    /// `[sample][coordinate]`.
    basis: Mat<f64>,
    /// Coordinates of every line, cosine and sine, weighted by the share of every rail node at each sample:
    /// `[coordinate][(line, phase, node)]`.
    waves: Mat<f64>,
    /// Indices of the rail nodes of the spacing.
    nodes: Vec<usize>,
    /// Root mean square of the surface in a line at level 1, times the gain of the filter, in m.
    surface_m: Vec<f64>,
}

fn speed_m_s() -> f64 {
    metres_per_second(SPEED_KM_H)
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Of all signals with this number of samples those that lie in the band, as columns (Slepian sequences).
fn signals_in_band(count: usize, sample_s: f64) -> Result<Mat<f64>, Failure> {
    let [from_hz, to_hz] = BAND_HZ;
    let below = |hz: f64, apart_s: f64| 2.0 * sample_s * hz * sinc(2.0 * hz * apart_s);
    let in_band = Mat::from_fn(count, count, |i, j| {
        let apart_s = (i as f64 - j as f64) * sample_s;
        below(to_hz, apart_s) - below(from_hz, apart_s)
    });
    let eigen = in_band.self_adjoint_eigen(Side::Lower).map_err(|_| "no eigenvectors")?;
    let shares = eigen.S().column_vector();
    let inside: Vec<usize> = (0..count).filter(|&it| shares[it] > 0.99).collect();
    Ok(Mat::from_fn(count, inside.len(), |row, column| eigen.U()[(row, inside[column])]))
}

/// Weights of the samples on both sides of the filtered one.
fn low_pass(step_s: f64) -> Vec<f64> {
    let tap = |tap: usize| {
        let from_middle = tap as f64 - HALF_FILTER as f64;
        let window = (0.5 * PI * from_middle / (HALF_FILTER as f64 + 1.0)).cos().powi(2);
        2.0 * CUT_OFF_HZ * step_s * sinc(2.0 * CUT_OFF_HZ * step_s * from_middle) * window
    };
    (0..=2 * HALF_FILTER).map(tap).collect()
}

impl Bay {
    fn new(experiment: Experiment, model: &TrackModel) -> Result<Self, Failure> {
        let step_s = experiment.time_step_s;
        let spacing_m = experiment.design.sleeper.spacing_m;
        let sample_s = step_s * STEP as f64;
        let basis =
            signals_in_band((spacing_m / speed_m_s() / sample_s).floor() as usize, sample_s)?;
        let filter = low_pass(step_s);
        let lines_hz: Vec<f64> = (1..=LINES).map(|line| f64::from(line) * LINE_HZ).collect();

        let sleeper_m = (SPANS / 2) as f64 * spacing_m;
        let all_m = model.layout().rail_nodes_m();
        let is_inside = |x_m: f64| (x_m - sleeper_m).abs() < 0.5 * spacing_m + 1e-6;
        let nodes: Vec<usize> = (0..all_m.len()).filter(|&node| is_inside(all_m[node])).collect();
        let element_m = all_m[nodes[1]] - all_m[nodes[0]];
        let first_m = sleeper_m - 0.5 * spacing_m;
        let weight = |time_s: f64, node: usize| {
            let x_m = first_m + speed_m_s() * time_s;
            (1.0 - (x_m - all_m[nodes[node]]).abs() / element_m).max(0.0)
        };
        let each = 2 * nodes.len();
        let samples = Mat::from_fn(basis.nrows(), lines_hz.len() * each, |sample, column| {
            let time_s = sample as f64 * sample_s;
            let angle = TAU * lines_hz[column / each] * time_s;
            let is_cosine = column % each < nodes.len();
            let wave = if is_cosine { angle.cos() } else { angle.sin() };
            weight(time_s, column % nodes.len()) * wave
        });
        let waves = basis.transpose() * samples;

        let gain = |hz: f64| -> f64 {
            let at = |tap: usize| (TAU * hz * step_s * (tap as f64 - HALF_FILTER as f64)).cos();
            filter.iter().enumerate().map(|(tap, weight)| weight * at(tap)).sum()
        };
        let roughness = Roughness::between(1.0, experiment.wavelengths_m);
        let surface = |hz: &f64| {
            let per_hz = roughness.density(TAU * hz / speed_m_s()) * TAU / speed_m_s();
            gain(*hz) * (per_hz * LINE_HZ).sqrt()
        };
        let surface_m = lines_hz.iter().map(surface).collect();
        Ok(Self { experiment, lines_hz, filter, basis, waves, nodes, surface_m })
    }

    /// Covariance of the coordinates at level 1: at every place of the spacing the signal is that of a stationary
    /// surface on a track that is the same everywhere.
    fn covariance(&self, model: &TrackModel) -> Mat<f64> {
        let design = model.design();
        let contact = 1.0 / HertzContact::new(design).stiffness(design.wheel.load_n);
        let direct = RailReceptances::new(model, &self.lines_hz, None).direct;
        let amplitude = |line: usize, node: usize| {
            let omega = TAU * self.lines_hz[line];
            let vehicle = model.vehicle();
            let stiffness =
                (contact + vehicle.receptance(omega) + direct[line][self.nodes[node]]).inv();
            (stiffness * vehicle.acceleration_per_force(omega)).norm() * self.surface_m[line]
        };
        let (lines, nodes) = (self.lines_hz.len(), self.nodes.len());
        let amplitudes = Mat::from_fn(lines, nodes, amplitude);
        let factor = Mat::from_fn(self.basis.ncols(), 2 * lines, |coordinate, column| {
            let first = column * nodes;
            (0..nodes)
                .map(|node| amplitudes[(column / 2, node)] * self.waves[(coordinate, first + node)])
                .sum::<f64>()
        });
        &factor * factor.transpose()
    }

    /// Coordinates of a time simulation over a surface of its own, with white noise of this deviation.
    fn simulated(
        &self,
        model: &TrackModel,
        level: f64,
        seed: u64,
        noises: &[f64],
    ) -> Result<Vec<Vec<f64>>, Failure> {
        let experiment = &self.experiment;
        let spacing_m = experiment.design.sleeper.spacing_m;
        let step_m = speed_m_s() * experiment.time_step_s;
        let first_m = ((SPANS / 2) as f64 - 0.5) * spacing_m;
        let pass = Pass {
            speed_m_s: speed_m_s(),
            // The first compared sample lies on the beginning of the spacing.
            start_m: first_m - (4.0 * spacing_m / step_m).ceil() * step_m,
            end_m: first_m + 1.2 * spacing_m,
            time_step_s: experiment.time_step_s,
            local_flexibility: experiment.local_flexibility,
        };
        let surface = model.surface(&Roughness::between(level, experiment.wavelengths_m), seed);
        let records = time::passes(slice::from_ref(model), &pass, &[surface])?;
        let record = &records[0];
        let first = ((first_m - pass.start_m) / step_m).round() as usize;
        let filtered = |sample: usize| -> f64 {
            let from = first + sample * STEP - HALF_FILTER;
            let samples = &record.acceleration_m_s2[from..];
            self.filter.iter().zip(samples).map(|(tap, value)| tap * value).sum()
        };
        let clean: Vec<f64> = (0..self.basis.nrows()).map(filtered).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let coordinates = |noise: &f64| {
            let mut noisy = clean.clone();
            for value in &mut noisy {
                let normal: f64 = StandardNormal.sample(&mut random);
                *value += noise * normal;
            }
            let of = |column: usize| {
                (0..noisy.len()).map(|row| self.basis[(row, column)] * noisy[row]).sum()
            };
            (0..self.basis.ncols()).map(of).collect()
        };
        Ok(noises.iter().map(coordinates).collect())
    }
}

fn points(count: u32, seed: u64) -> Result<Vec<Vec<f64>>, Failure> {
    Ok(Sequence::OwenScrambled.points(0..count, Parameter::COUNT, seed)?)
}

fn parameters(point: &[f64]) -> ParameterSet {
    Preset::VTrack.space().values(point, &Preset::VTrack.nominal())
}

/// A track with equal sleepers.
fn track(experiment: &Experiment, point: &[f64]) -> Result<TrackModel, Failure> {
    let supports = vec![Support::from(&parameters(point)); SPANS - 1];
    let Experiment { rail_elements_per_span, sleeper_elements, design, .. } = experiment;
    let mesh = Mesh::uniform(SPANS, *rail_elements_per_span, *sleeper_elements);
    Ok(TrackModel::build(design, &mesh, &supports, &[])?)
}

/// Log likelihood of all cases, `[level][case]`, given the track's covariance at level 1.
fn log_likelihood(
    covariance: &SelfAdjointEigen<f64>,
    noise: f64,
    levels: &[f64],
    cases: &Mat<f64>,
) -> Vec<Vec<f64>> {
    let whitened = covariance.U().transpose() * cases;
    let of_level = |&level: &f64| {
        let powers = covariance.S().column_vector().iter();
        let variances: Vec<f64> = powers.map(|it| level * it.max(0.0) + noise * noise).collect();
        let constant: f64 = variances.iter().map(|it| it.ln()).sum();
        let of_case = |case: usize| {
            let each = variances.iter().enumerate();
            let sum: f64 = each.map(|(it, variance)| whitened[(it, case)].powi(2) / variance).sum();
            -0.5 * (constant + sum)
        };
        (0..cases.ncols()).map(of_case).collect()
    };
    levels.iter().map(of_level).collect()
}

/// Value below which a share of the weights lies; `all` are pairs of a value and its weight.
fn quantile(all: &mut [(f64, f64)], share: f64) -> f64 {
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    let whole: f64 = all.iter().map(|(_, weight)| weight).sum();
    let mut sum = 0.0;
    let reached = all.iter().find(|(_, weight)| {
        sum += weight;
        sum >= share * whole
    });
    reached.map_or(f64::NAN, |(value, _)| *value)
}

/// Absolute error of the posterior median and whether the 90 % interval holds the truth, for every parameter. The
/// weights are `[track][level]`; all values are shares of the ranges.
fn scores(
    weights: &[Vec<f64>],
    bank: &[Vec<f64>],
    levels: &[f64],
    truth: &[f64],
) -> Vec<(f64, bool)> {
    let score = |parameter: usize| {
        let mut all: Vec<(f64, f64)> = if parameter + 1 < truth.len() {
            let sums = weights.iter().map(|levels| levels.iter().sum());
            bank.iter().map(|point| point[parameter]).zip(sums).collect()
        } else {
            let sum = |level: usize| weights.iter().map(|levels| levels[level]).sum();
            levels.iter().enumerate().map(|(level, share)| (*share, sum(level))).collect()
        };
        let [low, median, high] = [0.05, 0.5, 0.95].map(|share| quantile(&mut all, share));
        let value = truth[parameter];
        ((median - value).abs(), (low..=high).contains(&value))
    };
    (0..truth.len()).map(score).collect()
}

/// Errors of all parameters over the cases. Arguments of the log likelihood: track, level, case.
fn table_row(
    log_likelihood: impl Fn(usize, usize, usize) -> f64 + Sync,
    bank: &[Vec<f64>],
    levels: &[f64],
    cases: &[Vec<f64>],
) -> String {
    let score = |case: usize| {
        let all = (0..bank.len()).flat_map(|track| (0..LEVELS).map(move |level| (track, level)));
        let highest = all
            .map(|(track, level)| log_likelihood(track, level, case))
            .fold(f64::NEG_INFINITY, f64::max);
        let weight = |track, level| (log_likelihood(track, level, case) - highest).exp();
        let of_track = |track: usize| (0..LEVELS).map(|level| weight(track, level)).collect();
        let weights: Vec<Vec<f64>> = (0..bank.len()).map(of_track).collect();
        scores(&weights, bank, levels, &cases[case])
    };
    let scores: Vec<Vec<(f64, bool)>> = (0..cases.len()).into_par_iter().map(score).collect();
    let count = scores.len() as f64;
    let column = |(place, parameter): (usize, &Parameter)| {
        let mean = scores.iter().map(|case| case[place].0).sum::<f64>() / count;
        let square = scores.iter().map(|case| (case[place].0 - mean).powi(2)).sum::<f64>();
        let held = scores.iter().filter(|case| case[place].1).count() as f64 / count;
        let [mean, error, held] = [mean, square.sqrt() / count, held].map(|share| 100.0 * share);
        format!("{} {mean:.1} ± {error:.1} ({held:.0} %)", parameter.symbol())
    };
    let columns: Vec<String> = Parameter::ALL.iter().enumerate().map(column).collect();
    columns.join(", ")
}

fn main() -> Result<(), Failure> {
    faer::set_global_parallelism(Par::Seq);
    let number = |place: usize, usual: u32| -> Result<u32, Failure> {
        Ok(std::env::args().nth(place).map_or(Ok(usual), |text| text.parse())?)
    };
    let (bank, cases) = (points(number(1, 4000)?, SEEDS[0])?, points(number(2, 240)?, SEEDS[1])?);
    let experiment = Experiment::new(TrackDesign::v_track());
    let bay = Bay::new(experiment.clone(), &track(&experiment, &bank[0])?)?;
    let shares: Vec<f64> = (0..LEVELS).map(|level| (level as f64 + 0.5) / LEVELS as f64).collect();
    let axis = Preset::VTrack.axis(Parameter::IrregularityLevel);
    let levels: Vec<f64> =
        shares.iter().map(|share| axis.scale.at([axis.low, axis.high], *share)).collect();

    let simulated = |(case, point): (usize, &Vec<f64>)| {
        let level = parameters(point)[Parameter::IrregularityLevel];
        bay.simulated(&track(&experiment, point)?, level, 1_000_000 + case as u64, &NOISES)
    };
    let simulated: Vec<Vec<Vec<f64>>> =
        cases.par_iter().enumerate().map(simulated).collect::<Result<_, _>>()?;
    let of_noise = |noise: usize| {
        Mat::from_fn(bay.basis.ncols(), cases.len(), |row, case| simulated[case][noise][row])
    };
    let signals: Vec<Mat<f64>> = (0..NOISES.len()).map(of_noise).collect();
    println!("{} tracks, {} cases, {} coordinates", bank.len(), cases.len(), bay.basis.ncols());

    // `[track][noise][level][case]`.
    let likelihoods: Vec<Vec<Vec<Vec<f64>>>> = bank
        .par_iter()
        .map(|point| {
            let covariance = bay.covariance(&track(&experiment, point)?);
            let covariance =
                covariance.self_adjoint_eigen(Side::Lower).map_err(|_| "no eigenvectors")?;
            let of = |(noise, signals): (&f64, &Mat<f64>)| {
                log_likelihood(&covariance, *noise, &levels, signals)
            };
            Ok(NOISES.iter().zip(&signals).map(of).collect())
        })
        .collect::<Result<_, Failure>>()?;
    println!(
        "noise, then mean absolute error in % of the range ± standard error (share of truths in the 90 % intervals)"
    );
    for (number, noise) in NOISES.iter().enumerate() {
        let log_likelihood =
            |track: usize, level: usize, case: usize| likelihoods[track][number][level][case];
        println!("{noise} m/s2: {}", table_row(log_likelihood, &bank, &shares, &cases));
    }
    Ok(())
}
