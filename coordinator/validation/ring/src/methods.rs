//! Methods beside each other (paper, section 5.1).

use crate::estimates::{agree, correlation, correlation_by_chance, median, sd_share};
use crate::parameters::{ALONG, STIFFNESSES};
use crate::statement::{Found, Statement, each, percent, sure};
use crate::{Estimated, Method, Study};
use tracktwin_number::rounded;
use tracktwin_parameters::Parameter;

/// Largest median difference of Gaussian processes and selector, over the range of Table D1.
const DIFFERENCE: f64 = 0.1;
/// Least share of the other sleepers whose best matches differ less than those at joints.
const OTHERS: f64 = 0.9;
/// Least share of sleepers at which inversion and Gaussian processes agree.
const AGREE: f64 = 0.8;

pub(crate) fn statements(study: &Study) -> Vec<Statement> {
    let Some(processes) = study.by(Method::GaussianProcesses) else { return Vec::new() };
    let mut all = Vec::new();
    if let Some(selector) = study.by(Method::Selector) {
        all.extend(each(
            ("Fig. 20", Method::GaussianProcesses),
            &ALONG,
            |label| format!("Gaussian processes and model selector agree about the {label}"),
            [
                "the general trends are in good agreement",
                &sure(
                    "median difference at most a tenth of the range of Table D1, and a positive \
                     correlation along the track; undecided if this is at most two standard errors (2 \
                     over the root of the number of sleepers)",
                ),
            ],
            |parameter| trend(study, [processes, selector], parameter),
        ));
        all.push(Statement::of(
            ("Fig. 13", Method::Selector),
            [
                "The best matches differ more from the recording at joints",
                "significantly larger at the joints",
                "median error at joints above that of nine tenths of the other sleepers",
            ],
            mismatch(study, selector),
        ));
    }
    if let Some(inversion) = study.by(Method::Inversion) {
        all.extend(each(
            ("section 5.1", Method::Inversion),
            &STIFFNESSES,
            |label| format!("Inversion and Gaussian processes agree about the {label}"),
            [
                "-",
                &sure(
                    "difference inside its 90 % interval at 80 % of the sleepers that both call valid",
                ),
            ],
            |parameter| agreement(study, [inversion, processes], parameter),
        ));
    }
    all
}

/// Errors of the best matches at joints, against those elsewhere.
fn mismatch(study: &Study, selector: &Estimated) -> Option<Found> {
    let of = |at_joint: bool| {
        let sleepers = study.truth.sleepers.iter();
        let some = sleepers.filter(move |it| it.joint.is_some() == at_joint);
        some.filter_map(|it| selector.mape(&it.id)).collect::<Vec<f64>>()
    };
    let elsewhere = of(false);
    let at_joints = median(of(true))?;
    let below = elsewhere.iter().filter(|error| **error < at_joints).count();
    let text = format!(
        "{} % at joints, {} % elsewhere; above {below} of {} other sleepers",
        rounded(100.0 * at_joints, 2),
        rounded(100.0 * median(elsewhere.iter().copied())?, 2),
        elsewhere.len()
    );
    Some(Found::new(below as f64 >= OTHERS * elsewhere.len() as f64, text))
}

fn trend(study: &Study, [one, other]: [&Estimated; 2], parameter: Parameter) -> Option<Found> {
    let sleepers = study.truth.sleepers.iter();
    let pairs = sleepers
        .filter_map(|it| Some([one.any(&it.id, parameter)?, other.any(&it.id, parameter)?]));
    let pairs: Vec<_> = pairs.collect();
    let means: Vec<_> = pairs.iter().map(|[a, b]| (a.mean, b.mean)).collect();
    let [low, high] = parameter.range();
    let difference = median(means.iter().map(|(a, b)| (a - b).abs() / (high - low)))?;
    let along = correlation(&means);
    let text = format!(
        "median difference {} of the range, correlation along the track {}",
        rounded(difference, 2),
        along.map_or_else(|| "-".to_owned(), |it| format!("{it:.2}"))
    );
    let is_near = difference <= DIFFERENCE;
    let by_chance = correlation_by_chance(pairs.len());
    if is_near && along.is_none_or(|it| it.abs() <= by_chance) {
        let text = format!("{text}; a correlation of {by_chance:.2} may be chance");
        return Some(Found::undecided(text));
    }
    let is_alike = is_near && along.is_some_and(|it| it > 0.0);
    let sds = pairs.iter().flatten().map(|it| sd_share(*it, parameter));
    Some(Found::new(is_alike, text).if_sure(sds))
}

/// Whether two evaluations agree at enough of the sleepers that both call valid.
pub(crate) fn agreement(
    study: &Study,
    both: [&Estimated; 2],
    parameter: Parameter,
) -> Option<Found> {
    let mut agreed = Tally::default();
    agreed.add(study, both, parameter);
    agreed.found(AGREE, "")
}

/// At how many sleepers evaluations agree, of those that both of a pair call valid.
#[derive(Default)]
pub(crate) struct Tally {
    agreed: usize,
    count: usize,
    /// Standard deviations of all compared estimates, as shares of the parameter's range.
    sds: Vec<f64>,
}

impl Tally {
    /// Adds a pair of evaluations.
    pub(crate) fn add(
        &mut self,
        study: &Study,
        [one, other]: [&Estimated; 2],
        parameter: Parameter,
    ) {
        for sleeper in &study.truth.sleepers {
            let both = [one, other].map(|it| it.valid(&sleeper.id, parameter));
            let [Some(one), Some(other)] = both else { continue };
            self.count += 1;
            self.agreed += usize::from(agree(one, other));
            self.sds.extend([one, other].map(|it| sd_share(it, parameter)));
        }
    }

    /// Whether they agree at this share of the sleepers at least; none where none was compared.
    pub(crate) fn found(self, least: f64, remark: &str) -> Option<Found> {
        let Self { agreed, count, sds } = self;
        let share = agreed as f64 / count as f64;
        let text = || format!("{} ({agreed} of {count}{remark})", percent(share));
        (count > 0).then(|| Found::new(share >= least, text()).if_sure(sds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{estimated, study};
    use serde_json::json;
    use tracktwin_reproduction::ClaimVerdict;

    #[test]
    fn best_matches_that_differ_at_joints_are_the_paper_s() {
        let study = study();
        let with = |raised: f64| {
            let sleeper = |it: &crate::SleeperTruth| {
                let error = 0.05 + 1e-4 * it.number as f64 + it.joint.map_or(0.0, |_| raised);
                json!({"id": it.id, "selector": {"mape": [error]}})
            };
            let sleepers: Vec<_> = study.truth.sleepers.iter().map(sleeper).collect();
            let text = json!({ "sleepers": sleepers }).to_string();
            let found = mismatch(&study, &Estimated::read_selector(&text).unwrap().unwrap());
            Statement::of(("Fig. 13", Method::Selector), [""; 3], found).verdict
        };
        assert_eq!(with(0.02), ClaimVerdict::Reproduced);
        assert_eq!(with(0.0), ClaimVerdict::Differs);
    }

    #[test]
    fn methods_agree_about_the_trend_only_if_they_are_sure_and_vary_alike() {
        let study = study();
        let parameter = Parameter::BallastStiffness;
        let [low, high] = parameter.range();
        let verdict = |slopes: [f64; 2], sd_share: f64| {
            let [one, other] = slopes.map(|slope| {
                estimated(&study, |sleeper, _, _| {
                    let share = 0.5 + slope * (sleeper.number % 2) as f64;
                    (low + share * (high - low), sd_share * (high - low))
                })
            });
            let found = trend(&study, [&one, &other], parameter);
            Statement::of(("Fig. 20", Method::GaussianProcesses), [""; 3], found).verdict
        };
        assert_eq!(verdict([0.03, 0.04], 0.05), ClaimVerdict::Reproduced);
        assert_eq!(verdict([0.03, 0.04], 0.25), ClaimVerdict::CannotTell);
        assert_eq!(verdict([0.03, -0.03], 0.05), ClaimVerdict::Differs);
        assert_eq!(verdict([0.03, 0.0], 0.05), ClaimVerdict::CannotTell);
    }

    #[test]
    fn methods_that_differ_by_more_than_their_tolerance_do_not_agree() {
        let mut study = study();
        assert!(statements(&study).is_empty());
        let truth = estimated(&study, |_, _, truth| (truth, 0.05 * truth));
        let far = estimated(&study, |_, _, truth| (1.9 * truth, 0.05 * truth));
        study.methods = vec![
            (Method::Inversion, truth.clone()),
            (Method::GaussianProcesses, truth),
            (Method::Selector, far),
        ];
        let all = statements(&study);
        let (yes, no) = (ClaimVerdict::Reproduced, ClaimVerdict::Differs);
        let unknown = ClaimVerdict::CannotTell;
        assert_eq!(
            all.iter().map(|it| it.verdict).collect::<Vec<_>>(),
            [no, no, no, no, unknown, yes, yes]
        );
    }
}
