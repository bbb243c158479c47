//! The wall clock, for people to know how long things take. No simulated code sees it.

/// The result and the wall time it took [s].
#[allow(
    clippy::disallowed_types,
    reason = "how long a run takes is for people to know; no simulated code sees it"
)]
pub(crate) fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = std::time::Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}
