//! Numbers on the command line, checked against the range of their quantity.

use std::num::NonZeroUsize;
use tracktwin_parameters::{Quantity, QuantityError};

/// Parses an argument that is a quantity.
pub(super) fn number(
    of: Quantity,
) -> impl Fn(&str) -> Result<f64, QuantityError> + Clone + Send + Sync + 'static {
    move |text| of.parse(text)
}

/// Parses a count.
pub(super) fn count<T: TryFrom<u64>>(
    of: Quantity,
) -> impl Fn(&str) -> Result<T, QuantityError> + Clone + Send + Sync + 'static {
    move |text| {
        let count = of.parse_count(text)?;
        T::try_from(count)
            .map_err(|_| QuantityError::Range { value: count as f64, of: Box::new(of) })
    }
}

/// Parses a number of cores.
pub(super) fn cores(text: &str) -> Result<NonZeroUsize, QuantityError> {
    let of = tracktwin_parameters::quantity::CORES;
    let cores = usize::try_from(of.parse_count(text)?).ok().and_then(NonZeroUsize::new);
    cores.ok_or(QuantityError::Range { value: 0.0, of: Box::new(of) })
}
