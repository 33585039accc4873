//! Fig. 12: which parameter moves the LWPS, and where.

use crate::average::Average;
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
    fn variances(&self) -> Vec<f64> {
        let bins = self.groups.first().map_or(0, Vec::len);
        (0..bins).map(|bin| variance(self.groups.iter().map(|group| group[bin]))).collect()
    }

    /// Root mean square over the bins of the change of the LWPS by the parameter, in dB.
    fn size_db(&self) -> f64 {
        root_mean(&self.variances())
    }

    /// The same of two of its groups alone: half their distance.
    fn step_db(&self, groups: [usize; 2]) -> f64 {
        let bins = self.groups[groups[0]].iter().zip(&self.groups[groups[1]]);
        root_mean(&bins.map(|(a, b)| variance([*a, *b].into_iter())).collect::<Vec<_>>())
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

/// Unbiased variance of means less the mean of their own; below zero where there is but chance.
fn variance(averages: impl Iterator<Item = Average>) -> f64 {
    let all: Vec<Average> = averages.collect();
    let n = all.len() as f64;
    let mean = all.iter().map(|average| average.mean).sum::<f64>() / n;
    let squares: f64 = all.iter().map(|average| (average.mean - mean).powi(2)).sum();
    let chance: f64 = all.iter().map(|average| average.error.powi(2)).sum();
    squares / (n - 1.0) - chance / n
}

fn root_mean(variances: &[f64]) -> f64 {
    (variances.iter().sum::<f64>() / variances.len() as f64).max(0.0).sqrt()
}

fn of(effects: &[Effect], parameter: Parameter) -> &Effect {
    effects.iter().find(|effect| effect.parameter == parameter).expect("all have an effect")
}

fn greatest(compared: &mut Compared, effects: &[Effect]) {
    let mut sizes: Vec<(Parameter, f64)> =
        effects.iter().map(|effect| (effect.parameter, effect.size_db())).collect();
    sizes.sort_by(|a, b| b.1.total_cmp(&a.1));
    let first = [sizes[0].0, sizes[1].0];
    let expected = first.contains(&BallastStiffness) && first.contains(&IrregularityLevel);
    let list = sizes.iter().map(|(parameter, size)| format!("{} {size:.2}", parameter.symbol()));
    compared.row(
        "Ballast stiffness and irregularity level move the LWPS most",
        ["k_b, A_irr".to_owned(), format!("{} dB", list.collect::<Vec<_>>().join(", "))],
        ClaimVerdict::of(expected),
        "root mean square over the bins of the standard deviation of the five groups' means, less \
         what chance adds; the two largest are compared",
    );
}

fn wide(compared: &mut Compared, effects: &[Effect]) {
    let variances: Vec<Vec<f64>> = effects.iter().map(Effect::variances).collect();
    let place = effects.iter().position(|effect| effect.parameter == IrregularityLevel);
    let level = &variances[place.expect("the level is a parameter")];
    let first = |bin: &usize| variances.iter().all(|other| other[*bin] <= level[*bin]);
    let share = (0..level.len()).filter(first).count() as f64 / level.len().max(1) as f64;
    compared.row(
        "The irregularity level has the greatest effect over a wide range of frequency",
        ["wide".to_owned(), format!("greatest at {:.0} % of the bins", 100.0 * share)],
        ClaimVerdict::of(share > 0.5),
        "wide is taken as more than half of the figure's logarithmic axis",
    );
}

fn below(compared: &mut Compared, set: &TrainingSet, effects: &[Effect]) {
    let variances: Vec<f64> =
        of(effects, BallastStiffness).variances().into_iter().map(|v| v.max(0.0)).collect();
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
    compared.row(
        "Ballast stiffness acts below approximately 1000 Hz",
        ["< 1000 Hz".to_owned(), format!("{:.0} % below {limit_hz:.0} Hz", 100.0 * MOST)],
        ClaimVerdict::of((least..=most).contains(&limit_hz)),
        format!(
            "frequency below which nine tenths of the groups' variance lie; an even effect that \
             ends at {} to {} Hz, what 1000 Hz with one digit may stand for, has them below \
             {least:.0} to {most:.0} Hz. A lower limit means that the ballast acts at the lower \
             end of the paper's range only",
            BALLAST_BELOW_HZ[0], BALLAST_BELOW_HZ[1]
        ),
    );
}

fn when_low(compared: &mut Compared, effects: &[Effect]) {
    let effect = of(effects, RailpadStiffness);
    let (low, high) = (effect.step_db([0, 1]), effect.step_db([GROUPS - 2, GROUPS - 1]));
    compared.row(
        "Railpad stiffness acts when it is low (below 100 MN/m)",
        [
            "sensitive below, less so above".to_owned(),
            format!("{low:.2} dB between the lowest groups, {high:.2} dB between the highest"),
        ],
        ClaimVerdict::of(low > high),
        "root mean square over the bins of the standard deviation of two neighbouring groups' \
         means, less what chance adds; the two lowest groups meet at 68 MN/m on Table D1's range",
    );
}

fn hardly(compared: &mut Compared, effects: &[Effect], damping: Parameter) {
    let size = of(effects, damping).size_db();
    let least = |parameter: &Parameter| (*parameter, of(effects, *parameter).size_db());
    let (other, least) =
        TOLD.iter().map(least).min_by(|a, b| a.1.total_cmp(&b.1)).expect("four parameters");
    compared.row(
        format!("The LWPS is insensitive to {}", damping.label()),
        ["insensitive".to_owned(), format!("{size:.2} dB; {} {least:.2} dB", other.symbol())],
        ClaimVerdict::of(size < least),
        "less than the least of the four parameters that the paper evaluates",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{library, share, verdicts};
    use ClaimVerdict::{Differs, Reproduced};
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
        let set = library(&[13.0], 400, |_, set, frequency_hz| paper(set, frequency_hz));
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
    fn a_library_of_other_speeds_or_few_cases_is_refused() {
        let other = library(&[7.0], 100, |_, _, _| 0.0);
        assert!(sensitivity(&other).unwrap_err().to_string().contains("13 km/h"));
        let few = library(&[13.0], 10, |_, _, _| 0.0);
        assert!(sensitivity(&few).unwrap_err().to_string().contains("at least 20"));
    }
}
