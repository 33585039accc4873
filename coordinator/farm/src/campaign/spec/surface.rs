//! The surface spectrum of a campaign on a track whose slope is uncertain.

use tracktwin_experiment::metres_per_second;
use tracktwin_parameters::Track;
use tracktwin_track::extension::{SampledExtension, SampledValue};

/// Name of the kind that changes the spectrum.
pub(super) const SPECTRUM: &str = "roughness_spectrum";

/// Geometric mean of the range of the features in Hz (50 to 4000 Hz).
const MIDDLE_HZ: f64 = 447.0;

/// Distance of the ends of the uniform distribution from its middle, in standard deviations of the slope:
/// 90 % of a normal distribution lie between them.
const ENDS: f64 = 1.645;

/// The spectrum whose slope differs from case to case, about that of eq. B.6 (Shen et al. 2023). The
/// irregularity level is that of the wavelength in the middle of the features. `None` if the description
/// states a slope without uncertainty.
pub(super) fn slope(track: &Track, speeds_km_h: &[f64]) -> Option<SampledExtension> {
    let deviation = track.prior.slope_deviation;
    let (slowest, fastest) = (speeds_km_h.first()?, speeds_km_h.last()?);
    if deviation == 0.0 {
        return None;
    }
    // One more in the exponent of the wave number is a factor of two in power per octave.
    let slope_db = 10.0 * 2.0_f64.log10() * ENDS * deviation;
    let pivot_m = metres_per_second((slowest * fastest).sqrt()) / MIDDLE_HZ;
    let parameters = [
        ("slope_dB_per_octave", SampledValue::Between([-slope_db, slope_db])),
        ("pivot_wavelength_m", SampledValue::Fixed(pivot_m)),
    ];
    Some(SampledExtension {
        physics: SPECTRUM.to_owned(),
        x_m: None,
        sleepers: None,
        share: 1.0,
        parameters: parameters.map(|(name, value)| (name.to_owned(), value)).into(),
    })
}
