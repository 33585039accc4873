//! The parameters that statements and pictures are about.

use tracktwin_parameters::Parameter;

/// Those of the paper's Fig. 20, in its order.
pub(crate) const ALONG: [Parameter; 4] = [
    Parameter::IrregularityLevel,
    Parameter::RailpadStiffness,
    Parameter::SleeperBendingStiffness,
    Parameter::BallastStiffness,
];

/// Those of the paper's Fig. 24, which each sleeper has of its own.
pub(crate) const OWN: [Parameter; 3] =
    [Parameter::IrregularityLevel, Parameter::RailpadStiffness, Parameter::BallastStiffness];

/// Those whose truth is a number of each sleeper.
pub(crate) const STIFFNESSES: [Parameter; 2] =
    [Parameter::RailpadStiffness, Parameter::BallastStiffness];
