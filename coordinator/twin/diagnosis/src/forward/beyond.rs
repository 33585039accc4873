//! Track beyond the compared sleepers: position of its ends, and supports of the next sleepers.
//!
//! No measurement shows these quantities, but they affect the first and last compared sleepers. The forward
//! model computes their effect once, on a track with typical values. Afterwards it treats the effect as
//! linear.

use super::Forward;
use crate::baseline::{ENDS_SPANS, Outer};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use tracktwin_track::extension::Extension;
use tracktwin_track::model::{Assembly, ModelError, Support};

/// Change of a logarithm in either direction for a numerical derivative; about its standard deviation.
const STEP: f64 = 0.25;

impl Forward {
    /// Includes the unknown ends of the track and the unknown supports of its next sleepers. Their linear
    /// effect on the log powers is computed on a track with these values.
    ///
    /// # Errors
    /// The errors of [`Forward::log_power`].
    pub fn allow_beyond(&mut self, values: &DVector<f64>) -> Result<(), ModelError> {
        let plain = self.log_power(values, &[])?;
        let ends = ENDS_SPANS.into_par_iter().map(|spans| {
            let ended = self.with_ends(spans).log_power(values, &[])?;
            Ok(ended - &plain)
        });
        let outer = self.unknowns.outer_supports().into_par_iter().map(|outer| {
            let [below, above] = [-STEP, STEP].map(|change| {
                let held: Arc<dyn Extension> = Arc::new(self.held(outer, change));
                self.log_power(values, &[held])
            });
            Ok((above? - below?) / (2.0 * STEP))
        });
        let changes: Vec<DVector<f64>> = ends.chain(outer).collect::<Result<_, ModelError>>()?;
        self.beyond = DMatrix::from_columns(&changes);
        Ok(())
    }

    fn held(&self, outer: Outer, change: f64) -> Held {
        // The first of the section's sleepers has number zero there.
        let first = self.section.in_track(0);
        let in_track = first.checked_add_signed(outer.sleeper).expect("spans are modelled beyond");
        let sleepers = match outer.is_last {
            true if outer.sleeper < 0 => 0..in_track + 1,
            true => in_track..self.section.spans() - 1,
            false => in_track..in_track + 1,
        };
        Held { sleepers, is_railpad: outer.is_railpad, factor: change.exp() }
    }
}

/// Sleepers whose railpad or ballast stiffness is multiplied by a factor.
#[derive(Debug)]
struct Held {
    /// Indices in the track.
    sleepers: Range<usize>,
    is_railpad: bool,
    factor: f64,
}

impl Extension for Held {
    fn assemble(&self, assembly: &mut Assembly) {
        let [railpad, ballast] =
            if self.is_railpad { [self.factor, 1.0] } else { [1.0, self.factor] };
        for index in self.sleepers.clone() {
            let support = assembly.supports()[index];
            let railpad_stiffness = railpad * support.railpad_stiffness;
            let ballast_stiffness = ballast * support.ballast_stiffness;
            let held = Support { railpad_stiffness, ballast_stiffness, ..support };
            assembly.set_support(index, held);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bands::Bands;
    use crate::section::Section;
    use tracktwin_parameters::TrackDesign;

    fn forward() -> Forward {
        let section = Section::new(TrackDesign::v_track(), 4, 1.0);
        Forward::new(section, Bands::new(200.0, 2000.0), &[13.0, 7.0], vec![0.0; 2])
    }

    #[test]
    fn one_of_the_possible_ends_is_predicted_as_if_it_were_there() {
        let mut forward = forward();
        let mut values = forward.unknowns.typical();
        let ended = forward.with_ends(8).log_power(&values, &[]).unwrap();
        let plain = forward.log_power(&values, &[]).unwrap();
        forward.allow_beyond(&values).unwrap();
        let eight = ENDS_SPANS.iter().position(|spans| *spans == 8).unwrap();
        values[forward.unknowns.ends().start + eight] = 1.0;
        let error = (forward.log_power(&values, &[]).unwrap() - &ended).amax();
        assert!(error < 1e-9, "{error}");
        assert!((plain - ended).amax() > 0.01);
    }

    #[test]
    fn a_sleeper_beyond_the_section_is_felt_at_its_end_as_if_it_were_compared() {
        let mut forward = forward();
        let values = forward.unknowns.typical();
        forward.allow_beyond(&values).unwrap();
        let plain = forward.log_power(&values, &[]).unwrap();
        // The same track, of which three sleepers more are compared at either end.
        let section =
            Section { spans_beyond: 13, ..Section::new(forward.section.track.clone(), 10, 0.625) };
        let wider = Forward::new(section, forward.bands.clone(), &[13.0, 7.0], vec![0.0; 2]);
        let of_wider = wider.unknowns.typical();
        for (column, outer) in forward.unknowns.outer().zip(forward.unknowns.outer_supports()) {
            let range =
                if outer.is_railpad { wider.unknowns.railpad() } else { wider.unknowns.ballast() };
            let wide = |change: f64| {
                let mut changed = of_wider.clone();
                changed[range.start.strict_add_signed(outer.sleeper + 3)] += change;
                wider.log_power(&changed, &[]).unwrap()
            };
            let expected = 0.5 * (wide(STEP) - wide(-STEP));
            let expected = expected.rows(3 * forward.per_sleeper(), forward.count());
            let mut near = values.clone();
            near[column] = STEP;
            let found = forward.log_power(&near, &[]).unwrap() - &plain;
            assert!((&found - expected).amax() < 1e-9);
            assert!(found.amax() > 1e-3, "{}", found.amax());
        }
    }
}
