//! The parts under one degree of freedom of the rail, as a discrete transfer function for time steps.
//!
//! Railpad, sleeper, ballast and their extensions form a linear system that only the rail drives. The
//! force on the rail follows from the motion of the rail by a rational transfer function: a sum of
//! second-order sections, one per degree of freedom. The result is exact for the trapezoidal rule, which
//! equals Newmark's average acceleration.

use crate::model::Matrices;
use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};
use num_complex::Complex64;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};

/// Agreement, relative, of sections and a direct solution that both rest on 1e-16 and on an
/// eigenvalue problem of condition 1e4 or so; a defective one misses it by far.
const TOLERANCE: f64 = 1e-9;

/// Where the sections are compared with a direct solution besides the step itself: as slow as
/// 1 kHz is at 10 us.
const CHECKED_AT: f64 = 30.0;

/// Two poles of the discrete transfer function, a conjugate pair or two real ones, in the
/// variable `z - 1`, which keeps its digits where slow poles crowd near `z = 1`.
///
/// Its states follow `v ← keep v - pull w + u`, `w ← w + v`; its force is `velocity v +
/// displacement w`, before the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SecondOrderSection {
    pub(super) keep: f64,
    pub(super) pull: f64,
    pub(super) velocity: f64,
    pub(super) displacement: f64,
}

/// A substructure, reduced to its force on the rail.
///
/// The force on the rail is `relief u` from the current displacement plus the forces of the sections
/// from the past.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::time::lanes) struct Substructure {
    /// Reduction of the static stiffness of the rail in N/m by the flexibility of the substructure.
    pub(super) static_relief: f64,
    /// Reduction of the stiffness in a time step in N/m.
    pub(super) step_relief: f64,
    pub(super) sections: Vec<SecondOrderSection>,
}

impl Substructure {
    fn add(&mut self, other: &Self) {
        self.static_relief += other.static_relief;
        self.step_relief += other.step_relief;
        self.sections.extend_from_slice(&other.sections);
    }
}

/// All substructures of a track, by the degree of freedom of the rail to which they are connected.
/// Several at one degree of freedom are combined.
pub(in crate::time::lanes) type Hanging = BTreeMap<usize, Substructure>;

/// The substructures under a rail. The first `rail_dofs` degrees of freedom of the matrices are those of
/// the rail.
///
/// `None` if a substructure is connected to several degrees of freedom of the rail or to none, if its
/// mass is coupled to the rail, or if its poles cannot be separated. Such a track is solved as a whole.
pub(super) fn hanging(matrices: &Matrices, rail_dofs: usize, dt: f64) -> Option<Hanging> {
    let mut seen = vec![false; matrices.size()];
    let mut known: HashMap<Vec<u64>, Substructure> = HashMap::new();
    let mut hanging = Hanging::new();
    for start in rail_dofs..matrices.size() {
        if seen[start] {
            continue;
        }
        let (inside, rail_dof) = connected(matrices, rail_dofs, start, &mut seen)?;
        let local = Local::new(matrices, &inside, rail_dof, dt)?;
        // Sleepers are often alike, and their poles the same.
        let substructure = match known.entry(local.bits()) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(local.substructure()?),
        };
        hanging.entry(rail_dof).or_default().add(substructure);
    }
    Some(hanging)
}

/// All degrees of freedom outside the rail that are connected with `start`, ascending, and the one
/// degree of freedom of the rail to which they are connected.
fn connected(
    matrices: &Matrices,
    rail_dofs: usize,
    start: usize,
    seen: &mut [bool],
) -> Option<(Vec<usize>, usize)> {
    let (mut inside, mut rail, mut next) = (Vec::new(), None, vec![start]);
    seen[start] = true;
    while let Some(dof) = next.pop() {
        inside.push(dof);
        for &column in
            &matrices.columns()[matrices.row_starts()[dof]..matrices.row_starts()[dof + 1]]
        {
            if column >= rail_dofs {
                if !std::mem::replace(&mut seen[column], true) {
                    next.push(column);
                }
            } else if *rail.get_or_insert(column) != column {
                return None;
            }
        }
    }
    inside.sort_unstable();
    Some((inside, rail?))
}

/// The matrices of a substructure and of its coupling to the rail, damping as `2 C / dt` and mass
/// as `4 M / dt²`.
struct Local {
    stiffness: Mat<f64>,
    damping: Mat<f64>,
    mass: Mat<f64>,
    rail_stiffness: Mat<f64>,
    rail_damping: Mat<f64>,
}

impl Local {
    fn new(matrices: &Matrices, inside: &[usize], rail_dof: usize, dt: f64) -> Option<Self> {
        let n = inside.len();
        let entry = |values: &[f64], factor: f64, row: usize, column: usize| {
            matrices.place(row, column).map_or(0.0, |place| factor * values[place])
        };
        let square = |values: &[f64], factor: f64| {
            Mat::from_fn(n, n, |i, j| entry(values, factor, inside[i], inside[j]))
        };
        let coupling = |values: &[f64], factor: f64| {
            Mat::from_fn(n, 1, |i, _| entry(values, factor, inside[i], rail_dof))
        };
        let (c, m) = (2.0 / dt, 4.0 / (dt * dt));
        let rail_mass = coupling(matrices.mass(), m);
        (rail_mass.norm_max() == 0.0).then(|| Self {
            stiffness: square(matrices.stiffness(), 1.0),
            damping: square(matrices.damping(), c),
            mass: square(matrices.mass(), m),
            rail_stiffness: coupling(matrices.stiffness(), 1.0),
            rail_damping: coupling(matrices.damping(), c),
        })
    }

    fn bits(&self) -> Vec<u64> {
        let all =
            [&self.stiffness, &self.damping, &self.mass, &self.rail_stiffness, &self.rail_damping];
        let columns = all.into_iter().flat_map(Mat::col_iter);
        columns.flat_map(|column| column.iter().map(|value| value.to_bits())).collect()
    }

    /// The sections, from the poles.
    ///
    /// With `mu = 2 / (s dt) = (z + 1) / (z - 1)` the force is `b' (K mu² + C mu + M)⁻¹ b u`,
    /// `b = k mu + c`, on the matrices above: a constant, the relief at rest, and `r / (mu - mu_k)`
    /// of every pole. Stiffness carries itself, so that the problem is well posed without mass.
    fn substructure(&self) -> Option<Substructure> {
        let n = self.stiffness.nrows();
        let scaled = self.scaled_by_stiffness()?;
        let companion = Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, _) => f64::from(u8::from(j == i + n)),
            (false, true) => -scaled.mass[(i - n, j)],
            (false, false) => -scaled.damping[(i - n, j - n)],
        });
        let eigen = companion.eigen().ok()?;
        let poles: Vec<Pole> = (0..2 * n)
            .map(|k| {
                let vector: Vec<_> = (0..n).map(|i| eigen.U()[(i, k)]).collect();
                scaled.pole(eigen.S()[k], &vector)
            })
            .collect();
        let static_relief = scaled.rail_stiffness.squared_norm_l2();
        let agrees = |mu: f64| {
            let sum: Complex64 = poles.iter().map(|pole| pole.residue / (mu - pole.mu)).sum();
            let direct = scaled.relief(mu)?;
            ((static_relief + sum.re - direct).abs() < TOLERANCE * direct.abs()).then_some(direct)
        };
        agrees(CHECKED_AT)?;
        Some(Substructure { static_relief, step_relief: agrees(1.0)?, sections: sections(poles)? })
    }

    /// The same substructure in coordinates in which its stiffness is the identity.
    fn scaled_by_stiffness(&self) -> Option<Self> {
        let factor = Llt::new(self.stiffness.as_ref(), Side::Lower).ok()?;
        let lower = factor.L();
        let half = |matrix: &Mat<f64>| {
            let mut out = matrix.clone();
            lower.solve_lower_triangular_in_place(out.as_mut());
            out
        };
        let both = |matrix: &Mat<f64>| half(&half(matrix).transpose().to_owned());
        let n = self.stiffness.nrows();
        Some(Self {
            stiffness: Mat::identity(n, n),
            damping: both(&self.damping),
            mass: both(&self.mass),
            rail_stiffness: half(&self.rail_stiffness),
            rail_damping: half(&self.rail_damping),
        })
    }

    /// Residue at a pole with its vector, both matrices being symmetric.
    fn pole(&self, mu: Complex64, vector: &[Complex64]) -> Pole {
        let load = |i: usize| self.rail_stiffness[(i, 0)] * mu + self.rail_damping[(i, 0)];
        let loaded: Complex64 = vector.iter().enumerate().map(|(i, x)| load(i) * x).sum();
        let damped = |i: usize| -> Complex64 {
            vector.iter().enumerate().map(|(j, x)| x * self.damping[(i, j)]).sum()
        };
        let slope: Complex64 =
            vector.iter().enumerate().map(|(i, x)| x * (2.0 * mu * x + damped(i))).sum();
        Pole { mu, residue: loaded * loaded / slope }
    }

    /// `b' (K mu² + C mu + M)⁻¹ b` at a real `mu`, solved directly.
    fn relief(&self, mu: f64) -> Option<f64> {
        let n = self.stiffness.nrows();
        let matrix = Mat::from_fn(n, n, |i, j| {
            self.stiffness[(i, j)] * mu * mu + self.damping[(i, j)] * mu + self.mass[(i, j)]
        });
        let load =
            Mat::from_fn(n, 1, |i, _| self.rail_stiffness[(i, 0)] * mu + self.rail_damping[(i, 0)]);
        let factor = Llt::new(matrix.as_ref(), Side::Lower).ok()?;
        Some((load.transpose() * factor.solve(&load))[(0, 0)])
    }
}

/// A pole in `mu` and its residue.
#[derive(Clone, Copy)]
struct Pole {
    mu: Complex64,
    residue: Complex64,
}

impl Pole {
    /// Its place `z - 1`.
    fn delta(self) -> Complex64 {
        2.0 / (self.mu - 1.0)
    }

    /// Its residue in `z`.
    fn gain(self) -> Complex64 {
        -2.0 * self.residue / ((1.0 - self.mu) * (1.0 - self.mu))
    }
}

/// Poles two by two: conjugates, then the real ones in their order.
fn sections(poles: Vec<Pole>) -> Option<Vec<SecondOrderSection>> {
    let (mut real, complex): (Vec<Pole>, Vec<Pole>) =
        poles.into_iter().partition(|pole| pole.mu.im == 0.0);
    real.sort_by(|a, b| a.mu.re.total_cmp(&b.mu.re));
    let upper = complex.iter().filter(|pole| pole.mu.im > 0.0);
    let conjugate = |pole: &Pole| Pole { mu: pole.mu.conj(), residue: pole.residue.conj() };
    let mut sections: Vec<_> =
        upper.map(|pole| second_order_section(*pole, conjugate(pole))).collect();
    let (pairs, rest) = real.as_chunks::<2>();
    sections.extend(pairs.iter().map(|[a, b]| second_order_section(*a, *b)));
    (rest.is_empty() && 2 * sections.len() == complex.len() + real.len()).then_some(sections)
}

fn second_order_section(a: Pole, b: Pole) -> SecondOrderSection {
    let (sum, product) = ((a.delta() + b.delta()).re, (a.delta() * b.delta()).re);
    SecondOrderSection {
        keep: 1.0 + sum,
        pull: product,
        velocity: (a.gain() + b.gain()).re,
        displacement: -(a.gain() * b.delta() + b.gain() * a.delta()).re,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mesh, Support, TrackModel};
    use tracktwin_parameters::{Parameter, ParameterSet, TrackDesign};

    const DT: f64 = 1e-5;

    fn substructures(set: &ParameterSet) -> (TrackModel, Hanging) {
        let supports = vec![Support::from(set); 3];
        let mesh = Mesh::uniform(4, 2, 4);
        let model = TrackModel::build(&TrackDesign::v_track(), &mesh, &supports, &[]).unwrap();
        let hanging = hanging(model.matrices(), model.layout().rail_dofs(), DT).unwrap();
        (model, hanging)
    }

    /// The force of the sections under a motion of the rail at these steps.
    fn force(substructure: &Substructure, motion: &[f64]) -> Vec<f64> {
        let mut states = vec![[0.0; 2]; substructure.sections.len()];
        let step = |&moved: &f64| {
            let mut force = substructure.step_relief * moved;
            for (section, [v, w]) in substructure.sections.iter().zip(&mut states) {
                force += section.velocity * *v + section.displacement * *w;
                (*v, *w) = (section.keep * *v - section.pull * *w + moved, *w + *v);
            }
            force
        };
        motion.iter().map(step).collect()
    }

    #[test]
    fn a_rail_that_stays_lowered_feels_what_gives_way_at_rest() {
        let (_, hanging) = substructures(&ParameterSet::nominal());
        assert_eq!(hanging.len(), 3);
        let substructure = hanging.values().next().unwrap();
        let settled = force(substructure, &vec![1.0; 20_000])[19_999];
        // The slowest motion dies out in some 3 ms: nothing is left of it after 200.
        assert!((settled / substructure.static_relief - 1.0).abs() < 1e-9, "{settled}");
    }

    #[test]
    fn overdamped_pads_have_real_poles_and_are_condensed_too() {
        let stiff = ParameterSet::nominal()[Parameter::RailpadDamping] * 50.0;
        let set = ParameterSet::nominal().with(Parameter::RailpadDamping, stiff);
        let (model, hanging) = substructures(&set);
        let inside = model.layout().sleepers()[0].dofs().len();
        assert!(hanging.values().all(|of| of.sections.len() == inside));
    }

    #[test]
    fn without_stiffness_of_its_own_nothing_is_condensed() {
        let mut support = Support::from(&ParameterSet::nominal());
        (support.ballast_stiffness, support.railpad_stiffness) = (0.0, 0.0);
        let mesh = Mesh::uniform(4, 2, 4);
        let model = TrackModel::build(&TrackDesign::v_track(), &mesh, &[support; 3], &[]).unwrap();
        assert!(hanging(model.matrices(), model.layout().rail_dofs(), DT).is_none());
    }
}
