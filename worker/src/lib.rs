//! A worker: parameter set in, features out.
