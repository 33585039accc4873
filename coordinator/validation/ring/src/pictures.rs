//! Pictures of the ring like the paper's Figs. 13a, 20, 21, 22 and 24.

use crate::estimates::mean;
use crate::parameters::{ALONG, OWN};
use crate::{Estimated, Method, RailSpectra, SleeperTruth, Study};
use tracktwin_evaluation::Estimate;
use tracktwin_number::NORMAL_90;
use tracktwin_parameters::Parameter;
use tracktwin_reproduction::{Curve, Picture, Scale, Style};

/// Sleepers of the moving average of the ballast stiffness (paper, section 5.2).
const AVERAGED: usize = 10;

/// Sleepers between two names on the axis.
const NAMES: usize = 10;

pub(crate) fn pictures(study: &Study) -> Vec<(Vec<Picture>, &'static str)> {
    let mut uncertainty = frame(study, "Relative standard deviation of the inversion", "in %");
    if let Some(inversion) = study.by(Method::Inversion) {
        for parameter in OWN {
            let points = points(study, inversion, parameter, |of| 100.0 * of.sd / of.mean);
            uncertainty.curves.push(curve(parameter.label(), Style::Line, points));
        }
    }
    let mut along: Vec<_> = ALONG.map(|parameter| by_method(study, parameter)).into();
    along.push(uncertainty);
    let mut all = vec![(
        along,
        "Estimates from all passes with 90 % intervals, and the truth. Dashed vertical lines are \
         joints (paper, Fig. 20).",
    )];
    if let Some(selector) = study.by(Method::Selector) {
        all.push((
            vec![mismatch(study, selector)],
            "Mean absolute percentage error of the ten best matches in the library. Dashed vertical \
             lines are joints (paper, Fig. 13a).",
        ));
    }
    if let Some(spectra) = &study.spectra {
        all.push((vec![rails(spectra)], "Mean over the sleepers of each rail (paper, Fig. 21)."));
    }
    if !study.laps.is_empty() {
        all.push((
            vec![clamps(study), gaps(study)],
            "Each lap alone. Above: dots are clamps on the true railpad stiffness. Below: moving \
             average over ten sleepers; dashed vertical lines are gaps of the plywood (paper, Fig. 22).",
        ));
    }
    if !study.speeds.is_empty() {
        all.push((
            OWN.map(|parameter| by_speed(study, parameter)).into(),
            "The passes of each speed alone, with 90 % intervals (paper, Fig. 24).",
        ));
    }
    all
}

/// Errors of the best matches along the ring.
fn mismatch(study: &Study, selector: &Estimated) -> Picture {
    let sleepers = study.truth.sleepers.iter();
    let error = |it: &SleeperTruth| Some((it.number as f64, 100.0 * selector.mape(&it.id)?));
    let mut picture = frame(study, "Error of the model selector", "MAPE in %");
    picture.curves.push(curve(
        "ten best matches",
        Style::Line,
        sleepers.filter_map(error).collect(),
    ));
    picture
}

/// Divisor of the shown unit, and the unit.
fn unit(parameter: Parameter) -> (f64, &'static str) {
    match parameter {
        Parameter::RailpadStiffness | Parameter::BallastStiffness => (1e6, "in MN/m"),
        Parameter::SleeperBendingStiffness => (1e3, "in kN m²"),
        _ => (1.0, "in 10⁻⁴ m² rad/m"),
    }
}

/// An empty picture over the sleepers, with marks at the joints.
fn frame(study: &Study, title: &str, label: &str) -> Picture {
    let linear = |label: &str| Scale { label: label.to_owned(), logarithmic: false };
    let sleepers = &study.truth.sleepers;
    let last = sleepers.len().saturating_sub(1);
    let named = |index: usize| {
        index == 0 || index == last || (index % NAMES == NAMES - 1 && index + NAMES / 2 < last)
    };
    let names = sleepers.iter().enumerate().filter(|(index, _)| named(*index));
    Picture {
        title: title.to_owned(),
        x: linear("sleeper"),
        y: linear(label),
        curves: Vec::new(),
        names: names.map(|(_, it)| (it.number as f64, it.id.clone())).collect(),
        marks: study.truth.joints.iter().map(|joint| joint.after as f64 + 0.5).collect(),
        wide: true,
    }
}

fn capital(parameter: Parameter) -> String {
    let mut label = parameter.label().to_owned();
    label[..1].make_ascii_uppercase();
    label
}

fn of_parameter(study: &Study, parameter: Parameter) -> Picture {
    frame(study, &capital(parameter), unit(parameter).1)
}

fn curve(name: impl Into<String>, style: Style, points: Vec<(f64, f64)>) -> Curve {
    Curve { name: name.into(), style, points }
}

/// A point at each sleeper that was estimated.
fn points(
    study: &Study,
    estimated: &Estimated,
    parameter: Parameter,
    value: impl Fn(Estimate) -> f64,
) -> Vec<(f64, f64)> {
    let point =
        |it: &SleeperTruth| Some((it.number as f64, value(estimated.any(&it.id, parameter)?)));
    study.truth.sleepers.iter().filter_map(point).collect()
}

fn band(study: &Study, name: String, estimated: &Estimated, parameter: Parameter) -> Curve {
    let (divisor, _) = unit(parameter);
    let means = points(study, estimated, parameter, |of| of.mean / divisor);
    let half = points(study, estimated, parameter, |of| NORMAL_90 * of.sd / divisor);
    curve(name, Style::Band(half.into_iter().map(|point| point.1).collect()), means)
}

fn truth(study: &Study, parameter: Parameter) -> Curve {
    let (divisor, _) = unit(parameter);
    let point = |it: &SleeperTruth| (it.number as f64, it.values[&parameter] / divisor);
    curve("truth", Style::Truth, study.truth.sleepers.iter().map(point).collect())
}

fn by_method(study: &Study, parameter: Parameter) -> Picture {
    let mut picture = of_parameter(study, parameter);
    for (method, estimated) in &study.methods {
        let name = method.label().to_owned();
        let (divisor, _) = unit(parameter);
        picture.curves.push(match method {
            Method::Selector => {
                let means = points(study, estimated, parameter, |of| of.mean / divisor);
                curve(name, Style::Line, means)
            }
            _ => band(study, name, estimated, parameter),
        });
    }
    picture.curves.push(truth(study, parameter));
    picture
}

fn rails(spectra: &RailSpectra) -> Picture {
    let scale = |label: &str, logarithmic| Scale { label: label.to_owned(), logarithmic };
    let of = |(rail, levels): (&usize, &Vec<f64>)| {
        let points = spectra.frequencies_hz.iter().copied().zip(levels.iter().copied());
        curve(format!("rail {rail}"), Style::Line, points.collect())
    };
    Picture {
        title: format!("LWPS at {} km/h", spectra.speed_km_h),
        x: scale("frequency in Hz", true),
        y: scale("in dB re 1 (m/s²)²", false),
        curves: spectra.levels_db.iter().map(of).collect(),
        names: Vec::new(),
        marks: Vec::new(),
        wide: true,
    }
}

fn clamps(study: &Study) -> Picture {
    let parameter = Parameter::RailpadStiffness;
    let mut picture = of_parameter(study, parameter);
    let (divisor, _) = unit(parameter);
    for (lap, estimated) in (1..).zip(&study.laps) {
        let means = points(study, estimated, parameter, |of| of.mean / divisor);
        picture.curves.push(curve(format!("lap {lap}"), Style::Line, means));
    }
    let clamped = study.truth.sleepers.iter().filter(|it| it.clamp);
    let dots = clamped.map(|it| (it.number as f64, it.values[&parameter] / divisor)).collect();
    picture.curves.push(curve("clamp", Style::Points, dots));
    picture.curves.push(truth(study, parameter));
    picture
}

/// Moving average over the sleepers around each, fewer of them at the ends.
fn averaged(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let around = |index: usize| {
        let from = index.saturating_sub(AVERAGED / 2);
        let to = (index + AVERAGED.div_ceil(2)).min(points.len());
        let some = points[from..to].iter().map(|point| point.1);
        mean(some).map(|value| (points[index].0, value))
    };
    (0..points.len()).filter_map(around).collect()
}

fn gaps(study: &Study) -> Picture {
    let parameter = Parameter::BallastStiffness;
    let mut picture = of_parameter(study, parameter);
    let (divisor, _) = unit(parameter);
    for (lap, estimated) in (1..).zip(&study.laps) {
        let means = points(study, estimated, parameter, |of| of.mean / divisor);
        picture.curves.push(curve(format!("lap {lap}"), Style::Line, averaged(&means)));
    }
    picture.curves.push(truth(study, parameter));
    picture.marks = study.truth.gaps.iter().map(|gap| *gap as f64 + 0.5).collect();
    picture
}

fn by_speed(study: &Study, parameter: Parameter) -> Picture {
    let mut picture = of_parameter(study, parameter);
    for (speed, estimated) in &study.speeds {
        picture.curves.push(band(study, format!("{speed} km/h"), estimated, parameter));
    }
    picture.curves.push(truth(study, parameter));
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{estimated, study};

    #[test]
    fn pictures_have_a_point_a_sleeper_and_marks_at_joints_and_gaps() {
        let mut study = study();
        let known = estimated(&study, |_, _, truth| (truth, 0.1 * truth));
        study.methods = vec![(Method::Inversion, known.clone()), (Method::Selector, known.clone())];
        study.laps = vec![known.clone()];
        study.speeds = vec![(13.0, known)];
        let all = study.pictures();
        assert_eq!(all.iter().map(|group| group.0.len()).collect::<Vec<_>>(), [5, 1, 2, 3]);
        let railpads = &all[0].0[1];
        assert_eq!(railpads.marks, [12.5, 37.5, 62.5, 87.5]);
        assert!(railpads.curves.iter().all(|curve| curve.points.len() == 100));
        assert_eq!(all[2].0[1].marks.len(), 6);
        assert_eq!(railpads.names.last().unwrap().1, "SN100");
    }

    #[test]
    fn an_average_of_a_line_is_the_line_away_from_its_ends() {
        let line: Vec<_> = (0..40).map(|x| (f64::from(x), 2.0 * f64::from(x))).collect();
        // The window of ten reaches from five before to four behind.
        assert!((averaged(&line)[20].1 - 39.0).abs() < 1e-12);
    }
}
