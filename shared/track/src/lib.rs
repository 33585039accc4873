//! Finite-element model of wheel and track.
