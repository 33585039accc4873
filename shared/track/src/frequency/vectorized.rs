//! Computations that are compiled for each instruction set of the processor.

use pulp::{Arch, NullaryFnOnce};

/// Runs a computation in the copy that is compiled for the widest vectors of this processor.
///
/// The closure needs the attribute `#[inline(always)]`, and so does what it calls. Otherwise the loops are compiled
/// for the oldest processor. `Arch::dispatch` of a closure is not enough: it calls the closure through
/// `FnOnce::call_once`, which is not inlined.
pub fn vectorized<R>(compute: impl Fn() -> R) -> R {
    struct Compute<F>(F);
    impl<R, F: Fn() -> R> NullaryFnOnce for Compute<F> {
        type Output = R;

        #[inline(always)]
        fn call(self) -> R {
            (self.0)()
        }
    }
    Arch::new().dispatch(Compute(compute))
}
