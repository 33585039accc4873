//! Fig. 13: the model selector's error falls with the size of the library.

use crate::average::{Average, all};
use crate::picture::{Picture, Scale, Style};
use crate::spectrum::{enough, log_power, speed_index};
use crate::{ClaimVerdict, Compared, Error, Figure};
use rayon::prelude::*;
use tracktwin_evaluation::MATCHES;
use tracktwin_signal::FeatureSet;
use tracktwin_surrogate::{Selector, Split, TrainingSet, mape};

/// Library sizes, as far as a library reaches.
const SIZES: [usize; 7] = [100, 200, 500, 1000, 2000, 5000, 10_000];

/// Cases of the test half that stand for measurements: the paper averages over 100 sleepers.
pub(crate) const MEASURED: usize = 200;

/// The paper's feature vectors, the global one first.
pub(crate) const FEATURES: [FeatureSet; 5] =
    [FeatureSet::Gf, FeatureSet::Lf1, FeatureSet::Lf2, FeatureSet::Lf3, FeatureSet::Lf4];

/// The paper's MAPE of the global feature at 100 and at 10,000 model instances, in per cent.
const PAPER_GF: [f64; 2] = [6.2, 4.7];

/// Errors of one feature vector: a size of the library each, a measured case each.
struct Curve {
    feature: FeatureSet,
    errors: Vec<Vec<f64>>,
}

/// Cases of the test half, searched in growing parts of the other half, beside the paper's Fig. 13.
///
/// # Errors
/// [`Error::NoSpeed`], [`Error::TooFewCases`], or what the selector reports.
pub(crate) fn selector(set: &TrainingSet, seed: u64) -> Result<Compared, Error> {
    let figure = Figure::Fig13;
    let speed = speed_index(set, figure)?;
    enough(set, figure, MATCHES)?;
    let Split { train, test } = Split::halves(set.entries(), seed);
    let measured = &test[..test.len().min(MEASURED)];
    let sizes = sizes(train.len());
    let curve = |&feature: &FeatureSet| -> Result<Curve, Error> {
        let of = |case: usize| feature.select(&set.frequencies_hz, log_power(set, speed, case));
        let errors = sizes.iter().map(|&size| errors(&train[..size], measured, of));
        Ok(Curve { feature, errors: errors.collect::<Result<_, _>>()? })
    };
    let curves = FEATURES.iter().map(curve).collect::<Result<Vec<_>, _>>()?;
    let caption = "Mean absolute percentage error of the ten best matches, averaged over cases of \
                   the test half that stand for measurements, at 13 km/h.";
    let mut compared = Compared::new(figure, caption);
    falls(&mut compared, &curves, &sizes);
    amount(&mut compared, &curves, &sizes);
    hardest(&mut compared, &curves);
    compared.pictures.push(picture(&curves, &sizes));
    Ok(compared)
}

/// The sizes possible with this number of entries, and the full size.
fn sizes(entries: usize) -> Vec<usize> {
    SIZES.into_iter().filter(|&size| size < entries).chain([entries]).collect()
}

/// Best matches of each measured case among these entries, the nearest first.
pub(crate) fn nearest<'a>(
    entries: &[usize],
    measured: &[usize],
    of: impl Fn(usize) -> &'a [f64] + Sync,
) -> Result<Vec<Vec<usize>>, Error> {
    let table: Vec<f64> = entries.iter().flat_map(|&entry| of(entry)).copied().collect();
    let selector = Selector::new(table, of(entries[0]).len())?;
    let nearest = |&case: &usize| {
        let nearest = selector.nearest(of(case), MATCHES)?;
        Ok(nearest.iter().map(|match_| entries[match_.entry]).collect())
    };
    measured.par_iter().map(nearest).collect()
}

/// Mean error of the best matches of each measured case among these entries.
fn errors<'a>(
    entries: &[usize],
    measured: &[usize],
    of: impl Fn(usize) -> &'a [f64] + Sync,
) -> Result<Vec<f64>, Error> {
    let error = |(&case, matches): (&usize, &Vec<usize>)| {
        let all = matches.iter().map(|&entry| mape(of(case), of(entry)));
        all.sum::<f64>() / matches.len() as f64
    };
    Ok(measured.iter().zip(&nearest(entries, measured, &of)?).map(error).collect())
}

fn falls(compared: &mut Compared, curves: &[Curve], sizes: &[usize]) {
    let [first, .., last] = &curves[0].errors[..] else {
        let why = "the half that is searched has no more than 100 cases";
        let texts = ["falls from 100 to 10,000".to_owned(), "one size only".to_owned()];
        return compared.row(FALLS, texts, ClaimVerdict::CannotTell, why);
    };
    let fall: Vec<f64> = first.iter().zip(last).map(|(few, many)| few - many).collect();
    let fall = Average::of(&fall).times(100.0);
    let ours = format!(
        "falls by {:.2} ± {:.2} points from {} to {}",
        fall.mean,
        fall.error,
        sizes[0],
        sizes[sizes.len() - 1]
    );
    let why = "difference of the same measured cases, beyond two standard errors";
    compared.row(FALLS, ["falls".to_owned(), ours], fall.is_positive(), why);
}

const FALLS: &str = "The error falls as the library grows (GF)";

fn amount(compared: &mut Compared, curves: &[Curve], sizes: &[usize]) {
    let percent = |errors: &Vec<f64>| 100.0 * Average::of(errors).mean;
    let all: Vec<f64> = curves[0].errors.iter().map(percent).collect();
    let (first, last) = (all[0], all[all.len() - 1]);
    compared.row(
        "How large the error is (GF)",
        [
            format!("{} % at 100, {} % at 10,000", PAPER_GF[0], PAPER_GF[1]),
            format!("{first:.1} % at {}, {last:.1} % at {}", sizes[0], sizes[sizes.len() - 1]),
        ],
        ClaimVerdict::CannotTell,
        "a percentage of a level depends on its reference, which the paper does not give; ours is \
         1 um/s2 (ISO 1683). The paper's measured cases are sleepers, ours are simulations with a \
         surface of their own",
    );
}

fn hardest(compared: &mut Compared, curves: &[Curve]) {
    let last = |curve: &Curve| curve.errors[curve.errors.len() - 1].clone();
    let list =
        |curve: &Curve| format!("{} {:.1}", curve.feature, 100.0 * Average::of(&last(curve)).mean);
    let first = last(&curves[1]);
    let harder = |curve: &Curve| {
        let by: Vec<f64> = first.iter().zip(last(curve)).map(|(one, other)| one - other).collect();
        Average::of(&by).is_positive()
    };
    let ours: Vec<_> = curves[1..].iter().map(list).collect();
    compared.row(
        "LF1 is harder to match than LF2 to LF4",
        ["LF1 largest".to_owned(), format!("{} %", ours.join(", "))],
        all(curves[2..].iter().map(harder)),
        "the largest library, differences of the same measured cases beyond two standard errors; \
         percentages are of the level in dB above 1 um/s2 (ISO 1683)",
    );
}

fn picture(curves: &[Curve], sizes: &[usize]) -> Picture {
    let x = Scale::logarithmic("library entries");
    let mut picture = Picture::new("Error by library size", x, Scale::logarithmic("MAPE in %"));
    picture.wide = true;
    for Curve { feature, errors } in curves {
        let points = sizes.iter().zip(errors);
        let points = points.map(|(&size, all)| (size as f64, 100.0 * Average::of(all).mean));
        picture = picture.with(feature.name(), Style::Line, points.collect());
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{library, verdicts};
    use tracktwin_parameters::Parameter;

    #[test]
    fn more_entries_match_better_and_the_uneven_feature_is_hardest() {
        let set = library(&[13.0], 600, |_, set, frequency_hz| {
            let pad = 1e-8 * set[Parameter::RailpadStiffness];
            // Only the first local feature depends on much, and unevenly.
            let low = if frequency_hz < 750.0 { (9.0 * pad).sin() } else { 0.1 * pad };
            5.0 + low * set[Parameter::IrregularityLevel]
        });
        let compared = selector(&set, 0).unwrap();
        let expected =
            [ClaimVerdict::Reproduced, ClaimVerdict::CannotTell, ClaimVerdict::Reproduced];
        assert_eq!(verdicts(&compared), expected, "{:#?}", compared.rows);
    }

    #[test]
    fn cases_that_nothing_tells_apart_but_noise_do_not_fall() {
        let set = library(&[13.0], 120, |_, _, _| 5.0);
        let compared = selector(&set, 0).unwrap();
        assert_eq!(verdicts(&compared)[0], ClaimVerdict::CannotTell);
    }

    #[test]
    fn a_high_feature_that_is_hardest_differs() {
        let set = library(&[13.0], 300, |_, set, frequency_hz| {
            let level = set[Parameter::IrregularityLevel];
            if frequency_hz > 2500.0 { 5.0 + (3.0 * level).sin() * level } else { 5.0 }
        });
        assert_eq!(verdicts(&selector(&set, 0).unwrap())[2], ClaimVerdict::Differs);
    }
}
