//! PHOLD, the hold model, in Farside and in other simulators, one thread each, in one run: N actors,
//! each event schedules one to a random actor after a look-ahead plus an exponential delay. Prints
//! how long an event takes, as the median of rounds in which all take turns, and the ratios between
//! them beside what they should be.
//!
//! `cargo run --release` here takes some minutes, with a number of rounds as its argument less or
//! more of them. ns-3 takes part where its library and a C++ compiler are (`libns3-dev` of Debian),
//! SimPy where python3 can install it. This is no part of the workspace, so that it costs a user
//! nothing.

mod nexosim_hold;
mod outside;
#[path = "../../../benches/phold/model.rs"]
mod phold;
mod ratios;

use std::time::Instant;

use farside::Executor;

use outside::Program;
use phold::{LOOK_AHEAD_NS, MEAN_NS, Phold};

/// Rounds, unless told otherwise.
const ROUNDS: usize = 5;

/// One size of the benchmark.
#[derive(Clone, Copy)]
struct Size {
    actors: u32,
    /// Events on their way for each actor, all the time.
    population: u32,
    /// How many events to handle; what is measured are about three times as many.
    events: u64,
}

impl Size {
    fn name(self) -> String {
        format!("{}x{}", self.actors, self.population)
    }
}

const SIZES: [Size; 5] = [
    Size {
        actors: 16,
        population: 1,
        events: 1_200_000,
    },
    Size {
        actors: 128,
        population: 4,
        events: 1_200_000,
    },
    Size {
        actors: 1024,
        population: 16,
        events: 800_000,
    },
    Size {
        actors: 10_000,
        population: 4,
        events: 800_000,
    },
    Size {
        actors: 100_000,
        population: 4,
        events: 1_200_000,
    },
];

/// The columns of the table.
const NAMES: [&str; 6] = ["NeXosim", "SimPy", "ns-3", "inline", "digest", "kameo"];

/// NeXosim joins each actor with each other by a port, and kameo has a host for each actor: with
/// more actors than this neither fits the time and the memory of this run.
const MOST_JOINED: u32 = 2_000;
/// SimPy and NeXosim handle so many times fewer events than the others, which take less time for one.
const SIMPY_SHARE: u64 = 40;
const NEXOSIM_SHARE: u64 = 8;

/// How long an event takes [ns], without the assembly: two runs, one four times as long as the
/// other, and what lies between them.
fn event_ns(size: Size, hold: impl Fn(Size) -> u64) -> f64 {
    let timed = |size| {
        let start = Instant::now();
        let events = hold(size);
        (events as f64, start.elapsed().as_secs_f64())
    };
    let (short_events, short_s) = timed(size);
    let (long_events, long_s) = timed(Size {
        events: 4 * size.events,
        ..size
    });
    (long_s - short_s) * 1e9 / (long_events - short_events)
}

/// Farside on one host and one thread.
fn inline(size: Size, digest: bool) -> u64 {
    farside(size, false, digest, Executor::Inline)
}

/// Farside with a host for each actor, joined by links, through kameo; no digest, as in the others.
fn kameo(size: Size) -> u64 {
    farside(size, true, false, Executor::Kameo { threads: 1 })
}

fn farside(size: Size, by_link: bool, digest: bool, executor: Executor) -> u64 {
    let phold = Phold {
        actors: size.actors,
        population: size.population,
        by_link,
        digest,
    };
    phold.run(size.events, executor)
}

/// One round: how long an event takes in each of [`NAMES`] [ns], none where that takes no part.
fn round(size: Size, ns_3: Option<&Program>, simpy: Option<&Program>) -> [Option<f64>; 6] {
    let joined = size.actors <= MOST_JOINED;
    let events = 4 * size.events;
    [
        joined.then(|| {
            let events = size.events / NEXOSIM_SHARE;
            event_ns(Size { events, ..size }, nexosim_hold::run)
        }),
        simpy.and_then(|simpy| {
            simpy.event_ns(Size {
                events: events / SIMPY_SHARE,
                ..size
            })
        }),
        ns_3.and_then(|ns_3| ns_3.event_ns(Size { events, ..size })),
        Some(event_ns(size, |size| inline(size, false))),
        Some(event_ns(size, |size| inline(size, true))),
        joined.then(|| event_ns(size, kameo)),
    ]
}

/// The median of each column of some rounds.
fn medians(rounds: &[[Option<f64>; 6]]) -> [Option<f64>; 6] {
    std::array::from_fn(|column| {
        let mut all: Vec<f64> = rounds.iter().filter_map(|round| round[column]).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    })
}

fn row(name: &str, cells: [String; 6]) -> String {
    cells.iter().fold(format!("{name:>10}"), |row, cell| {
        format!("{row} {cell:>9}")
    })
}

/// `profile inline|digest|kameo SIZE-INDEX EVENTS`: one run of Farside alone, for a profiler.
fn profile(mut arguments: impl Iterator<Item = String>) {
    let way = arguments.next();
    let mut number = || arguments.next().and_then(|at| at.parse::<u64>().ok());
    let size = SIZES[number().unwrap_or(0) as usize];
    let events = number().unwrap_or(size.events);
    let size = Size { events, ..size };
    match way.as_deref() {
        Some("digest") => inline(size, true),
        Some("kameo") => kameo(size),
        _ => inline(size, false),
    };
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let first = arguments.next();
    if first.as_deref() == Some("profile") {
        return profile(arguments);
    }
    let rounds = first
        .and_then(|rounds| rounds.parse().ok())
        .unwrap_or(ROUNDS)
        .max(1);
    let said = |name: &str, made: Result<Program, String>| match made {
        Ok(program) => Some(program),
        Err(why) => {
            println!("{name} takes no part: {why}");
            None
        }
    };
    let ns_3 = said("ns-3", outside::ns_3());
    let simpy = said("SimPy", outside::simpy());
    println!("PHOLD, nanoseconds an event, medians of {rounds} rounds in which all take turns");
    println!("{}", row("size", NAMES.map(str::to_owned)));
    let mut table = Vec::new();
    for size in SIZES {
        let all: Vec<_> = (0..rounds)
            .map(|_| round(size, ns_3.as_ref(), simpy.as_ref()))
            .collect();
        let medians = medians(&all);
        let cells = medians.map(|ns| ns.map_or("-".to_owned(), |ns| format!("{ns:.0}")));
        println!("{}", row(&size.name(), cells));
        table.push((size, medians));
    }
    println!();
    ratios::print(&table);
}
