//! Entry point for long computations from asynchronous code.

/// Runs `work` on this thread. The runtime moves other tasks of this thread to another one.
///
/// # Panics
/// Panics on a single-threaded runtime, which cannot move other tasks.
pub fn compute<T>(work: impl FnOnce() -> T) -> T {
    tokio::task::block_in_place(work)
}
