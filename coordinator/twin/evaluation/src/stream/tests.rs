//! A stream gives the same numbers as the evaluation of a whole recording.

use super::recent::RECENT_MAX;
use super::*;
use crate::testing;
use crate::{BySpeeds, Estimates, Evaluation, SleeperEvaluation, evaluate};
use tracktwin_signal::recording::Pass;
use tracktwin_signal::{Extractor, Signal};
use tracktwin_surrogate::{Trained, TrainingSet};

/// Tolerance for rounding: predictions of one and of many sleepers are summed in different orders.
const ROUNDING: f64 = 1e-9;

struct Models {
    extractor: Extractor,
    library: TrainingSet,
    trained: Trained,
    by_speeds: BySpeeds,
}

impl Models {
    fn new() -> Self {
        let library = testing::library();
        let trained = testing::models(&library);
        Self { extractor: testing::extractor(), library, trained, by_speeds: BySpeeds::default() }
    }

    fn twin(&self) -> Twin<'_> {
        let Self { extractor, library, trained, by_speeds } = self;
        Twin { extractor, models: trained, library, by_speeds }
    }

    fn rows(&self, section: &Recording, samples: &[Sample]) -> Vec<Row> {
        let mut stream = Stream::new(section, self.twin()).unwrap();
        let most = stream.samples_max();
        let mut rows = Vec::new();
        for sample in samples {
            rows.extend(stream.push(sample).unwrap());
            assert!(stream.segment.len() < most && stream.open.len() < 4);
        }
        rows.extend(stream.finish().unwrap());
        // Every sleeper once, along the track.
        let ids: Vec<&str> = rows.iter().map(id).collect();
        let expected: Vec<&str> = section.sleepers.iter().map(|it| it.id.as_str()).collect();
        assert_eq!(ids, expected);
        rows
    }

    fn batch(&self, recording: &Recording) -> Evaluation {
        evaluate(recording, &self.twin()).unwrap()
    }
}

fn id(row: &Row) -> &str {
    match &row.outcome {
        Outcome::Evaluated(it) => &it.sleeper.id,
        Outcome::Unevaluated { id, .. } => id,
    }
}

fn evaluated(rows: &[Row]) -> Vec<&SleeperEvaluation> {
    let of = |row: &'_ Row| matches!(row.outcome, Outcome::Evaluated(_));
    let of = rows.iter().filter(|row| of(row)).map(|row| match &row.outcome {
        Outcome::Evaluated(it) => &it.sleeper,
        Outcome::Unevaluated { .. } => unreachable!("just filtered"),
    });
    of.collect()
}

fn reason(row: &Row) -> Option<Reason> {
    match row.outcome {
        Outcome::Evaluated(_) => None,
        Outcome::Unevaluated { reason, .. } => Some(reason),
    }
}

fn samples(pass: &Pass) -> Vec<Sample> {
    let pairs = pass.position_m.iter().zip(pass.signal.samples()).enumerate();
    let rate_hz = pass.signal.sample_rate_hz();
    pairs
        .map(|(index, (&position_m, &acceleration_m_s2))| Sample {
            time_s: 7.0 + index as f64 / rate_hz,
            position_m,
            acceleration_m_s2,
        })
        .collect()
}

/// The recording with these stretches of its first pass, as passes.
fn cut(recording: &Recording, stretches: &[Range<usize>]) -> Recording {
    let pass = &recording.passes[0];
    let part = |stretch: &Range<usize>| Pass {
        signal: Signal::new(
            recording.sample_rate_hz,
            pass.signal.samples()[stretch.clone()].to_vec(),
        )
        .unwrap(),
        position_m: pass.position_m[stretch.clone()].to_vec(),
        ..pass.clone()
    };
    Recording { passes: stretches.iter().map(part).collect(), ..recording.clone() }
}

fn alike(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * b.abs()
}

fn assert_means(a: &Estimates, b: &Estimates) {
    assert!(a.keys().eq(b.keys()));
    assert!(a.values().zip(b.values()).all(|(a, b)| alike(a.mean, b.mean)), "{a:?} {b:?}");
}

/// All that does not depend on other sleepers.
fn assert_same(streamed: &SleeperEvaluation, batch: &SleeperEvaluation) {
    assert_eq!((&streamed.id, streamed.x_m), (&batch.id, batch.x_m));
    // Features to the bit.
    assert_eq!(streamed.measured, batch.measured, "{}", batch.id);
    assert_eq!(streamed.selector, batch.selector);
    assert_means(&streamed.estimates, &batch.estimates);
    let sds = streamed.sd_without_unevenness.values().zip(batch.sd_without_unevenness.values());
    assert!(sds.into_iter().all(|(a, b)| alike(*a, *b)));
    let own = |sleeper: &SleeperEvaluation| {
        let flags = sleeper.flags.iter().copied();
        let tests = [crate::Flag::OutsideLibrary, crate::Flag::DomainNotTested];
        flags.filter(|flag| !tests.contains(flag)).collect::<Vec<_>>()
    };
    assert_eq!(own(streamed), own(batch), "{}", batch.id);
}

fn assert_all_same(rows: &[Row], batch: &Evaluation) {
    let streamed = evaluated(rows);
    assert_eq!(streamed.len(), batch.sleepers.len());
    streamed.iter().zip(&batch.sleepers).for_each(|(a, b)| assert_same(a, b));
}

#[test]
fn a_stream_gives_the_numbers_of_the_batch() {
    let models = Models::new();
    for speed_km_h in testing::SPEEDS_KM_H {
        let recording = testing::long_recording(3.0, &[speed_km_h], 40);
        let rows = models.rows(&recording, &samples(&recording.passes[0]));
        assert_all_same(&rows, &models.batch(&recording));
        assert_eq!(evaluated(&rows).len(), 40);
        let json: serde_json::Value = serde_json::from_str(&rows[7].to_json()).unwrap();
        assert_eq!((&json["format"], &json["id"]), (&"tracktwin-stream/1".into(), &"SN7".into()));
        assert!(json["irregularity_level"]["sd"].is_f64() && json["unevenness"].is_f64());
    }
}

#[test]
fn a_row_is_the_last_sleeper_of_a_batch_of_those_before_it() {
    let models = Models::new();
    // Inside the library, and beyond its level.
    for level in [3.0, 20.0] {
        let recording = testing::long_recording(level, &[13.0], 40);
        let rows = models.rows(&recording, &samples(&recording.passes[0]));
        for last in [0, 3, 10, 24, 25, 38] {
            let first = (last + 1_usize).saturating_sub(RECENT_MAX);
            let sleepers = recording.sleepers[first..=last].to_vec();
            let batch = models.batch(&Recording { sleepers, ..recording.clone() });
            let expected = batch.sleepers.last().unwrap();
            let Outcome::Evaluated(found) = &rows[last].outcome else { panic!("{last}") };
            assert_same(&found.sleeper, expected);
            assert_eq!(found.sleeper.flags, expected.flags, "{level} {last}");
            let is_outside = expected.flags.contains(&crate::Flag::OutsideLibrary);
            assert!(!is_outside || level > 3.0);
            let sds = found.sleeper.estimates.values().zip(expected.estimates.values());
            assert!(sds.into_iter().all(|(a, b)| alike(a.sd, b.sd)), "{level} {last}");
            assert!(alike(found.unevenness, batch.unevenness.scatter), "{level} {last}");
        }
    }
}

#[test]
fn gaps_and_missing_samples_end_a_pass_and_begin_another() {
    let models = Models::new();
    let recording = testing::long_recording(3.0, &[13.0], 30);
    let whole = samples(&recording.passes[0]);
    let count = whole.len();
    // A window is 346 samples: a few samples, and more than two windows.
    for lost in [3000..3003, 3000..3800] {
        let batch = models.batch(&cut(&recording, &[0..lost.start, lost.end..count]));
        let mut with_gap = whole.clone();
        with_gap.drain(lost.clone());
        let mut with_nan = whole.clone();
        with_nan[lost.clone()].iter_mut().for_each(|it| it.acceleration_m_s2 = f64::NAN);
        for (samples, expected) in [(with_gap, Reason::Gap), (with_nan, Reason::NotFinite)] {
            let rows = models.rows(&recording, &samples);
            assert_all_same(&rows, &batch);
            let reasons: Vec<_> = rows.iter().filter_map(reason).collect();
            assert_eq!(reasons.len(), 30 - batch.sleepers.len());
            assert!(reasons.iter().all(|it| *it == expected), "{reasons:?}");
            assert_eq!(reasons.is_empty(), lost.len() < 10);
        }
        assert!(batch.sleepers[8].flags.contains(&crate::Flag::ShortMargin));
    }
}

#[test]
fn without_a_whole_window_no_sleeper_counts_as_inside() {
    let models = Models::new();
    // Beyond the library, and a sample lost every 500: a window and its margins never fit between.
    let recording = testing::long_recording(20.0, &[13.0], 30);
    let mut samples = samples(&recording.passes[0]);
    let starts = (0..samples.len()).step_by(500);
    let stretches: Vec<_> =
        starts.map(|start| start + 1..(start + 500).min(samples.len())).collect();
    samples.iter_mut().step_by(500).for_each(|sample| sample.acceleration_m_s2 = f64::NAN);
    let batch = models.batch(&cut(&recording, &stretches));
    assert_eq!((batch.outside_library.share, batch.outside_library.not_tested), (0.0, 1.0));
    assert!(batch.outside_library.is_most());
    assert!(batch.notes.iter().any(|note| note.contains("not tested against the library")));
    let rows = models.rows(&recording, &samples);
    let streamed = evaluated(&rows);
    assert!(streamed.len() > 10);
    let is_told = |it: &SleeperEvaluation| it.flags.contains(&crate::Flag::DomainNotTested);
    assert!(batch.sleepers.iter().all(is_told) && streamed.into_iter().all(is_told));
}

#[test]
fn one_wrong_position_costs_no_sleeper_away_from_it() {
    let models = Models::new();
    let recording = testing::long_recording(3.0, &[13.0], 30);
    let whole = samples(&recording.passes[0]);
    let count = whole.len();
    // The first sample, and one near the beginning of a window; the track is 3.6 m long.
    for at in [0, 3000] {
        let mut stretches = vec![0..at, at + 1..count];
        stretches.retain(|stretch| !stretch.is_empty());
        let batch = models.batch(&cut(&recording, &stretches));
        for wrong_m in [1e9, 2.0, -1e9] {
            let mut samples = whole.clone();
            samples[at].position_m = wrong_m;
            let rows = models.rows(&recording, &samples);
            assert!(rows.iter().all(|row| reason(row).is_none()), "{at} {wrong_m}");
            assert_all_same(&rows, &batch);
        }
    }
}

#[test]
fn a_stream_that_ends_behind_a_jump_says_so_of_the_sleepers_before_it() {
    let models = Models::new();
    let recording = testing::long_recording(3.0, &[13.0], 30);
    let mut samples = samples(&recording.passes[0]);
    samples.truncate(3001);
    samples[3000].position_m = 2.0;
    let rows = models.rows(&recording, &samples);
    // SN16 has its place there.
    for (index, row) in rows.iter().enumerate().skip(9) {
        let expected = if index < 16 { Reason::Gap } else { Reason::NotCovered };
        assert_eq!(reason(row), Some(expected), "SN{index}");
    }
}

#[test]
fn a_stream_that_ends_early_gives_the_numbers_of_what_there_is() {
    let models = Models::new();
    let recording = testing::long_recording(3.0, &[10.0], 20);
    let rows = models.rows(&recording, &samples(&recording.passes[0])[700..5000]);
    let batch = models.batch(&cut(&recording, std::slice::from_ref(&(700..5000))));
    assert_all_same(&rows, &batch);
    let reasons: Vec<_> = rows.iter().filter_map(reason).collect();
    assert!(reasons.iter().all(|it| *it == Reason::NotCovered), "{reasons:?}");
    assert!(matches!(rows[0].outcome, Outcome::Unevaluated { .. }));
    let nothing = models.rows(&recording, &[]);
    assert!(nothing.iter().all(|row| reason(row) == Some(Reason::NotCovered)));
}

#[test]
fn sleepers_around_a_change_of_speed_are_left_out_and_the_others_have_their_own_model() {
    let models = Models::new();
    let mut recording = testing::long_recording(3.0, &[13.0], 40);
    let rate_hz = recording.sample_rate_hz;
    let mut place = 0.0;
    let positions: Vec<f64> = (0..recording.passes[0].position_m.len())
        .map(|index| {
            let before = place;
            place += if index < 6000 { 10.0 } else { 13.0 } / 3.6 / rate_hz;
            before
        })
        .collect();
    recording.passes[0].position_m = positions;
    let rows = models.rows(&recording, &samples(&recording.passes[0]));
    let part = |speed_km_h: f64, stretch: Range<usize>| {
        let mut part = cut(&recording, &[stretch]);
        part.passes[0].speed_km_h = speed_km_h;
        models.batch(&part).sleepers
    };
    let count = recording.passes[0].position_m.len();
    let (slow, fast) = (part(10.0, 0..6000), part(13.0, 6000..count));
    let (mut counts, mut changes) = ([0; 2], 0);
    for row in &rows {
        match &row.outcome {
            Outcome::Evaluated(it) => {
                let is_fast = it.sleeper.measured[0].speed_km_h > 11.0;
                counts[usize::from(is_fast)] += 1;
                let all = if is_fast { &fast } else { &slow };
                let batch = all.iter().find(|sleeper| sleeper.id == it.sleeper.id);
                assert_same(&it.sleeper, batch.unwrap());
            }
            Outcome::Unevaluated {
                reason: Reason::SpeedChanges { speeds_km_h: [a, b] }, ..
            } => {
                assert!((9.9..12.6).contains(a) && (10.3..13.1).contains(b), "{a} {b}");
                changes += 1;
            }
            Outcome::Unevaluated { reason, .. } => assert_eq!(*reason, Reason::NotCovered),
        }
    }
    assert!(counts[0] > 10 && counts[1] > 10 && (1..4).contains(&changes), "{counts:?} {changes}");
}

#[test]
fn a_train_that_stands_or_goes_at_no_speed_of_the_models_takes_no_memory() {
    let models = Models::new();
    let recording = testing::long_recording(3.0, &[13.0], 20);
    let mut samples = samples(&recording.passes[0]);
    let still = samples[3000];
    let rest = std::iter::repeat_n(still, 50_000);
    samples.splice(3000..3000, rest);
    (0..).zip(&mut samples).for_each(|(n, it)| it.time_s = f64::from(n) / 1e4);
    let rows = models.rows(&recording, &samples);
    let stopped = rows.iter().filter(|row| matches!(reason(row), Some(Reason::OtherSpeed { .. })));
    assert_eq!(stopped.count(), 1);
    assert!(evaluated(&rows).len() > 14);
    let creeping: Vec<Sample> = (0..100_000)
        .map(|n| Sample { time_s: f64::NAN, position_m: 2e-5 * f64::from(n), ..still })
        .collect();
    let rows = models.rows(&recording, &creeping);
    let slow = |row: &Row| matches!(reason(row), Some(Reason::OtherSpeed { speed_km_h }) if speed_km_h < 1.0);
    // At the beginning and the end too little is seen of a window to call its speed.
    assert!(rows[1..15].iter().all(slow), "{rows:?}");
}

#[test]
fn times_of_another_rate_and_a_rate_too_low_are_refused() {
    let models = Models::new();
    let recording = testing::long_recording(3.0, &[13.0], 10);
    let mut stream = Stream::new(&recording, models.twin()).unwrap();
    let refused = samples(&recording.passes[0]).iter_mut().find_map(|sample| {
        sample.time_s *= 1.2;
        stream.push(sample).err()
    });
    let text = refused.unwrap().to_string();
    assert!(text.starts_with("time_s: the samples come at 8333.33 Hz"), "{text}");
    // Steps of two sample intervals are gaps, each of them.
    let mut stream = Stream::new(&recording, models.twin()).unwrap();
    let refused = samples(&recording.passes[0]).iter_mut().take(101).find_map(|sample| {
        sample.time_s *= 2.0;
        stream.push(sample).err()
    });
    let text = refused.unwrap().to_string();
    assert!(text.starts_with("time_s: the samples come at 5000 Hz"), "{text}");
    let slow = Recording { sample_rate_hz: 2000.0, ..recording };
    let text = Stream::new(&slow, models.twin()).err().unwrap().to_string();
    assert!(text.contains("2000 Hz is too low") && text.contains("2500 Hz"), "{text}");
}
