//! Pages of constructed diagnoses: what a reader must find on them, and that nothing is fetched
//! from elsewhere. The pages are left in the target folder for a look.

use std::collections::BTreeMap;
use std::path::Path;
use tracktwin_diagnosis::{
    BeforeAfter, Diagnosis, Estimate, FORMAT, Fit, Hypothesis, Levels, Location, Mismatch, Score,
    Scores, SleeperValues, Verdict,
};
use tracktwin_report::{Origin, diagnosis_page};

/// As metres a second times 3.6 come out.
const SPEEDS_KM_H: [f64; 3] = [13.000_000_000_000_002, 10.0, 7.0];
const SLEEPERS: usize = 29;
const BANDS: usize = 33;
const SCATTER_DB: f64 = 1.4;
/// Names begin at SN5, as in a recording whose first sleepers are run over too early.
const FIRST: usize = 5;

type At = [usize; 3];

/// A number that looks drawn from a normal distribution, always the same for the same cell.
fn noise(at: At) -> f64 {
    let seed = (at[0] * 7919 + at[1] * 104_729 + at[2] * 1_299_709) as f64;
    let uniform = |k: f64| ((seed + k * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0);
    let twelve: f64 = (0..12).map(|k| uniform(f64::from(k))).sum();
    twelve - 6.0
}

fn frequency_hz(band: usize) -> f64 {
    100.0 * (band as f64 / 6.0).exp2()
}

fn table(level: impl Fn(At) -> f64) -> Vec<Vec<Vec<f64>>> {
    let bands = |speed, sleeper| (0..BANDS).map(|band| level([speed, sleeper, band])).collect();
    (0..SPEEDS_KM_H.len())
        .map(|speed| (0..SLEEPERS).map(|sleeper| bands(speed, sleeper)).collect())
        .collect()
}

/// Levels whose prediction lacks `effect_db` before, and has it after.
fn levels(effect_db: impl Fn(At) -> f64) -> Levels {
    let track = |at: At| {
        let octave = (frequency_hz(at[2]) / 300.0).log2();
        14.0 - 3.0 * at[0] as f64 - 2.0 * octave * octave
            + 8.0 * (-(octave - 1.6).powi(2) * 6.0).exp()
    };
    let scattered = |at: At| SCATTER_DB * noise(at);
    Levels {
        frequency_hz: (0..BANDS).map(frequency_hz).collect(),
        speeds_km_h: SPEEDS_KM_H.to_vec(),
        measured_db: table(|at| track(at) + effect_db(at) + scattered(at)),
        before_db: table(track),
        after_db: table(|at| track(at) + effect_db(at)),
        scatter_db: vec![vec![SCATTER_DB; BANDS]; SPEEDS_KM_H.len()],
    }
}

/// Stiffness along the track; `biased` says by what factor it is wrong before.
fn track(biased: impl Fn(usize) -> f64) -> Vec<SleeperValues> {
    let sleeper = |index: usize| {
        let wave = 1.0 + 0.06 * (index as f64 * 0.9).sin();
        let both = |mean: f64, share: f64, bias: f64| BeforeAfter {
            before: Estimate { mean: mean * bias, sd: share * mean * bias },
            after: Estimate { mean, sd: share * mean },
        };
        SleeperValues {
            id: format!("SN{}", index + FIRST),
            x_m: 0.125 * (index + FIRST + 1) as f64,
            railpad_stiffness: both(1.5e8 * wave, 0.05, biased(index)),
            ballast_stiffness: both(1.2e7 / wave, 0.04, biased(index).sqrt()),
            irregularity_level: both(3.0, 0.06, biased(index).powf(0.8)),
        }
    };
    (0..SLEEPERS).map(sleeper).collect()
}

fn fit(before: f64, after: f64, gains: &[(&str, f64)]) -> Fit {
    let scores = |held_out: f64| Scores {
        in_sample: Score { score: held_out + 0.15 },
        held_out: Some(Score { score: held_out }),
    };
    Fit {
        score: "mean log predictive density per band and sleeper, nats".to_owned(),
        before: scores(before),
        after: scores(after),
        held_out_gain_nats: gains
            .iter()
            .map(|(speed, gain)| ((*speed).to_owned(), *gain))
            .collect(),
    }
}

fn hypothesis(physics: &str, probability: f64, would_separate: &str) -> Hypothesis {
    Hypothesis {
        physics: physics.to_owned(),
        probability,
        accepted: false,
        location: None,
        port: None,
        behaviour: None,
        parameters: BTreeMap::new(),
        look_alikes: Vec::new(),
        would_separate: would_separate.to_owned(),
        detectability: 9.3 * probability,
        log_evidence: 45.0 * probability - 5.0,
    }
}

fn estimates(values: &[(&str, f64, f64)]) -> BTreeMap<String, Estimate> {
    values.iter().map(|&(name, mean, sd)| (name.to_owned(), Estimate { mean, sd })).collect()
}

/// Nothing left out.
fn consistent() -> Diagnosis {
    Diagnosis {
        format: FORMAT.to_owned(),
        recording: "dev-01".to_owned(),
        verdict: Verdict::Consistent,
        sentence: "The track model with its own stiffness at every sleeper explains the recording; nothing is left out that would show at 7 to 13 km/h.".to_owned(),
        nothing_left_out: Some(0.84),
        mismatches: Vec::new(),
        hypotheses: Vec::new(),
        fit: fit(-1.31, -1.31, &[]),
        bias_removed: BTreeMap::new(),
        track: track(|_| 1.0),
        levels: levels(|_| 0.0),
        notes: vec!["Below 150 Hz a level scatters by 4 dB: what acts only there may stay unseen.".to_owned()],
    }
}

fn at_joint() -> Location {
    Location { x_m: [2.4375, 2.4375], sleepers: vec!["SN18".to_owned(), "SN19".to_owned()] }
}

/// A dipped rail joint between SN18 and SN19 that the baseline takes for soft railpads.
fn left_out() -> Diagnosis {
    let joint = |[speed, sleeper, band]: At| {
        let [place, octave] = [
            sleeper as f64 + FIRST as f64 - 18.5,
            (frequency_hz(band) / (700.0 + 180.0 * (2.0 - speed as f64))).log2(),
        ];
        9.0 * (-(place / 0.9).powi(2)).exp() * (-(octave / 0.8).powi(2)).exp()
    };
    let mut accepted = hypothesis(
        "rail_joint",
        0.93,
        "a slower pass: the dip's part moves with the speed, the bending's does not",
    );
    accepted.accepted = true;
    accepted.location = Some(at_joint());
    accepted.parameters = estimates(&[
        ("dip_m", 8.2e-5, 1.04e-5),
        ("bending_factor", 0.151, 0.03),
        ("length_m", 1.53e-2, 2.1e-3),
    ]);
    accepted.look_alikes = vec!["squat".to_owned()];
    let mut squat = hypothesis("squat", 0.06, "a look at the railhead");
    squat.location = Some(at_joint());
    squat.look_alikes = vec!["rail_joint".to_owned()];
    let mismatch = Mismatch {
        x_m: [2.3125, 2.5625],
        sleepers: vec!["SN18".to_owned(), "SN19".to_owned()],
        frequency_hz: [449.0, 1425.0],
        speeds_km_h: SPEEDS_KM_H.to_vec(),
        level_db: 6.1,
        p_value: 0.0004,
    };
    Diagnosis {
        recording: "dev-02".to_owned(),
        verdict: Verdict::LeftOutPhysics,
        sentence: "Between SN18 and SN19, at 2.438 m: a dipped rail joint, 93 %. With it the withheld 10 km/h passes fit 6 dB better; without it the railpads there come out 45 % too soft.".to_owned(),
        nothing_left_out: None,
        mismatches: vec![mismatch],
        hypotheses: vec![accepted, squat, hypothesis("missing_railpad", 0.008, ""), hypothesis("sleeper_bolt", 0.001, "")],
        fit: fit(-1.62, -1.35, &[("13", 38.2), ("10", 41.7), ("7", 22.9)]),
        bias_removed: BTreeMap::from([
            ("railpad_stiffness_N_m".to_owned(), BeforeAfter { before: 8.4e7, after: 1.52e8 }),
            ("sleeper_EI_N_m2".to_owned(), BeforeAfter { before: 6900.0, after: 5010.0 }),
        ]),
        track: track(|index| if (13..15).contains(&index) { 0.56 } else { 1.0 }),
        levels: levels(joint),
        notes: vec!["The dip's length is hardly known apart from its depth.".to_owned()],
        ..consistent()
    }
}

/// Something at SN12 that nothing in the catalogue does.
fn unknown() -> Diagnosis {
    let absorber =
        |at: At| if at[1] + FIRST == 12 && (18..24).contains(&at[2]) { -7.0 } else { 0.0 };
    let mut lacking = levels(absorber);
    lacking.after_db.clone_from(&lacking.before_db);
    let mut nearest = hypothesis("sleeper_bolt", 0.11, "");
    nearest.location = Some(Location { x_m: [1.625, 1.625], sleepers: vec!["SN12".to_owned()] });
    Diagnosis {
        recording: "blind-07".to_owned(),
        verdict: Verdict::UnknownPhysics,
        sentence: "At SN12, 1.625 m, between 800 and 1600 Hz: the rail vibrates 7 dB less than any known kind of physics explains.".to_owned(),
        nothing_left_out: None,
        mismatches: vec![Mismatch {
            x_m: [1.5625, 1.6875],
            sleepers: vec!["SN12".to_owned()],
            frequency_hz: [800.0, 1425.0],
            speeds_km_h: SPEEDS_KM_H.to_vec(),
            level_db: 6.8,
            p_value: 0.012,
        }],
        hypotheses: vec![hypothesis("unknown_physics", 0.84, ""), nearest],
        levels: lacking,
        ..consistent()
    }
}

/// A sensor that resonates on its mounting.
fn chain() -> Diagnosis {
    let resonance =
        |at: At| 11.0 * (-(6.0 * (frequency_hz(at[2]) / 3200.0).log2()).powi(2) / 2.0).exp();
    let mut accepted =
        hypothesis("sensor_mount_resonance", 0.997, "another sensor or another mounting");
    accepted.accepted = true;
    accepted.parameters =
        estimates(&[("frequency_Hz", 3213.0, 14.0), ("damping_ratio", 0.031, 0.006)]);
    accepted.look_alikes = vec!["flexible_axle_box".to_owned()];
    Diagnosis {
        recording: "dev-08".to_owned(),
        verdict: Verdict::MeasurementChain,
        sentence: "The sensor resonates on its mounting at 3213 Hz (over 99 %): a fault of the measurement, not of the track.".to_owned(),
        nothing_left_out: None,
        mismatches: vec![Mismatch {
            x_m: [0.75, 4.25],
            sleepers: (0..SLEEPERS).map(|index| format!("SN{}", index + FIRST)).collect(),
            frequency_hz: [2540.0, 4032.0],
            speeds_km_h: SPEEDS_KM_H.to_vec(),
            level_db: 8.4,
            p_value: 1e-5,
        }],
        hypotheses: vec![accepted],
        fit: fit(-1.9, -1.33, &[("13 km/h", 212.0), ("10 km/h", 198.0), ("7 km/h", 161.0)]),
        bias_removed: BTreeMap::from([(
            "ballast_stiffness_N_m".to_owned(),
            BeforeAfter { before: 1.05e7, after: 1.2e7 },
        )]),
        track: track(|_| 0.8),
        levels: levels(resonance),
        ..consistent()
    }
}

/// The page, left for a look, after a check that nothing on it comes from elsewhere.
fn page(name: &str, diagnosis: &Diagnosis) -> String {
    let origin = Origin {
        command: format!("tracktwin diagnose recordings/{} --out result", diagnosis.recording),
        version: "tracktwin 0.1.0".to_owned(),
        library: String::new(),
    };
    let page = diagnosis_page(diagnosis, &origin);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("diagnosis-{name}.html"));
    std::fs::write(path, &page).expect("writable");
    let own = page.replace("http://www.w3.org/2000/svg", "");
    for foreign in ["http://", "https://", "<script", "<link", "url(", "@import", "src="] {
        assert!(!own.contains(foreign), "{name} has {foreign}");
    }
    assert!(!page.contains("NaN") && !page.contains("inf\""), "{name} has a number that is none");
    assert!(page.contains(&origin.command) && page.contains(&origin.version));
    page
}

/// How many charts have a title that contains `text`.
fn charts(page: &str, text: &str) -> usize {
    page.split("aria-label=\"")
        .skip(1)
        .filter(|part| part.split('"').next().is_some_and(|title| title.contains(text)))
        .count()
}

#[track_caller]
fn assert_reads(page: &str, facts: &[&str]) {
    for fact in facts {
        assert!(page.contains(fact), "not on the page: {fact}");
    }
}

/// The sentence as it stands on the page.
fn unbroken(diagnosis: &Diagnosis) -> String {
    diagnosis.sentence.replace(" %", "\u{a0}%")
}

#[test]
fn left_out_physics_is_named_placed_measured_and_its_bias_shown() {
    let diagnosis = left_out();
    let page = page("left-out", &diagnosis);
    assert_reads(&page, &[&unbroken(&diagnosis), "left-out physics", "93 %", "✓ accepted"]);
    assert_reads(
        &page,
        &["SN18 and SN19, 2.438 m", "Looks much like squat", "the dip's part moves"],
    );
    assert_reads(&page, &["depth of the dip", "82 µm", "61 to 103 µm", "0.15"]);
    assert_reads(&page, &["84 MN/m", "152 MN/m", "−45 %", "sleeper bending stiffness", "+38 %"]);
    assert_reads(&page, &["449 to 1425 Hz", "below 0.001", "+41.7", "3 of 3"]);
    // Before and after at each speed, a chart a speed at the place, three along the track.
    assert_eq!(charts(&page, "before, re-tuned track only"), 3);
    assert_eq!(charts(&page, "after, with rail joint"), 3);
    assert_eq!(charts(&page, "SN18, 13 km/h") + charts(&page, "SN19, 13 km/h"), 1);
    assert_eq!(page.matches("class=\"line box").count(), 6);
    assert!(!page.contains("sleeper bolt"), "what is improbable is counted, not listed");
    assert_reads(&page, &["1 further hypothesis is"]);
}

#[test]
fn a_consistent_recording_reads_well_and_has_no_empty_tables() {
    let diagnosis = consistent();
    let page = page("consistent", &diagnosis);
    let sure = "probability that nothing is left out";
    assert_reads(
        &page,
        &[&diagnosis.sentence, "tag consistent", "84 %", sure, &diagnosis.notes[0]],
    );
    assert_reads(
        &page,
        &[
            "No difference here is one that something left out would explain better",
            "doesn't exclude",
        ],
    );
    assert_reads(
        &page,
        &[
            "of all levels lie within twice the scatter",
            "2871 levels",
            "29 sleepers, 100 to 4032 Hz",
        ],
    );
    assert!(!page.contains("<tbody></tbody>") && !page.contains("✓ accepted"));
    assert!(!page.contains("after, with") && !page.contains("How strong it is"));
    assert!(!page.contains("bias removed"));
}

#[test]
fn unknown_physics_is_placed_and_says_what_came_nearest() {
    let page = page("unknown", &unknown());
    assert_reads(&page, &["unknown physics", "SN12 (1.562 to 1.688 m)", "800 to 1425 Hz", "0.012"]);
    assert_reads(
        &page,
        &["at SN12, where they differ most", "6.8 dB", "84 %", "sleeper bolt", "11 %"],
    );
    assert!(!page.contains("✓ accepted") && !page.contains("How strong it is"));
}

#[test]
fn unknown_physics_that_was_accepted_has_no_second_prediction() {
    let mut diagnosis = unknown();
    diagnosis.hypotheses[0].accepted = true;
    diagnosis.hypotheses[0].location = unknown().hypotheses.swap_remove(1).location;
    let page = page("unknown-accepted", &diagnosis);
    assert_reads(&page, &["84 %", "probability of this physics: unknown physics", "6.8 dB"]);
    assert!(!page.contains("after, with"));
}

#[test]
fn what_the_passes_show_alone_is_not_said_to_improve_the_prediction() {
    let mut flat = hypothesis("wheel_flat", 0.999, "more laps");
    (flat.accepted, flat.detectability, flat.log_evidence) = (true, 0.0, 14.0);
    flat.parameters = estimates(&[("length_m", 3.1e-3, 2e-4)]);
    let page = page(
        "wheel-flat",
        &Diagnosis { verdict: Verdict::LeftOutPhysics, hypotheses: vec![flat], ..consistent() },
    );
    assert_reads(&page, &["seen in the passes themselves; probability by chance below 0.001"]);
    assert_reads(&page, &["The predictions on this page are without it", "3.1 mm", "over 99 %"]);
    for claim in ["after, with", "d′ 0.0", "withheld speeds are predicted better"] {
        assert!(!page.contains(claim), "{claim}");
    }
}

#[test]
fn a_fault_of_the_measuring_chain_is_not_called_physics() {
    let page = page("chain", &chain());
    assert_reads(
        &page,
        &["measuring chain", "not the track", "in the measuring chain", "over 99 %"],
    );
    assert_reads(&page, &["3213 Hz", "all along the track, 2540 to 4032 Hz"]);
    assert_reads(&page, &["mean over all sleepers, 13 km/h", "probability of this fault"]);
    assert!(!page.contains("probability of this physics"));
}

#[test]
fn one_speed_says_that_nothing_could_be_withheld() {
    let mut diagnosis = left_out();
    diagnosis.fit.before.held_out = None;
    diagnosis.fit.after.held_out = None;
    diagnosis.fit.held_out_gain_nats.clear();
    let levels = &mut diagnosis.levels;
    levels.speeds_km_h.truncate(1);
    for table in [&mut levels.measured_db, &mut levels.before_db, &mut levels.after_db] {
        table.truncate(1);
    }
    let page = page("one-speed", &diagnosis);
    assert_reads(&page, &["With a single speed nothing could be withheld"]);
    assert!(!page.contains("gain when withheld"));
}

#[test]
fn a_kilometre_of_track_stays_a_page_of_a_megabyte() {
    const TIMES: usize = 60;
    let mut long = consistent();
    let sleeper = long.track[0].clone();
    long.track = (0..SLEEPERS * TIMES)
        .map(|n| SleeperValues { id: format!("S{n}"), x_m: 0.6 * n as f64, ..sleeper.clone() })
        .collect();
    let Levels { measured_db, before_db, after_db, .. } = &mut long.levels;
    for speed in [measured_db, before_db, after_db].into_iter().flatten() {
        let short = std::mem::take(speed);
        speed.extend(short.iter().cycle().take(SLEEPERS * TIMES).cloned());
    }
    let page = page("long", &long);
    assert_reads(&page, &["Each cell is the mean of 8 sleepers"]);
    assert!(page.len() < 1_500_000, "{} bytes", page.len());
}

#[test]
fn missing_levels_leave_gaps_and_no_levels_leave_out_the_pictures() {
    let mut gaps = left_out();
    gaps.levels.measured_db[1][13][5] = f64::NAN;
    gaps.levels.after_db[0].truncate(20);
    page("gaps", &gaps);
    let page =
        page("nothing", &Diagnosis { levels: Levels::default(), track: Vec::new(), ..unknown() });
    assert_reads(&page, &["unknown physics", "800 to 1425 Hz"]);
}
