//! Constructed diagnoses, one for each verdict.

use std::collections::BTreeMap;
use tracktwin_diagnosis::{
    BeforeAfter, Confirmation, ConfirmedSpeed, Diagnosis, Estimate, FORMAT, FitScores, Hypothesis,
    Levels, Location, Mismatch, Score, Scores, SleeperValues, Verdict,
};

/// Speeds in km/h as they result from m/s times 3.6, with rounding errors.
const SPEEDS_KM_H: [f64; 3] = [13.000_000_000_000_002, 10.0, 7.0];
pub(crate) const SLEEPERS: usize = 29;
const BANDS: usize = 33;
const SCATTER_DB: f64 = 1.4;
/// Number of the first sleeper, as in a recording whose first sleepers were not recorded completely.
const FIRST: usize = 5;

type At = [usize; 3];

/// A pseudo-random number with normal distribution; a function of the cell.
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

/// Levels whose first prediction lacks `effect_db` and whose second prediction includes it.
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
        scatter_db: vec![vec![Some(SCATTER_DB); BANDS]; SPEEDS_KM_H.len()],
    }
}

/// Stiffness along the track; `biased` is the factor by which the stiffness is wrong before.
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
            flags: Vec::new(),
        }
    };
    (0..SLEEPERS).map(sleeper).collect()
}

fn fit(before: f64, after: f64, gains: &[(&str, f64)]) -> FitScores {
    let scores = |held_out: f64| Scores {
        in_sample: Score { score: held_out + 0.15 },
        held_out: Some(Score { score: held_out }),
    };
    FitScores {
        score: "mean log predictive density per band and sleeper, nats".to_owned(),
        before: scores(before),
        after: scores(after),
        held_out_gain_nats: gains
            .iter()
            .map(|(speed, gain)| ((*speed).to_owned(), *gain))
            .collect(),
    }
}

pub(crate) fn hypothesis(physics: &str, probability: f64, would_separate: &str) -> Hypothesis {
    Hypothesis {
        family: None,
        family_probability: 0.0,
        physics: physics.to_owned(),
        probability,
        accepted: false,
        location: None,
        port: None,
        behaviour: None,
        parameters: BTreeMap::new(),
        assumed: BTreeMap::new(),
        look_alikes: Vec::new(),
        would_separate: would_separate.to_owned(),
        detectability: 9.3 * probability,
        log_evidence: 45.0 * probability - 5.0,
    }
}

pub(crate) fn estimates(values: &[(&str, f64, f64)]) -> BTreeMap<String, Estimate> {
    values.iter().map(|&(name, mean, sd)| (name.to_owned(), Estimate { mean, sd })).collect()
}

/// A recording in which nothing is left out.
pub(crate) fn consistent() -> Diagnosis {
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
        confirmation: None,
        support_changes: Vec::new(),
        loss_of_contact: None,
        notes: vec!["Below 150 Hz a level scatters by 4 dB: what acts only there may stay unseen.".to_owned()],
        sections: Vec::new(),
    }
}

fn at_joint() -> Location {
    Location { x_m: [2.4375, 2.4375], sleepers: vec!["SN18".to_owned(), "SN19".to_owned()] }
}

/// A dipped rail joint between SN18 and SN19, which the baseline fits as soft railpads.
pub(crate) fn left_out() -> Diagnosis {
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
        confirmation: Some(Confirmation {
            passes: vec!["pass-2.parquet".to_owned()],
            speeds: vec![ConfirmedSpeed { speed_km_h: 13.0, before_db: 3.4, after_db: 2.1 }],
            sleepers: 5,
            gain_nats: 41.7,
            is_confirmed: true,
        }),
        loss_of_contact: None,
        notes: vec!["The dip's length is hardly known apart from its depth.".to_owned()],
        ..consistent()
    }
}

/// An effect at SN12 that no kind of the catalogue explains.
pub(crate) fn unknown() -> Diagnosis {
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

/// A sensor whose mounting resonates.
pub(crate) fn chain() -> Diagnosis {
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
