//! A fitted section as a series of numbers, so that an interrupted inversion continues where it was.

use crate::fit::{Fitted, unknowns_of};
use nalgebra::DVector;
use tracktwin_diagnosis::{Exception, Own, PreparedRecording, Variation};

impl Fitted {
    /// Version of the fit. Stored sections of another version are fitted again.
    pub const VERSION: u32 = 2;

    /// The fit as numbers: values, deviations, misfits, variations, and a pair for each exception.
    pub fn numbers(&self) -> Vec<f64> {
        let Self { unknowns, values, deviations, misfit } = self;
        let variation =
            unknowns.variation.iter().flat_map(|it| [it.smooth, it.length, it.independent]);
        let exceptions =
            unknowns.exceptions.iter().flat_map(|it| [it.field as usize as f64, it.sleeper as f64]);
        values
            .iter()
            .chain(deviations)
            .chain(misfit)
            .copied()
            .chain(variation)
            .chain(exceptions)
            .collect()
    }

    /// Restores the fit of a section from [`Fitted::numbers`]; `None` if they do not belong to it.
    pub fn from_numbers(prepared: &PreparedRecording, numbers: &[f64]) -> Option<Self> {
        let mut unknowns = unknowns_of(&prepared.forward);
        let (values, rest) = numbers.split_at_checked(unknowns.count())?;
        let (deviations, rest) = rest.split_at_checked(unknowns.count())?;
        let (misfit, rest) = rest.split_at_checked(prepared.forward.section.sleepers)?;
        let (variation, exceptions) = rest.split_at_checked(3 * unknowns.variation.len())?;
        for (of, numbers) in unknowns.variation.iter_mut().zip(variation.chunks_exact(3)) {
            *of = Variation { smooth: numbers[0], length: numbers[1], independent: numbers[2] };
        }
        let exception = |pair: &[f64]| {
            let field = *Own::ALL.get(pair[0] as usize)?;
            Some(Exception { field, sleeper: pair[1] as usize })
        };
        unknowns.exceptions = exceptions.chunks_exact(2).map(exception).collect::<Option<_>>()?;
        Some(Self {
            unknowns,
            values: DVector::from_column_slice(values),
            deviations: DVector::from_column_slice(deviations),
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
        unknowns.exceptions = vec![Exception { field: Own::RailpadStiffness, sleeper: 3 }];
        let count = unknowns.count();
        let fitted = Fitted {
            values: DVector::from_fn(count, |index, _| index as f64),
            deviations: DVector::repeat(count, 0.5),
            misfit: vec![0.9; section.forward.section.sleepers],
            unknowns,
        };
        let numbers = fitted.numbers();
        let restored = Fitted::from_numbers(&section, &numbers).unwrap();
        assert_eq!(format!("{restored:?}"), format!("{fitted:?}"));
        assert!(Fitted::from_numbers(&section, &numbers[..count]).is_none());
    }
}
