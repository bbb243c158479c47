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

/// How long it is since it was started.
#[allow(
    clippy::disallowed_types,
    reason = "how long a search has taken is for people to bound; no simulated code sees it"
)]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stopwatch(std::time::Instant);

impl Stopwatch {
    #[allow(clippy::disallowed_types, reason = "as above")]
    pub(crate) fn start() -> Self {
        Stopwatch(std::time::Instant::now())
    }

    /// Seconds since the start.
    pub(crate) fn elapsed_s(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}
