//! The evaluation.
