//! Two clocks for benchmarks: what passed on the wall, and what the processor worked.

/// How long something took, in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Took {
    pub(crate) wall_s: f64,
    /// Of all threads, in user and kernel mode; none where the system does not say.
    pub(crate) processor_s: Option<f64>,
}

/// Does some work and says how long it took.
#[allow(
    clippy::disallowed_types,
    reason = "a benchmark measures the wall clock"
)]
pub(crate) fn timed<T>(work: impl FnOnce() -> T) -> (T, Took) {
    let (start, processor) = (std::time::Instant::now(), processor_s());
    let done = work();
    let took = Took {
        wall_s: start.elapsed().as_secs_f64(),
        processor_s: processor_s().zip(processor).map(|(to, from)| to - from),
    };
    (done, took)
}

/// What this process has used of the processor so far, as Linux counts it in hundredths of a second.
fn processor_s() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name, in brackets, may hold spaces; the two times are fields 14 and 15.
    let (_, fields) = stat.rsplit_once(") ")?;
    let mut fields = fields.split(' ').skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

/// The median of what was measured; NaN of nothing.
pub(crate) fn median(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of.get(of.len() / 2).copied().unwrap_or(f64::NAN)
}

/// By how much the second of each pair took longer than the first: on the wall, and of the
/// processor. Each the median over the pairs: other work on the machine must not decide.
pub(crate) fn ratios(pairs: &[(Took, Took)]) -> [f64; 2] {
    let wall = pairs.iter().map(|(ours, peer)| peer.wall_s / ours.wall_s);
    let processor = pairs.iter().filter_map(|(ours, peer)| {
        let (ours, peer) = ours.processor_s.zip(peer.processor_s)?;
        Some(peer / ours)
    });
    [median(wall.collect()), median(processor.collect())]
}
