//! Fig. 14: the models' errors on the test half.

use crate::average::{Average, all};
use crate::picture::{Picture, Scale, Style};
use crate::spectrum::SPEED_KM_H;
use crate::{ClaimVerdict, Compared, Error, Figure, bound};
use Parameter::{BallastStiffness, IrregularityLevel, RailpadStiffness, SleeperBendingStiffness};
use std::f64::consts::FRAC_PI_2;
use tracktwin_parameters::Parameter;
use tracktwin_signal::FeatureSet;
use tracktwin_surrogate::{ModelGroup, Tested, Trained};

/// Cases that trained the paper's models.
const PAPER_TRAINED: usize = 5000;

/// The paper's values for the global feature at 13 km/h: MASE in per cent, its words, and the
/// largest that still is that number: half a per cent above "about", nothing above "less than".
const PAPER_GF: [(Parameter, &str, f64); 4] = [
    (BallastStiffness, "about 5 %", 5.5),
    (IrregularityLevel, "< 5 %", 5.0),
    (SleeperBendingStiffness, "about 10 %", 10.5),
    (RailpadStiffness, "about 15 %", 15.5),
];

/// The paper's local features.
const LOCAL: [FeatureSet; 4] = [FeatureSet::Lf1, FeatureSet::Lf2, FeatureSet::Lf3, FeatureSet::Lf4];

/// The paper's limit in per cent for the level estimated by any local feature.
const LEVEL_LOCAL: f64 = 10.0;

/// Two numbers that both are "approximately 5 %" differ by this factor at most: 5.5 over 4.5.
const ALIKE: f64 = 5.5 / 4.5;

/// Parts of the railpad's range whose errors are compared.
const PARTS: usize = 5;

/// Test errors of trained models beside the paper's Fig. 14.
///
/// `tested` are true and predicted values by the global feature at 13 km/h.
///
/// # Errors
/// [`Error::NoModel`] or [`Error::NotVaried`].
pub(crate) fn test_errors(models: &Trained, tested: &[Tested]) -> Result<Compared, Error> {
    let caption = "Mean absolute scaled error (MASE) on the test half at 13 km/h by feature \
                   vector; true and predicted values by the global feature.";
    let mut compared = Compared::new(Figure::Fig14, caption);
    let global = Mases::new(models, FeatureSet::Gf)?;
    if let Some((missing, ..)) = PAPER_GF.iter().find(|of| global.of(of.0).is_nan()) {
        return Err(Error::NotVaried { figure: Figure::Fig14, symbol: missing.symbol() });
    }
    let locals = LOCAL.map(|feature| Mases::new(models, feature));
    let [Ok(lf1), Ok(lf2), Ok(lf3), Ok(lf4)] = locals else {
        return Err(locals.into_iter().find_map(Result::err).expect("one is missing"));
    };
    let locals = [lf1, lf2, lf3, lf4];
    global_rows(&mut compared, models, &global);
    beside_the_bound(&mut compared, &global);
    together(&mut compared, models);
    better(&mut compared, models, &global, &locals);
    level_by_any(&mut compared, &locals);
    ballast_by_first(&mut compared, &global, &locals[0]);
    grows(&mut compared, tested);
    compared.pictures = pictures(&global, &locals, tested);
    Ok(compared)
}

/// Test errors of a feature vector's models at the paper's speed.
struct Mases<'a> {
    feature: FeatureSet,
    group: &'a ModelGroup,
}

impl<'a> Mases<'a> {
    fn new(models: &'a Trained, feature: FeatureSet) -> Result<Self, Error> {
        let group = models.group(&[SPEED_KM_H], feature.name()).ok_or(Error::NoModel {
            figure: Figure::Fig14,
            feature: feature.name(),
            speed_km_h: SPEED_KM_H,
        })?;
        Ok(Self { feature, group })
    }

    /// In per cent; not a number for a parameter that was not varied.
    fn of(&self, parameter: Parameter) -> f64 {
        percent(self.group, parameter)
    }
}

fn percent(group: &ModelGroup, parameter: Parameter) -> f64 {
    let model = group.models().iter().find(|model| model.parameter == parameter);
    model.map_or(f64::NAN, |model| 100.0 * model.score.mase_test)
}

fn global_rows(compared: &mut Compared, models: &Trained, global: &Mases<'_>) {
    for (parameter, paper, limit) in PAPER_GF {
        let ours = global.of(parameter);
        compared.row(
            format!("Error of {} by the global feature at 13 km/h", parameter.symbol()),
            [paper.to_owned(), format!("{ours:.1} %")],
            ClaimVerdict::of(ours < limit),
            because(ours < limit, limit, models, REASON),
        );
    }
}

/// The paper's numbers beside the least that the powers of one sleeper spacing allow.
fn beside_the_bound(compared: &mut Compared, global: &Mases<'_>) {
    let list = |of: &dyn Fn(Parameter) -> String| {
        let all =
            PAPER_GF.map(|(parameter, ..)| format!("{} {}", parameter.symbol(), of(parameter)));
        all.join(", ")
    };
    let least = list(&|of| format!("{}", bound::of(of)));
    let ours = list(&|of| format!("{:.1}", global.of(of)));
    let below: Vec<&str> = PAPER_GF
        .iter()
        .filter(|(parameter, _, limit)| *limit < bound::of(*parameter))
        .map(|(parameter, ..)| parameter.symbol())
        .collect();
    let named = if below.is_empty() { "none".to_owned() } else { below.join(", ") };
    let paper = PAPER_GF.map(|(parameter, words, _)| format!("{} {words}", parameter.symbol()));
    compared.row(
        "One sleeper spacing at 13 km/h tells enough for the errors by the global feature",
        [paper.join(", "), format!("Bayes bound {least} %; ours {ours} %")],
        ClaimVerdict::CannotTell,
        format!(
            "numbers of the paper, with their rounding, below the bound: {named}. The bound takes \
             independent powers 29 Hz apart, which tell about as much of these parameters as the \
             samples with noise of about 0.3 m/s2. With less noise the samples tell more: 12.4 % for \
             k_p and 3.5 % for EI_s at 0.03 m/s2 (docs/decisions/0034)"
        ),
    );
}

/// What limits the models at one speed.
const REASON: &str = "; every case has its own surface, which limits what the powers of one stretch \
                      of 0.125 m at one speed tell (docs/decisions/0003)";

/// The tolerance; behind it, what makes errors larger than the paper's.
fn because(reached: bool, limit: f64, models: &Trained, reason: &str) -> String {
    let tolerance = format!("below {limit} %, the paper's number with its rounding");
    let trained = models.entries().div_ceil(2);
    match (reached, trained < PAPER_TRAINED) {
        (true, _) => tolerance,
        (false, true) => {
            format!("{tolerance}{reason}; {trained} cases trained, the paper's {PAPER_TRAINED}")
        }
        (false, false) => format!("{tolerance}{reason}"),
    }
}

fn together(compared: &mut Compared, models: &Trained) {
    let Some(group) = models.groups().iter().max_by_key(|group| group.key().speeds_km_h.len())
    else {
        return;
    };
    let speeds: Vec<_> = group.key().speeds_km_h.iter().map(ToString::to_string).collect();
    if speeds.len() < 2 {
        return;
    }
    for (parameter, paper, limit) in PAPER_GF {
        let ours = percent(group, parameter);
        compared.check(
            format!(
                "The same by all speeds together, as this program evaluates: {}",
                parameter.symbol()
            ),
            [
                format!("{paper}, at 13 km/h"),
                format!("{ours:.1} %, at {} km/h", speeds.join(" + ")),
            ],
            ClaimVerdict::of(ours < limit),
            format!(
                "the paper has no number for several speeds; {}",
                because(ours < limit, limit, models, "")
            ),
        );
    }
}

/// Standard error of the mean of `count` absolute errors of a normal distribution, as a share of
/// that mean.
fn share(count: usize) -> f64 {
    ((FRAC_PI_2 - 1.0) / count as f64).sqrt()
}

fn better(compared: &mut Compared, models: &Trained, global: &Mases<'_>, locals: &[Mases<'_>]) {
    let error = share(models.entries() / 2);
    let average = |mean: f64| Average { mean, error: error * mean };
    let mut verdicts = Vec::new();
    let mut ours = Vec::new();
    for (parameter, ..) in PAPER_GF {
        let least = locals.iter().min_by(|a, b| a.of(parameter).total_cmp(&b.of(parameter)));
        let Some(least) = least else { continue };
        let (best, whole) = (least.of(parameter), global.of(parameter));
        ours.push(format!("{} {whole:.1}, {} {best:.1} %", parameter.symbol(), least.feature));
        verdicts.push(average(best).less(average(whole)).is_positive());
    }
    compared.row(
        "The global feature outperforms every local feature for all four parameters",
        ["GF best".to_owned(), ours.join("; ")],
        all(verdicts),
        "GF against the best local feature at 13 km/h, beyond two standard errors of both means",
    );
}

fn level_by_any(compared: &mut Compared, locals: &[Mases<'_>]) {
    let values = locals.iter().map(|local| (local.feature, local.of(IrregularityLevel)));
    let values: Vec<_> = values.collect();
    let most = values.iter().map(|value| value.1).fold(0.0, f64::max);
    let list: Vec<_> = values.iter().map(|(name, mase)| format!("{name} {mase:.1}")).collect();
    compared.row(
        "Any local feature tells the irregularity level",
        ["< 10 %".to_owned(), format!("{} %", list.join(", "))],
        ClaimVerdict::of(most < LEVEL_LOCAL),
        "the largest below 10 %; a narrow band knows the power of one short stretch of surface \
         less surely than the whole range does (docs/decisions/0003)",
    );
}

fn ballast_by_first(compared: &mut Compared, global: &Mases<'_>, first: &Mases<'_>) {
    let (whole, local) = (global.of(BallastStiffness), first.of(BallastStiffness));
    compared.row(
        "LF1 tells ballast stiffness about as well as the global feature",
        ["both approximately 5 %".to_owned(), format!("LF1 {local:.1} %, GF {whole:.1} %")],
        ClaimVerdict::of(local <= ALIKE * whole),
        format!(
            "numbers that both round to 5 % differ by a factor of {ALIKE:.2} at most; below \
             400 Hz, which LF1 leaves out, the wheel's resonance on the track also tells k_b"
        ),
    );
}

fn grows(compared: &mut Compared, tested: &[Tested]) {
    let Some((_, pairs)) = tested.iter().find(|of| of.0 == RailpadStiffness) else { return };
    let [low, high] = RailpadStiffness.range();
    let part = |truth: f64| ((truth - low) / (high - low) * PARTS as f64) as usize;
    let of = |wanted: &dyn Fn(usize) -> bool| {
        let chosen = pairs.iter().filter(|(truth, _)| wanted(part(*truth)));
        let errors: Vec<f64> =
            chosen.map(|(truth, told)| 100.0 * (told - truth).abs() / (high - low)).collect();
        Average::of(&errors)
    };
    let (soft, above) = (of(&|part| part == 0), of(&|part| part > 0));
    let (below, hard) = (of(&|part| part < PARTS - 1), of(&|part| part >= PARTS - 1));
    let ours = format!(
        "{:.1} % in the lowest fifth, {:.1} % above; {:.1} % in the highest, {:.1} % below",
        soft.mean, above.mean, hard.mean, below.mean
    );
    compared.row(
        "Errors of railpad stiffness are small where it is low and grow with it",
        ["small where low, larger where high".to_owned(), ours],
        all([above.less(soft).is_positive(), hard.less(below).is_positive()]),
        "mean absolute error of test cases at 13 km/h, lowest and highest fifth each against all \
         others, beyond two standard errors; models that hear little of a parameter answer near \
         the middle of its range, and err most at both ends",
    );
}

fn pictures(global: &Mases<'_>, locals: &[Mases<'_>], tested: &[Tested]) -> Vec<Picture> {
    let parameters = PAPER_GF.map(|(parameter, ..)| parameter);
    let of = |mases: &Mases<'_>| {
        let values = parameters.iter().map(|&parameter| mases.of(parameter)).collect();
        (mases.feature.name().to_owned(), values)
    };
    let least = (bound::NAME.to_owned(), parameters.map(bound::of).to_vec());
    let kinds = std::iter::once(global).chain(locals).map(of).chain([least]);
    let symbols = parameters.map(Parameter::symbol);
    let bars = Picture::bars("Test error at 13 km/h", "MASE in %", &symbols, kinds);
    let scatter = |(parameter, pairs): &Tested| {
        let [low, high] = parameter.range();
        let axis =
            |what| Scale::linear(format!("{what} {}, share of its range", parameter.symbol()));
        let unit = |value: f64| (value - low) / (high - low);
        let points = pairs.iter().map(|&(truth, told)| (unit(truth), unit(told))).collect();
        Picture::new(parameter.label(), axis("true"), axis("told"))
            .with("", Style::Dots, points)
            .with("", Style::Truth, vec![(0.0, 0.0), (1.0, 1.0)])
    };
    let shown = tested.iter().filter(|of| PAPER_GF.iter().any(|paper| paper.0 == of.0));
    std::iter::once(bars).chain(shown.map(scatter)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{library, random};
    use tracktwin_surrogate::{FeatureColumns, TrainOptions, train};

    /// Models of a library whose bins are the parameters themselves, with noise of this size.
    fn models(speeds_km_h: &[f64], noise: f64) -> Trained {
        let mut set = library(speeds_km_h, 300, |_, set, frequency_hz| {
            let share = |parameter: Parameter| {
                let [low, high] = parameter.range();
                (set[parameter] - low) / (high - low)
            };
            let heard = match frequency_hz {
                ..400.0 => share(SleeperBendingStiffness),
                400.0..700.0 => share(BallastStiffness),
                700.0..1500.0 => share(IrregularityLevel),
                _ => share(RailpadStiffness),
            };
            10.0 * heard
        });
        for (index, value) in set.log_power.iter_mut().flatten().enumerate() {
            *value += noise * (random(index) - 0.5);
        }
        let columns = |feature: FeatureSet| FeatureColumns {
            name: feature.name().to_owned(),
            columns: feature.bins(&set.frequencies_hz),
        };
        let features = [&[FeatureSet::Gf][..], &LOCAL].concat().into_iter().map(columns).collect();
        train(&set, &TrainOptions::new(features), &|_| ()).unwrap()
    }

    fn verdict(compared: &Compared, words: &str) -> ClaimVerdict {
        compared.rows.iter().find(|row| row.claim.contains(words)).unwrap().verdict
    }

    #[test]
    fn what_the_bins_say_is_told_and_what_a_local_feature_does_not_hear_is_not() {
        let told = |grows: bool| {
            let pair = |index: usize| {
                let truth = 1e7 + 2.9e8 * index as f64 / 99.0;
                let error = if grows { 0.1 * truth } else { 0.1 * (3.1e8 - truth) };
                (truth, truth + error * (random(index) - 0.5))
            };
            vec![(RailpadStiffness, (0..100).map(pair).collect())]
        };
        let models = models(&[13.0], 0.5);
        let compared = test_errors(&models, &told(true)).unwrap();
        for parameter in [BallastStiffness, RailpadStiffness, SleeperBendingStiffness] {
            let words = format!("Error of {} by", parameter.symbol());
            assert_eq!(verdict(&compared, &words), ClaimVerdict::Reproduced, "{parameter}");
        }
        assert_eq!(verdict(&compared, "Any local feature"), ClaimVerdict::Differs);
        let bound = compared.rows.iter().find(|row| row.claim.contains("tells enough")).unwrap();
        assert_eq!(bound.verdict, ClaimVerdict::CannotTell, "{bound:?}");
        assert!(bound.why.contains("below the bound: EI_s, k_p."), "{}", bound.why);
        assert_eq!(compared.pictures[0].curves.last().unwrap().name, bound::NAME);
        assert_eq!(verdict(&compared, "grow"), ClaimVerdict::Reproduced);
        let shrinking = test_errors(&models, &told(false)).unwrap();
        assert_eq!(verdict(&shrinking, "grow"), ClaimVerdict::Differs);
    }

    #[test]
    fn models_without_one_of_the_four_parameters_are_refused() {
        let mut set = library(&[13.0], 300, |_, set, _| set[IrregularityLevel]);
        set.varied = vec![IrregularityLevel];
        set.scales.truncate(1);
        set.parameters = set.parameters.into_iter().skip(5).step_by(6).collect();
        let features = vec![FeatureColumns::new("GF", 0..10)];
        let models = train(&set, &TrainOptions::new(features), &|_| ()).unwrap();
        let message = test_errors(&models, &[]).unwrap_err().to_string();
        assert!(message.contains("fig14") && message.contains("k_b"), "{message}");
    }

    #[test]
    fn errors_above_the_paper_s_differ_and_say_why() {
        let compared = test_errors(&models(&[13.0], 400.0), &[]).unwrap();
        let row = &compared.rows[0];
        assert_eq!(row.verdict, ClaimVerdict::Differs, "{row:?}");
        assert!(row.why.contains("0003") && row.why.contains("150 cases"), "{}", row.why);
    }

    #[test]
    fn errors_by_all_speeds_together_are_checks_of_the_program() {
        for (noise, expected) in [(0.5, ClaimVerdict::Holds), (400.0, ClaimVerdict::Fails)] {
            let compared = test_errors(&models(&[7.0, 13.0], noise), &[]).unwrap();
            let together = compared.rows.iter().filter(|row| row.claim.contains("all speeds"));
            let verdicts: Vec<_> = together.map(|row| row.verdict).collect();
            assert_eq!(verdicts, [expected; 4], "{noise}");
        }
    }
}
