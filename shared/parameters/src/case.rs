//! One case of a campaign: a parameter set and the seed of the surface it is simulated on.

use crate::ParameterSet;

/// Input of one simulation: its position in the campaign, and everything that determines its
/// result.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Index in the Sobol sequence of the campaign.
    pub index: u32,
    /// Parameters of the track, equal at every sleeper.
    pub parameters: ParameterSet,
    /// Seed of the irregularity. It is below 2^63, the range of the signed integers of SQL.
    pub surface_seed: u64,
}

impl Case {
    /// Hash of parameter names, values and seed: 32 hexadecimal digits of BLAKE3.
    ///
    /// 128 bits distinguish any two cases and keep a database of a million rows small.
    pub fn parameter_hash(&self) -> String {
        let mut hasher = blake3::Hasher::new_derive_key("tracktwin case parameters 1");
        for (parameter, value) in self.parameters.iter() {
            hasher.update(parameter.name().as_bytes()).update(&value.to_be_bytes());
        }
        hasher.update(&self.surface_seed.to_be_bytes());
        hasher.finalize().to_hex()[..32].to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameter;

    #[test]
    fn the_hash_tells_parameters_and_seeds_apart_but_not_places() {
        let case = Case { index: 1, parameters: ParameterSet::nominal(), surface_seed: 7 };
        let hash = case.parameter_hash();
        assert_eq!(hash, Case { index: 2, ..case.clone() }.parameter_hash());
        assert_ne!(hash, Case { surface_seed: 8, ..case.clone() }.parameter_hash());
        for &parameter in Parameter::ALL {
            let value = case.parameters[parameter].next_up();
            let nudged = Case { parameters: case.parameters.with(parameter, value), ..case };
            assert_ne!(hash, nudged.parameter_hash(), "{parameter}");
        }
    }
}
