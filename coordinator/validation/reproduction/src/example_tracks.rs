//! Fig. 15: the tracks of the numerical examples.

use crate::agreement::unit;
use crate::example::{Example, examples};
use crate::example_track::ExampleTrack;
use crate::picture::{Picture, Scale, Style};
use crate::{ClaimVerdict, Compared, Error, Figure};
use tracktwin_experiment::Experiment;
use tracktwin_parameters::Parameter;
use tracktwin_track::model::TrackModel;

/// Sleepers of the paper's section, and the lengths in mm of its rail elements on either side of
/// the fifth.
const PAPER_SLEEPERS: usize = 9;
const PAPER_ELEMENTS_MM: [f64; 2] = [0.3, 6.3];

/// Half of the last digit of these lengths in mm, and room for a length that lies on the border.
const ROUNDING_MM: f64 = 0.05 + 1e-9;

/// Distance in m within which two places are one.
const SAME_M: f64 = 1e-9;

/// Figures whose examples are drawn.
const FIGURES: [Figure; 4] = [Figure::Fig16, Figure::Fig17, Figure::Fig18, Figure::Fig19];

/// The tracks that are simulated for Figs. 16 to 19 beside the paper's Fig. 15.
///
/// # Errors
/// [`Error::Model`].
pub(crate) fn example_tracks(experiment: &Experiment) -> Result<Compared, Error> {
    let track = ExampleTrack::new(experiment);
    let all: Vec<Example> = FIGURES.into_iter().flat_map(examples).collect();
    let model = track.track(&all[0])?;
    let section_m = [1, 5, PAPER_SLEEPERS].map(|sleeper| track.x_m(sleeper));
    let caption = "Length of the rail's elements along the simulated track, with lines at the nine \
                   sleepers of the section; parameters of each example at these sleepers.";
    let mut compared = Compared::new(Figure::Fig15, caption);
    sleepers(&mut compared, &model, section_m);
    for (side, paper_mm) in PAPER_ELEMENTS_MM.into_iter().enumerate() {
        elements(&mut compared, &model, [section_m[side], section_m[side + 1]], side, paper_mm);
    }
    beyond(&mut compared, &model, section_m);
    compared.pictures.push(mesh_picture(&model, &track));
    compared.pictures.extend(FIGURES.into_iter().flat_map(parameter_pictures));
    Ok(compared)
}

/// Lengths in mm of the rail's elements, each with the place of its middle in m.
fn lengths_mm(model: &TrackModel) -> Vec<(f64, f64)> {
    let nodes = model.layout().rail_nodes_m().windows(2);
    nodes.map(|ends| (0.5 * (ends[0] + ends[1]), 1e3 * (ends[1] - ends[0]))).collect()
}

fn sleepers(compared: &mut Compared, model: &TrackModel, [first_m, _, last_m]: [f64; 3]) {
    let inside = first_m - SAME_M..last_m + SAME_M;
    let sleepers = model.layout().sleepers().iter();
    let count = sleepers.filter(|sleeper| inside.contains(&sleeper.position_m)).count();
    compared.check(
        "Sleepers of the section",
        [PAPER_SLEEPERS.to_string(), count.to_string()],
        ClaimVerdict::of(count == PAPER_SLEEPERS),
        "input of the program, counted in the simulated track",
    );
}

fn elements(
    compared: &mut Compared,
    model: &TrackModel,
    [from_m, to_m]: [f64; 2],
    side: usize,
    paper_mm: f64,
) {
    let all = lengths_mm(model).into_iter().filter(|of| (from_m..to_m).contains(&of.0));
    let [low, high] = all.fold([f64::INFINITY, 0.0_f64], |[a, b], of| [a.min(of.1), b.max(of.1)]);
    let inside = |length: f64| (length - paper_mm).abs() <= ROUNDING_MM;
    let between = [[1, 5], [5, 9]][side];
    compared.check(
        format!("Rail elements between sleepers {} and {}", between[0], between[1]),
        [format!("{paper_mm} mm"), format!("{low:.3} to {high:.3} mm")],
        ClaimVerdict::of(inside(low) && inside(high)),
        "input of the program: lengths that round to the paper's; a whole number of elements fills \
         each span",
    );
}

fn beyond(compared: &mut Compared, model: &TrackModel, [first_m, _, last_m]: [f64; 3]) {
    let outside = lengths_mm(model).into_iter().filter(|of| of.0 < first_m || of.0 > last_m);
    let longest = outside.map(|of| of.1).fold(0.0, f64::max);
    let length_m = model.layout().length_m();
    compared.row(
        "What lies beyond the nine sleepers",
        [
            "not stated".to_owned(),
            format!(
                "{first_m:.2} m before and {:.2} m behind, elements of up to {longest:.1} mm",
                length_m - last_m
            ),
        ],
        ClaimVerdict::CannotTell,
        "the paper describes the section only; here it stands in the middle of the campaign's \
         track, whose parameters beyond it are those of the first and the last of the nine",
    );
}

fn mesh_picture(model: &TrackModel, track: &ExampleTrack<'_>) -> Picture {
    let mut picture = Picture::new(
        "Mesh of the rail",
        Scale::linear("position in m"),
        Scale::logarithmic("element length in mm"),
    );
    picture.wide = true;
    picture.marks = (1..=PAPER_SLEEPERS).map(|sleeper| track.x_m(sleeper)).collect();
    picture.with("", Style::Line, thinned(&lengths_mm(model)))
}

/// The first and the last of all neighbours with the same length.
fn thinned(lengths: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let runs = lengths.chunk_by(|a, b| (a.1 / b.1 - 1.0).abs() < 1e-6);
    runs.flat_map(|run| [run[0], run[run.len() - 1]]).collect()
}

/// A picture for each parameter that changes along or between the examples of a figure.
fn parameter_pictures(figure: Figure) -> Vec<Picture> {
    let all = examples(figure);
    let values =
        |parameter| all.iter().flat_map(move |of| of.sleepers.iter().map(move |it| it[parameter]));
    let changes = |parameter: &Parameter| {
        let first = values(*parameter).next();
        values(*parameter).any(|value| Some(value) != first)
    };
    let picture = |&parameter: &Parameter| {
        let (divisor, unit) = unit(parameter);
        let title = format!("{figure}: {}", parameter.symbol());
        let y = Scale::linear(format!("{} in {unit}", parameter.symbol()));
        let mut picture = Picture::new(title, Scale::linear("sleeper"), y);
        picture.wide = true;
        for example in &all {
            let values = (1..).zip(&example.sleepers);
            let points = values.map(|(at, set)| (f64::from(at), set[parameter] / divisor));
            picture = picture.with(example.name.clone(), Style::Line, points.collect());
        }
        picture.names = (1..=all[0].sleepers.len()).map(|at| (at as f64, at.to_string())).collect();
        picture
    };
    Parameter::ALL.iter().filter(|of| changes(of)).map(picture).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::verdicts;
    use ClaimVerdict::{CannotTell, Fails, Holds};
    use tracktwin_parameters::{Preset, TrackDesign};
    use tracktwin_track::model::{Mesh, Support};

    #[test]
    fn the_simulated_track_is_the_paper_s() {
        let experiment = Experiment::new(TrackDesign::v_track());
        let compared = example_tracks(&experiment).unwrap();
        assert_eq!(verdicts(&compared), [Holds, Holds, Holds, CannotTell]);
        assert!(compared.rows[1].ours.starts_with("0.300"), "{}", compared.rows[1].ours);
        assert!(compared.rows[2].ours.starts_with("6.250"), "{}", compared.rows[2].ours);
        // The mesh; k_p and k_b of Figs. 16 and 19, the level of Fig. 17, the sleepers of Fig. 18.
        assert_eq!(compared.pictures.len(), 1 + 2 + 1 + 1 + 2);
        assert_eq!(compared.pictures[0].marks.len(), 9);
    }

    #[test]
    fn another_mesh_differs() {
        let supports = vec![Support::from(&Preset::VTrack.nominal()); 39];
        let mesh = Mesh::uniform(40, 20, 2);
        let model = TrackModel::build(&TrackDesign::v_track(), &mesh, &supports, &[]).unwrap();
        let mut compared = Compared::new(Figure::Fig15, "");
        elements(&mut compared, &model, [2.0, 2.5], 0, 0.3);
        elements(&mut compared, &model, [2.5, 3.0], 1, 6.3);
        sleepers(&mut compared, &model, [2.0, 2.5, 2.75]);
        assert_eq!(verdicts(&compared), [Fails, Holds, Fails]);
    }
}
