//! How fast the K9's models are planned with: the thorough one and the light one on the same stimuli.
//!
//! ```text
//! cargo bench -p farside-idea --bench models
//! ```
//!
//! `-- --ticks N` runs the thorough model alone on a calm day, for a profiler.

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::time::Instant;

use farside_idea::models::plant::{Chances, Plant};
use farside_idea::models::{self, System};
use farside_idea::service::PlanService;
use farside_idea::service::temporal::{Temporal, TemporalOptions};

fn main() {
    let mut arguments = std::env::args().skip_while(|at| at != "--ticks").skip(1);
    if let Some(ticks) = arguments.next().and_then(|ticks| ticks.parse().ok()) {
        run("thorough", models::system(), Chances::CALM, ticks, None);
        return;
    }
    println!(
        "                       cycles/s  of thorough's  operations  decisions  guards  backtracks  rules"
    );
    for (day, chances) in [("calm", Chances::CALM), ("wild", Chances::WILD)] {
        let mut thorough = None;
        for (name, system) in [("thorough", models::system()), ("light", models::light())] {
            let rate = run(
                &format!("{day}, {name}"),
                system,
                chances,
                300_000,
                thorough,
            );
            thorough = thorough.or(Some(rate));
        }
    }
}

/// Plans so many ticks, and prints a line. Gives the cycles in a second, which it sets beside a peer's.
fn run(name: &str, system: &System, chances: Chances, ticks: i64, peer: Option<f64>) -> f64 {
    let service = Temporal::new(system.model.clone(), TemporalOptions::default());
    let service = service.expect("all timelines are states");
    let mut plant = Plant::new(service, system, chances, 1);
    let start = Instant::now();
    for tick in 0..ticks {
        if let Err(why) = plant.step(tick) {
            panic!("{name}, tick {tick}: {why}");
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    let counters = plant.service.counters();
    let each = |count: u64| count as f64 / ticks as f64;
    let rate = ticks as f64 / seconds;
    println!(
        "{name:<20} {rate:>10.0} {:>14.2} {:>11.1} {:>10.3} {:>7.3} {:>11.4} {:>6}",
        rate / peer.unwrap_or(rate),
        each(counters.operations),
        each(counters.decisions),
        each(counters.guards),
        each(counters.backtracks),
        system.model.rules.len(),
    );
    rate
}
