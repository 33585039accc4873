//! Fig. 12: which parameter moves the LWPS, and where.

use crate::average::{Average, all};
use crate::picture::{Picture, Scale, Style};
use crate::spectrum::{enough, mean_spectrum, points, speed_index};
use crate::{ClaimVerdict, Compared, Error, Figure};
use Parameter::{
    BallastDamping, BallastStiffness, IrregularityLevel, RailpadDamping, RailpadStiffness,
    SleeperBendingStiffness,
};
use tracktwin_parameters::Parameter;
use tracktwin_surrogate::TrainingSet;

/// Sub-ranges of every parameter, as in the paper.
const GROUPS: usize = 5;

/// Share of a parameter's effect that lies where it is said to act: a figure's reader leaves out
/// the rest.
const MOST: f64 = 0.9;

/// Frequencies in Hz that the paper's "approximately 1000 Hz" may stand for: those that with one
/// digit are 1000.
const BALLAST_BELOW_HZ: [f64; 2] = [950.0, 1500.0];

/// Parameters that the paper evaluates, and the one that it calls without effect.
const TOLD: [Parameter; 4] =
    [BallastStiffness, IrregularityLevel, RailpadStiffness, SleeperBendingStiffness];

/// A parameter's groups: the mean LWPS of each in dB, lowest values first.
struct Effect {
    parameter: Parameter,
    groups: Vec<Vec<Average>>,
}

/// Mean spectra of groups of cases beside the paper's Fig. 12.
///
/// # Errors
/// [`Error::NoSpeed`], [`Error::NotVaried`] or [`Error::TooFewCases`].
pub(crate) fn sensitivity(set: &TrainingSet) -> Result<Compared, Error> {
    let figure = Figure::Fig12;
    let speed = speed_index(set, figure)?;
    enough(set, figure, GROUPS)?;
    let effects = Parameter::ALL
        .iter()
        .map(|&parameter| Effect::new(set, speed, parameter))
        .collect::<Result<Vec<_>, _>>()?;
    let caption =
        "Mean LWPS at 13 km/h of the cases in five equal parts of each parameter's range.";
    let mut compared = Compared::new(figure, caption);
    greatest(&mut compared, &effects);
    wide(&mut compared, &effects);
    below(&mut compared, set, &effects);
    when_low(&mut compared, &effects);
    for damping in [RailpadDamping, BallastDamping] {
        hardly(&mut compared, &effects, damping);
    }
    let shown = effects.iter().map(|effect| effect.picture(&set.frequencies_hz));
    compared.pictures.extend(shown);
    Ok(compared)
}

impl Effect {
    fn new(set: &TrainingSet, speed: usize, parameter: Parameter) -> Result<Self, Error> {
        let (figure, symbol) = (Figure::Fig12, parameter.symbol());
        let column = set.varied.iter().position(|&varied| varied == parameter);
        let column = column.ok_or(Error::NotVaried { figure, symbol })?;
        let value = |case: usize| set.parameters[case * set.varied.len() + column];
        let groups = groups(set.entries(), value);
        if let Some(group) = groups.iter().find(|group| group.len() < 2) {
            let found = group.len();
            return Err(Error::TooFewCases { figure, found, least: 2 });
        }
        let groups = groups.iter().map(|group| mean_spectrum(set, speed, group)).collect();
        Ok(Self { parameter, groups })
    }

    /// Variance in dB2 of the groups' means about their own mean at each bin, less what chance
    /// adds.
    fn variances(&self) -> Vec<Average> {
        let bins = self.groups.first().map_or(0, Vec::len);
        (0..bins).map(|bin| variance(self.groups.iter().map(|group| group[bin]))).collect()
    }

    /// Mean square over the bins of the change of the LWPS by the parameter, in dB2.
    fn size(&self) -> Average {
        mean(&self.variances())
    }

    /// The same of two of its groups alone: half the square of their distance.
    fn step(&self, groups: [usize; 2]) -> Average {
        let bins = self.groups[groups[0]].iter().zip(&self.groups[groups[1]]);
        mean(&bins.map(|(a, b)| variance([*a, *b].into_iter())).collect::<Vec<_>>())
    }

    fn picture(&self, frequencies_hz: &[f64]) -> Picture {
        let x = Scale::logarithmic("frequency in Hz");
        let title = self.parameter.symbol();
        let mut picture = Picture::new(title, x, Scale::linear("dB re 1 (m/s²)²"));
        let names = ["lowest", "", "", "", "highest"];
        for (name, group) in names.into_iter().zip(&self.groups) {
            picture = picture.with(name, Style::Line, points(frequencies_hz, group));
        }
        picture
    }
}

/// Cases by which fifth of the values' range theirs lies in.
fn groups(entries: usize, value: impl Fn(usize) -> f64) -> Vec<Vec<usize>> {
    let low = (0..entries).map(&value).fold(f64::INFINITY, f64::min);
    let high = (0..entries).map(&value).fold(f64::NEG_INFINITY, f64::max);
    let mut groups = vec![Vec::new(); GROUPS];
    for case in 0..entries {
        let share = (value(case) - low) / (high - low);
        groups[((share * GROUPS as f64) as usize).min(GROUPS - 1)].push(case);
    }
    groups
}

/// Unbiased variance of means less the mean of their own; below zero where there is but chance. Its
/// error is that of normal means with these errors.
fn variance(averages: impl Iterator<Item = Average>) -> Average {
    let all: Vec<Average> = averages.collect();
    let n = all.len() as f64;
    let mean = all.iter().map(|average| average.mean).sum::<f64>() / n;
    let squares: f64 = all.iter().map(|average| (average.mean - mean).powi(2)).sum();
    let chance = all.iter().map(|average| average.error.powi(2)).sum::<f64>() / n;
    let variance = squares / (n - 1.0) - chance;
    let error = (2.0 * chance * (chance + 2.0 * variance.max(0.0)) / (n - 1.0)).sqrt();
    Average { mean: variance, error }
}

/// Mean over the bins, whose errors count as one: neighbouring bins vary together.
fn mean(variances: &[Average]) -> Average {
    let n = variances.len() as f64;
    let sum = |of: fn(&Average) -> f64| variances.iter().map(of).sum::<f64>();
    Average { mean: sum(|of| of.mean) / n, error: sum(|of| of.error) / n }
}

/// Root of a mean square in dB2, in dB.
fn decibels(square: Average) -> f64 {
    square.mean.max(0.0).sqrt()
}

fn of(effects: &[Effect], parameter: Parameter) -> &Effect {
    effects.iter().find(|effect| effect.parameter == parameter).expect("all have an effect")
}

fn greatest(compared: &mut Compared, effects: &[Effect]) {
    let mut sizes: Vec<(Parameter, Average)> =
        effects.iter().map(|effect| (effect.parameter, effect.size())).collect();
    sizes.sort_by(|a, b| b.1.mean.total_cmp(&a.1.mean));
    let is_first =
        |of: &&(Parameter, Average)| [BallastStiffness, IrregularityLevel].contains(&of.0);
    let others: Vec<Average> = sizes.iter().filter(|of| !is_first(of)).map(|of| of.1).collect();
    let larger =
        |of: &(Parameter, Average)| all(others.iter().map(|other| of.1.less(*other).is_positive()));
    let list = sizes.iter().map(|of| format!("{} {:.2}", of.0.symbol(), decibels(of.1)));
    compared.row(
        "Ballast stiffness and irregularity level move the LWPS most",
        ["k_b, A_irr".to_owned(), format!("{} dB", list.collect::<Vec<_>>().join(", "))],
        all(sizes.iter().filter(is_first).map(larger)),
        "root mean square over the bins of the standard deviation of the five groups' means, less \
         what chance adds; the squares of these two against those of all others, beyond two standard \
         errors",
    );
}

fn wide(compared: &mut Compared, effects: &[Effect]) {
    let level = of(effects, IrregularityLevel).variances();
    let others = effects.iter().filter(|effect| effect.parameter != IrregularityLevel);
    let others: Vec<Vec<Average>> = others.map(Effect::variances).collect();
    let at_bin =
        |bin: usize| all(others.iter().map(|other| level[bin].less(other[bin]).is_positive()));
    let bins: Vec<ClaimVerdict> = (0..level.len()).map(at_bin).collect();
    let share = |wanted: ClaimVerdict| {
        bins.iter().filter(|bin| **bin == wanted).count() as f64 / bins.len() as f64
    };
    let (greatest, smaller) = (share(ClaimVerdict::Reproduced), share(ClaimVerdict::Differs));
    let verdict = if greatest > 0.5 {
        ClaimVerdict::Reproduced
    } else if smaller >= 0.5 {
        ClaimVerdict::Differs
    } else {
        ClaimVerdict::CannotTell
    };
    compared.row(
        "The irregularity level has the greatest effect over a wide range of frequency",
        [
            "wide".to_owned(),
            format!(
                "greatest at {:.0} % of the bins, not at {:.0} %",
                100.0 * greatest,
                100.0 * smaller
            ),
        ],
        verdict,
        "wide is taken as more than half of the figure's logarithmic axis; at each bin against all \
         others, beyond two standard errors",
    );
}

fn below(compared: &mut Compared, set: &TrainingSet, effects: &[Effect]) {
    let effect = of(effects, BallastStiffness);
    let variances: Vec<f64> = effect.variances().iter().map(|bin| bin.mean.max(0.0)).collect();
    let all: f64 = variances.iter().sum();
    let mut sum = 0.0;
    let reached = variances.iter().position(|variance| {
        sum += variance;
        sum >= MOST * all
    });
    let limit_hz = reached.map_or(f64::INFINITY, |bin| set.frequencies_hz[bin]);
    // What even an effect that ends at the paper's frequency would have on a logarithmic axis.
    let lowest_hz = set.frequencies_hz[0];
    let [least, most] = BALLAST_BELOW_HZ.map(|end| lowest_hz * (end / lowest_hz).powf(MOST));
    let verdict = if effect.size().differs_from_zero() {
        ClaimVerdict::of((least..=most).contains(&limit_hz))
    } else {
        ClaimVerdict::CannotTell
    };
    compared.row(
        "Ballast stiffness acts below approximately 1000 Hz",
        ["< 1000 Hz".to_owned(), format!("{:.0} % below {limit_hz:.0} Hz", 100.0 * MOST)],
        verdict,
        format!(
            "frequency below which nine tenths of the groups' variance lie, where the effect is \
             beyond two standard errors; an even effect that ends at {} to {} Hz, what 1000 Hz with \
             one digit may stand for, has them below {least:.0} to {most:.0} Hz. A lower limit means \
             that the ballast acts at the lower end of the paper's range only",
            BALLAST_BELOW_HZ[0], BALLAST_BELOW_HZ[1]
        ),
    );
}

fn when_low(compared: &mut Compared, effects: &[Effect]) {
    let effect = of(effects, RailpadStiffness);
    let (low, high) = (effect.step([0, 1]), effect.step([GROUPS - 2, GROUPS - 1]));
    compared.row(
        "Railpad stiffness acts when it is low (below 100 MN/m)",
        [
            "sensitive below, less so above".to_owned(),
            format!(
                "{:.2} dB between the lowest groups, {:.2} dB between the highest",
                decibels(low),
                decibels(high)
            ),
        ],
        low.less(high).is_positive(),
        "root mean square over the bins of the standard deviation of two neighbouring groups' \
         means, less what chance adds; difference of the squares beyond two standard errors; the two \
         lowest groups meet at 68 MN/m on Table D1's range",
    );
}

fn hardly(compared: &mut Compared, effects: &[Effect], damping: Parameter) {
    let size = of(effects, damping).size();
    let least = |parameter: &Parameter| (*parameter, of(effects, *parameter).size());
    let (other, least) = TOLD
        .iter()
        .map(least)
        .min_by(|a, b| a.1.mean.total_cmp(&b.1.mean))
        .expect("four parameters");
    let [ours, theirs] = [size, least].map(|of| format!("{:.2} dB", decibels(of)));
    compared.row(
        format!("The LWPS is insensitive to {}", damping.label()),
        ["insensitive".to_owned(), format!("{ours}; {} {theirs}", other.symbol())],
        least.less(size).is_positive(),
        "less than the least of the four parameters that the paper evaluates, the squares beyond two \
         standard errors",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{library, random, share, verdicts};
    use ClaimVerdict::{CannotTell, Differs, Reproduced};
    use tracktwin_parameters::ParameterSet;

    /// As the paper has it: railpads saturate, ballast below 1000 Hz, the level everywhere.
    fn paper(set: &ParameterSet, frequency_hz: f64) -> f64 {
        let ballast = if frequency_hz < 1000.0 { 2.5 * share(set, BallastStiffness) } else { 0.0 };
        let pad = 1.0 - (-4.0 * share(set, RailpadStiffness)).exp();
        3.0 * share(set, IrregularityLevel)
            + ballast
            + 0.8 * pad
            + 0.6 * share(set, SleeperBendingStiffness)
    }

    #[test]
    fn a_library_as_the_paper_has_it_is_reproduced() {
        let set = library(&[13.0], 6000, |_, set, frequency_hz| paper(set, frequency_hz));
        let compared = sensitivity(&set).unwrap();
        assert_eq!(verdicts(&compared), [Reproduced; 6], "{:#?}", compared.rows);
        assert_eq!(compared.pictures.len(), Parameter::COUNT);
    }

    #[test]
    fn dampings_that_matter_and_ballast_heard_everywhere_differ() {
        let set = library(&[13.0], 400, |_, set, frequency_hz| {
            let dampings = share(set, RailpadDamping) + share(set, BallastDamping);
            paper(set, frequency_hz.min(800.0)) - 4.0 * dampings
        });
        let found = verdicts(&sensitivity(&set).unwrap());
        assert_eq!((found[0], found[1], found[2]), (Differs, Differs, Differs));
        assert_eq!(found[4..], [Differs, Differs]);
    }

    #[test]
    fn ballast_that_acts_at_the_lowest_frequencies_only_differs() {
        let set = library(&[13.0], 400, |_, set, frequency_hz| {
            let low = if frequency_hz < 400.0 { 2.5 * share(set, BallastStiffness) } else { 0.0 };
            paper(set, frequency_hz.max(1000.0)) + low
        });
        let compared = sensitivity(&set).unwrap();
        assert_eq!(verdicts(&compared)[2], Differs, "{:#?}", compared.rows[2]);
    }

    #[test]
    fn effects_within_chance_give_no_verdict() {
        let nothing = sensitivity(&library(&[13.0], 400, |_, _, _| 0.0)).unwrap();
        assert_eq!(verdicts(&nothing), [CannotTell; 6], "{:#?}", nothing.rows);
        // Sixty cases do not average the level away.
        let few = library(&[13.0], 60, |_, set, frequency_hz| paper(set, frequency_hz));
        let found = verdicts(&sensitivity(&few).unwrap());
        assert_eq!(found[3..], [CannotTell; 3], "{found:?}");
    }

    #[test]
    fn the_variance_of_means_has_the_error_that_repetition_finds() {
        let truth = [0.0, 1.0, 2.0];
        let normal =
            |index: usize| (0..12).map(|part| random(12 * index + part)).sum::<f64>() - 6.0;
        let drawn: Vec<Average> = (0..4000)
            .map(|trial| {
                let mean = |(at, mean): (usize, &f64)| Average {
                    mean: mean + 0.5 * normal(3 * trial + at),
                    error: 0.5,
                };
                variance(truth.iter().enumerate().map(mean))
            })
            .collect();
        let found = Average::of(&drawn.iter().map(|of| of.mean).collect::<Vec<_>>());
        assert!(found.plus(-1.0).mean.abs() < 0.05, "{found:?}");
        let exact = variance(truth.iter().map(|&mean| Average { mean, error: 0.0 }));
        assert_eq!(exact, Average { mean: 1.0, error: 0.0 });
        let scatter = found.error * 4000.0_f64.sqrt();
        let expected = (2.0_f64 * 0.25 * (0.25 + 2.0) / 2.0).sqrt();
        assert!((scatter / expected - 1.0).abs() < 0.05, "{scatter} {expected}");
    }

    #[test]
    fn a_library_of_other_speeds_or_few_cases_is_refused() {
        let other = library(&[7.0], 100, |_, _, _| 0.0);
        assert!(sensitivity(&other).unwrap_err().to_string().contains("13 km/h"));
        let few = library(&[13.0], 10, |_, _, _| 0.0);
        assert!(sensitivity(&few).unwrap_err().to_string().contains("at least 20"));
    }
}
