//! Track and vehicle stated by a recording, and their comparison with a design.

use super::Recording;
use serde_json::{Map, Value, json};
use tracktwin_parameters::{Preset, Track, TrackDesign};

/// Largest relative difference between two tracks that count as equal.
const ALIKE: f64 = 0.02;

/// A quantity that `nominal` of `recording.json` may state.
struct Quantity {
    /// Its object; `None` if it is in `nominal` itself.
    part: Option<&'static str>,
    name: &'static str,
    unit: &'static str,
    of: fn(&mut TrackDesign) -> &mut f64,
}

impl Quantity {
    const fn new(
        part: Option<&'static str>,
        name: &'static str,
        unit: &'static str,
        of: fn(&mut TrackDesign) -> &mut f64,
    ) -> Self {
        Self { part, name, unit, of }
    }

    /// Its place in `recording.json`.
    fn path(&self) -> String {
        match self.part {
            Some(part) => format!("nominal.{part}.{}", self.name),
            None => format!("nominal.{}", self.name),
        }
    }

    fn value(&self, design: &TrackDesign) -> f64 {
        *(self.of)(&mut design.clone())
    }

    fn stated(&self, recording: &Recording) -> Option<f64> {
        match self.part {
            Some(part) => recording.nominal_value(part, self.name),
            None => recording.nominal.get(self.name)?.as_f64(),
        }
    }
}

pub(super) const RAIL: Option<&str> = Some("rail");
pub(super) const SLEEPER: Option<&str> = Some("sleeper");
pub(super) const WHEEL: Option<&str> = Some("wheel");

/// All quantities, in the order in which they are compared.
const QUANTITIES: [Quantity; 15] = [
    Quantity::new(SLEEPER, "spacing_m", "m", |it| &mut it.sleeper.spacing_m),
    Quantity::new(RAIL, "area_m2", "m2", |it| &mut it.rail.area_m2),
    Quantity::new(RAIL, "second_moment_m4", "m4", |it| &mut it.rail.second_moment_m4),
    Quantity::new(RAIL, "youngs_Pa", "Pa", |it| &mut it.rail.youngs_modulus_pa),
    Quantity::new(RAIL, "density_kg_m3", "kg/m3", |it| &mut it.rail.density_kg_m3),
    Quantity::new(RAIL, "poisson", "", |it| &mut it.rail.poisson),
    Quantity::new(RAIL, "shear_coefficient", "", |it| &mut it.rail.shear_coefficient),
    Quantity::new(SLEEPER, "half_length_m", "m", |it| &mut it.sleeper.half_length_m),
    Quantity::new(SLEEPER, "rail_seat_m", "m", |it| &mut it.sleeper.rail_seat_m),
    Quantity::new(SLEEPER, "area_m2", "m2", |it| &mut it.sleeper.section.area_m2),
    Quantity::new(SLEEPER, "density_kg_m3", "kg/m3", |it| &mut it.sleeper.section.density_kg_m3),
    Quantity::new(None, "railhead_radius_m", "m", |it| &mut it.railhead_radius_m),
    Quantity::new(WHEEL, "mass_kg", "kg", |it| &mut it.wheel.mass_kg),
    Quantity::new(WHEEL, "load_N", "N", |it| &mut it.wheel.load_n),
    Quantity::new(WHEEL, "radius_m", "m", |it| &mut it.wheel.radius_m),
];

/// Further quantities that a recording may state. They are not compared: the bending stiffness of the
/// sleeper is one of the parameters, and the damping of the rail is seldom known.
const FURTHER: [Quantity; 5] = [
    Quantity::new(None, "rail_damping_s", "s", |it| &mut it.rail_damping_s),
    Quantity::new(SLEEPER, "second_moment_m4", "m4", |it| &mut it.sleeper.section.second_moment_m4),
    Quantity::new(SLEEPER, "youngs_Pa", "Pa", |it| &mut it.sleeper.section.youngs_modulus_pa),
    Quantity::new(SLEEPER, "poisson", "", |it| &mut it.sleeper.section.poisson),
    Quantity::new(SLEEPER, "shear_coefficient", "", |it| &mut it.sleeper.section.shear_coefficient),
];

/// Quantities that a recording must state to be recognised as a recording of a preset.
const MASSES: [(&str, &str); 2] = [("rail", "area_m2"), ("wheel", "mass_kg")];

/// Distance in m between the recorded wheel and the other wheel of its bogie, which runs behind it.
pub(super) const WHEELBASE: &str = "wheelbase_m";

/// Names in `nominal` of what is no number, each with its object.
const NAMES: [(Option<&str>, &str); 2] = [(RAIL, "profile"), (None, "gain_known")];

/// Names of all numbers that `nominal` may have, each with its object.
pub(super) fn numbers() -> impl Iterator<Item = (Option<&'static str>, &'static str)> {
    let quantities = QUANTITIES.iter().chain(&FURTHER).map(|it| (it.part, it.name));
    quantities.chain([(WHEEL, WHEELBASE)])
}

/// A doubt for each name in `nominal` that is not known: its value is not used.
pub(super) fn doubts_on_names(nominal: &Map<String, Value>) -> Vec<String> {
    let known: Vec<(Option<&str>, &str)> = numbers().chain(NAMES).collect();
    let doubts_of = |part: Option<&str>, fields: &Map<String, Value>| -> Vec<String> {
        let of_part = known.iter().filter(|(of, _)| *of == part);
        let names: Vec<&str> = of_part.map(|(_, name)| *name).collect();
        let is_part = |name: &str| part.is_none() && [RAIL, SLEEPER, WHEEL].contains(&Some(name));
        let unknown =
            fields.keys().filter(|name| !names.contains(&name.as_str()) && !is_part(name));
        let path = part.map_or("nominal".to_owned(), |part| format!("nominal.{part}"));
        let doubt = |name: &String| {
            let known = names.join(", ");
            format!(
                "doubt: recording.json: {path}.{name} is not known, so its value is not used; known are {known}"
            )
        };
        unknown.map(doubt).collect()
    };
    let parts = [RAIL, SLEEPER, WHEEL].into_iter().flatten();
    let fields = parts.filter_map(|part| Some((Some(part), nominal.get(part)?.as_object()?)));
    let all = std::iter::once((None, nominal)).chain(fields);
    all.flat_map(|(part, fields)| doubts_of(part, fields)).collect()
}

/// A quantity in which two tracks differ by more than 2 %.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{quantity} {}, not {}", with_unit(*found, unit), with_unit(*known, unit))]
pub struct OtherTrack {
    /// Name of the quantity, with a verb: `nominal.wheel.mass_kg is`.
    pub quantity: String,
    /// Value of the quantity on the checked track.
    pub found: f64,
    /// Value of the quantity on the reference track.
    pub known: f64,
    /// Unit of both; empty for a plain number.
    pub unit: &'static str,
}

impl OtherTrack {
    /// The value found, with its unit.
    pub fn found(&self) -> String {
        with_unit(self.found, self.unit)
    }

    /// The value known, with its unit.
    pub fn known(&self) -> String {
        with_unit(self.known, self.unit)
    }

    fn new(quantity: String, found: f64, known: f64, unit: &'static str) -> Result<(), Self> {
        // What is not a number is not alike either.
        if (found - known).abs() <= ALIKE * known.abs() {
            return Ok(());
        }
        Err(Self { quantity, found, known, unit })
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{value} {unit}").trim_end().to_owned()
}

impl Recording {
    /// Compares the stated track and vehicle, and the distances of the sleepers, with a design.
    /// Quantities that the recording does not state are not compared.
    ///
    /// # Errors
    /// [`OtherTrack`] with the first quantity that differs by more than 2 %.
    pub fn check_track(&self, design: &TrackDesign) -> Result<(), OtherTrack> {
        let spacing_m = design.sleeper.spacing_m;
        let quantity = "nominal.sleeper.spacing_m is".to_owned();
        OtherTrack::new(quantity, self.spacing_m, spacing_m, "m")?;
        if let Some(distance_m) = self.median_distance_m() {
            // To a tenth of a millimetre, as a message can show it.
            let distance_m = (1e4 * distance_m).round() / 1e4;
            let quantity = "the sleeper spacing in the recording is".to_owned();
            OtherTrack::new(quantity, distance_m, spacing_m, "m")?;
        }
        for quantity in &QUANTITIES {
            if let Some(found) = quantity.stated(self) {
                let known = quantity.value(design);
                OtherTrack::new(format!("{} is", quantity.path()), found, known, quantity.unit)?;
            }
        }
        Ok(())
    }

    /// The track and vehicle that the recording states. Missing values come from the preset with the
    /// most similar sleeper spacing.
    pub fn stated_track(&self) -> StatedTrack {
        // A preset is recognised by its masses: a spacing alone could be any track's.
        let states_masses = MASSES.iter().all(|key| self.states(*key));
        let recognised = Preset::ALL
            .iter()
            .find(|preset| states_masses && self.check_track(&preset.design()).is_ok());
        let preset = recognised.copied().unwrap_or(Preset::like(self.spacing_m));
        let known = preset.track();
        let mut design = known.design.clone();
        let mut assumed = Vec::new();
        let differs = self.check_track(&design).is_err();
        for quantity in QUANTITIES.iter().chain(&FURTHER) {
            match quantity.stated(self) {
                // What is V-Track's to two per cent is V-Track's.
                Some(value) if differs || preset != Preset::VTrack => {
                    *(quantity.of)(&mut design) = value;
                }
                Some(_) => (),
                None => assumed.push(quantity.path()),
            }
        }
        design.sleeper.spacing_m = if differs { self.spacing_m } else { design.sleeper.spacing_m };
        match self.nominal.get("wheel").and_then(|wheel| wheel.get(WHEELBASE)) {
            Some(wheelbase) => {
                design.wheel.further_wheels_m =
                    wheelbase.as_f64().map(|metres| -metres.abs()).into_iter().collect();
            }
            None if preset == Preset::VTrack => (),
            None => assumed.push(format!("nominal.wheel.{WHEELBASE}")),
        }
        let track = if design == known.design { known } else { known.with_design(design) };
        StatedTrack { track, preset, assumed }
    }

    fn states(&self, (part, name): (&str, &str)) -> bool {
        self.nominal_value(part, name).is_some()
    }
}

/// A track that a recording states.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedTrack {
    /// The track.
    pub track: Track,
    /// Preset from which the missing values come.
    pub preset: Preset,
    /// Keys that `recording.json` does not state.
    pub assumed: Vec<String>,
}

/// Compares two designs in all quantities that a recording can state.
///
/// # Errors
/// [`OtherTrack`] with the first quantity in which `found` differs from `known` by more than 2 %.
pub fn compare_designs(found: &TrackDesign, known: &TrackDesign) -> Result<(), OtherTrack> {
    QUANTITIES.iter().try_for_each(|quantity| {
        let [found, known] = [found, known].map(|design| quantity.value(design));
        OtherTrack::new(format!("{} is", quantity.path()), found, known, quantity.unit)
    })
}

/// The content of `nominal` in `recording.json` for a track of this design.
pub fn nominal(design: &TrackDesign) -> Map<String, Value> {
    let mut nominal = json!({});
    for quantity in QUANTITIES.iter().chain(&FURTHER) {
        let value = json!(quantity.value(design));
        match quantity.part {
            Some(part) => nominal[part][quantity.name] = value,
            None => nominal[quantity.name] = value,
        }
    }
    // Null: it is known that there is no other wheel.
    if *design != TrackDesign::v_track() {
        let wheelbase_m = design.wheel.further_wheels_m.first().map(|ahead_m| ahead_m.abs());
        nominal["wheel"][WHEELBASE] = json!(wheelbase_m);
    }
    match nominal {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Sleeper;

    fn recording() -> Recording {
        let sleeper =
            |place: u32| Sleeper { id: format!("SN{place}"), x_m: 0.125 * f64::from(place) };
        Recording {
            name: "rig".to_owned(),
            sample_rate_hz: 1e4,
            channel: String::new(),
            passes: Vec::new(),
            sleepers: (0..5).map(sleeper).collect(),
            nominal: nominal(&TrackDesign::v_track()),
            spacing_m: 0.125,
            doubts: Vec::new(),
        }
    }

    #[test]
    fn a_misspelt_name_is_doubted() {
        let mut nominal = nominal(&TrackDesign::v_track());
        nominal.insert("gain_known".to_owned(), json!(true));
        assert_eq!(doubts_on_names(&nominal), [""; 0]);
        nominal["wheel"]["mass"] = json!(44.0);
        nominal.insert("weel".to_owned(), json!({}));
        let [top, wheel] = &doubts_on_names(&nominal)[..] else { panic!("{nominal:?}") };
        assert!(top.starts_with("doubt: recording.json: nominal.weel is not known"), "{top}");
        assert!(wheel.contains("nominal.wheel.mass is not known"), "{wheel}");
        assert!(wheel.ends_with("known are mass_kg, load_N, radius_m, wheelbase_m"), "{wheel}");
    }

    #[test]
    fn every_quantity_that_a_recording_states_is_compared() {
        let v_track = TrackDesign::v_track();
        assert_eq!(recording().check_track(&v_track), Ok(()));
        // V-Track's rail seat is at the middle of the sleeper: no factor changes that.
        for quantity in QUANTITIES.iter().filter(|quantity| quantity.value(&v_track) > 0.0) {
            for (factor, is_alike) in [(1.019, true), (0.981, true), (1.021, false), (0.979, false)]
            {
                let mut recording = recording();
                let known = quantity.value(&v_track);
                let part = quantity.part.map(|part| recording.nominal.get_mut(part));
                let fields = match part {
                    Some(part) => part.and_then(Value::as_object_mut).unwrap(),
                    None => &mut recording.nominal,
                };
                fields.insert(quantity.name.to_owned(), json!(factor * known));
                let found = recording.check_track(&v_track);
                assert_eq!(found.is_ok(), is_alike, "{} × {factor}: {found:?}", quantity.path());
                if let Err(other) = found {
                    assert_eq!(other.quantity, format!("{} is", quantity.path()));
                    assert_eq!((other.found, other.known), (factor * known, known));
                }
            }
        }
    }

    #[test]
    fn what_a_recording_does_not_state_is_not_compared() {
        let silent = Recording { nominal: Map::new(), ..recording() };
        assert_eq!(silent.check_track(&TrackDesign::v_track()), Ok(()));
        let enlarged = silent.check_track(&TrackDesign::v_track().enlarged(5.0)).unwrap_err();
        assert_eq!(enlarged.to_string(), "nominal.sleeper.spacing_m is 0.125 m, not 0.625 m");
        let mut far = recording();
        far.sleepers.iter_mut().for_each(|sleeper| sleeper.x_m *= 1.12);
        let far = far.check_track(&TrackDesign::v_track()).unwrap_err().to_string();
        assert_eq!(far, "the sleeper spacing in the recording is 0.14 m, not 0.125 m");
    }

    #[test]
    fn a_recording_that_states_a_whole_design_assumes_nothing() {
        for preset in Preset::ALL {
            let mut design = preset.design();
            design.sleeper.section.youngs_modulus_pa *= 1.5;
            design.rail_damping_s *= 2.0;
            let spacing_m = design.sleeper.spacing_m;
            let recording = Recording {
                nominal: nominal(&design),
                sleepers: Vec::new(),
                spacing_m,
                ..recording()
            };
            let StatedTrack { track, assumed, .. } = recording.stated_track();
            assert_eq!(assumed, Vec::<String>::new(), "{}", preset.name());
            if *preset != Preset::VTrack {
                assert_eq!(track.design, design);
            }
        }
    }

    #[test]
    fn designs_of_two_scales_differ() {
        let v_track = TrackDesign::v_track();
        assert_eq!(compare_designs(&v_track, &v_track), Ok(()));
        let other = compare_designs(&v_track.enlarged(5.0), &v_track).unwrap_err();
        assert_eq!((other.found, other.known), (0.625, 0.125));
    }
}
