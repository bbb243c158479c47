//! What an event costs, counted: allocations, instructions, misses of the first cache and of the
//! last. Counts do not depend on what else the machine does, so that a loss is seen.
//!
//! `cargo bench -p farside --bench events` prints a table: sizes from 16 actors to 100,000, each on
//! one host, with the digest, and on hosts of their own joined by links. Instructions and misses are
//! counted by valgrind, which runs this program again; where it is not installed, the table has
//! allocations only, and a line says so.
//!
//! The model is PHOLD, as `tests/peers` runs it too. Each figure is the difference of two
//! runs, one longer than the other, so that the start is in none.

#[path = "phold/model.rs"]
mod phold;

use std::process::{Command, ExitCode};

use farside::Executor;

use phold::Phold;

/// The caches that valgrind imagines: size in bytes, ways, bytes of a line. Fixed, so that figures
/// of two machines can be compared.
const CACHES: [&str; 3] = ["--I1=32768,8,64", "--D1=32768,8,64", "--LL=33554432,16,64"];

/// What is done with events.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    /// All actors on one host; no digest.
    Plain,
    /// All actors on one host.
    Digest,
    /// A host for each actor, joined by links; no digest.
    Links,
}

const MODES: [(&str, Mode); 3] = [
    ("plain", Mode::Plain),
    ("digest", Mode::Digest),
    ("links", Mode::Links),
];

#[derive(Clone, Copy)]
struct Size {
    actors: u32,
    /// Events on their way for each actor, all the time.
    population: u32,
    /// How many events the shorter run has, and how many more the longer.
    events: u64,
    more: u64,
}

const fn size(actors: u32, population: u32, events: u64, more: u64) -> Size {
    Size {
        actors,
        population,
        events,
        more,
    }
}

const SIZES: [Size; 5] = [
    size(16, 1, 50_000, 100_000),
    size(128, 4, 50_000, 100_000),
    size(1024, 16, 100_000, 200_000),
    size(10_000, 4, 100_000, 200_000),
    size(100_000, 4, 400_000, 400_000),
];

/// Runs until about so many events were handled; returns how many were.
fn hold(size: Size, events: u64, mode: Mode) -> u64 {
    let phold = Phold {
        actors: size.actors,
        population: size.population,
        by_link: mode == Mode::Links,
        digest: mode == Mode::Digest,
    };
    phold.run(events, Executor::Inline)
}

/// How often memory was asked for, in a run of so many events; and how many events it had.
fn allocations(size: Size, events: u64, mode: Mode) -> (u64, u64) {
    let mut handled = 0;
    let counted = allocation_counter::measure(|| handled = hold(size, events, mode));
    (counted.count_total, handled)
}

/// What valgrind counts in one run of this program: instructions, misses of the first data cache,
/// and of the last.
fn count(name: &str, size: Size, events: u64) -> Result<[u64; 3], String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut valgrind = Command::new("valgrind");
    valgrind.args([
        "--tool=cachegrind",
        "--cache-sim=yes",
        "--cachegrind-out-file=/dev/null",
    ]);
    valgrind.args(CACHES).arg(program);
    let numbers = [u64::from(size.actors), u64::from(size.population), events];
    valgrind
        .args(["run", name])
        .args(numbers.map(|number| number.to_string()));
    let done = valgrind
        .output()
        .map_err(|error| format!("valgrind: {error}"))?;
    let said = String::from_utf8_lossy(&done.stderr);
    let of = |label: &str| {
        let squeezed = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        let line = said.lines().find(|line| squeezed(line).contains(label));
        let total = line.and_then(|line| line.split(':').nth(1)?.split_whitespace().next());
        let digits = total.map(|total| total.replace(',', ""));
        let number = digits.and_then(|digits| digits.parse().ok());
        number.ok_or_else(|| format!("valgrind did not say `{label}`: {said}"))
    };
    Ok([of("I refs:")?, of("D1 misses:")?, of("LLd misses:")?])
}

/// Counts one size in one mode, and prints its line.
fn line(size: Size, name: &str, mode: Mode, with_valgrind: bool) -> Result<(), String> {
    let long = size.events + size.more;
    let (short_allocations, short_events) = allocations(size, size.events, mode);
    let (long_allocations, long_events) = allocations(size, long, mode);
    let events = (long_events - short_events) as f64;
    let an_event = |more: u64, less: u64| (more as f64 - less as f64) / events;
    let label = format!("{}x{}", size.actors, size.population);
    let allocated = an_event(long_allocations, short_allocations);
    print!("{label:>9} {name:>7} {allocated:12.4}");
    if with_valgrind {
        let (short, long) = (count(name, size, size.events)?, count(name, size, long)?);
        let [instructions, first, last] = [0, 1, 2].map(|at| an_event(long[at], short[at]));
        print!(" {instructions:13.0} {first:10.2} {last:10.3}");
    }
    println!();
    Ok(())
}

/// `run MODE ACTORS POPULATION EVENTS`: one run, for valgrind.
fn run_once(arguments: &[String]) -> Option<()> {
    let (_, mode) = MODES
        .iter()
        .find(|(name, _)| Some(name) == arguments.first().map(|a| a.as_str()).as_ref())?;
    let mut numbers = arguments[1..]
        .iter()
        .map_while(|text| text.parse::<u64>().ok());
    let (actors, population) = (numbers.next()? as u32, numbers.next()? as u32);
    let events = numbers.next()?;
    hold(size(actors, population, events, 0), events, *mode);
    Some(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    if arguments.first().is_some_and(|first| first == "run") {
        return match run_once(&arguments[1..]) {
            Some(()) => ExitCode::SUCCESS,
            None => {
                eprintln!("expected: run plain|digest|links ACTORS POPULATION EVENTS");
                ExitCode::from(2)
            }
        };
    }
    let version = Command::new("valgrind").arg("--version").output();
    let with_valgrind = version.is_ok_and(|version| version.status.success());
    println!("counts an event; a plain event handles one message and sends one");
    print!("{:>9} {:>7} {:>12}", "size", "mode", "allocations");
    if with_valgrind {
        println!(
            " {:>13} {:>10} {:>10}",
            "instructions", "D1 misses", "LL misses"
        );
    } else {
        println!("\n(valgrind is not installed: instructions and misses are not counted)");
    }
    for size in SIZES {
        for (name, mode) in MODES {
            // An argument picks sizes or modes, as benchmarks' arguments do.
            let label = format!("{}x{}/{name}", size.actors, size.population);
            if arguments
                .iter()
                .any(|filter| !label.contains(filter.as_str()))
            {
                continue;
            }
            if let Err(trouble) = line(size, name, mode, with_valgrind) {
                println!();
                eprintln!("{trouble}");
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}
