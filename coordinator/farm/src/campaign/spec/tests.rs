//! Tests of campaign files: valid files are parsed, invalid files are refused.

use super::*;
use tracktwin_track::extension::SampledValue;

fn refusal(change: impl Fn(&str) -> String) -> String {
    Campaign::parse(&change(DEFAULT), "c.toml", None).unwrap_err().to_string()
}

#[test]
fn the_built_in_campaign_is_table_d1_at_the_paper_s_speeds() {
    let campaign = Campaign::built_in(None).unwrap();
    assert_eq!(campaign.definition.space, Preset::VTrack.space());
    assert_eq!(campaign.definition.experiment.speeds_km_h, [7.0, 10.0, 13.0]);
}

#[test]
fn an_unknown_key_is_named_with_its_line() {
    let message = refusal(|text| format!("speeed_km_h = [7]\n{text}"));
    assert!(message.starts_with("c.toml:1: unknown field `speeed_km_h`"), "{message}");
    assert!(message.contains("speeds_km_h") && !message.contains('\n'), "{message}");
}

#[test]
fn a_name_is_one_that_can_be_shown_and_typed() {
    for good in ["v-track", "Gleis 2.1", "Übung_1+"] {
        Campaign::parse(&format!("name = \"{good}\"\nseed = 1\ncases = 1"), "f", None).unwrap();
    }
    for wrong in ["", " ", "-rf", "\\u001b[31mred", "a\\nb", "a/b", &"x".repeat(65)] {
        let text = format!("name = \"{wrong}\"\nseed = 1\ncases = 1");
        let error = Campaign::parse(&text, "f", None).unwrap_err();
        assert!(matches!(error, SpecError::Name { .. }), "{wrong}: {error}");
        assert!(!error.to_string().contains('\u{1b}'), "{error}");
    }
}

#[test]
fn a_reversed_range_is_named() {
    let message =
        refusal(|text| format!("{text}\n[parameters]\nballast_stiffness_N_m = [22e6, 4e6]"));
    assert!(message.starts_with("c.toml: parameters.ballast_stiffness_N_m: "), "{message}");
}

#[test]
fn an_unknown_parameter_is_named_with_the_known_ones() {
    let message = refusal(|text| format!("{text}\n[parameters]\npad_stiffness = [1, 2]"));
    assert!(message.contains("`pad_stiffness`") && message.contains("railpad_stiffness_N_m"));
}

#[test]
fn an_extension_joins_the_experiment_or_is_refused_with_the_reason() {
    let text = format!(
        "{DEFAULT}\n[[extension]]\nphysics = \"hanging_sleeper\"\nsleepers = [19]\n\
             share = 0.5\ngap_m = {{ low = 2e-5, high = 4e-4, scale = \"logarithmic\" }}\n"
    );
    let campaign = Campaign::parse(&text, "c.toml", None).unwrap();
    assert_eq!(campaign.definition.experiment.extensions.len(), 1);
    assert_ne!(campaign.id(), Campaign::built_in(None).unwrap().id());
    let missing = text.replace("gap_m", "gap");
    let message = Campaign::parse(&missing, "c.toml", None).unwrap_err().to_string();
    assert_eq!(
        message,
        "c.toml: extension: hanging_sleeper: has no parameter `gap`; it has gap_m, damping_share"
    );
}

#[test]
fn a_line_has_surfaces_of_different_slope_unless_the_file_states_a_spectrum() {
    let extensions = |text: &str| {
        let campaign = Campaign::parse(text, "c.toml", None).unwrap();
        campaign.definition.experiment.extensions
    };
    assert_eq!(extensions(DEFAULT), []);
    let line = DEFAULT.replace("cases = 800", "cases = 800\npreset = \"60E1-concrete\"");
    let [slope] = <[_; 1]>::try_from(extensions(&line)).unwrap();
    let between = slope.parameters["slope_dB_per_octave"];
    // An exponent that differs by 1.645 changes the power by 4.95 dB an octave.
    let SampledValue::Between([low, high]) = between else { panic!("{between:?}") };
    assert!((high - 4.95).abs() < 0.01 && low == -high, "{low} {high}");
    let own = "\n[[extension]]\nphysics = \"roughness_spectrum\"\nlevel_dB = 1.0\n";
    let [own] = <[_; 1]>::try_from(extensions(&format!("{line}{own}"))).unwrap();
    assert!(!own.parameters.contains_key("slope_dB_per_octave"));
}

#[test]
fn more_cases_than_the_sequence_has_points_need_another_sequence() {
    let many = Some(OWEN_POINTS_MAX + 1);
    let campaign = Campaign::parse(DEFAULT, "c.toml", many).unwrap();
    assert_eq!(campaign.definition.sequence, Sequence::Rotated);
    let text = format!("sequence = \"owen_scrambled\"\n{DEFAULT}");
    let error = Campaign::parse(&text, "c.toml", many).unwrap_err();
    assert!(error.to_string().contains("write `sequence = \"rotated\"`"));
}

#[test]
fn more_cases_leave_the_identity_as_it_was() {
    let few = Campaign::built_in(Some(10)).unwrap();
    let many = Campaign::built_in(Some(1000)).unwrap();
    assert_eq!(few.id(), many.id());
    let other = Campaign::parse(&DEFAULT.replace("seed = 1", "seed = 2"), "", None).unwrap();
    assert_ne!(few.id(), other.id());
}

#[test]
fn numbers_of_the_description_are_axes_or_values() {
    let with = |section: &str| {
        Campaign::parse(&format!("{DEFAULT}\n[parameters]\n{section}"), "c.toml", None)
    };
    let text = "vehicle.mass_kg = [42, 46]\n\"vehicle.load_N\" = 5000\n\
                track.sleeper.spacing_m = { low = 0.12, high = 0.13, scale = \"logarithmic\" }\n\
                ballast_stiffness_N_m = 1e7\n";
    let campaign = with(text).unwrap();
    let definition = &campaign.definition;
    let experiment = &definition.experiment;
    let axes: Vec<_> =
        experiment.design_axes.iter().map(|it| (it.number.key(), it.low, it.high)).collect();
    assert_eq!(axes, [("track.sleeper.spacing_m", 0.12, 0.13), ("vehicle.mass_kg", 42.0, 46.0)]);
    assert_eq!(experiment.design.wheel.load_n, 5000.0);
    assert_eq!(definition.space.axes().len(), 5);
    assert_ne!(campaign.id(), with("ballast_stiffness_N_m = 1e7").unwrap().id());

    for (section, message) in [
        ("vehicle.mas_kg = 44", "`vehicle.mas_kg` is not a number of a track file"),
        ("vehicle.mass_kg = [46, 42]", "parameters.vehicle.mass_kg: the range [46, 42]"),
        ("vehicle.mass_kg = 0.044", "parameters.vehicle.mass_kg: 0.044 kg cannot be"),
        ("vehicle.mass_kg = \"heavy\"", "expected a number, [low, high] or"),
        ("mass_kg = 44", "such as vehicle.mass_kg"),
        ("vehicle.mass_kg = 44\n\"vehicle.mass_kg\" = [42, 46]", "duplicate key `vehicle.mass_kg`"),
        ("track.sleeper.rail_seat_m = [0, 0.3]", "lies outside the half sleeper of 0.24 m"),
    ] {
        let found = with(section).unwrap_err().to_string();
        assert!(found.contains(message) && !found.contains('\n'), "{found}");
    }
}
