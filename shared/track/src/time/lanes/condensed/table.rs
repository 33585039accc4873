//! Coefficients by place; equal coefficients are stored only once.

use crate::time::lanes::block::Block;
use std::collections::HashMap;

/// One value per place. Rails and sleepers are equal from span to span. Values that are stored only once
/// stay in the nearest cache.
#[derive(Clone, Debug)]
pub(super) struct Table<T> {
    values: Vec<T>,
    places: Vec<u32>,
}

/// Values that can be compared by their bits.
pub(super) trait Bits {
    /// The bits of all its numbers.
    fn bits(&self) -> Vec<u64>;
}

impl<T> Table<T> {
    /// The value at a place.
    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> &T {
        &self.values[self.places[place] as usize]
    }
}

impl<T: Bits> FromIterator<T> for Table<T> {
    fn from_iter<I: IntoIterator<Item = T>>(all: I) -> Self {
        let mut known: HashMap<Vec<u64>, u32> = HashMap::new();
        let (mut values, mut places) = (Vec::new(), Vec::new());
        for value in all {
            places.push(*known.entry(value.bits()).or_insert_with(|| {
                values.push(value);
                u32::try_from(values.len() - 1).expect("a track has fewer places")
            }));
        }
        Self { values, places }
    }
}

impl<const N: usize> Bits for [Block; N] {
    fn bits(&self) -> Vec<u64> {
        self.iter().flat_map(|block| block.0).map(f64::to_bits).collect()
    }
}
