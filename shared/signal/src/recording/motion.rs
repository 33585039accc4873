//! Faults of a column of positions: motions that no wheel makes.

use tracktwin_number::{rounded, significant};

/// Why positions are no motion of a wheel, with the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionFault {
    /// The position runs against the direction of travel.
    #[error(
        "{} from {} m to {} m at row {row}, against the direction of travel; smooth the \
             positions, or omit them and give the speed",
        if after < before { "decreases" } else { "increases" },
        rounded(*before, 9), rounded(*after, 9)
    )]
    RunsBack {
        /// The row, counted from 1, where it does.
        row: usize,
        /// The position in m one row earlier.
        before: f64,
        /// The position in m of that row.
        after: f64,
    },
    /// The position decreases from start to end.
    #[error(
        "decreases along the pass, from {} m to {} m; change the sign of the positions, \
             also those of the sleepers",
        rounded(*from_m, 9), rounded(*to_m, 9)
    )]
    Decreases {
        /// The first position in m.
        from_m: f64,
        /// The last one in m.
        to_m: f64,
    },
    /// Some files run one way along the positions and some the other.
    #[error(
        "the positions decrease, but those of other files increase; import each direction \
             separately"
    )]
    Directions,
    /// The position restarts.
    #[error(
        "restarts at row {row}, from {} m to {} m, as a counter does that is reset or full; \
             split the pass there into two files",
        rounded(*before, 9), rounded(*after, 9)
    )]
    Restarts {
        /// The row, counted from 1, where it does.
        row: usize,
        /// The position in m one row earlier.
        before: f64,
        /// The position in m of that row.
        after: f64,
    },
    /// The position jumps ahead.
    #[error(
        "jumps from {} m to {} m at row {row}{}",
        rounded(*before, 9), rounded(*after, 9), after_rest(*constant_from, *row)
    )]
    Jumps {
        /// The row, counted from 1, where it does.
        row: usize,
        /// The position in m one row earlier.
        before: f64,
        /// The position in m of that row.
        after: f64,
        /// The first of the rows with the position before the jump, if the position stood still there.
        constant_from: Option<usize>,
    },
    /// The wheel is at rest.
    #[error(
        "does not change {}; keep only the parts where the wheel rolls and the position changes",
        standing(*from_s, *to_s, *row)
    )]
    StandsStill {
        /// The first row, counted from 1, with the constant position.
        row: usize,
        /// Start of the standstill in s from the first row.
        from_s: f64,
        /// End of the standstill in s. `None`: until the end of the pass.
        to_s: Option<f64>,
    },
    /// The position changes too rarely to be straightened.
    #[error(
        "changes only {steps} time{}, by {} m each; record positions with a finer \
             resolution, or omit them and give the speed",
        if *steps == 1 { "" } else { "s" }, significant(*step_m, 2)
    )]
    FewSteps {
        /// How often it changes.
        steps: usize,
        /// The median change in m.
        step_m: f64,
    },
    /// Steps of the position are too long to separate sleepers.
    #[error(
        "advances in steps of {} m; steps above {} m cannot separate sleepers: record \
             positions with a finer resolution, or give the speed and the position of a sleeper",
        significant(*step_m, 2), significant(*needed_m, 2)
    )]
    CoarsePosition {
        /// The median step in m.
        step_m: f64,
        /// Largest sufficient step in m.
        needed_m: f64,
    },
}

impl MotionFault {
    /// The fault of positions whose signs were changed, in terms of the positions themselves.
    pub(super) fn with_signs_changed(self) -> Self {
        match self {
            Self::RunsBack { row, before, after } => {
                Self::RunsBack { row, before: -before, after: -after }
            }
            Self::Restarts { row, before, after } => {
                Self::Restarts { row, before: -before, after: -after }
            }
            Self::Jumps { row, before, after, constant_from } => {
                Self::Jumps { row, before: -before, after: -after, constant_from }
            }
            other => other,
        }
    }
}

/// The remedy of a jump: the rows before it in which the position did not change are wrong, too.
fn after_rest(constant_from: Option<usize>, row: usize) -> String {
    constant_from.map_or_else(
        || "; split the pass there".to_owned(),
        |from| {
            format!(
                " and does not change from row {from} to row {}; leave these rows out, and split \
                 the pass there into two files",
                row - 1
            )
        },
    )
}

/// When a wheel is at rest.
fn standing(from_s: f64, to_s: Option<f64>, row: usize) -> String {
    to_s.map_or_else(
        || "during the whole pass".to_owned(),
        |to_s| format!("from {from_s:.2} s to {to_s:.2} s, from row {row} on"),
    )
}
