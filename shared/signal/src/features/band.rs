//! One-third octaves.

use std::fmt;

/// Nominal centres in Hz of the one-third octaves from 50 Hz to 4 kHz (IEC 61260-1, base ten).
const NOMINAL_HZ: [u32; 20] = [
    50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500,
    3150, 4000,
];

/// The exponent `n` of the 50 Hz band, whose exact centre is `10^(n / 10)` Hz.
const FIRST_EXPONENT: u32 = 17;

/// A one-third octave between 50 Hz and 4 kHz.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ThirdOctave(u32);

impl ThirdOctave {
    /// Number of bands.
    pub const COUNT: usize = NOMINAL_HZ.len();

    /// All bands, by ascending frequency. [`Features::band_levels_db`](crate::Features::band_levels_db)
    /// has the same order.
    pub fn all() -> impl ExactSizeIterator<Item = Self> {
        (0..20).map(Self)
    }

    /// Nominal centre in Hz.
    pub const fn nominal_hz(self) -> u32 {
        NOMINAL_HZ[self.0 as usize]
    }

    /// Lower edge (included) and upper edge (excluded) in Hz: a twentieth of a decade on either side of
    /// the exact centre (IEC 61260-1, base ten).
    pub fn edges_hz(self) -> [f64; 2] {
        let exponent = f64::from(FIRST_EXPONENT + self.0);
        [-0.5, 0.5].map(|side| 10_f64.powf((exponent + side) / 10.0))
    }

    /// Name of the level of the band in files and tables, such as `level_1000_Hz_dB`.
    pub fn level_name(self) -> String {
        format!("level_{}_Hz_dB", self.nominal_hz())
    }
}

impl fmt::Display for ThirdOctave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} Hz", self.nominal_hz())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_follow_each_other_without_gap_and_hold_their_nominal_centres() {
        let bands: Vec<_> = ThirdOctave::all().collect();
        assert_eq!(bands.len(), ThirdOctave::COUNT);
        for band in &bands {
            let [low, high] = band.edges_hz();
            assert!((low..high).contains(&f64::from(band.nominal_hz())), "{band}");
        }
        for pair in bands.windows(2) {
            let [upper, lower] = [pair[0].edges_hz()[1], pair[1].edges_hz()[0]];
            assert!((upper / lower - 1.0).abs() < 1e-14, "{} and {}", pair[0], pair[1]);
        }
    }

    #[test]
    fn levels_are_named_by_their_nominal_centre() {
        assert_eq!(ThirdOctave(13).level_name(), "level_1000_Hz_dB");
    }
}
