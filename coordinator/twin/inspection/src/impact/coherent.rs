//! Shape of the surface at a kink, from the innovations of the passes.
//!
//! Innovations are the response to a surface that is white. A shape of the surface therefore appears in them as
//! the shape that the same filter makes white: its transform over the root of the surface's spectral density, with
//! the minimum phase. Unlike a ratio of spectra, this keeps the phase, which concentrates a weak kink.

use super::shape::{Fitted, Form, Shape, most_likely};
use crate::along::{Innovations, Surface};
use num_complex::Complex64;

/// Shortest and longest length of a dip and of a hollow, in sleeper spacings. Shorter ones stand out by their power.
const DIP_LENGTHS: [f64; 2] = [0.1, 2.4];
const HOLLOW_LENGTHS: [f64; 2] = [0.045, 0.8];
/// Relative standard deviation of a depth beside that of the surface's level: the prediction of innovations takes
/// a part of the defect for the usual signal. Changes of slope of 4 mrad came out as 2.2 to 3.2 mrad.
const DEPTH_DEVIATION: f64 = 0.3;
/// Number of lengths.
const LENGTHS: usize = 40;
/// Points of a template; the shape is in its middle.
const POINTS: usize = 2048;
/// Parts of the step at which a template is known.
const PARTS: usize = 4;
/// Distance in steps before and behind the middle over which a template is compared.
const BEFORE: f64 = 80.0;
const BEHIND: f64 = 120.0;
/// Distance in parts of a step by which a pass may be shifted, on either side.
const SHIFT: i32 = 8;

/// Fits dips and hollows to the innovations around `x_m`, whose samples are `step_m` apart.
pub(super) fn coherent_shape(
    surface: &Surface,
    passes: &[Innovations],
    x_m: f64,
    step_m: f64,
    spacing_m: f64,
) -> Shape {
    let around: Vec<Around> = passes.iter().map(|pass| around(pass, x_m, step_m)).collect();
    let whitening = whitening(surface, step_m);
    let grid = |form: Form, [shortest, longest]: [f64; 2]| -> Vec<Fitted> {
        let length = |index: usize| {
            let share = index as f64 / (LENGTHS - 1) as f64;
            shortest * (longest / shortest).powf(share) * spacing_m
        };
        let fitted =
            |length: f64| fitted(&template(form, length, &whitening, step_m), &around, length);
        (0..LENGTHS).map(|index| fitted(length(index))).collect()
    };
    let dips = grid(Form::Dip, DIP_LENGTHS);
    let hollows = grid(Form::Hollow, HOLLOW_LENGTHS);
    most_likely(dips, hollows, surface.height_deviation.hypot(DEPTH_DEVIATION))
}

/// Distances of the samples of a pass from a place in steps, and their innovations in their usual size.
type Around = Vec<(f64, f64)>;

fn around(pass: &Innovations, x_m: f64, step_m: f64) -> Around {
    let usual = pass.usual();
    let samples = pass.position_m.iter().zip(&pass.values);
    let scaled = samples.map(|(position, value)| ((position - x_m) / step_m, value / usual));
    scaled.filter(|(distance, _)| (-BEFORE..BEHIND).contains(distance)).collect()
}

/// Minimum-phase transform that makes the surface white with a variance of one at every point.
fn whitening(surface: &Surface, step_m: f64) -> Vec<Complex64> {
    let density = |line: usize| surface.density_m3(line as f64 / (POINTS as f64 * step_m));
    let one_sided: Vec<f64> = (0..=POINTS / 2).map(density).collect();
    // Beyond the longest and the shortest wave of the surface its density stays what it is there.
    let longest = one_sided.iter().position(|density| *density > 0.0).unwrap_or(0);
    let shortest = one_sided.iter().rposition(|density| *density > 0.0).unwrap_or(POINTS / 2);
    // The two-sided density is half the one-sided one.
    let ln_gain = |line: usize| {
        let wave = line.min(POINTS - line).clamp(longest, shortest);
        0.5 * (step_m / (0.5 * one_sided[wave])).ln()
    };
    let mut lines: Vec<Complex64> =
        (0..POINTS).map(|line| Complex64::new(ln_gain(line), 0.0)).collect();
    // The cepstrum of a minimum-phase filter is zero before its origin.
    tracktwin_fourier::inverse(POINTS).process(&mut lines);
    for (quefrency, line) in lines.iter_mut().enumerate() {
        let fold = match quefrency {
            0 => 1.0,
            _ if quefrency < POINTS / 2 => 2.0,
            _ if quefrency == POINTS / 2 => 1.0,
            _ => 0.0,
        };
        *line *= fold / POINTS as f64;
    }
    tracktwin_fourier::forward(POINTS).process(&mut lines);
    lines.iter().map(|line| line.exp()).collect()
}

/// Innovations of a shape of 1 m depth at every part of a step; the shape is in the middle.
fn template(form: Form, length_m: f64, whitening: &[Complex64], step_m: f64) -> Vec<f64> {
    let middle = POINTS / 2;
    let height = |point: usize| form.height((point as f64 - middle as f64) * step_m, length_m);
    let mut lines: Vec<Complex64> =
        (0..POINTS).map(|point| Complex64::new(height(point), 0.0)).collect();
    tracktwin_fourier::forward(POINTS).process(&mut lines);
    let mut fine = vec![Complex64::ZERO; PARTS * POINTS];
    for (line, (value, gain)) in lines.iter().zip(whitening).enumerate() {
        let place = if line < middle { line } else { line + (PARTS - 1) * POINTS };
        fine[place] = value * gain / POINTS as f64;
    }
    tracktwin_fourier::inverse(fine.len()).process(&mut fine);
    fine.iter().map(|value| value.re).collect()
}

/// Depth that fits the passes best, each shifted within reach. The passes share one surface and count as one.
fn fitted(template: &[f64], around: &[Around], length: f64) -> Fitted {
    let middle = (template.len() / 2) as f64;
    let of_pass = |pass: &Around| {
        let at = |shift: i32| {
            let place = |distance: f64| middle + distance * PARTS as f64 - f64::from(shift);
            let pairs = pass.iter().map(|(distance, value)| {
                let weight = template[place(*distance).round() as usize];
                (weight * value, weight * weight)
            });
            let (sum, square) = pairs.fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
            (sum / square.sqrt(), square.sqrt())
        };
        let best = (-SHIFT..=SHIFT).map(at).max_by(|a, b| a.0.total_cmp(&b.0));
        best.expect("a pass has shifts")
    };
    let each: Vec<(f64, f64)> = around.iter().map(of_pass).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| each.iter().map(of).sum::<f64>() / each.len() as f64;
    let (matched, norm) = (mean(|pass| pass.0).max(0.0), mean(|pass| pass.1));
    Fitted { squares: -matched * matched, length, depth: matched / norm }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::along::testing::Rolled;

    const SPACING_M: f64 = 0.125;
    const STEP_M: f64 = SPACING_M / 120.0;

    /// Shape found at 1.3 m under the passes of a surface with this shape.
    fn found(seed: u64, form: Form, depth_m: f64, length_m: f64) -> Shape {
        let height = |_, x: f64| depth_m * form.height(x - 1.3, length_m);
        let recording = Rolled { height_m: &height, ..Rolled::faultless(seed) }.recording();
        let top_hz = |speed_km_h: f64| 0.5 * speed_km_h / 3.6 / STEP_M;
        let passes = recording.passes.iter();
        let passes: Vec<Innovations> =
            passes.filter_map(|pass| Innovations::of(pass, top_hz(pass.speed_km_h))).collect();
        coherent_shape(&Surface::of(&recording), &passes, 1.3, STEP_M, SPACING_M)
    }

    #[test]
    fn a_dip_and_a_hollow_have_their_form_length_and_depth() {
        for seed in 3..6 {
            let hollow = found(seed, Form::Hollow, 2e-5, 0.02);
            assert_eq!(hollow.form, Form::Hollow);
            assert!((hollow.length_m.0 / 0.02 - 1.0).abs() < 0.05, "{hollow:?}");
            let error_m = hollow.depth_m.0 - 2e-5;
            assert!(error_m.abs() < 2.0 * hollow.depth_m.1, "{hollow:?}");
            let dip = found(seed, Form::Dip, 6e-5, 0.03);
            assert_eq!(dip.form, Form::Dip);
            // The change of slope is known, depth and length hardly.
            let error_rad = dip.slope_rad - 4e-3;
            assert!(error_rad.abs() < 2.0 * DEPTH_DEVIATION * 4e-3, "{dip:?}");
        }
    }
}
