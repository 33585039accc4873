//! Extensions whose presence and values differ from case to case of a campaign.

use super::{Extension, ExtensionInstance, InstanceError, Kind};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use tracktwin_parameters::{Scale, TrackDesign, unit};

/// An extension that a share of the cases has. Its values are drawn from their ranges.
///
/// In TOML the parameters are fields of the same table as the name. Each parameter is a number,
/// `[low, high]` or `{ low, high, scale }`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampledExtension {
    /// Name of the kind.
    pub physics: String,
    /// Start and end of the extension along the track in m. Both are equal for a point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x_m: Option<[f64; 2]>,
    /// Indices of the sleepers, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sleepers: Option<Vec<usize>>,
    /// Share of the cases that have the extension, 0 to 1.
    #[serde(default = "every_case")]
    pub share: f64,
    /// Value or range of each parameter, by name.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, SampledValue>,
}

/// A parameter of a [`SampledExtension`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number, [low, high] or { low, high, scale }")]
pub enum SampledValue {
    /// The same value in all cases that have the extension.
    Fixed(f64),
    /// Drawn from a uniform distribution between two values.
    Between([f64; 2]),
    /// Drawn from a distribution between two values that is uniform on the given scale.
    Scaled {
        /// Lowest value.
        low: f64,
        /// Highest value.
        high: f64,
        /// Scale on which the distribution is uniform.
        scale: Scale,
    },
}

const fn every_case() -> f64 {
    1.0
}

impl SampledValue {
    /// The value at a relative position in the range, from 0 (lowest) to 1 (highest).
    fn at(self, share: f64) -> f64 {
        match self {
            Self::Fixed(value) => value,
            Self::Between(range) => Scale::Linear.at(range, share),
            Self::Scaled { low, high, scale } => scale.at([low, high], share),
        }
    }

    /// The invalid value, and the requirement on it: `low` above `high`, or a logarithmic scale whose
    /// `low` is not positive.
    fn fault(self) -> Option<(f64, &'static str)> {
        match self {
            Self::Between([low, high]) | Self::Scaled { low, high, .. } if low > high => {
                Some((high, "at least `low`"))
            }
            Self::Scaled { low, scale: Scale::Logarithmic, .. } if low <= 0.0 => {
                Some((low, "positive on a logarithmic scale"))
            }
            _ => None,
        }
    }
}

impl SampledExtension {
    /// The extension of the case with this seed. `None` if the case has no such extension.
    pub fn draw(&self, seed: u64) -> Option<ExtensionInstance> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut unit = || unit(random.next_u64());
        let present = unit() < self.share;
        // Drawn whether present or not: another share changes no value.
        let instance = self.instance(&mut unit);
        present.then_some(instance)
    }

    /// The extension at the low and at the high end of all its ranges, on a track of this design.
    ///
    /// # Errors
    /// [`InstanceError`] names the invalid kind, share, parameter or place.
    pub fn checked(
        &self,
        design: &TrackDesign,
        spans: usize,
    ) -> Result<[Arc<dyn Extension>; 2], InstanceError> {
        if !(0.0..=1.0).contains(&self.share) {
            return Err(InstanceError::Value {
                physics: self.physics.clone(),
                parameter: "share".to_owned(),
                value: self.share,
                form: "from 0 to 1",
            });
        }
        for (name, value) in &self.parameters {
            if let Some((value, form)) = value.fault() {
                return Err(InstanceError::Value {
                    physics: self.physics.clone(),
                    parameter: name.clone(),
                    value,
                    form,
                });
            }
        }
        self.check_whole()?;
        let built = |end: f64| -> Result<Arc<dyn Extension>, InstanceError> {
            let instance = self.instance(&mut || end);
            instance.check_numbers()?;
            instance.build(design, spans)
        };
        Ok([built(0.0)?, built(1.0)?])
    }

    /// Refuses a range of a parameter that has no value between two of its values.
    fn check_whole(&self) -> Result<(), InstanceError> {
        let kind = Kind::from_name(&self.physics);
        let is_whole = |name: &str| {
            kind.and_then(|kind| kind.parameter(name)).is_some_and(|it| !it.bound.is_continuous())
        };
        let ends = |value: SampledValue| [value.at(0.0), value.at(1.0)];
        let found = self.parameters.iter().find_map(|(name, &value)| {
            let [low, high] = ends(value);
            (low < high && is_whole(name)).then_some((name, high))
        });
        let Some((name, value)) = found else { return Ok(()) };
        Err(InstanceError::Value {
            physics: self.physics.clone(),
            parameter: name.clone(),
            value,
            form: "one number in all cases, not a range, because only some numbers are possible",
        })
    }

    /// The extension with every value at the relative position in its range that `unit` returns.
    fn instance(&self, unit: &mut impl FnMut() -> f64) -> ExtensionInstance {
        let parameters = self.parameters.iter();
        let parameters = parameters.map(|(name, value)| (name.clone(), value.at(unit()))).collect();
        let (physics, sleepers) = (self.physics.clone(), self.sleepers.clone());
        ExtensionInstance { physics, x_m: self.x_m, sleepers, parameters }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voids(share: f64) -> SampledExtension {
        let gap = SampledValue::Scaled { low: 1e-5, high: 1e-3, scale: Scale::Logarithmic };
        SampledExtension {
            physics: "hanging_sleeper".to_owned(),
            x_m: None,
            sleepers: Some(vec![4, 5]),
            share,
            parameters: BTreeMap::from([("gap_m".to_owned(), gap)]),
        }
    }

    #[test]
    fn the_share_of_cases_has_it_and_its_values_fill_their_range() {
        let drawn: Vec<_> = (0..2000).filter_map(|seed| voids(0.5).draw(seed)).collect();
        // 0.011 is one standard error.
        assert!((drawn.len() as f64 / 2000.0 - 0.5).abs() < 0.05, "{}", drawn.len());
        let gaps: Vec<f64> = drawn.iter().map(|void| void.parameters["gap_m"]).collect();
        assert!(gaps.iter().all(|gap| (1e-5..1e-3).contains(gap)));
        let low = gaps.iter().filter(|&&gap| gap < 1e-4).count() as f64;
        assert!((low / gaps.len() as f64 - 0.5).abs() < 0.08, "{low}");
    }

    #[test]
    fn a_case_s_values_depend_on_its_seed_alone() {
        assert_eq!(voids(1.0).draw(7), voids(1.0).draw(7));
        assert_ne!(voids(1.0).draw(7), voids(1.0).draw(8));
        let rare = voids(0.3);
        let seed = (0..100).find(|&seed| rare.draw(seed).is_some()).unwrap();
        assert_eq!(rare.draw(seed), voids(1.0).draw(seed));
    }

    #[test]
    fn it_survives_json_and_what_cannot_be_built_is_refused() {
        let json = serde_json::to_string(&voids(0.5)).unwrap();
        assert_eq!(serde_json::from_str::<SampledExtension>(&json).unwrap(), voids(0.5));
        let design = TrackDesign::v_track();
        voids(0.5).checked(&design, 12).unwrap();
        assert!(voids(1.5).checked(&design, 12).unwrap_err().to_string().contains("share is 1.5"));
        let mut negative = voids(0.5);
        negative.parameters.insert("gap_m".to_owned(), SampledValue::Between([-1e-5, 1e-4]));
        let refusal = negative.checked(&design, 12).unwrap_err().to_string();
        assert!(refusal.contains("gap_m: -1e-5 m is not a valid gap"), "{refusal}");
        // Both ends can be built; what lies between is no number, or is drawn from the wrong end.
        for (low, high) in [(-3.0, 3.0), (3.0, 1.0)] {
            let slope = SampledValue::Scaled { low, high, scale: Scale::Logarithmic };
            let mut rough = voids(0.5);
            rough.physics = "roughness_spectrum".to_owned();
            rough.sleepers = None;
            rough.parameters = BTreeMap::from([("slope_dB_per_octave".to_owned(), slope)]);
            let refusal = rough.checked(&design, 12).unwrap_err().to_string();
            assert!(refusal.contains("slope_dB_per_octave is"), "{refusal}");
        }
        // Between two whole numbers there is none.
        let mut order = voids(0.5);
        order.physics = "wheel_out_of_round".to_owned();
        order.sleepers = None;
        order.parameters = BTreeMap::from([
            ("order".to_owned(), SampledValue::Between([1.0, 20.0])),
            ("amplitude_m".to_owned(), SampledValue::Fixed(1e-5)),
        ]);
        let refusal = order.checked(&design, 12).unwrap_err().to_string();
        assert!(refusal.contains("order is 20 but must be one number in all cases"), "{refusal}");
        order.parameters.insert("order".to_owned(), SampledValue::Between([20.0, 20.0]));
        order.checked(&design, 12).unwrap();
        let mut twice = voids(0.5);
        twice.sleepers = Some(vec![5, 5]);
        let refusal = twice.checked(&design, 12).unwrap_err().to_string();
        assert!(refusal.contains("ascending"), "{refusal}");
    }
}
