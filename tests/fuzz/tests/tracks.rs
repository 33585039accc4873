use super::ITERATIONS;
use tracktwin_parameters::{Parameter, Preset, Track};
use tracktwin_track::model::{Mesh, Support, TrackModel};

/// A description with one changed number defines a track that can be built, or is refused.
#[test]
fn a_track_file_is_understood_or_refused() {
    let lines: Vec<String> =
        Preset::Concrete60E1.track().to_toml().lines().map(str::to_owned).collect();
    bolero::check!(name = "tracks").with_iterations(ITERATIONS).with_type::<(u8, f64)>().for_each(
        |&(place, value)| {
            let mut changed = lines.clone();
            let line = usize::from(place) % changed.len();
            if let Some((key, _)) = lines[line].split_once(" = ") {
                changed[line] = format!("{key} = {value:?}");
            }
            let Ok(track) = Track::parse(&changed.join("\n")) else { return };
            let stiffness = track.nominal[Parameter::RailpadStiffness];
            assert!(stiffness.is_finite() && stiffness > 0.0);
            let supports = [Support::from(&track.nominal); 3];
            TrackModel::build(&track.design, &Mesh::uniform(4, 2, 2), &supports, &[]).unwrap();
        },
    );
}

#[test]
fn any_bytes_are_no_track_or_one() {
    bolero::check!(name = "track-bytes").with_iterations(ITERATIONS).for_each(|bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes);
        assert_eq!(Track::parse(&text), Track::parse(&text));
    });
}
