//! PHOLD, the hold model, through Farside's public API and through NeXosim's, one thread each, in
//! one run: N actors, each event schedules one to a random actor after a look-ahead plus an
//! exponential delay. Prints events per second, as the best of several interleaved rounds, and the
//! ratios between them.
//!
//! `cargo run --release` here; it is no part of the workspace, so that it costs a user nothing.

mod farside_hold;
mod nexosim_hold;

use std::time::Instant;

/// The look-ahead: no event is scheduled sooner [ns].
const LOOK_AHEAD_NS: u64 = 100_000_000;
/// The mean of the exponential part [ns].
const MEAN_NS: f64 = 900_000_000.0;

/// One size of the benchmark.
#[derive(Clone, Copy)]
struct Size {
    actors: u32,
    /// Events on their way for each actor, all the time.
    population: u32,
    /// How many events to handle.
    events: u64,
}

/// Events per second of `hold`, without its assembly: two runs, one four times as long as the
/// other, and what lies between them.
fn rate(size: Size, hold: impl Fn(Size) -> u64) -> f64 {
    let timed = |size| {
        let start = Instant::now();
        let events = hold(size);
        (events as f64, start.elapsed().as_secs_f64())
    };
    let (short_events, short_s) = timed(size);
    let (long_events, long_s) = timed(Size { events: 4 * size.events, ..size });
    (long_events - short_events) / (long_s - short_s)
}

/// `profile SIZE-INDEX EVENTS`: one run of Farside alone, for a profiler.
fn profile(size: Size) {
    farside_hold::inline(size, false);
}

const SIZES: [Size; 3] = [
    Size { actors: 16, population: 1, events: 500_000 },
    Size { actors: 128, population: 4, events: 400_000 },
    Size { actors: 1024, population: 16, events: 300_000 },
];

fn main() {
    let mut arguments = std::env::args().skip(1);
    if arguments.next().as_deref() == Some("profile") {
        let mut number = |default| arguments.next().and_then(|at| at.parse().ok()).unwrap_or(default);
        let index = number(0);
        let size = SIZES[index];
        let events = number(size.events as usize) as u64;
        return profile(Size { events, ..size });
    }
    let rounds: usize = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(5);
    println!("PHOLD, million events/s, best of {rounds} rounds");
    println!(
        "{:>9} {:>9} {:>9} {:>9} {:>9} | {:>8} {:>8} {:>8} {:>10}",
        "size", "nexosim", "inline", "+digest", "kameo", "inline/n", "digest/n", "kameo/n", "digest ns"
    );
    for size in SIZES {
        let mut best = [0.0f64; 4];
        for _ in 0..rounds {
            let rates = [
                rate(size, nexosim_hold::run),
                rate(size, |size| farside_hold::inline(size, false)),
                rate(size, |size| farside_hold::inline(size, true)),
                rate(size, farside_hold::kameo),
            ];
            for (best, rate) in best.iter_mut().zip(rates) {
                *best = best.max(rate);
            }
        }
        let [nexosim, inline, digest, kameo] = best;
        println!(
            "{:>9} {:>9.2} {:>9.2} {:>9.2} {:>9.2} | {:>8.1} {:>8.1} {:>8.1} {:>10.0}",
            format!("{}x{}", size.actors, size.population),
            nexosim / 1e6,
            inline / 1e6,
            digest / 1e6,
            kameo / 1e6,
            inline / nexosim,
            digest / nexosim,
            kameo / nexosim,
            1e9 / digest - 1e9 / inline,
        );
    }
}
