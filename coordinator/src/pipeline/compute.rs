//! The one door from asynchronous code to computations that take long.

/// Computes on this thread; its other tasks move to another one.
///
/// # Panics
/// On a single-threaded runtime, which cannot move its other tasks.
pub fn compute<T>(work: impl FnOnce() -> T) -> T {
    tokio::task::block_in_place(work)
}
