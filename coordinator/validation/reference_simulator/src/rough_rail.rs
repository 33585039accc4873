//! Rails that are rougher than the others: at all wavelengths, and more strongly in a band of
//! wavelengths.

use crate::scene::RoughRail;
use crate::surface::Irregularity;
use std::f64::consts::PI;

/// Wavelengths in m of the band: at 13 km/h from 700 to 4000 Hz (Shen et al. 2023, section 5.1).
pub(crate) const BAND_M: [f64; 2] = [0.9e-3, 5.2e-3];

/// Length in m over which one surface passes into another.
const FADE_M: f64 = 0.01;

impl Irregularity {
    /// The same, rougher on some rails; `band` is an independent irregularity of the waves
    /// [`BAND_M`], at the same level and of the same length.
    ///
    /// On a rail the height is `sqrt(l) (z + sqrt(b - 1) z_band)` with the factors `l` of the level
    /// and `b` of the band, so that its density is `l b` times that of eq. B.6 inside the band.
    pub(crate) fn roughened(&self, rails: &[RoughRail], band: &Self) -> Self {
        let rough = |(index, (own, band)): (usize, (&[f64; 2], &[f64; 2]))| {
            let x_m = index as f64 * self.step_m;
            let mut knot = *own;
            for rail in rails {
                let [share, slope] = share(rail.x_m, x_m);
                let level = rail.level_factor.sqrt();
                let [more, of_band] = [level - 1.0, level * (rail.band_factor - 1.0).sqrt()];
                let added = [0, 1].map(|part| more * own[part] + of_band * band[part]);
                knot[0] += share * added[0];
                knot[1] += share * added[1] + slope * added[0];
            }
            knot
        };
        let knots = self.knots.iter().zip(&band.knots).enumerate().map(rough).collect();
        Self { step_m: self.step_m, knots }
    }
}

/// Weight of a rail's own surface at a place, 0 to 1, and its slope in 1/m.
fn share([from_m, to_m]: [f64; 2], x_m: f64) -> [f64; 2] {
    let (since, until) = (x_m - from_m, to_m - x_m);
    let (inside, way) = if since < until { (since, 1.0) } else { (until, -1.0) };
    let place = inside / FADE_M;
    if place <= 0.0 {
        return [0.0, 0.0];
    }
    if place >= 1.0 {
        return [1.0, 0.0];
    }
    let angle = PI * place;
    [0.5 * (1.0 - angle.cos()), way * 0.5 * PI * angle.sin() / FADE_M]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nuisances::Nuisances;
    use crate::surface::{WAVES_M, density};
    use rand_chacha::ChaCha12Rng;
    use rand_chacha::rand_core::SeedableRng;
    use std::f64::consts::TAU;

    const RAIL: RoughRail = RoughRail { x_m: [1.0, 3.0], level_factor: 1.5, band_factor: 3.0 };

    fn surface(seed: u64) -> Irregularity {
        let drawn = |waves_m, seed| {
            let random = &mut ChaCha12Rng::seed_from_u64(seed);
            Irregularity::draw(2.0, 4.0, waves_m, &Nuisances::default(), random)
        };
        drawn(WAVES_M, seed).roughened(&[RAIL], &drawn(BAND_M, seed + 1000))
    }

    /// Mean square of `z(x + d) - 2 z(x) + z(x - d)` over a stretch.
    fn bend(surface: &Irregularity, from_m: f64, distance_m: f64) -> f64 {
        let count = 700;
        let at = |index: usize| {
            let x_m = from_m + index as f64 * 1e-3;
            let height = |x_m| surface.height(x_m);
            height(x_m + distance_m) - 2.0 * height(x_m) + height(x_m - distance_m)
        };
        (0..count).map(|index| at(index).powi(2)).sum::<f64>() / count as f64
    }

    /// The same by the spectrum: integral of `S (2 - 2 cos k d)²`, with the band's factor.
    fn expected(factor: f64, band_factor: f64, distance_m: f64) -> f64 {
        let steps = 20_000;
        let [low, high] = [TAU / WAVES_M[1], TAU / WAVES_M[0]];
        let ratio = (high / low).powf(1.0 / f64::from(steps));
        let inside = |k: f64| (TAU / BAND_M[1]..=TAU / BAND_M[0]).contains(&k);
        let part = |index: i32| {
            let k = low * ratio.powf(f64::from(index) + 0.5);
            let power = if inside(k) { band_factor } else { 1.0 };
            let weight = (2.0 - 2.0 * (k * distance_m).cos()).powi(2);
            2.0 * factor * power * density(k) * weight * k * ratio.ln()
        };
        (0..steps).map(part).sum()
    }

    #[test]
    fn the_power_of_each_rail_is_that_of_its_spectrum() {
        let distance_m = 1e-3;
        let mean = |from_m: f64| {
            (0..20).map(|seed| bend(&surface(seed), from_m, distance_m)).sum::<f64>() / 20.0
        };
        let rough = mean(1.5) / expected(1.5, 3.0, distance_m);
        let plain = mean(0.1) / expected(1.0, 1.0, distance_m);
        // Twenty stretches of 0.7 m hold some thousand waves of 5 to 20 mm: 4 % by chance.
        assert!((rough - 1.0).abs() < 0.15 && (plain - 1.0).abs() < 0.15, "{rough} {plain}");
    }

    #[test]
    fn slopes_are_those_of_the_heights_where_surfaces_meet() {
        let surface = surface(3);
        for index in [1.002, 1.006, 2.995].map(|x_m| (x_m / surface.step_m) as usize) {
            let [before, after] = [index - 1, index + 1].map(|it| surface.knots[it][0]);
            let slope = (after - before) / (2.0 * surface.step_m);
            let found = surface.knots[index][1];
            // Waves of eight knots: a central difference loses a tenth of their slope.
            assert!((slope - found).abs() < 0.1 * found.abs() + 1e-5, "{slope} {found}");
        }
    }
}
