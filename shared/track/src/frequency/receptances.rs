//! The rail's receptances as values.

use rustfft::num_complex::Complex64;

/// Receptances of the rail at a set of frequencies, in m/N.
#[derive(Clone, Debug)]
pub struct RailReceptances {
    /// Direct receptance of every rail node: `[frequency][node]`, zero where the rail is held.
    pub direct: Vec<Vec<Complex64>>,
    /// From a force at each rail seat to every rail node: `[frequency][sleeper][node]`; empty
    /// unless asked for.
    pub from_seats: Vec<Vec<Vec<Complex64>>>,
}
