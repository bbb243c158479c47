//! How fast plans are kept, with the figures of an earlier commit beside.
//!
//! ```text
//! cargo bench -p farside-planning --bench timelines
//! cargo bench -p farside-planning --bench timelines -- --store
//! ```
//!
//! `-- --ticks N` runs the executive alone, for a profiler. The second form above stores the figures, with the commit that they are of, in
//! `benches/timelines/earlier.csv`, from which the next run reads what it prints beside its own.

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

mod rover;

use std::fmt::Write as _;
use std::time::Instant;

use farside_planning::Ticks;
use farside_planning::parameters::{Domain, Kind, Store};
use farside_planning::profile::{Profile, Use};
use farside_planning::search::Verdict;
use farside_planning::temporal::{Network, Span};
use rover::Rover;

/// What was measured.
struct Row {
    name: &'static str,
    /// How many were done.
    count: u64,
    seconds: f64,
    /// How much was looked at, where it is counted.
    operations: u64,
}

/// A row of an earlier run.
struct Earlier {
    commit: String,
    name: String,
    per_second: f64,
    operations_each: f64,
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let store = arguments.iter().any(|argument| argument == "--store");
    let ticks = arguments.iter().skip_while(|at| *at != "--ticks").nth(1);
    if let Some(ticks) = ticks.and_then(|ticks| ticks.parse().ok()) {
        executive(ticks);
        return;
    }
    let rows = [
        executive(100_000),
        network(),
        profile(),
        parameters(),
        push_and_pop(),
    ];
    let earlier = read_earlier();
    let commit = earlier.first().map_or("none", |row| row.commit.as_str());
    println!(
        "{:<34} {:>12} {:>10}   earlier ({commit}), and of that",
        "", "a second", "operations"
    );
    for row in &rows {
        let per_second = row.count as f64 / row.seconds;
        let each = row.operations as f64 / row.count as f64;
        print!("{:<34} {per_second:>12.0} {each:>10.1}", row.name);
        match earlier.iter().find(|at| at.name == row.name) {
            Some(at) => println!(
                "   {:>12.0} {:>10.1} {:>6.2}",
                at.per_second,
                at.operations_each,
                per_second / at.per_second
            ),
            None => println!(),
        }
    }
    if store {
        write_earlier(&rows);
    }
}

fn measured(name: &'static str, count: u64, run: impl FnOnce() -> u64) -> Row {
    let start = Instant::now();
    let operations = run();
    Row {
        name,
        count,
        seconds: start.elapsed().as_secs_f64(),
        operations,
    }
}

/// The executive's need: a rover's 11 timelines, one latency ahead, the past forgotten.
fn executive(ticks: Ticks) -> Row {
    let mut rover = Rover::new(1);
    let mut spent = [0; 10];
    let row = measured("executive: ticks", ticks as u64, || {
        let mut before = 0;
        for tick in 0..ticks {
            let verdict = rover.step(tick);
            assert!(
                matches!(verdict, Verdict::Solved),
                "tick {tick}: {verdict:?}"
            );
            if (tick + 1) % (ticks / 10) == 0 {
                let now = rover.executive.database().operations();
                spent[(tick / (ticks / 10)) as usize] = now - before;
                before = now;
            }
        }
        before
    });
    let ratio = spent[9] as f64 / spent[0] as f64;
    let counters = rover.executive.counters();
    let tokens = rover.executive.database().len();
    println!(
        "{ticks} ticks: operations of the last tenth {ratio:.3} times the first's, {tokens} tokens"
    );
    println!("{counters:?}\n");
    row
}

/// A chain of 1,000 points, whose bounds are tightened and given back.
fn network() -> Row {
    const EDITS: u64 = 200_000;
    let mut network = Network::new(Span::new(0, 1_000_000));
    let points: Vec<_> = (0..1_000).map(|_| network.add_point()).collect();
    for pair in points.windows(2) {
        let posted = network.constrain(pair[0], pair[1], Span::new(1, 500), ());
        posted.expect("it fits");
    }
    measured("temporal network: edits", EDITS, || {
        for edit in 0..EDITS / 2 {
            let at = (edit * 7_919 % 1_000) as usize;
            let after = network.bounds(points[at]).min + 3;
            let posted = network.constrain(network.origin(), points[at], Span::at_least(after), ());
            network.retract(posted.expect("it fits"));
        }
        network.work().points + network.work().inequalities
    })
}

/// 1,000 uses, each of which moves, and a question after each move.
fn profile() -> Row {
    const EDITS: u64 = 200_000;
    let mut profile = Profile::new(1_000_000, Span::at_least(0));
    let one = |start: Ticks| {
        let (start, end) = (
            Span::new(start, start + 20),
            Span::new(start + 30, start + 50),
        );
        Use::renewable(start, end, Span::exactly(3))
    };
    let uses: Vec<_> = (0..1_000)
        .map(|at| profile.add(one(at * 40), ()).expect("it fits"))
        .collect();
    measured("profile: moves, each with a question", EDITS, || {
        for edit in 0..EDITS {
            let at = (edit * 7_919 % 1_000) as usize;
            let start = (edit * 104_729 % 40_000) as Ticks;
            profile.update(uses[at], one(start)).expect("it fits");
            std::hint::black_box(profile.first_over_use(0));
        }
        0
    })
}

/// Sums of 1,000 variables, each bound and given back.
fn parameters() -> Row {
    const EDITS: u64 = 200_000;
    let mut store = Store::new();
    let variables: Vec<_> = (0..1_000)
        .map(|_| store.add(Domain::from(Span::new(0, 1_000))))
        .collect();
    for three in variables.chunks_exact(3) {
        let sum = [three[0].into(), three[1].into(), three[2].into()];
        store.post(Kind::Sum, &sum, ()).expect("it fits");
    }
    measured("parameters: bindings and retractions", EDITS, || {
        for edit in 0..EDITS / 2 {
            let at = (edit * 7_919 % 999) as usize;
            let posted = store.restrict(variables[at], Domain::exactly(400), ());
            store.retract(posted.expect("it fits"));
        }
        store.work().operations()
    })
}

/// A push, an edit of times and its undoing.
fn push_and_pop() -> Row {
    const EDITS: u64 = 200_000;
    let mut network = Network::new(Span::new(0, 1_000_000));
    let points: Vec<_> = (0..1_000).map(|_| network.add_point()).collect();
    measured("push, edit, pop", EDITS, || {
        for edit in 0..EDITS {
            let at = (edit * 7_919 % 1_000) as usize;
            network.push();
            let posted = network.constrain(network.origin(), points[at], Span::exactly(5), ());
            posted.expect("it fits");
            network.pop();
        }
        network.work().points + network.work().inequalities
    })
}

fn path() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/timelines/earlier.csv")
}

fn read_earlier() -> Vec<Earlier> {
    let text = std::fs::read_to_string(path()).unwrap_or_default();
    let row = |line: &str| {
        let mut cells = line.split(';');
        Some(Earlier {
            commit: cells.next()?.to_owned(),
            name: cells.next()?.to_owned(),
            per_second: cells.next()?.parse().ok()?,
            operations_each: cells.next()?.parse().ok()?,
        })
    };
    text.lines().filter_map(row).collect()
}

fn write_earlier(rows: &[Row]) {
    let git = std::process::Command::new("git");
    let commit = { git }.args(["rev-parse", "--short", "HEAD"]).output();
    let commit = commit.map_or(String::new(), |at| {
        String::from_utf8_lossy(&at.stdout).into_owned()
    });
    let mut text = String::new();
    for row in rows {
        let per_second = row.count as f64 / row.seconds;
        let each = row.operations as f64 / row.count as f64;
        let commit = commit.trim();
        writeln!(text, "{commit};{};{per_second:.0};{each:.1}", row.name).expect("a text takes it");
    }
    std::fs::write(path(), text).expect("the table can be written");
}
