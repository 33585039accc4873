//! The page of an improvement.

use super::assert_reads;
use super::examples::left_out;
use serde_json::{Value, json};
use tracktwin_report::{Improvement, improvement_page};

fn evaluation(sleepers: &[(&str, f64)]) -> Value {
    let sleeper = |(id, railpad): &(&str, f64)| {
        json!({
            "id": id, "x_m": 2.5,
            "railpad_stiffness_N_m": {"mean": railpad, "sd": 1.2e7},
            "ballast_stiffness_N_m": {"mean": 1.1e7, "sd": 6e5},
        })
    };
    json!({"method": "inversion", "sleepers": sleepers.iter().map(sleeper).collect::<Vec<_>>()})
}

#[test]
fn estimates_stand_before_and_after_and_the_place_in_bold() {
    let diagnosis = left_out();
    let before = evaluation(&[("SN17", 1.5e8), ("SN18", 8.4e7), ("SN40", 1e8)]);
    let after = evaluation(&[("SN17", 1.52e8), ("SN18", 1.53e8)]);
    let improvement = Improvement::new(&diagnosis, &before, &after).unwrap();
    let places: Vec<_> =
        improvement.sleepers.iter().map(|it| (it.id.as_str(), it.is_at_place)).collect();
    assert_eq!(places, [("SN17", false), ("SN18", true)]);
    assert_eq!(improvement.physics, ["rail_joint"]);
    assert_eq!(improvement.method, "inversion");
    let page = improvement_page(&improvement, &diagnosis);
    assert_reads(
        &page,
        &["<b>SN18</b>", "84.0 ± 12", "153 ± 12", "11.0 ± 0.60", "They confirm it"],
    );
    assert_reads(&page, &["Estimates of the inversion"]);
    assert_reads(&page, &["href=\"before/report.html\"", "href=\"after/report.html\""]);
    let document = serde_json::to_value(&improvement).unwrap();
    assert_eq!(document["format"], "tracktwin-improvement/1");
    assert_eq!(document["sleepers"][1]["railpad_stiffness_N_m"]["after"]["mean"], 1.53e8);

    assert_eq!(Improvement::new(&diagnosis, &before, &evaluation(&[("SN3", 1e8)])), None);
}
