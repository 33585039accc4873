//! Sleepers at even distances from the one that is stated.

use super::super::error::Fault;
use super::super::{Pass, Sleeper};
use super::Layout;
use tracktwin_parameters::quantity::SLEEPERS;

/// Spacings beyond the nearest pass up to which the stated sleeper may stand. Further away, an error of the
/// spacing has grown too large inside the passes.
const BEYOND_SPACINGS: f64 = 10.0;
/// Factors between units that are mistaken for each other, and what the value would be.
const MISTAKEN: [(f64, &str); 2] =
    [(1e3, "if it was in km"), (1e-3, "if it was in mm, or in m with positions in km")];

/// Sleepers along all passes, from the stated one on; none if none is stated.
///
/// # Errors
/// [`Fault::SleeperOutside`] if the stated one is far from all passes, or [`Fault::OutOfRange`] if there are
/// too many.
pub(super) fn along(
    passes: &[Pass],
    layout: &Layout,
    is_backwards: bool,
) -> Result<Vec<Sleeper>, Fault> {
    let Some(stated_m) = layout.sleeper_m else { return Ok(Vec::new()) };
    let sign = if is_backwards { -1.0 } else { 1.0 };
    let (known, spacing_m) = (sign * stated_m, layout.spacing_m());
    let ends = |pass: &Pass| [pass.position_m[0], pass.position_m[pass.position_m.len() - 1]];
    let is_near = |x_m: f64| {
        passes
            .iter()
            .map(ends)
            .any(|[first, last]| (first - x_m).max(x_m - last) <= BEYOND_SPACINGS * spacing_m)
    };
    let span = |[low, high]: [f64; 2], [first, last]: [f64; 2]| [low.min(first), high.max(last)];
    let [low, high] = passes.iter().map(ends).fold([f64::INFINITY, f64::NEG_INFINITY], span);
    if !is_near(known) {
        let [from_m, to_m] = if is_backwards { [-high, -low] } else { [low, high] };
        let guess = MISTAKEN.into_iter().find(|(factor, _)| is_near(factor * known));
        let guess = guess.map(|(factor, when)| (factor * stated_m, when));
        return Err(Fault::SleeperOutside { stated_m, from_m, to_m, guess });
    }
    let number = |x: f64| (x - known) / spacing_m;
    let (from, to) = (number(low).ceil() as i64, number(high).floor() as i64);
    // No more than may be.
    SLEEPERS.check((to - from + 1).max(0) as f64).map_err(Fault::OutOfRange)?;
    let sleeper = |(index, number): (usize, i64)| Sleeper {
        id: format!("SN{}", index + 1),
        x_m: known + number as f64 * spacing_m,
    };
    Ok((from..=to).enumerate().map(sleeper).collect())
}
