//! Limits of the wavelengths of an irregularity.

use crate::{Quantity, QuantityError};

/// Shortest wavelength of an irregularity in m. The program stores the surface at four points a wave.
const SHORTEST: Quantity = Quantity::new("shortest wavelength", "m", [1e-5, 0.1], [1e-4, 0.01]);

/// Longest wavelength of an irregularity in m.
const LONGEST: Quantity = Quantity::new("longest wavelength", "m", [0.05, 100.0], [0.5, 10.0]);

/// Wavelengths of an irregularity that are not allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WavelengthsError {
    /// A wavelength is outside its limits.
    #[error(transparent)]
    Limits(#[from] QuantityError),
    /// The longer one comes first.
    #[error("[{}, {}] must be two lengths in m, the shorter first", .0[0], .0[1])]
    Order([f64; 2]),
}

/// Checks the shortest and the longest wavelength of an irregularity in m.
///
/// # Errors
/// [`WavelengthsError`] if one is outside its limits, as a length in millimetres is, or the longer one comes first.
pub fn check_wavelengths(wavelengths_m: [f64; 2]) -> Result<(), WavelengthsError> {
    let [shortest, longest] = wavelengths_m;
    SHORTEST.check(shortest)?;
    LONGEST.check(longest)?;
    if shortest < longest { Ok(()) } else { Err(WavelengthsError::Order(wavelengths_m)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_and_wrong_orders_are_refused() {
        check_wavelengths([1e-3, 3.0]).unwrap();
        let refusal = |wavelengths_m| check_wavelengths(wavelengths_m).unwrap_err().to_string();
        assert!(
            refusal([1.0, 3000.0]).contains("did you mean 0.001?"),
            "{}",
            refusal([1.0, 3000.0])
        );
        assert!(refusal([1e-300, 1.0]).contains("shortest wavelength"));
        assert!(refusal([f64::NAN, 1.0]).contains("shortest wavelength"));
        assert!(refusal([0.09, 0.06]).contains("the shorter first"));
    }
}
