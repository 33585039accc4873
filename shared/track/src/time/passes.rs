//! Many passes, each computed by the solver that its track needs.

use super::{Pass, PassError, PassRecord, lanes, newmark};
use crate::model::{Surface, TrackModel};

/// Runs the vehicle over many tracks, each with its own surface. The records have the order of the
/// tracks.
///
/// Each record equals that of [`super::pass`] up to rounding. Order and grouping of the cases do not
/// change a single bit. The fast solver computes linear tracks ([`TrackModel::is_linear`]) in groups, also
/// with distant further wheels. The plain solver computes tracks with force laws, near wheels or parts that
/// move on the wheel.
///
/// # Errors
/// [`PassError`] of a case that fails.
pub fn passes(
    models: &[TrackModel],
    pass: &Pass,
    surfaces: &[Surface],
) -> Result<Vec<PassRecord>, PassError> {
    let is_fast: Vec<bool> =
        models.iter().map(|model| lanes::can_run(model, pass.time_step_s)).collect();
    if is_fast.iter().all(|is_fast| *is_fast) || models.len() != surfaces.len() {
        return lanes::passes(models, pass, surfaces);
    }
    let chosen = (0..models.len()).filter(|&case| is_fast[case]);
    let chosen = chosen.map(|case| (models[case].clone(), surfaces[case].clone()));
    let (fast_models, fast_surfaces): (Vec<_>, Vec<_>) = chosen.unzip();
    let mut fast = lanes::passes(&fast_models, pass, &fast_surfaces)?.into_iter();
    let record = |((model, surface), is_fast): ((&TrackModel, &Surface), bool)| {
        if is_fast {
            Ok(fast.next().expect("every case of the fast solver has been run"))
        } else {
            newmark::pass(model, pass, surface)
        }
    };
    models.iter().zip(surfaces).zip(is_fast).map(record).collect()
}
