//! Many passes: each by the solver that its track needs.

use super::{Pass, PassError, PassRecord, lanes, newmark};
use crate::model::{Surface, TrackModel};

/// Runs the vehicle over many tracks, each with its own surface; the records come in their order.
///
/// Equal to [`super::pass`] case by case, up to rounding; equal to the last bit however the cases
/// are grouped and ordered. Tracks that matrices and one rigid wheel describe go through the fast
/// solver side by side ([`TrackModel::is_linear`]); those with force laws, a second wheel or parts
/// that hang on the wheel go through the plain one.
///
/// # Errors
/// [`PassError`] of a case that has one.
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
