//! The smallest possible error from the powers of one sleeper spacing at one speed.

use tracktwin_parameters::Parameter::{
    self, BallastStiffness, IrregularityLevel, RailpadStiffness, SleeperBendingStiffness,
};

/// Bayes bound: mean absolute scaled error in per cent (paper, eq. 11) of the posterior median, for
/// the spectrum from 50 to 4000 Hz of one sleeper spacing at 13 km/h, averaged over Table D1.
///
/// Origin: an independent model in the frequency domain, without time steps and without elements:
/// an endless track whose spans are all alike, a rigid wheel, a linear contact spring, eq. B.6. Of
/// 24,576 tracks (Sobol points of all six parameters) 600 are observed: at frequencies one
/// resolution (29 Hz) apart the power is exponentially distributed about its expectation, which is
/// averaged along the spacing. Bayes's rule over the other tracks gives the posterior
/// (docs/models.md). The samples of the spacing tell more if the noise of the sensor is below about
/// 0.3 m/s2 (docs/decisions/0034).
const ONE_SPACING: [(Parameter, f64); 4] = [
    (RailpadStiffness, 17.4),
    (BallastStiffness, 4.9),
    (SleeperBendingStiffness, 11.2),
    (IrregularityLevel, 4.9),
];

/// Name of the bound in legends and rows.
pub(crate) const NAME: &str = "Bayes bound";

/// The bound of a parameter in per cent of its range. NaN if it was not computed.
pub(crate) fn of(parameter: Parameter) -> f64 {
    let known = ONE_SPACING.iter().find(|known| known.0 == parameter);
    known.map_or(f64::NAN, |known| known.1)
}
