//! Space-filling points: a function of index, dimension and seed alone.

use crate::unit;
use serde::{Deserialize, Serialize};

/// Number of points of the Owen-scrambled sequence. Beyond this number `sobol_burley` repeats its points
/// without an error.
pub const OWEN_POINTS_MAX: u32 = 1 << 16;

/// Largest number of axes of a campaign: that of the small table of direction numbers of Joe and Kuo.
const DIMENSIONS_MAX: usize = 100;

/// Sobol sequence of the points of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sequence {
    /// Owen-scrambled, at most [`OWEN_POINTS_MAX`] points.
    OwenScrambled,
    /// Joe and Kuo's points, rotated (modulo 1) by a vector drawn from the seed; 2^32 points.
    Rotated,
}

/// A point that the sequence does not have.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum SobolError {
    /// The Owen-scrambled sequence would repeat.
    #[error(
        "index {index} exceeds the {OWEN_POINTS_MAX} points of the owen_scrambled sequence; \
             set `sequence = \"rotated\"` in the campaign"
    )]
    Exhausted {
        /// The requested index.
        index: u32,
    },
    /// More dimensions than the sequence has.
    #[error("{dimensions} axes exceed the limit of the Sobol sequence ({DIMENSIONS_MAX})")]
    TooManyDimensions {
        /// The requested number of dimensions.
        dimensions: usize,
    },
}

impl Sequence {
    /// The default sequence of a campaign with this number of cases.
    pub const fn for_cases(cases: u32) -> Self {
        if cases <= OWEN_POINTS_MAX { Self::OwenScrambled } else { Self::Rotated }
    }

    /// Coordinates in [0, 1) of the points with these indices: one `Vec` of length `dimensions` per
    /// point.
    ///
    /// # Errors
    /// [`SobolError`] if the sequence has no such point.
    pub fn points(
        self,
        indices: std::ops::Range<u32>,
        dimensions: usize,
        seed: u64,
    ) -> Result<Vec<Vec<f64>>, SobolError> {
        if dimensions > DIMENSIONS_MAX {
            return Err(SobolError::TooManyDimensions { dimensions });
        }
        match self {
            Self::OwenScrambled => {
                if !indices.is_empty() && indices.end > OWEN_POINTS_MAX {
                    return Err(SobolError::Exhausted { index: indices.end - 1 });
                }
                Ok(indices.map(|index| owen_point(index, dimensions, seed)).collect())
            }
            Self::Rotated => Ok(rotated_points(indices, dimensions, seed)),
        }
    }
}

fn owen_point(index: u32, dimensions: usize, seed: u64) -> Vec<f64> {
    let seed = fold(seed);
    (0..dimensions)
        .map(|dimension| {
            let dimension = u32::try_from(dimension).expect("checked against the maximum");
            f64::from(sobol_burley::sample(index, dimension, seed))
        })
        .collect()
}

fn rotated_points(indices: std::ops::Range<u32>, dimensions: usize, seed: u64) -> Vec<Vec<f64>> {
    let parameters = sobol::params::JoeKuoD6::minimal();
    let rotation: Vec<f64> = (0..dimensions).map(|axis| rotation(seed, axis as u64)).collect();
    sobol::Sobol::<f64>::new(dimensions, &parameters)
        .skip(indices.start as usize)
        .take(indices.len())
        .map(|point| point.iter().zip(&rotation).map(|(x, r)| (x + r).fract()).collect())
        .collect()
}

/// 64 bits of seed in the 32 that `sobol_burley` takes.
fn fold(seed: u64) -> u32 {
    let mixed = mix(seed);
    u32::try_from(mixed >> 32).expect("32 bits are left")
}

/// A number in [0, 1) from a seed and a stream.
fn rotation(seed: u64, stream: u64) -> f64 {
    unit(mix(mix(seed) ^ stream))
}

/// Finaliser of `SplitMix64` (Steele, Lea & Flood 2014): every bit of the input reaches every bit.
pub(crate) fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn owen_scrambling_refuses_to_repeat_itself() {
        let beyond = OWEN_POINTS_MAX..OWEN_POINTS_MAX + 1;
        let error = Sequence::OwenScrambled.points(beyond.clone(), 6, 1).unwrap_err();
        assert_eq!(error, SobolError::Exhausted { index: OWEN_POINTS_MAX });
        assert_eq!(Sequence::Rotated.points(beyond, 6, 1).unwrap().len(), 1);
    }

    #[test]
    fn both_sequences_fill_every_axis_evenly() {
        for sequence in [Sequence::OwenScrambled, Sequence::Rotated] {
            let points = sequence.points(0..1024, 6, 7).unwrap();
            for axis in 0..6 {
                let mut counts = [0_usize; 16];
                for point in &points {
                    counts[(point[axis] * 16.0) as usize] += 1;
                }
                // Rotation may move one point of each stratum over its edge.
                assert!(counts.iter().all(|&count| count.abs_diff(64) <= 1), "{sequence:?}");
            }
        }
    }

    #[test]
    fn a_point_does_not_depend_on_the_range_it_is_asked_in() {
        for sequence in [Sequence::OwenScrambled, Sequence::Rotated] {
            let all = sequence.points(0..50, 6, 3).unwrap();
            assert_eq!(sequence.points(30..40, 6, 3).unwrap(), all[30..40]);
        }
    }

    proptest! {
        #[test]
        fn an_axis_does_not_depend_on_how_many_follow(index in 0..OWEN_POINTS_MAX, seed: u64) {
            for sequence in [Sequence::OwenScrambled, Sequence::Rotated] {
                let index = if sequence == Sequence::Rotated { index % 500 } else { index };
                let few = sequence.points(index..index + 1, 6, seed).unwrap();
                let many = sequence.points(index..index + 1, 9, seed).unwrap();
                prop_assert_eq!(&few[0][..], &many[0][..6]);
                prop_assert!(many[0].iter().all(|x| (0.0..1.0).contains(x)));
            }
        }
    }
}
