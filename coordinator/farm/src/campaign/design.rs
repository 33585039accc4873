//! Derives a case from its Sobol index. The case depends only on the campaign's seed and the index.

use super::{Campaign, Surfaces};
use std::ops::Range;
use tracktwin_parameters::{Case, ParameterSet, SobolError};

/// Returns the case with this Sobol index.
///
/// # Errors
/// Returns [`SobolError`] if the campaign's sequence has no point with this index.
pub fn case(campaign: &Campaign, index: u32) -> Result<Case, SobolError> {
    let mut one = cases(campaign, index..index + 1)?;
    Ok(one.pop().expect("one index makes one case"))
}

/// Returns the cases with these Sobol indices, in ascending order.
///
/// # Errors
/// Returns [`SobolError`] if the campaign's sequence has no point for one of the indices.
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

/// Seed of an irregularity. It has 63 bits, because integers in SQL are signed.
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
