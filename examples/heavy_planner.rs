//! Planners that take real time to compute, on several threads. Demonstrates in particular
//! [`Simulation::heavy`] and [`Executor::Kameo`]: hosts whose handlers are worth a thread run side
//! by side between any two messages, and the result is the same as on one thread, to the last bit.
//!
//! ```text
//!                 ┌───────────┐
//!           ┌────▶│ planner_1 │ heavy
//!   ┌──────┐│     └───────────┘
//!   │ base │┤ ...       100 ms each way      Problem ▶  ◀ Plan
//!   └──────┘│     ┌───────────┐
//!           └────▶│ planner_4 │ heavy
//!                 └───────────┘
//! ```
//!
//! `cargo run --release --example heavy_planner`

use farside::prelude::*;
use serde::{Deserialize, Serialize};

const PLANNERS: u32 = 4;
const ROUNDS: u32 = 5;

#[derive(Serialize, Deserialize)]
struct Problem {
    round: u32,
}

#[derive(Serialize, Deserialize)]
struct Plan {
    round: u32,
    tour_m: f64,
}

/// Looks for a short tour through 40 sites by swapping at random and keeping what is better.
struct Planner {
    base: Address<Base>,
}

impl Actor for Planner {
    type Accepts = (Problem,);
}

impl Handler<Problem> for Planner {
    fn handle(&mut self, problem: Problem, ctx: &mut Context<'_, Self>) -> Outcome {
        let draws = ctx.random("tour");
        let mut sites: Vec<[f64; 2]> = (0..40)
            .map(|_| [draws.uniform(), draws.uniform()])
            .collect();
        let mut tour_m = length_m(&sites);
        for _ in 0..2_000 {
            let (a, b) = (draws.below(40) as usize, draws.below(40) as usize);
            sites.swap(a, b);
            let swapped_m = length_m(&sites);
            if swapped_m < tour_m {
                tour_m = swapped_m;
            } else {
                sites.swap(a, b);
            }
        }
        let round = problem.round;
        ctx.send(self.base, Plan { round, tour_m });
        Ok(())
    }
}

/// Square roots are the same on every machine; most functions of floats are not.
fn length_m(sites: &[[f64; 2]]) -> f64 {
    let legs = sites.windows(2).map(|leg| {
        let (east, north) = (leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]);
        1_000.0 * (east * east + north * north).sqrt()
    });
    legs.sum()
}

struct Base {
    round: u32,
    answers: u32,
    total_m: f64,
}

impl Base {
    fn ask(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for number in 1..=PLANNERS {
            let planner = ctx.recipient::<Problem>(&format!("planner_{number}"))?;
            ctx.send(planner, Problem { round: self.round });
        }
        Ok(())
    }
}

impl Actor for Base {
    type Accepts = (Plan,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.ask(ctx)
    }
}

impl Handler<Plan> for Base {
    fn handle(&mut self, plan: Plan, ctx: &mut Context<'_, Self>) -> Outcome {
        assert_eq!(plan.round, self.round);
        self.answers += 1;
        self.total_m += plan.tour_m;
        if self.answers.is_multiple_of(PLANNERS) {
            self.round += 1;
            if self.round == ROUNDS {
                ctx.stop(format!("{:.3} m in all", self.total_m));
                return Ok(());
            }
            self.ask(ctx)?;
        }
        Ok(())
    }
}

fn run(executor: Executor) -> Report {
    let mut sim = Simulation::new(11);
    let here = sim.host("base");
    let base = sim.actor(here, "base", |_name| Base {
        round: 0,
        answers: 0,
        total_m: 0.0,
    });
    // The look-ahead: in 100 ms nobody hears of what the others do, so all may go on.
    let link = || FixedDelay::new(SimDuration::from_millis(100));
    sim.uplink(here, "base-all", link());
    for number in 1..=PLANNERS {
        let name = format!("planner_{number}");
        let host = sim.host(&name);
        sim.heavy(host);
        sim.actor(host, &name, move |_name| Planner { base });
        sim.link(host, here, &format!("{name}-base"), link());
    }
    sim.run(executor).expect("the simulation can start")
}

fn main() {
    let one = run(Executor::Inline);
    println!("{}", one.end.detail());
    for threads in [1, 2, 4] {
        let many = run(Executor::Kameo { threads });
        println!("{threads} threads: {}", many.digest);
        assert_eq!(many, one);
    }
    assert_eq!(one.end.name(), "stopped");
    assert_eq!(one.counts.delivered, u64::from(2 * PLANNERS * ROUNDS));
}
