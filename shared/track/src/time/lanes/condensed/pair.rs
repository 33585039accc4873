//! Products of two-by-two blocks with pairs of numbers, in all lanes.
//!
//! A full block is written row by row, a symmetric one as its first, mixed and last entry.

use crate::time::lanes::block::Block;

pub(super) type Full = [Block; 4];
pub(super) type Symmetric = [Block; 3];
pub(super) type Pair = [Block; 2];

/// `sum + A x`.
#[inline(always)]
pub(super) fn add([a, b, c, d]: Full, [x, y]: Pair, [s, t]: Pair) -> Pair {
    [b.mul_add(y, a.mul_add(x, s)), d.mul_add(y, c.mul_add(x, t))]
}

/// `sum + A' x`.
#[inline(always)]
pub(super) fn add_transposed(a: Full, x: Pair, sum: Pair) -> Pair {
    add(transposed(a), x, sum)
}

/// `sum - A x`.
#[inline(always)]
pub(super) fn subtract([a, b, c, d]: Full, [x, y]: Pair, [s, t]: Pair) -> Pair {
    let (s, t) = (a.subtracted_from(x, s), c.subtracted_from(x, t));
    [b.subtracted_from(y, s), d.subtracted_from(y, t)]
}

/// `sum - A' x`.
#[inline(always)]
pub(super) fn subtract_transposed(a: Full, x: Pair, sum: Pair) -> Pair {
    subtract(transposed(a), x, sum)
}

/// `sum + S x`.
#[inline(always)]
pub(super) fn add_symmetric([a, b, c]: Symmetric, [x, y]: Pair, [s, t]: Pair) -> Pair {
    [b.mul_add(y, a.mul_add(x, s)), c.mul_add(y, b.mul_add(x, t))]
}

/// `S x`.
#[inline(always)]
pub(super) fn times_vector([a, b, c]: Symmetric, [x, y]: Pair) -> Pair {
    [b.mul_add(y, a * x), c.mul_add(y, b * x)]
}

/// `A'`.
#[inline(always)]
pub(super) fn transposed([a, b, c, d]: Full) -> Full {
    [a, c, b, d]
}

/// `-A`.
pub(super) fn negated(a: Full) -> Full {
    a.map(|entry| Block::default() - entry)
}

/// `A S`.
pub(super) fn times_symmetric([a, b, c, d]: Full, [p, q, r]: Symmetric) -> Full {
    [b.mul_add(q, a * p), b.mul_add(r, a * q), d.mul_add(q, c * p), d.mul_add(r, c * q)]
}

/// `S - A B'`, where that is symmetric.
pub(super) fn less_product(
    [p, q, r]: Symmetric,
    [a, b, c, d]: Full,
    [e, f, g, h]: Full,
) -> Symmetric {
    [
        b.subtracted_from(f, a.subtracted_from(e, p)),
        b.subtracted_from(h, a.subtracted_from(g, q)),
        d.subtracted_from(h, c.subtracted_from(g, r)),
    ]
}

/// Inverse of a symmetric block and its two pivots; it is positive definite where both are
/// positive.
pub(super) fn inverse([p, q, r]: Symmetric) -> (Symmetric, [Block; 2]) {
    let first = p.recip();
    let ratio = q * first;
    let pivot = ratio.subtracted_from(q, r);
    let last = pivot.recip();
    let mixed = ratio * last;
    ([mixed.mul_add(ratio, first), Block::default() - mixed, last], [p, pivot])
}
