//! The one door from asynchronous code to computations that take long.

/// Computes on this thread, whose other tasks go on on another one.
///
/// # Panics
/// On a runtime of one thread: nobody is left for its other tasks.
pub fn compute<T>(work: impl FnOnce() -> T) -> T {
    tokio::task::block_in_place(work)
}
