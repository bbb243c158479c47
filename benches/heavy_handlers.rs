//! What the kameo executor is for: one run of hosts whose handlers take long, inline and on two
//! threads.
//!
//! `cargo bench -p farside --bench heavy_handlers` prints, for several lengths of a handler, how
//! long a run takes on each executor and how much faster the second is. Both must come to the same
//! digest. It is no test of speed: a busy machine gives smaller ratios.
//!
//! The model: planners on a host each, joined in a ring by links of 10 ms. Every 10 ms a planner
//! plans, which takes the work, and tells the next what it found.

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::hint::black_box;
use std::time::Instant;

use farside::prelude::*;
use serde::{Deserialize, Serialize};

/// The least of this many rounds counts: noise only ever adds.
const ROUNDS: usize = 9;

const THREADS: usize = 2;

/// The planning cycle, and the delay of every link.
const CYCLE: SimDuration = SimDuration::from_millis(10);

#[derive(Serialize, Deserialize)]
struct Cycle;

#[derive(Serialize, Deserialize)]
struct Found {
    value: u64,
}

struct Planner {
    next: String,
    value: u64,
    /// How many steps of [`plan`] make a handler's work.
    steps: u64,
}

impl Actor for Planner {
    type Accepts = (Cycle, Found);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(CYCLE, Cycle);
        Ok(())
    }
}

impl Handler<Cycle> for Planner {
    fn handle(&mut self, _cycle: Cycle, ctx: &mut Context<'_, Self>) -> Outcome {
        self.value = plan(self.value, self.steps);
        let next = ctx.lookup::<Planner>(&self.next)?;
        ctx.send(next, Found { value: self.value });
        ctx.timer(CYCLE, Cycle);
        Ok(())
    }
}

impl Handler<Found> for Planner {
    fn handle(&mut self, found: Found, _ctx: &mut Context<'_, Self>) -> Outcome {
        self.value ^= found.value.rotate_left(17);
        Ok(())
    }
}

/// Work that takes time and nothing else: each step needs the one before.
fn plan(mut value: u64, steps: u64) -> u64 {
    for step in 0..steps {
        value = (value ^ (value >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) ^ step;
    }
    value
}

/// How many steps of [`plan`] take a microsecond on this machine.
fn steps_per_microsecond() -> f64 {
    let steps = 1_000_000;
    let once = |round| {
        let start = Instant::now();
        black_box(plan(black_box(round), steps));
        start.elapsed().as_secs_f64() * 1e6
    };
    let least_us = (0..20).map(once).fold(f64::INFINITY, f64::min);
    steps as f64 / least_us
}

/// One line of the table.
#[derive(Clone, Copy)]
struct Size {
    hosts: usize,
    work_us: u64,
    cycles: u64,
}

fn build(size: Size, steps: u64) -> Simulation {
    let mut sim = Simulation::new(1);
    let name = |at: usize| format!("planner_{}", at % size.hosts);
    let hosts: Vec<HostId> = (0..size.hosts).map(|at| sim.host(&name(at))).collect();
    for (at, host) in hosts.iter().enumerate() {
        let (next, value) = (name(at + 1), at as u64);
        sim.heavy(*host);
        sim.actor(*host, &name(at), move |_| Planner {
            next: next.clone(),
            value,
            steps,
        });
        let to = hosts[(at + 1) % size.hosts];
        let link = format!("{}-{}", name(at), name(at + 1));
        sim.link(*host, to, &link, FixedDelay::new(CYCLE));
    }
    let until = SimTime::from_nanos(CYCLE.as_nanos() * (size.cycles + 1));
    sim.stop_at(until, "enough cycles");
    sim
}

/// Runs once; returns the time it took \[s\] and the report.
fn timed(sim: Simulation, executor: Executor) -> (f64, Report) {
    let start = Instant::now();
    let report = sim.run(executor).expect("the model can start");
    (start.elapsed().as_secs_f64(), report)
}

fn compare(size: Size, steps_per_us: f64) {
    let steps = (size.work_us as f64 * steps_per_us) as u64;
    let (mut inline_s, mut kameo_s) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        let (seconds, expected) = timed(build(size, steps), Executor::Inline);
        inline_s = inline_s.min(seconds);
        let executor = Executor::Kameo { threads: THREADS };
        let (seconds, report) = timed(build(size, steps), executor);
        kameo_s = kameo_s.min(seconds);
        assert_eq!(expected.digest, report.digest, "executors disagree");
    }
    let per_cycle_us = 1e6 / size.cycles as f64;
    println!(
        "{:5} {:8} us {:12.1} us {:12.1} us {:10.2}",
        size.hosts,
        size.work_us,
        inline_s * per_cycle_us,
        kameo_s * per_cycle_us,
        inline_s / kameo_s,
    );
}

fn main() {
    let steps_per_us = steps_per_microsecond();
    println!("a cycle of all hosts, least of {ROUNDS} rounds; kameo on {THREADS} threads");
    println!("hosts        work          inline           kameo   speed-up");
    for (hosts, work_us, cycles) in [
        (32, 10, 500),
        (32, 30, 300),
        (32, 100, 100),
        (8, 30, 1000),
        (8, 100, 300),
    ] {
        let size = Size {
            hosts,
            work_us,
            cycles,
        };
        compare(size, steps_per_us);
    }
}
