//! Power in short cells along the track, pass by pass, and how unlikely each is.

use crate::along::{Background, Energy, by_speed, ln_gamma_tail, median, speed_m_s, whitened};
use std::ops::Range;
use tracktwin_signal::recording::{Pass, Recording};

/// Frequencies in Hz of a blow: above them the surface's own power varies little from place to
/// place, and the contact rings.
const BLOW_HZ: [f64; 2] = [700.0, 5000.0];
/// Wave numbers in cycles/m of a hollow of 2 to 10 mm, whose sound is lower the slower the wheel.
const HOLLOW_PER_M: [f64; 2] = [100.0, 1000.0];
/// Lowest frequency in Hz of a hollow: below it the track rings for longer than the wheel takes.
const HOLLOW_LOW_HZ: f64 = 200.0;
/// Highest frequency as a share of the sample rate.
const HIGH_SHARE: f64 = 0.4;
/// Power over the noise floor up to which frequencies are used.
const AUDIBLE: f64 = 4.0;
/// Width of a cell as a share of the sleepers' spacing: 10 mm of 125 mm, the length of a squat and
/// of the ringing after it.
const CELL_SHARE: f64 = 0.08;
/// Least product of a cell's duration and bandwidth: below it power is mostly chance.
const PRODUCT_MIN: f64 = 6.0;
/// Cells to a step: neighbouring cells overlap by half.
const STEPS: usize = 2;
/// Distance in sleeper spacings on either side from which a cell's normal power is taken.
const NEAR_SPACINGS: f64 = 1.5;
/// Quartile of the logarithm of a gamma variable over its standard deviation, for a normal one.
const QUARTILES: f64 = 1.349;

/// Kind of impact that is searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ImpactKind {
    /// The same frequencies at all speeds: kinks, edges, everything that rings.
    Blows,
    /// The same wavelengths at all speeds: hollows that a slow wheel rolls through quietly.
    Hollows,
}

impl ImpactKind {
    pub(crate) const BOTH: [Self; 2] = [Self::Blows, Self::Hollows];

    /// The band in Hz in a pass; none where it is empty.
    pub(crate) fn band(self, pass: &Pass, background: &Background) -> Option<[f64; 2]> {
        let speed = speed_m_s(pass);
        let [low, high] = match self {
            Self::Blows => BLOW_HZ,
            Self::Hollows => {
                [(HOLLOW_PER_M[0] * speed).max(HOLLOW_LOW_HZ), HOLLOW_PER_M[1] * speed]
            }
        };
        let top = HIGH_SHARE * pass.signal.sample_rate_hz();
        let audible = background.audible_hz(AUDIBLE).max(2.0 * low);
        let (low, high) = (low.min(0.5 * top), high.min(top).min(audible));
        (high > 1.3 * low).then_some([low, high])
    }
}

/// Cells of one speed: power over what is normal there, mean of that speed's passes.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    /// Place of the first cell's middle in m.
    pub first_m: f64,
    /// Distance of neighbouring cells' middles in m.
    pub step_m: f64,
    /// Width of a cell in m.
    pub width_m: f64,
    /// Power of every cell over the median around it.
    pub ratio: Vec<f64>,
    /// Shape of the gamma distribution that the ratios follow without impacts.
    pub shape: f64,
    /// Indices of the passes they come from.
    pub passes: Vec<usize>,
}

impl Cells {
    /// Middle of a cell in m.
    pub(crate) fn place_m(&self, cell: usize) -> f64 {
        self.first_m + cell as f64 * self.step_m
    }

    /// `ln P` of a cell's power without an impact.
    pub(crate) fn ln_tail(&self, cell: usize) -> f64 {
        ln_gamma_tail(self.shape, self.ratio[cell])
    }
}

/// The cells of every speed (of every pass if `each`) on one grid of places.
///
/// Empty where no pass has sound enough above the impacts' lowest frequency.
pub(crate) fn cells(recording: &Recording, kind: ImpactKind, each: bool) -> Vec<Cells> {
    let passes = &recording.passes;
    let groups =
        if each { (0..passes.len()).map(|index| vec![index]).collect() } else { by_speed(passes) };
    let Some(width_m) = width(recording, kind) else { return Vec::new() };
    let from = passes.iter().map(|pass| pass.position_m[0]).fold(f64::MIN, f64::max);
    let ends = passes.iter().map(|pass| pass.position_m[pass.position_m.len() - 1]);
    // The fading ends of a pass and half a cell stay out.
    let room = 2.5 * width_m;
    let (first_m, last_m) = (from + room, ends.fold(f64::MAX, f64::min) - room);
    let step_m = width_m / STEPS as f64;
    if last_m < first_m + 8.0 * width_m {
        return Vec::new();
    }
    let count = ((last_m - first_m) / step_m) as usize + 1;
    let grid = Grid { kind, first_m, step_m, width_m, count, near: near(recording, step_m) };
    groups.into_iter().filter_map(|group| grid.cells(passes, group)).collect()
}

/// The width of a cell in m, wide enough for the fastest pass; none if there is no signal.
fn width(recording: &Recording, kind: ImpactKind) -> Option<f64> {
    let mut width = CELL_SHARE * recording.spacing_m;
    for pass in &recording.passes {
        let [low, high] = kind.band(pass, &Background::of(&pass.signal)?)?;
        width = width.max(PRODUCT_MIN * speed_m_s(pass) / (high - low));
    }
    (width < 0.5 * recording.spacing_m).then_some(width)
}

fn near(recording: &Recording, step_m: f64) -> usize {
    ((NEAR_SPACINGS * recording.spacing_m / step_m).round() as usize).max(8)
}

struct Grid {
    kind: ImpactKind,
    first_m: f64,
    step_m: f64,
    width_m: f64,
    count: usize,
    near: usize,
}

impl Grid {
    fn cells(&self, passes: &[Pass], group: Vec<usize>) -> Option<Cells> {
        let mut ratio = vec![0.0; self.count];
        for &index in &group {
            let power = self.powers(&passes[index])?;
            for (cell, sum) in ratio.iter_mut().enumerate() {
                let normal = median(power[self.around(cell)].to_vec());
                *sum += power[cell] / normal.max(f64::MIN_POSITIVE) / group.len() as f64;
            }
        }
        let shape = shape(&ratio)?;
        // The median of a gamma variable lies below its mean (Wilson and Hilferty).
        let median_over_mean = (1.0 - 1.0 / (9.0 * shape)).powi(3);
        for value in &mut ratio {
            *value *= median_over_mean;
        }
        let Self { first_m, step_m, width_m, .. } = *self;
        Some(Cells { first_m, step_m, width_m, ratio, shape, passes: group })
    }

    fn powers(&self, pass: &Pass) -> Option<Vec<f64>> {
        let background = Background::of(&pass.signal)?;
        let white = whitened(&pass.signal, &background, self.kind.band(pass, &background)?);
        let energy = Energy::new(pass, &white);
        let power = |cell: usize| {
            let middle = self.first_m + cell as f64 * self.step_m;
            energy.mean(middle - 0.5 * self.width_m, middle + 0.5 * self.width_m)
        };
        Some((0..self.count).map(power).collect())
    }

    fn around(&self, cell: usize) -> Range<usize> {
        cell.saturating_sub(self.near)..(cell + self.near + 1).min(self.count)
    }
}

/// Shape of the gamma distribution with the quartiles of these ratios; none if they don't vary.
///
/// The logarithm of a gamma variable has standard deviation `1/sqrt(shape)` and a little more;
/// quartiles stay what they are when a few cells hold an impact.
fn shape(ratio: &[f64]) -> Option<f64> {
    let mut logs: Vec<f64> = ratio.iter().map(|value| value.max(1e-12).ln()).collect();
    logs.sort_by(f64::total_cmp);
    let quartile = |quarters: usize| logs[(logs.len() - 1) * quarters / 4];
    let deviation = (quartile(3) - quartile(1)) / QUARTILES;
    (deviation > 0.0).then(|| 0.5 + 1.0 / deviation.powi(2))
}
