//! From features to estimates: prediction, selector, and a lap from file to evaluation.

use super::{ENTRIES, Error, Line};
use tracktwin_benches::{axle_box, cost, feature_vectors, library, once};
use tracktwin_evaluation::{BySpeeds, Twin, evaluate};
use tracktwin_signal::recording::{Pass, Recording, Sleeper};
use tracktwin_signal::{Extractor, FeatureDefinition};
use tracktwin_surrogate::{
    FeatureColumns, InputScaling, ModelGroup, Neighbour, Selector, TrainOptions, Trained,
    TrainingSet, train,
};

/// Speeds of the paper's campaign, in km/h.
const SPEEDS_KM_H: [f64; 3] = [7.0, 10.0, 13.0];
/// Number of sleepers of a lap, and their spacing in m.
const SLEEPERS: u16 = 100;
const SPACING_M: f64 = 0.125;
/// Sample rate in Hz.
const RATE_HZ: f64 = 1e5;

/// Models of the global feature for `set`, with the scaling that training usually selects.
fn models(set: &TrainingSet) -> Result<Trained, Error> {
    let all = FeatureColumns::new("GF", 0..set.frequencies_hz.len());
    let scalings = vec![InputScaling::Whitened { components: 16, shrinkage: 0.1 }];
    let options = TrainOptions { scalings, ..TrainOptions::new(vec![all]) };
    Ok(train(set, &options, &|_| ())?)
}

/// Means and standard deviations of six parameters from the features of all speeds.
pub(crate) fn predictions() -> Result<Vec<Line>, Error> {
    let trained = models(&library(2 * ENTRIES, &SPEEDS_KM_H))?;
    let group = trained.group(&SPEEDS_KM_H, "GF").ok_or("no model of all speeds")?;
    let width = SPEEDS_KM_H.len() * trained.frequencies_hz().len();
    let features = feature_vectors(100, width);
    let observed: Vec<Vec<f64>> =
        features.row_iter().map(|row| row.iter().copied().collect()).collect();
    let (first, ready) = once(|| group.predict(&observed[..1]));
    first?;
    let off = batch_against_single(group, &observed)?;
    let pairs = different_pairs(group);
    let accuracy = format!("{pairs} pairs of hyper-parameters; sd within {off:.0e} of a batch's");
    let hundred = cost(|| group.predict(&observed)).of_each(100);
    Ok(vec![
        Line::new("prediction: models made ready", ready, "once for each run of the program"),
        Line::new("prediction of one", cost(|| group.predict(&observed[..1])), accuracy),
        Line::new("prediction in a batch of 100, each", hundred, ""),
    ])
}

fn different_pairs(group: &ModelGroup) -> usize {
    let all: Vec<_> = group.models().iter().map(|model| model.hyperparameters).collect();
    (0..all.len()).filter(|&i| !all[..i].contains(&all[i])).count()
}

/// Largest relative difference of standard deviations predicted one by one and together.
fn batch_against_single(group: &ModelGroup, observed: &[Vec<f64>]) -> Result<f64, Error> {
    let together = group.predict(observed)?;
    let mut worst = 0.0_f64;
    for (one, together) in observed.iter().zip(&together) {
        let alone = &group.predict(std::slice::from_ref(one))?[0];
        let pairs = alone.iter().zip(together);
        worst = pairs.map(|(a, b)| (a.sd / b.sd - 1.0).abs()).fold(worst, f64::max);
    }
    Ok(worst)
}

pub(crate) fn selector() -> Result<Vec<Line>, Error> {
    let library = feature_vectors(10_000, 304);
    let rows: Vec<f64> = library.row_iter().flat_map(|row| row.iter().copied()).collect();
    let observed: Vec<f64> = rows[..304].iter().map(|x| x + 0.1).collect();
    let selector = Selector::new(rows, 304)?;
    let each =
        cost(|| (0..100).map(|_| selector.nearest(&observed, 10)).collect::<Vec<_>>()).of_each(100);
    let found = selector.nearest(&observed, 10)?;
    let same = found == sorted(&selector, &observed)[..10];
    let accuracy = if same { "the order of a full sort" } else { "NOT the order of a full sort" };
    Ok(vec![Line::new("selector: ten of 10,000 x 304", each, accuracy)])
}

/// All entries, ordered by distance.
fn sorted(selector: &Selector, observed: &[f64]) -> Vec<Neighbour> {
    let distance = |entry| {
        let pairs = selector.features(entry).iter().zip(observed);
        pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    };
    let neighbour = |entry| Neighbour { entry, distance: distance(entry) };
    let mut all: Vec<_> = (0..selector.entries()).map(neighbour).collect();
    all.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    all
}

/// A pass over 100 sleepers at 13 km/h, from its file to its evaluation.
pub(crate) fn lap() -> Result<Vec<Line>, Error> {
    let set = library(2 * ENTRIES, &[13.0]);
    let (models, extractor) = (models(&set)?, Extractor::new(&FeatureDefinition::default())?);
    let by_speeds = BySpeeds::default();
    let twin =
        Twin { extractor: &extractor, models: &models, library: &set, by_speeds: &by_speeds };
    let folder = tempfile::tempdir()?;
    let recording = recording();
    recording.write(folder.path())?;
    let work = || -> Result<_, Error> { Ok(evaluate(&Recording::open(folder.path())?, &twin)?) };
    let evaluated = work()?.sleepers.len();
    let cost = cost(work);
    let train_s = f64::from(SLEEPERS) * SPACING_M / (13.0 / 3.6);
    let faster = train_s / cost.least_s;
    let accuracy = format!("{evaluated} sleepers; {faster:.1} times as fast as the train");
    Ok(vec![Line::new("lap of 100 sleepers, file to evaluation", cost, accuracy)])
}

fn recording() -> Recording {
    let speed_m_s = 13.0 / 3.6;
    let samples = (f64::from(SLEEPERS) * SPACING_M / speed_m_s * RATE_HZ) as usize;
    let place = |index: u16| SPACING_M * (f64::from(index) + 0.5);
    Recording {
        name: "lap".to_owned(),
        sample_rate_hz: RATE_HZ,
        channel: String::new(),
        passes: vec![Pass {
            file: "pass".to_owned(),
            speed_km_h: 13.0,
            signal: axle_box(samples),
            position_m: (0..samples).map(|i| i as f64 * speed_m_s / RATE_HZ).collect(),
            axle: None,
            contact_loss_share: None,
        }],
        sleepers: (0..SLEEPERS).map(|i| Sleeper { id: format!("S{i}"), x_m: place(i) }).collect(),
        nominal: serde_json::Map::new(),
        spacing_m: SPACING_M,
        doubts: Vec::new(),
    }
}
