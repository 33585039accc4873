//! Measured receptances, and the selection of values for the fit.

use num_complex::Complex64;
use tracktwin_parameters::TrackDesign;

/// Smallest coherence of a fitted value.
pub const COHERENCE_MIN: f64 = 0.9;

/// Lowest and highest fitted frequency in Hz for V-Track: above 4 kHz the paper's model and measurement
/// differ (Shen et al. 2023, Fig. 9). For other tracks both are divided by the length ratio.
const USUAL_HZ: [f64; 2] = [100.0, 4000.0];

/// Part of an octave on either side, and smallest number of frequencies, over which the coherence is averaged.
const AVERAGED_OCTAVES: f64 = 1.0 / 12.0;
const AVERAGED_MIN: usize = 9;

/// Number of fitted frequencies per octave.
const PER_OCTAVE: f64 = 24.0;

/// Point receptance of the rail: force and displacement at one position, positive in the same direction.
#[derive(Clone, Debug, PartialEq)]
pub struct PointReceptance {
    /// Position along the track in m.
    pub position_m: f64,
    /// Frequencies in Hz, ascending and positive.
    pub frequencies_hz: Vec<f64>,
    /// Displacement per unit force in m/N at each frequency, for the time dependence `exp(+i w t)`.
    pub values: Vec<Complex64>,
    /// Coherence of force and response at each frequency, 0 to 1; `None` if unknown.
    pub coherence: Option<Vec<f64>>,
    /// Number of averaged hits; `None` if unknown.
    pub hits: Option<usize>,
}

/// Criteria for fitted frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Lowest and highest frequency in Hz.
    pub range_hz: [f64; 2],
    /// Smallest coherence, 0 to 1.
    pub coherence: f64,
}

/// Selected values of all measured receptances.
#[derive(Clone, Debug, PartialEq)]
pub struct Selected {
    /// Receptances at the fitted frequencies.
    pub points: Vec<PointReceptance>,
    /// Notes on values that were left out, one sentence each.
    pub notes: Vec<String>,
}

impl Selection {
    /// The default criteria for a track of this design.
    pub fn usual(design: &TrackDesign) -> Self {
        let ratio = design.length_ratio();
        Self { range_hz: USUAL_HZ.map(|hz| hz / ratio), coherence: COHERENCE_MIN }
    }
}

impl PointReceptance {
    /// Whether force and response have opposite directions. The imaginary part of a point receptance must
    /// be negative; the function tests whether it is positive (energy gain) for more than half of the
    /// values.
    pub fn is_turned(&self) -> bool {
        let gaining = self.values.iter().filter(|value| value.im > 0.0).count();
        2 * gaining > self.values.len()
    }

    /// Standard deviation of the real and imaginary part of the logarithm at a frequency, from the
    /// coherence: `sqrt((1 - g) / (2 g n))` for the coherence `g` of `n` hits (Bendat and Piersol, *Random
    /// Data*, 4th ed., section 9.1). Zero if the coherence is unknown.
    pub(crate) fn deviation(&self, index: usize) -> f64 {
        let Some(coherence) = self.coherence.as_ref().map(|it| it[index]) else { return 0.0 };
        let hits = self.hits.unwrap_or(1).max(1) as f64;
        ((1.0 - coherence) / (2.0 * coherence * hits)).max(0.0).sqrt()
    }

    /// The coherence without chance, at every frequency: the median over neighbouring frequencies of
    /// `(n g - 1) / (n - 1)` for the estimate `g` of `n` hits, which noise alone makes `1/n` in the mean.
    ///
    /// An estimate of few hits is large where the noise happens to agree with the force. Values that are selected by
    /// their own estimate are therefore too large.
    fn settled_coherence(&self) -> Option<Vec<f64>> {
        let hits = self.hits.filter(|&hits| hits > 1).map(|hits| hits as f64);
        let unbiased = |&g: &f64| hits.map_or(g, |n| ((n * g - 1.0) / (n - 1.0)).max(0.0));
        let all: Vec<f64> = self.coherence.as_ref()?.iter().map(unbiased).collect();
        let hz = &self.frequencies_hz;
        let median = |index: usize| {
            let ends = [-AVERAGED_OCTAVES, AVERAGED_OCTAVES].map(f64::exp2);
            let [from, to] = ends.map(|end| hz.partition_point(|other| *other < hz[index] * end));
            let from = from.min(index.saturating_sub(AVERAGED_MIN / 2));
            let to = to.max(index + AVERAGED_MIN / 2 + 1).min(all.len());
            let mut near = all[from..to].to_vec();
            let middle = near.len() / 2;
            *near.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        Some((0..all.len()).map(median).collect())
    }

    /// The receptance at the frequencies with these indices.
    pub(crate) fn kept(&self, indices: &[usize]) -> Self {
        Self {
            position_m: self.position_m,
            frequencies_hz: indices.iter().map(|&index| self.frequencies_hz[index]).collect(),
            values: indices.iter().map(|&index| self.values[index]).collect(),
            coherence: self
                .coherence
                .as_ref()
                .map(|all| indices.iter().map(|&index| all[index]).collect()),
            hits: self.hits,
        }
    }
}

/// Selects the values for the fit: inside the frequency range, coherent, and at most 24 frequencies per
/// octave. Of several frequencies the function selects those nearest to equal steps of the logarithm.
///
/// A point without such a frequency is left out. The notes list everything that was left out.
pub fn select(points: &[PointReceptance], selection: &Selection) -> Selected {
    let [low, high] = selection.range_hz;
    let mut notes = Vec::new();
    let (mut inside, mut incoherent, mut unknown) = (0, 0, 0);
    let mut kept_points = Vec::new();
    for point in points {
        let point = PointReceptance { coherence: point.settled_coherence(), ..point.clone() };
        let count = point.frequencies_hz.len();
        let in_range = |&index: &usize| (low..=high).contains(&point.frequencies_hz[index]);
        let range: Vec<usize> = (0..count).filter(in_range).collect();
        let is_coherent = |&index: &usize| {
            let is_enough = |all: &Vec<f64>| all[index] >= selection.coherence && all[index] > 0.0;
            point.coherence.as_ref().is_none_or(is_enough)
        };
        let coherent: Vec<usize> = range.iter().copied().filter(is_coherent).collect();
        inside += range.len();
        incoherent += range.len() - coherent.len();
        unknown += usize::from(point.coherence.is_none());
        let kept = nearest(&point.frequencies_hz, &coherent, selection.range_hz);
        if kept.is_empty() {
            notes.push(format!(
                "The receptance at {} m has no coherent value from {low:.0} to {high:.0} Hz and is \
                 left out.",
                point.position_m
            ));
        } else {
            kept_points.push(point.kept(&kept));
        }
    }
    if incoherent > 0 {
        notes.push(format!(
            "{incoherent} of {inside} values are left out: their coherence is below {}.",
            selection.coherence
        ));
    }
    if unknown > 0 {
        notes.push(format!(
            "The coherence of {unknown} of {} receptances is not known (it takes several hits): \
             none of their values is left out.",
            points.len()
        ));
    }
    Selected { points: kept_points, notes }
}

/// The indices whose frequencies are nearest to equal steps of the logarithm.
fn nearest(frequencies_hz: &[f64], indices: &[usize], [low, high]: [f64; 2]) -> Vec<usize> {
    let steps = ((high / low).log2() * PER_OCTAVE).floor().max(0.0) as usize;
    let mut kept = Vec::new();
    for step in 0..=steps {
        let wanted = low * (step as f64 / PER_OCTAVE).exp2();
        let distance = |index: usize| (frequencies_hz[index] / wanted).log2().abs();
        let best = indices.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        // Only what lies nearer to this step than to the next ones.
        let best = best.filter(|&index| distance(index) <= 0.5 / PER_OCTAVE);
        if best.is_some_and(|index| kept.last() != Some(&index)) {
            kept.extend(best);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(count: usize) -> PointReceptance {
        PointReceptance {
            position_m: 1.0,
            frequencies_hz: (1..=count).map(|k| 10.0 * k as f64).collect(),
            values: vec![Complex64::new(1e-8, -1e-9); count],
            coherence: Some(vec![0.99; count]),
            hits: Some(5),
        }
    }

    #[test]
    fn incoherent_values_are_left_out_and_it_is_said() {
        let mut point = point(400);
        point.coherence.as_mut().unwrap()[20..40].fill(0.5);
        let selection = Selection::usual(&TrackDesign::v_track());
        let Selected { points, notes } = select(&[point], &selection);
        let incoherent = |hz: &f64| (205.0..405.0).contains(hz);
        assert!(!points[0].frequencies_hz.iter().any(incoherent));
        assert!(notes[0].starts_with("20 of 391 values"), "{notes:?}");
        // 5.3 octaves, less the one that is missing; lines 10 Hz apart are fewer at the low end.
        assert!((80..128).contains(&points[0].values.len()), "{}", points[0].values.len());
    }

    /// Noise that happens to agree with the force makes a receptance and its coherence too large.
    #[test]
    fn a_line_is_not_selected_by_its_own_chance() {
        let mut point = point(400);
        let coherence = point.coherence.as_mut().unwrap();
        // Five hits of a true coherence of 0.8: every fifth estimate is above 0.9.
        coherence.iter_mut().enumerate().for_each(|(k, it)| *it = 0.72 + 0.06 * (k % 5) as f64);
        let selection = Selection::usual(&TrackDesign::v_track());
        assert!(select(&[point.clone()], &selection).points.is_empty());
        let lower = Selection { coherence: 0.5, ..selection };
        let kept = select(&[point], &lower).points.remove(0).coherence.unwrap();
        // The median estimate of 0.84 without its bias: (5 * 0.84 - 1) / 4.
        let mean = kept.iter().sum::<f64>() / kept.len() as f64;
        assert!((mean - 0.8).abs() < 0.01, "{mean}");
    }

    #[test]
    fn a_point_without_any_coherent_value_is_named() {
        let mut bad = point(100);
        bad.coherence.as_mut().unwrap().fill(0.1);
        let selection = Selection::usual(&TrackDesign::v_track());
        let Selected { points, notes } = select(&[bad, point(100)], &selection);
        assert_eq!(points.len(), 1);
        assert!(notes[0].contains("at 1 m"), "{notes:?}");
    }

    #[test]
    fn a_response_against_the_force_is_noticed() {
        let mut point = point(10);
        assert!(!point.is_turned());
        point.values.iter_mut().for_each(|value| *value = -*value);
        assert!(point.is_turned());
    }

    #[test]
    fn a_coherence_is_a_deviation() {
        // Half of the power of a single hit is noise: as large as the signal, half of it in phase.
        let mut point = PointReceptance { hits: Some(1), ..point(1) };
        point.coherence = Some(vec![0.5]);
        assert!((point.deviation(0) - 0.5_f64.sqrt()).abs() < 1e-12);
    }
}
