//! One value for every parameter.

use crate::Parameter;
use std::ops::{Index, IndexMut};

/// A value for every parameter of the catalogue, in SI units (see [`Parameter::unit`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterSet([f64; Parameter::COUNT]);

impl ParameterSet {
    /// The set of these values, in catalogue order.
    pub const fn new(values: [f64; Parameter::COUNT]) -> Self {
        Self(values)
    }

    /// Every parameter at its nominal value.
    pub fn nominal() -> Self {
        Self(std::array::from_fn(|index| Parameter::ALL[index].nominal()))
    }

    /// The set with one value changed.
    #[must_use]
    pub fn with(mut self, parameter: Parameter, value: f64) -> Self {
        self[parameter] = value;
        self
    }

    /// The values, in catalogue order.
    pub const fn values(&self) -> &[f64; Parameter::COUNT] {
        &self.0
    }

    /// Parameters and values, in catalogue order.
    pub fn iter(&self) -> impl Iterator<Item = (Parameter, f64)> + '_ {
        Parameter::ALL.iter().copied().zip(self.0)
    }
}

impl Default for ParameterSet {
    fn default() -> Self {
        Self::nominal()
    }
}

impl Index<Parameter> for ParameterSet {
    type Output = f64;

    fn index(&self, parameter: Parameter) -> &f64 {
        &self.0[parameter.index()]
    }
}

impl IndexMut<Parameter> for ParameterSet {
    fn index_mut(&mut self, parameter: Parameter) -> &mut f64 {
        &mut self.0[parameter.index()]
    }
}
