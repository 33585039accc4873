//! What is drawn for each case besides its parameters: numbers of the design, and extensions.

use crate::Experiment;
use std::collections::BTreeMap;
use tracktwin_parameters::{Case, DesignAxis, TrackDesign, unit};
use tracktwin_track::extension::ExtensionInstance;

impl Experiment {
    /// The design of a case. It depends only on the experiment and on the parameters and seed of the case.
    pub fn design_of(&self, case: &Case) -> TrackDesign {
        self.design_with(|axis| axis.at(unit(draw(case, DESIGN, axis.number.key().as_bytes()))))
    }

    /// The design that is most similar to a stated one: varied numbers have the stated value, or the
    /// nearest end of their range.
    pub fn design_like(&self, stated: &TrackDesign) -> TrackDesign {
        self.design_with(|axis| axis.number.value(stated).clamp(axis.low, axis.high))
    }

    /// The designs at the lower and at the upper end of all ranges.
    pub(crate) fn end_designs(&self) -> [TrackDesign; 2] {
        [0.0, 1.0].map(|share| self.design_with(|axis| axis.at(share)))
    }

    fn design_with(&self, value: impl Fn(&DesignAxis) -> f64) -> TrackDesign {
        let mut design = self.design.clone();
        for axis in &self.design_axes {
            axis.number.set(&mut design, value(axis));
        }
        design
    }

    /// Whether two cases can have different sleeper spacings, and therefore passes of different length.
    pub(crate) fn varies_spacing(&self) -> bool {
        let [low, high] = self.end_designs();
        low.sleeper.spacing_m < high.sleeper.spacing_m
    }

    /// The extensions of a case with their values. They depend only on the experiment and on the
    /// parameters and seed of the case.
    pub fn extensions_of(&self, case: &Case) -> Vec<ExtensionInstance> {
        let seed = |number: usize| draw(case, EXTENSION, &(number as u64).to_le_bytes());
        let numbered = self.extensions.iter().enumerate();
        numbered.filter_map(|(number, extension)| extension.draw(seed(number))).collect()
    }

    /// All values drawn for a case besides its parameters, by name: `vehicle.mass_kg`,
    /// `roughness_spectrum.slope_dB_per_octave`. A second extension of the same kind is `squat#2`.
    pub fn drawn(&self, case: &Case) -> BTreeMap<String, f64> {
        let design = self.design_of(case);
        let numbers = self.design_axes.iter().map(|axis| axis.number);
        let mut drawn: BTreeMap<String, f64> =
            numbers.map(|number| (number.key().to_owned(), number.value(&design))).collect();
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for ExtensionInstance { physics, parameters, .. } in self.extensions_of(case) {
            let count = counts.entry(physics.clone()).or_default();
            *count += 1;
            let kind = if *count == 1 { physics } else { format!("{physics}#{count}") };
            drawn.extend(
                parameters.into_iter().map(|(name, value)| (format!("{kind}.{name}"), value)),
            );
        }
        drawn
    }
}

/// Contexts of the hashes.
const DESIGN: &str = "tracktwin case design 1";
const EXTENSION: &str = "tracktwin case extension 1";

/// Random bits of a case, different for each context and item.
fn draw(case: &Case, context: &str, item: &[u8]) -> u64 {
    let mut hasher = blake3::Hasher::new_derive_key(context);
    hasher.update(case.parameter_hash().as_bytes()).update(item);
    let hash = hasher.finalize();
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has 32 bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracktwin_parameters::{DesignNumber, ParameterSet, Scale};

    fn experiment() -> Experiment {
        let axis = |key, low, high| DesignAxis {
            number: DesignNumber::named(key).unwrap(),
            low,
            high,
            scale: Scale::Linear,
        };
        let mut experiment = Experiment::new(TrackDesign::v_track());
        experiment.design_axes =
            vec![axis("vehicle.mass_kg", 40.0, 48.0), axis("track.sleeper.spacing_m", 0.12, 0.13)];
        experiment
    }

    fn case(index: u32) -> Case {
        Case { index, parameters: ParameterSet::nominal(), surface_seed: u64::from(index) }
    }

    #[test]
    fn the_numbers_of_cases_fill_their_ranges_and_do_not_depend_on_other_axes() {
        let experiment = experiment();
        let masses: Vec<f64> =
            (0..1000).map(|index| experiment.design_of(&case(index)).wheel.mass_kg).collect();
        let mean = masses.iter().sum::<f64>() / 1000.0;
        // Standard deviation of the mean: 8 / sqrt(12) / sqrt(1000) = 0.073.
        assert!((mean - 44.0).abs() < 0.3, "{mean}");
        assert!(masses.iter().all(|mass| (40.0..=48.0).contains(mass)));
        assert!(masses.iter().any(|mass| *mass < 40.1) && masses.iter().any(|mass| *mass > 47.9));
        let fewer = Experiment { design_axes: experiment.design_axes[..1].to_vec(), ..experiment };
        assert_eq!(fewer.design_of(&case(7)).wheel.mass_kg, masses[7]);
        assert_eq!(fewer.design_of(&case(7)).sleeper, TrackDesign::v_track().sleeper);
    }

    #[test]
    fn a_stated_design_is_met_inside_the_ranges_only() {
        let mut stated = TrackDesign::v_track();
        stated.wheel.mass_kg = 46.0;
        stated.sleeper.spacing_m = 0.2;
        stated.wheel.load_n = 1.0;
        let design = experiment().design_like(&stated);
        assert_eq!((design.wheel.mass_kg, design.sleeper.spacing_m), (46.0, 0.13));
        assert_eq!(design.wheel.load_n, TrackDesign::v_track().wheel.load_n);
    }

    #[test]
    fn everything_drawn_has_a_name() {
        let mut experiment = experiment();
        let bolts = r#"{"physics": "sleeper_bolt", "stiffness_N_per_m": [1e7, 5e7]}"#;
        let bolts: tracktwin_track::extension::SampledExtension =
            serde_json::from_str(bolts).unwrap();
        experiment.extensions = vec![bolts.clone(), bolts];
        let drawn = experiment.drawn(&case(3));
        let names: Vec<_> = drawn.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                "sleeper_bolt#2.stiffness_N_per_m",
                "sleeper_bolt.stiffness_N_per_m",
                "track.sleeper.spacing_m",
                "vehicle.mass_kg"
            ]
        );
        assert_eq!(drawn["vehicle.mass_kg"], experiment.design_of(&case(3)).wheel.mass_kg);
        assert_ne!(
            drawn["sleeper_bolt.stiffness_N_per_m"],
            drawn["sleeper_bolt#2.stiffness_N_per_m"]
        );
    }
}
