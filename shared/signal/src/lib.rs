//! Signals and their features.
