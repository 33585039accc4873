//! Many passes, each computed by the solver that its track needs.

use super::{Pass, PassError, PassRecord, lanes, newmark};
use crate::model::{Surface, TrackModel};

/// Runs the vehicle over many tracks, each with its own surface. The records have the order of the
/// tracks.
///
/// Each record equals that of [`super::pass`] up to rounding. Order and grouping of the cases do not
/// change a single bit. The fast solver computes linear tracks ([`TrackModel::is_linear`]) in groups.
/// The plain solver computes tracks with force laws, a second wheel or parts that move on the wheel.
///
/// # Errors
/// [`PassError`] of a case that fails.
pub fn passes(
    models: &[TrackModel],
    pass: &Pass,
    surfaces: &[Surface],
) -> Result<Vec<PassRecord>, PassError> {
    if models.iter().all(TrackModel::is_linear) || models.len() != surfaces.len() {
        return lanes::passes(models, pass, surfaces);
    }
    let linear: Vec<_> = (0..models.len()).filter(|&case| models[case].is_linear()).collect();
    let chosen = linear.iter().map(|&case| (models[case].clone(), surfaces[case].clone()));
    let (linear_models, linear_surfaces): (Vec<_>, Vec<_>) = chosen.unzip();
    let mut fast = lanes::passes(&linear_models, pass, &linear_surfaces)?.into_iter();
    let record = |(model, surface): (&TrackModel, &Surface)| {
        if model.is_linear() {
            Ok(fast.next().expect("every linear track has been run"))
        } else {
            newmark::pass(model, pass, surface)
        }
    };
    models.iter().zip(surfaces).map(record).collect()
}
