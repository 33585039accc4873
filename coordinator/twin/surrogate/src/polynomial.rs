//! Polynomials in the parameters of a library, for the expected features of a track.

use faer::{Mat, MatRef};

/// Smallest number of entries per coefficient; the degree is lowered until it is reached.
const ENTRIES_PER_COEFFICIENT: usize = 8;
/// The logarithm of a parameter is used if its range spans more than this ratio: the effect of stiffness
/// and irregularity level on a spectrum saturates or is multiplicative.
const LOGARITHMIC_FROM: f64 = 4.0;

/// All monomials up to a total degree, in parameters mapped onto [-1, 1].
#[derive(Clone, Debug)]
pub(crate) struct Polynomial {
    axes: Vec<UnitAxis>,
    /// Every monomial is the sorted list of the axes that are its factors.
    monomials: Vec<Vec<usize>>,
}

/// Range of a parameter, or of its logarithm, that is mapped onto [-1, 1].
#[derive(Clone, Copy, Debug)]
struct UnitAxis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Polynomial {
    /// The polynomial of the highest total degree, at most `degree_max`, that these `parameters` (n
    /// x p) can determine.
    pub(crate) fn of(parameters: MatRef<'_, f64>, degree_max: usize) -> Self {
        let axes: Vec<_> =
            parameters.col_iter().map(|column| UnitAxis::of(column.iter().copied())).collect();
        let monomials = (1..=degree_max)
            .rev()
            .map(|degree| monomials(axes.len(), degree))
            .find(|m| m.len() * ENTRIES_PER_COEFFICIENT <= parameters.nrows())
            .unwrap_or_else(|| self::monomials(axes.len(), 1));
        Self { axes, monomials }
    }

    /// Number of coefficients.
    pub(crate) fn coefficients(&self) -> usize {
        self.monomials.len()
    }

    /// Maps parameters (n x p) onto [-1, 1] by their ranges.
    pub(crate) fn unit(&self, parameters: MatRef<'_, f64>) -> Mat<f64> {
        Mat::from_fn(parameters.nrows(), self.axes.len(), |i, j| {
            self.axes[j].unit(parameters[(i, j)])
        })
    }

    /// Values of the monomials (n x coefficients) at mapped parameters (n x p).
    pub(crate) fn basis(&self, unit: MatRef<'_, f64>) -> Mat<f64> {
        Mat::from_fn(unit.nrows(), self.monomials.len(), |i, k| {
            self.monomials[k].iter().map(|&axis| unit[(i, axis)]).product()
        })
    }

    /// Derivatives of the monomials (p x coefficients) with respect to the mapped parameters, at the point
    /// `unit`.
    pub(crate) fn slopes(&self, unit: &[f64]) -> Mat<f64> {
        Mat::from_fn(self.axes.len(), self.monomials.len(), |axis, k| {
            let monomial = &self.monomials[k];
            let power = monomial.iter().filter(|&&factor| factor == axis).count();
            let others = monomial.iter().filter(|&&factor| factor != axis);
            let rest: f64 = others.map(|&factor| unit[factor]).product();
            let Some(lower) = power.checked_sub(1) else { return 0.0 };
            power as f64 * (0..lower).map(|_| unit[axis]).product::<f64>() * rest
        })
    }
}

impl UnitAxis {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        let [low, high] = values.fold(ends, |[low, high], v| [low.min(v), high.max(v)]);
        if low > 0.0 && high / low > LOGARITHMIC_FROM {
            Self { low: low.ln(), high: high.ln(), logarithmic: true }
        } else {
            Self { low, high, logarithmic: false }
        }
    }

    fn unit(self, value: f64) -> f64 {
        let scaled = if self.logarithmic { value.ln() } else { value };
        2.0 * (scaled - self.low) / (self.high - self.low) - 1.0
    }
}

/// Monomials of total degree 0 to `degree`, each as the sorted list of its factors.
fn monomials(axes: usize, degree: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    let mut last = all.clone();
    for _ in 0..degree {
        last = last
            .iter()
            .flat_map(|m: &Vec<usize>| {
                let from = m.last().copied().unwrap_or(0);
                (from..axes).map(move |axis| [m.as_slice(), &[axis]].concat())
            })
            .collect();
        all.extend_from_slice(&last);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_parameters_have_84_monomials_up_to_cubes() {
        assert_eq!(monomials(6, 3).len(), 84);
        assert_eq!(monomials(2, 2), [vec![], vec![0], vec![1], vec![0, 0], vec![0, 1], vec![1, 1]]);
    }

    #[test]
    fn slopes_are_those_of_small_steps() {
        let parameters = Mat::from_fn(200, 2, |i, j| 1.0 + ((i * (7 + 4 * j)) % 40) as f64);
        let polynomial = Polynomial::of(parameters.as_ref(), 3);
        let value = |at: [f64; 2]| polynomial.basis(Mat::from_fn(1, 2, |_, j| at[j]).as_ref());
        let (at, step) = ([0.3, -0.7], 1e-5);
        let slopes = polynomial.slopes(&at);
        for axis in 0..2 {
            let moved = |by: f64| {
                value(std::array::from_fn(|j| at[j] + by * f64::from(u8::from(j == axis))))
            };
            let difference = (moved(step) - moved(-step)) * faer::Scale(0.5 / step);
            for k in 0..polynomial.coefficients() {
                assert!((difference[(0, k)] - slopes[(axis, k)]).abs() < 1e-9);
            }
        }
    }
}
