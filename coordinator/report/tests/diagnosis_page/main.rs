//! Pages of constructed diagnoses: required content, and no external resources. The pages are kept in the
//! target folder for visual inspection.

mod examples;
mod improvement;

use self::examples::{SLEEPERS, chain, consistent, estimates, hypothesis, left_out, unknown};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use tracktwin_diagnosis::{Diagnosis, Levels, SectionVerdict, SleeperValues, Verdict};
use tracktwin_report::{Origin, diagnosis_page};

/// The page, after a check for external resources. It is also written to the target folder.
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

/// Number of charts whose title contains `text`.
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

/// The sentence of the result in the form that the page contains.
fn unbroken(diagnosis: &Diagnosis) -> String {
    diagnosis.sentence.replace(" %", "\u{a0}%")
}

#[test]
fn left_out_physics_is_named_placed_measured_and_its_bias_shown() {
    let diagnosis = left_out();
    let page = page("left-out", &diagnosis);
    assert_reads(&page, &[&unbroken(&diagnosis), "left-out physics", "93 %", "✓ accepted"]);
    assert_reads(&page, &["SN18 and SN19, 2.438 m", "Look-alikes: squat", "the dip's part moves"]);
    assert_reads(&page, &["depth of the dip", "82 µm", "61 to 103 µm", "0.15"]);
    assert_reads(&page, &["84 MN/m", "152 MN/m", "−45 %", "sleeper bending stiffness", "+38 %"]);
    assert_reads(&page, &["449 to 1425 Hz", "below 0.001", "+41.7", "3 of 3"]);
    // Before and after at each speed, a chart a speed at the place, three along the track.
    assert_eq!(charts(&page, "before, re-tuned track only"), 3);
    assert_eq!(charts(&page, "after, with rail joint"), 3);
    assert_eq!(charts(&page, "13 km/h, SN18") + charts(&page, "13 km/h, SN19"), 1);
    assert_eq!(page.matches("class=\"line box").count(), 6);
    assert!(!page.contains("sleeper bolt"), "what is improbable is counted, not listed");
    assert_reads(&page, &["1 further hypothesis is"]);
    assert_reads(&page, &["pass-2.parquet", "They confirm it", "by 42 nats", "3.4 dB", "2.1 dB"]);
}

#[test]
fn the_sections_of_a_long_track_have_their_verdicts_and_pages() {
    let section = |number: usize, sleepers: [&str; 2], diagnosis: &Diagnosis| SectionVerdict {
        number,
        sleepers: sleepers.map(str::to_owned),
        verdict: diagnosis.verdict,
        sentence: diagnosis.sentence.clone(),
        nothing_left_out: diagnosis.nothing_left_out,
    };
    let mut diagnosis = left_out();
    assert!(!page("left-out", &diagnosis).contains("Sections"));
    diagnosis.sections =
        vec![section(1, ["SN1", "SN30"], &consistent()), section(2, ["SN25", "SN54"], &left_out())];
    let page = page("sections", &diagnosis);
    assert_reads(&page, &["Sections", "sections/02/report.html", "SN25 to SN54", "SN1 to SN30"]);
    assert_eq!(page.matches("tag consistent").count(), 1);
    assert_eq!(page.matches("tag left-out").count(), 2);
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
        &["No difference is better explained by left-out physics", "does not exclude"],
    );
    assert_reads(
        &page,
        &[
            "of all levels lie within twice the expected scatter",
            "2871 levels",
            "29 sleepers, 100 to 4032 Hz",
        ],
    );
    assert!(!page.contains("<tbody></tbody>") && !page.contains("✓ accepted"));
    assert!(!page.contains("after, with") && !page.contains("Estimated parameters"));
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
    assert!(!page.contains("✓ accepted") && !page.contains("Estimated parameters"));
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
    flat.assumed = [("depth_m".to_owned(), 2e-5)].into();
    let page = page(
        "wheel-flat",
        &Diagnosis { verdict: Verdict::LeftOutPhysics, hypotheses: vec![flat], ..consistent() },
    );
    assert_reads(&page, &["found in the passes alone; probability by chance below 0.001"]);
    assert_reads(&page, &["The predictions on this page do not include it", "3.1 mm", "over 99 %"]);
    assert_reads(&page, &["20.0 µm", "assumed"]);
    for claim in ["after, with", "d′ 0.0", "withheld speeds are predicted better"] {
        assert!(!page.contains(claim), "{claim}");
    }
}

#[test]
fn a_fault_of_the_measuring_chain_is_not_called_physics() {
    let page = page("chain", &chain());
    assert_reads(
        &page,
        &["measuring chain", "not in the track", "in the measuring chain", "over 99 %"],
    );
    assert_reads(&page, &["3213 Hz", "all along the track, 2540 to 4032 Hz"]);
    assert_reads(&page, &["13 km/h, mean over all sleepers", "probability of this fault"]);
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
    assert_reads(&page, &["With a single speed no speed could be withheld"]);
    assert!(!page.contains("gain when withheld"));
}

#[test]
fn passes_alone_without_a_fit_have_no_scores() {
    let mut alone = Diagnosis { levels: Levels::default(), track: Vec::new(), ..chain() };
    alone.fit.before.held_out = None;
    alone.fit.after.held_out = None;
    alone.fit.held_out_gain_nats.clear();
    let page = page("alone", &alone);
    assert_reads(&page, &["nothing was fitted"]);
    assert!(!page.contains("withheld"), "nothing was withheld");
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

/// Collects the names of the fields of a document, each with the fields that contain it.
fn fields(value: &Value, name: &str, all: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (field, value) in fields {
                let name = format!("{name}.{field}");
                self::fields(value, &name, all);
                all.insert(name);
            }
        }
        Value::Array(values) => values.iter().for_each(|it| fields(it, &format!("{name}[]"), all)),
        _ => {}
    }
}

#[test]
fn a_diagnosis_has_the_fields_that_are_kept() {
    let mut all = BTreeSet::new();
    for diagnosis in [left_out(), consistent(), unknown(), chain()] {
        fields(&serde_json::to_value(diagnosis).expect("a diagnosis is JSON"), "", &mut all);
    }
    let lines: Vec<String> = all.into_iter().map(|name| name + "\n").collect();
    test_needs::assert_snapshot("diagnosis-fields.txt", &lines.concat());
}
