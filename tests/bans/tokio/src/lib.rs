//! A stand-in for tokio with nothing but `spawn`, where the real one has it.

pub use task::spawn;

/// Where the real one defines it.
pub mod task {
    /// Drops the future.
    pub fn spawn<F: Future>(future: F) {
        drop(future);
    }
}
