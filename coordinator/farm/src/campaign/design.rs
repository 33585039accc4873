//! From an index to a case: a function of the campaign's seed and the index alone.

use super::{Campaign, Surfaces};
use std::ops::Range;
use tracktwin_parameters::{Case, ParameterSet, SobolError};

/// The case with this index.
///
/// # Errors
/// [`SobolError`] when the campaign's sequence has no such point.
pub fn case(campaign: &Campaign, index: u32) -> Result<Case, SobolError> {
    let mut one = cases(campaign, index..index + 1)?;
    Ok(one.pop().expect("one index makes one case"))
}

/// The cases with these indices.
///
/// # Errors
/// [`SobolError`] when the campaign's sequence has no such points.
pub fn cases(campaign: &Campaign, indices: Range<u32>) -> Result<Vec<Case>, SobolError> {
    let definition = &campaign.definition;
    let fixed = ParameterSet::new(definition.fixed);
    let axes = definition.space.axes().len();
    let points = definition.sequence.points(indices.clone(), axes, definition.seed)?;
    Ok(indices
        .zip(points)
        .map(|(index, point)| Case {
            index,
            parameters: definition.space.values(&point, &fixed),
            surface_seed: surface_seed(
                definition.seed,
                match definition.surfaces {
                    Surfaces::PerCase => index,
                    Surfaces::Shared => 0,
                },
            ),
        })
        .collect())
}

/// The seed of an irregularity: 63 bits, so that SQL's signed integers hold it.
fn surface_seed(campaign_seed: u64, number: u32) -> u64 {
    let mut hasher = blake3::Hasher::new_derive_key("tracktwin surface seed 1");
    hasher.update(&campaign_seed.to_le_bytes()).update(&number.to_le_bytes());
    let hash = hasher.finalize();
    let bytes = hash.as_bytes().first_chunk::<8>().expect("a hash has 32 bytes");
    u64::from_le_bytes(*bytes) >> 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_does_not_depend_on_the_others() {
        let campaign = Campaign::built_in(Some(100)).unwrap();
        let all = cases(&campaign, 0..100).unwrap();
        for index in [0, 17, 99] {
            let alone = case(&campaign, index).unwrap();
            assert_eq!(alone.parameters, all[index as usize].parameters);
            assert_eq!(alone.surface_seed, all[index as usize].surface_seed);
        }
    }

    #[test]
    fn no_two_cases_share_a_surface() {
        let campaign = Campaign::built_in(Some(2000)).unwrap();
        let mut seeds: Vec<_> =
            cases(&campaign, 0..2000).unwrap().iter().map(|case| case.surface_seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 2000);
    }
}
