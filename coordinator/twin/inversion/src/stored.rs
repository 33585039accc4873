//! A fitted section as a series of numbers, so that an interrupted inversion continues where it was.

use crate::fit::{Fitted, unknowns_of};
use nalgebra::DVector;
use tracktwin_diagnosis::{Amplitude, Exception, Own, PreparedRecording, SupportChange, Variation};

/// Kinds of stored support changes.
const TRANSITION: f64 = 0.0;
const SPOT: f64 = 1.0;

impl Fitted {
    /// Version of the fit. Stored sections of another version are fitted again.
    pub const VERSION: u32 = 8;

    /// The fit as numbers: values, deviations, misfits, variations, the deviation of the railpads' damping, the number
    /// of support changes, six numbers for each of them, and a pair for each exception.
    pub fn numbers(&self) -> Vec<f64> {
        let Self { unknowns, values, deviations, changes, misfit } = self;
        let mut numbers = [values.as_slice(), deviations.as_slice(), misfit].concat();
        numbers.extend(
            unknowns.variation.iter().flat_map(|it| [it.smooth, it.length, it.independent]),
        );
        numbers.extend([unknowns.railpad_damping_deviation, changes.len() as f64]);
        for (&change, &Amplitude { log, deviation, probability }) in
            unknowns.support_changes.iter().zip(changes)
        {
            let (kind, first, last) = match change {
                SupportChange::Transition { before, after } => (TRANSITION, before, after),
                SupportChange::Spot { first, last } => (SPOT, first, last),
            };
            numbers.extend([kind, first as f64, last as f64, log, deviation, probability]);
        }
        numbers.extend(
            unknowns.exceptions.iter().flat_map(|it| [it.field as usize as f64, it.sleeper as f64]),
        );
        numbers
    }

    /// Restores the fit of a section from [`Fitted::numbers`]; `None` if they do not belong to it.
    pub fn from_numbers(prepared: &PreparedRecording, numbers: &[f64]) -> Option<Self> {
        let mut unknowns = unknowns_of(&prepared.forward);
        let (values, rest) = numbers.split_at_checked(unknowns.count())?;
        let (deviations, rest) = rest.split_at_checked(unknowns.count())?;
        let (misfit, rest) = rest.split_at_checked(prepared.forward.section.sleepers())?;
        let (variation, rest) = rest.split_at_checked(3 * unknowns.variation.len())?;
        for (of, numbers) in unknowns.variation.iter_mut().zip(variation.chunks_exact(3)) {
            *of = Variation { smooth: numbers[0], length: numbers[1], independent: numbers[2] };
        }
        let (&[railpad_damping_deviation, count], rest) = rest.split_first_chunk()?;
        unknowns.railpad_damping_deviation = railpad_damping_deviation;
        let (stored, exceptions) = rest.split_at_checked(6 * count as usize)?;
        let change = |numbers: &[f64]| {
            let (first, last) = (numbers[1] as usize, numbers[2] as usize);
            if numbers[0] == TRANSITION {
                SupportChange::Transition { before: first, after: last }
            } else {
                SupportChange::Spot { first, last }
            }
        };
        unknowns.support_changes = stored.chunks_exact(6).map(change).collect();
        let amplitude = |numbers: &[f64]| Amplitude {
            log: numbers[3],
            deviation: numbers[4],
            probability: numbers[5],
        };
        let exception = |pair: &[f64]| {
            let field = *Own::ALL.get(pair[0] as usize)?;
            Some(Exception { field, sleeper: pair[1] as usize })
        };
        unknowns.exceptions = exceptions.chunks_exact(2).map(exception).collect::<Option<_>>()?;
        Some(Self {
            unknowns,
            values: DVector::from_column_slice(values),
            deviations: DVector::from_column_slice(deviations),
            changes: stored.chunks_exact(6).map(amplitude).collect(),
            misfit: misfit.to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use tracktwin_signal::recording::Recording;

    #[test]
    fn numbers_restore_a_fit_and_those_of_another_section_do_not() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sample");
        let recording = Recording::open(&folder).unwrap();
        let track = recording.stated_track().track;
        let section = crate::sections(&recording, &track).unwrap().remove(0);
        let mut unknowns = unknowns_of(&section.forward);
        unknowns.variation[1] = Variation { smooth: 0.2, length: 5.0, independent: 0.1 };
        unknowns.railpad_damping_deviation *= 0.5;
        unknowns.exceptions = vec![Exception { field: Own::RailpadStiffness, sleeper: 3 }];
        let spot = SupportChange::Spot { first: 4, last: 7 };
        unknowns.support_changes = vec![SupportChange::Transition { before: 2, after: 3 }, spot];
        let count = unknowns.count();
        let fitted = Fitted {
            values: DVector::from_fn(count, |index, _| index as f64),
            deviations: DVector::repeat(count, 0.5),
            changes: [0.3, -0.4]
                .map(|log| Amplitude { log, deviation: 0.1, probability: 0.9 })
                .to_vec(),
            misfit: vec![0.9; section.forward.section.sleepers()],
            unknowns,
        };
        let numbers = fitted.numbers();
        let restored = Fitted::from_numbers(&section, &numbers).unwrap();
        assert_eq!(format!("{restored:?}"), format!("{fitted:?}"));
        assert!(Fitted::from_numbers(&section, &numbers[..count]).is_none());
    }
}
