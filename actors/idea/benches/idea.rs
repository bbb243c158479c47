//! The K9 system agent's planner under each technology: interpreted, propositional, compiled.
//!
//! ```text
//! cargo bench -p farside-idea --bench idea
//! ```
//!
//! A plant answers polls and commands and gives goals, once, and what was posted is kept; each
//! technology then decides the same ticks. What is measured is the planner alone: statuses and goals
//! that are posted, and the cycle. "Through the service" is as the plan runner asks any technology,
//! which copies out what began and ended; "direct" is the table's own interface, which has it read in
//! place. `-- --ticks N technology` runs one alone, for a profiler; a
//! table is walked `--again M` times once it is made.

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::sync::Arc;
use std::time::Instant;

use farside_idea::models::plant::{Chances, Plant};
use farside_idea::models::system;
use farside_idea::service::compiled::Compiled;
use farside_idea::service::propositional::Propositional;
use farside_idea::service::temporal::{Temporal, TemporalOptions};
use farside_idea::service::{
    Contract, Ended, Outcome, Plan, PlanService, Present, Refusal, ServiceCounters, Snapshot,
    Stale, Started,
};
use farside_planning::Ticks;
use farside_planning::model::{Model, PredicateId, TimelineId, Value};
use smallvec::SmallVec;

const TICKS: Ticks = 172_800;
const BUDGET: u64 = 100_000;

/// What is posted to a service.
enum Call {
    Bind(Contract, SmallVec<[Option<Value>; 3]>, bool),
    Goal(TimelineId, PredicateId, SmallVec<[Value; 6]>),
    Cancel(Contract),
    Cycle(Ticks),
}

/// A service that keeps what is posted to it, if it is taken.
struct Recorder {
    service: Temporal,
    calls: Vec<Call>,
}

impl PlanService for Recorder {
    fn model(&self) -> &Arc<Model> {
        self.service.model()
    }

    fn advance(&mut self, now: Ticks) {
        self.service.advance(now);
    }

    fn bind(
        &mut self,
        contract: Contract,
        outputs: &[Option<Value>],
        ends: bool,
    ) -> Result<(), Refusal> {
        self.service.bind(contract, outputs, ends)?;
        self.calls
            .push(Call::Bind(contract, SmallVec::from_slice(outputs), ends));
        Ok(())
    }

    fn insert_goal(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        inputs: &[Value],
    ) -> Result<(), Refusal> {
        self.service.insert_goal(timeline, predicate, inputs)?;
        let call = Call::Goal(timeline, predicate, SmallVec::from_slice(inputs));
        self.calls.push(call);
        Ok(())
    }

    fn cancel(&mut self, contract: Contract) -> Result<(), Refusal> {
        self.service.cancel(contract)?;
        self.calls.push(Call::Cancel(contract));
        Ok(())
    }

    fn solve(&mut self, horizon: Ticks, budget: u64) -> Outcome {
        self.calls.push(Call::Cycle(self.service.now()));
        self.service.solve(horizon, budget)
    }

    fn started(&self) -> &[Started] {
        self.service.started()
    }

    fn ended(&self) -> &[Ended] {
        self.service.ended()
    }

    fn present(&self, timeline: TimelineId) -> Option<Present> {
        self.service.present(timeline)
    }

    fn forget(&mut self, before: Ticks) {
        self.service.forget(before);
    }

    fn counters(&self) -> ServiceCounters {
        self.service.counters()
    }

    fn now(&self) -> Ticks {
        self.service.now()
    }

    fn commit(&mut self, snapshot: &Snapshot, plan: Plan) -> Result<(), Stale> {
        self.service.commit(snapshot, plan)
    }

    fn drop_plan(&mut self, timeline: TimelineId) {
        self.service.drop_plan(timeline);
    }
}

/// What is posted in so many ticks.
fn record(chances: Chances, ticks: Ticks) -> Vec<Call> {
    let service = Recorder {
        service: temporal(),
        calls: Vec::new(),
    };
    let mut plant = Plant::new(service, system(), chances, 1);
    for tick in 0..ticks {
        let stepped = plant.step(tick);
        stepped.unwrap_or_else(|why| panic!("tick {tick}: {why}"));
    }
    plant.service.calls
}

fn temporal() -> Temporal {
    let service = Temporal::new(system().model.clone(), TemporalOptions::default());
    service.expect("the model fits")
}

/// A cycle as the plan runner asks for it. A sum over what is decided tells whether all technologies
/// decide alike.
fn cycle_served<S: PlanService>(service: &mut S) -> (Outcome, u64) {
    let outcome = service.solve(1, BUDGET);
    let started = service.started().iter();
    let decided = started.map(|at| at.predicate as u64 + at.contract.number);
    (outcome, decided.sum::<u64>() + service.ended().len() as u64)
}

/// A cycle by the table's own interface.
fn cycle_direct(table: &mut Compiled) -> (Outcome, u64) {
    let outcome = table.decide(1, BUDGET);
    let started = table.each_started();
    let decided = started.map(|at| at.predicate as u64 + at.contract.number);
    (
        outcome,
        decided.sum::<u64>() + table.each_ended().count() as u64,
    )
}

/// Seconds that a service takes for what was recorded, and a sum over what it decided.
fn replay<S: PlanService>(
    service: &mut S,
    calls: &[Call],
    cycle: impl Fn(&mut S) -> (Outcome, u64),
) -> (f64, u64) {
    let start = Instant::now();
    let mut decided = 0_u64;
    service.advance(0);
    for call in calls {
        let posted = match call {
            Call::Bind(contract, outputs, ends) => service.bind(*contract, outputs, *ends),
            Call::Goal(timeline, predicate, inputs) => {
                service.insert_goal(*timeline, *predicate, inputs)
            }
            Call::Cancel(contract) => service.cancel(*contract),
            Call::Cycle(tick) => {
                let (outcome, sum) = cycle(service);
                assert_eq!(outcome, Outcome::Decided, "tick {tick}");
                service.forget(*tick);
                decided = decided.wrapping_add(sum);
                service.advance(tick + 1);
                Ok(())
            }
        };
        posted.expect("it was taken before");
    }
    (start.elapsed().as_secs_f64(), decided)
}

struct Row {
    name: &'static str,
    seconds: f64,
    decided: u64,
    counters: ServiceCounters,
}

fn row<S: PlanService>(
    name: &'static str,
    service: &mut S,
    calls: &[Call],
    cycle: impl Fn(&mut S) -> (Outcome, u64),
) -> Row {
    let (seconds, decided) = replay(service, calls, cycle);
    let counters = service.counters();
    Row {
        name,
        seconds,
        decided,
        counters,
    }
}

fn compare(name: &str, chances: Chances, ticks: Ticks) {
    let calls = record(chances, ticks);
    let model = &system().model;
    let propositional = || Propositional::new(model.clone()).expect("the model fits");
    let mut compiled = Compiled::new(model.clone()).expect("the model fits");
    let mut rows = vec![row(
        "interpreted (temporal)",
        &mut temporal(),
        &calls,
        cycle_served,
    )];
    rows.push(row(
        "propositional",
        &mut propositional(),
        &calls,
        cycle_served,
    ));
    let name_of = "compiled, from nothing";
    rows.push(row(name_of, &mut compiled, &calls, cycle_served));
    let size = compiled.size();
    let mut warm = compiled.restarted().expect("the model fits");
    let name_of = "compiled, through the service";
    rows.push(row(name_of, &mut warm, &calls, cycle_served));
    let again = warm.size().interpreted;
    let mut warm = warm.restarted().expect("the model fits");
    rows.push(row("compiled, direct", &mut warm, &calls, cycle_direct));
    println!(
        "{name}: {ticks} ticks, {} posted",
        calls.len() as Ticks - ticks
    );
    println!(
        "{:<30} {:>12} {:>9} {:>7} {:>11} {:>7}",
        "", "cycles a s", "ns each", "ratio", "operations", "tokens"
    );
    for at in &rows {
        assert_eq!(at.decided, rows[0].decided, "{}", at.name);
        println!(
            "{:<30} {:>12.0} {:>9.0} {:>7.1} {:>11.1} {:>7}",
            at.name,
            ticks as f64 / at.seconds,
            at.seconds * 1e9 / ticks as f64,
            rows[0].seconds / at.seconds,
            at.counters.operations as f64 / ticks as f64,
            at.counters.tokens
        );
    }
    println!(
        "table: {} states, {} nodes, {} transitions with {} effects, {} bytes ({} with the \
         interpreter's copies); {} and then {again} cycles were interpreted\n",
        size.states,
        size.nodes,
        size.transitions,
        size.effects,
        size.table_bytes,
        size.bytes,
        size.interpreted
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let ticks = arguments.iter().skip_while(|at| *at != "--ticks").nth(1);
    if let Some(ticks) = ticks.and_then(|ticks| ticks.parse().ok()) {
        let again = arguments.iter().skip_while(|at| *at != "--again").nth(1);
        let again = again.and_then(|at| at.parse().ok()).unwrap_or(9);
        let calls = record(Chances::CALM, ticks);
        let is = |name: &str| arguments.iter().any(|at| at == name);
        let model = &system().model;
        let (seconds, _) = if is("compiled") || is("direct") {
            let mut service = Compiled::new(model.clone()).expect("the model fits");
            replay(&mut service, &calls, cycle_served);
            let mut best = f64::INFINITY;
            for _ in 0..again {
                service = service.restarted().expect("the model fits");
                let (seconds, _) = if is("direct") {
                    replay(&mut service, &calls, cycle_direct)
                } else {
                    replay(&mut service, &calls, cycle_served)
                };
                best = best.min(seconds);
            }
            (best, 0)
        } else if is("propositional") {
            let mut service = Propositional::new(model.clone()).expect("the model fits");
            replay(&mut service, &calls, cycle_served)
        } else {
            replay(&mut temporal(), &calls, cycle_served)
        };
        println!("{:.0} cycles a second", ticks as f64 / seconds);
        return;
    }
    compare("calm", Chances::CALM, TICKS);
    compare("wild", Chances::WILD, TICKS / 4);
}
