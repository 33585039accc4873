//! The tracks of the paper's numerical examples (section 4) and the nominal track, and their
//! evaluations.

use crate::{Error, Figure};
use Parameter::{BallastStiffness, IrregularityLevel, RailpadStiffness, SleeperBendingStiffness};
use tracktwin_evaluation::{Estimate, Estimates, Evaluation};
use tracktwin_parameters::{Parameter, ParameterSet};

/// Sleepers of a track section (paper, Fig. 15).
pub(crate) const SLEEPERS: usize = 9;

/// Parameter sets A0 to A3: railpad and ballast stiffness in N/m (paper, Table 4.1).
const TABLE_4_1: [[f64; 2]; 4] = [[2e8, 2e7], [1.5e8, 1.6e7], [1e8, 1.2e7], [5e7, 8e6]];

/// The smallest change of a stiffness between two of these sets in N/m: the resolution of the
/// examples.
pub(crate) fn smallest_step(parameter: Parameter) -> f64 {
    let column = usize::from(parameter == BallastStiffness);
    let steps = TABLE_4_1.windows(2).map(|pair| (pair[0][column] - pair[1][column]).abs());
    steps.fold(f64::INFINITY, f64::min)
}

/// Levels of irregularity of Fig. 17 in 1e-4 m2 rad/m.
const LEVELS: [f64; 3] = [2.0, 3.0, 4.0];

/// Bending stiffness of Fig. 18 in N m2: low, middle and high in Table D1's range, as the text does
/// not give the paper's.
const BENDING_N_M2: [f64; 3] = [4000.0, 5000.0, 6000.0];

/// Lengths of the rail's elements in m between sleepers 1 and 5 and between 5 and 9 (paper,
/// section 4).
const ELEMENTS_M: [f64; 2] = [0.3e-3, 6.3e-3];

/// Surfaces over which the nominal track is passed in Fig. 3.
const NOMINAL: usize = 8;

/// Sleepers, from 1, at which stiffness is reduced in Fig. 19.
pub(crate) const REDUCED: [std::ops::RangeInclusive<usize>; 3] = [4..=4, 4..=6, 5..=9];

/// A track section of nine sleepers.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// Figure that the example belongs to.
    pub figure: Figure,
    /// Title of the column in the figure of the paper.
    pub name: String,
    /// The parameters at each sleeper.
    pub sleepers: Vec<ParameterSet>,
    /// Seed of the surface; the examples of section 4 have different ones.
    pub seed: u64,
}

/// The examples of a figure, one per column. Empty for figures without examples.
pub fn examples(figure: Figure) -> Vec<Example> {
    let example = |name: String, of: &dyn Fn(usize) -> ParameterSet| Example {
        figure,
        name,
        sleepers: (1..=SLEEPERS).map(of).collect(),
        seed: 0,
    };
    let first_seed = match figure {
        Figure::Fig17 => 4,
        Figure::Fig18 => 7,
        Figure::Fig19 => 10,
        Figure::Fig2 | Figure::Fig3 => 13,
        _ => 1,
    };
    let seeds = first_seed..;
    let nominal = |at| example(format!("nominal {at}"), &|_| ParameterSet::nominal());
    let examples: Vec<Example> = match figure {
        // Fig. 2 shows the first pass of Fig. 3.
        Figure::Fig2 => vec![nominal(1)],
        Figure::Fig3 => (1..=NOMINAL).map(nominal).collect(),
        Figure::Fig16 => (1..=3)
            .map(|to| example(format!("A0 to A{to}"), &|at| set(if at <= 4 { 0 } else { to })))
            .collect(),
        Figure::Fig17 => LEVELS
            .iter()
            .map(|&level| {
                example(format!("A_irr {level}"), &|_| set(2).with(IrregularityLevel, level))
            })
            .collect(),
        Figure::Fig18 => BENDING_N_M2
            .iter()
            .map(|&stiffness| {
                let of = |_| set(2).with(SleeperBendingStiffness, stiffness);
                example(format!("EI_s {stiffness} N m²"), &of)
            })
            .collect(),
        Figure::Fig19 => REDUCED
            .iter()
            .map(|reduced| {
                let of = |at| set(if reduced.contains(&at) { 3 } else { 2 });
                let count = reduced.clone().count();
                example(format!("{count} of nine reduced"), &of)
            })
            .collect(),
        Figure::Fig8
        | Figure::Fig9
        | Figure::Fig10
        | Figure::Fig11
        | Figure::Fig12
        | Figure::Fig13
        | Figure::Fig14
        | Figure::Fig15
        | Figure::Fig25 => Vec::new(),
    };
    examples.into_iter().zip(seeds).map(|(example, seed)| Example { seed, ..example }).collect()
}

/// The nominal track with railpads and ballast of a row of Table 4.1.
fn set(row: usize) -> ParameterSet {
    let [railpad, ballast] = TABLE_4_1[row];
    ParameterSet::nominal().with(RailpadStiffness, railpad).with(BallastStiffness, ballast)
}

impl Example {
    /// Number of rail elements between a sleeper, counted from 1, and the next sleeper at the distance
    /// `spacing_m`.
    pub fn elements(sleeper: usize, spacing_m: f64) -> usize {
        let length_m = if sleeper < 5 { ELEMENTS_M[0] } else { ELEMENTS_M[1] };
        (spacing_m / length_m).round() as usize
    }

    /// The name of a sleeper, counted from 1.
    pub fn sleeper(number: usize) -> String {
        format!("S{number}")
    }
}

/// The evaluation of an example.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluatedExample {
    /// The truth.
    pub example: Example,
    /// Estimates, one per sleeper.
    pub sleepers: Vec<Estimates>,
    /// Estimates of the same recording by inversion; `None` if it was evaluated with models only.
    pub inverted: Option<Vec<Estimates>>,
}

impl EvaluatedExample {
    /// The estimates of an evaluation of the example's recording.
    ///
    /// # Errors
    /// [`Error::NotEstimated`] names the sleeper and the parameter without an estimate.
    pub fn new(example: Example, evaluation: &Evaluation) -> Result<Self, Error> {
        let found = evaluation.sleepers.iter().map(|sleeper| (&*sleeper.id, &sleeper.estimates));
        let sleepers = complete(example.figure, found)?;
        Ok(Self { example, sleepers, inverted: None })
    }

    /// Adds the estimates of an inversion of the example's recording: id and estimates of each sleeper.
    ///
    /// # Errors
    /// [`Error::NotEstimated`] names the sleeper and the parameter without an estimate.
    pub fn with_inversion<'a>(
        mut self,
        found: impl Iterator<Item = (&'a str, &'a Estimates)>,
    ) -> Result<Self, Error> {
        self.inverted = Some(complete(self.example.figure, found)?);
        Ok(self)
    }

    /// The example with the estimates of its inversion instead of those of the models.
    pub(crate) fn by_inversion(&self) -> Option<Self> {
        let sleepers = self.inverted.clone()?;
        Some(Self { example: self.example.clone(), sleepers, inverted: None })
    }

    /// What is true of a sleeper, counted from 1.
    pub(crate) fn truth(&self, sleeper: usize, parameter: Parameter) -> f64 {
        self.example.sleepers[sleeper - 1][parameter]
    }

    /// Its estimates.
    pub(crate) fn estimate(&self, sleeper: usize, parameter: Parameter) -> Estimate {
        self.sleepers[sleeper - 1][&parameter]
    }

    /// Estimates at these sleepers.
    pub(crate) fn estimates(
        &self,
        sleepers: impl IntoIterator<Item = usize>,
        parameter: Parameter,
    ) -> Vec<Estimate> {
        sleepers.into_iter().map(|sleeper| self.estimate(sleeper, parameter)).collect()
    }
}

/// The estimates of all sleepers of an example, in their order.
fn complete<'a>(
    figure: Figure,
    found: impl Iterator<Item = (&'a str, &'a Estimates)>,
) -> Result<Vec<Estimates>, Error> {
    let found: Vec<_> = found.collect();
    let of = |number: usize| {
        let name = Example::sleeper(number);
        let sleeper = found.iter().find(|(id, _)| *id == name);
        let estimates = sleeper.map(|(_, estimates)| (*estimates).clone()).unwrap_or_default();
        let varied =
            [RailpadStiffness, BallastStiffness, SleeperBendingStiffness, IrregularityLevel];
        match varied.iter().find(|parameter| !estimates.contains_key(parameter)) {
            Some(missing) => {
                Err(Error::NotEstimated { figure, sleeper: number, symbol: missing.symbol() })
            }
            None => Ok(estimates),
        }
    };
    (1..=SLEEPERS).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_examples_are_the_paper_s() {
        let step = &examples(Figure::Fig16)[2];
        assert_eq!(step.sleepers[3][RailpadStiffness], 2e8);
        assert_eq!(step.sleepers[4][RailpadStiffness], 5e7);
        assert_eq!(step.sleepers[4][BallastStiffness], 8e6);
        let local = &examples(Figure::Fig19)[1];
        let soft = local.sleepers.iter().filter(|set| set[BallastStiffness] == 8e6).count();
        assert_eq!((soft, local.name.as_str()), (3, "3 of nine reduced"));
        assert_eq!(examples(Figure::Fig17)[0].sleepers[8][IrregularityLevel], 2.0);
        assert!(examples(Figure::Fig12).is_empty());
        let seeds = Figure::ALL[3..].iter().flat_map(|&figure| examples(figure));
        assert!(seeds.map(|example| example.seed).eq(1..=12));
        assert_eq!(examples(Figure::Fig2)[0].seed, examples(Figure::Fig3)[0].seed);
    }

    #[test]
    fn the_smallest_steps_are_those_of_the_table() {
        assert_eq!(smallest_step(RailpadStiffness), 5e7);
        assert_eq!(smallest_step(BallastStiffness), 4e6);
    }

    #[test]
    fn the_mesh_is_fine_up_to_the_fifth_sleeper() {
        assert_eq!(Example::elements(1, 0.125), 417);
        assert_eq!(Example::elements(4, 0.125), 417);
        assert_eq!(Example::elements(5, 0.125), 20);
    }
}
