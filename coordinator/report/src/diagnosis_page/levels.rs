//! Differences between measured and predicted levels, and their means over cells (speed, sleeper, band).

use tracktwin_diagnosis::{Diagnosis, Levels};

/// Prediction with which the measured levels are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Prediction of the re-tuned baseline.
    Before,
    /// Prediction with the accepted hypotheses.
    After,
}

/// Measured level in dB at `[speed, sleeper, band]`; `None` if there is no finite value.
pub(super) fn measured(levels: &Levels, at: [usize; 3]) -> Option<f64> {
    of(&levels.measured_db, at)
}

/// Predicted level in dB at `[speed, sleeper, band]`.
pub(super) fn predicted(levels: &Levels, side: Side, at: [usize; 3]) -> Option<f64> {
    let table = match side {
        Side::Before => &levels.before_db,
        Side::After => &levels.after_db,
    };
    of(table, at)
}

/// Measured minus predicted level in dB; `None` if the cell is not compared.
pub(super) fn difference(levels: &Levels, side: Side, at: [usize; 3]) -> Option<f64> {
    scatter(levels, at[0], at[2])?;
    Some(measured(levels, at)? - predicted(levels, side, at)?)
}

/// Expected standard deviation of a level at a speed in a band, in dB; `None` if the band is not compared.
pub(super) fn scatter(levels: &Levels, speed: usize, band: usize) -> Option<f64> {
    levels.scatter_db.get(speed)?.get(band).copied()?.filter(|sd| *sd > 0.0)
}

fn of(table: &[Vec<Vec<f64>>], [speed, sleeper, band]: [usize; 3]) -> Option<f64> {
    table.get(speed)?.get(sleeper)?.get(band).copied().filter(|level| level.is_finite())
}

/// All cells of one speed.
pub(super) fn cells(diagnosis: &Diagnosis, speed: usize) -> impl Iterator<Item = [usize; 3]> {
    let bands = diagnosis.levels.frequency_hz.len();
    (0..diagnosis.track.len())
        .flat_map(move |sleeper| (0..bands).map(move |band| [speed, sleeper, band]))
}

/// All cells of all speeds.
pub(super) fn all_cells(diagnosis: &Diagnosis) -> impl Iterator<Item = [usize; 3]> {
    (0..diagnosis.levels.speeds_km_h.len()).flat_map(|speed| cells(diagnosis, speed))
}

/// Root mean square of the difference over cells, in dB; `None` if there are no cells.
pub(super) fn rms(
    levels: &Levels,
    side: Side,
    cells: impl Iterator<Item = [usize; 3]>,
) -> Option<f64> {
    let squares = cells.filter_map(|at| difference(levels, side, at)).map(|db| db * db);
    let (sum, count) = squares.fold((0.0, 0u32), |(sum, n), square| (sum + square, n + 1));
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// Share of the cells with a difference of at most two standard deviations; `None` if there are no cells.
pub(super) fn share_within_two_sd(diagnosis: &Diagnosis, side: Side) -> Option<f64> {
    let levels = &diagnosis.levels;
    let within = all_cells(diagnosis).filter_map(|at| {
        Some(difference(levels, side, at)?.abs() <= 2.0 * scatter(levels, at[0], at[2])?)
    });
    let (inside, count) = within.fold((0u32, 0u32), |(yes, n), is| (yes + u32::from(is), n + 1));
    (count > 0).then(|| f64::from(inside) / f64::from(count))
}

/// Mean of (difference / standard deviation)² at a sleeper, over speeds and bands.
pub(super) fn mismatch_norm(diagnosis: &Diagnosis, sleeper: usize) -> f64 {
    let levels = &diagnosis.levels;
    let (mut sum, mut count) = (0.0, 0u32);
    for speed in 0..levels.speeds_km_h.len() {
        for band in 0..levels.frequency_hz.len() {
            let difference = difference(levels, Side::Before, [speed, sleeper, band]);
            if let (Some(db), Some(sd)) = (difference, scatter(levels, speed, band)) {
                sum += (db / sd).powi(2);
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}

/// Median of the expected standard deviations, in dB; `None` if there are none.
pub(super) fn usual_scatter(levels: &Levels) -> Option<f64> {
    let mut all: Vec<f64> = levels.scatter_db.iter().flatten().copied().flatten().collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_that_are_not_compared_count_nowhere() {
        let levels = Levels {
            frequency_hz: vec![100.0, 200.0, 4000.0],
            speeds_km_h: vec![40.0],
            measured_db: vec![vec![vec![11.0, 9.0, -20.0]]],
            before_db: vec![vec![vec![10.0, 10.0, 0.0]]],
            after_db: vec![vec![vec![10.0, 10.0, 0.0]]],
            scatter_db: vec![vec![Some(2.0), Some(2.0), None]],
        };
        let cells = || (0..3).map(|band| [0, 0, band]);
        assert_eq!(rms(&levels, Side::Before, cells()), Some(1.0));
        assert_eq!(difference(&levels, Side::After, [0, 0, 2]), None);
        assert_eq!(measured(&levels, [0, 0, 2]), Some(-20.0));
    }
}
