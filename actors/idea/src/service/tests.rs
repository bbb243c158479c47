//! What every planning technology must do, asked of each of them.

mod ahead;
mod cycles;
mod equal;
mod legal;
mod plans;
mod random;
mod refusals;
mod work;

use farside_planning::language::{Options, read_model};
use farside_planning::model::{Model, TimelineId, Value};

use super::compiled::Compiled;
use super::propositional::Propositional;
use super::temporal::{Temporal, TemporalOptions};
use super::*;

/// A model that has what an executive needs, in small.
const TEXT: &str = include_str!("tests/agent.ddl");

const BUDGET: u64 = 10_000;

fn read(text: &str) -> Arc<Model> {
    let model = read_model("agent.ddl", text, &Options::default()).ok();
    Arc::new(model.unwrap_or_else(|findings| panic!("{findings}")))
}

/// A technology with a model, asked by names.
struct Agent {
    name: &'static str,
    service: Box<dyn PlanService>,
}

/// Each technology with a model, after its first cycle at tick 0.
fn agents(text: &str) -> Vec<Agent> {
    let model = read(text);
    let mut agents = Vec::new();
    for deletes in [true, false] {
        let options = TemporalOptions {
            deletes,
            ..TemporalOptions::default()
        };
        let service = Temporal::new(model.clone(), options).expect("the model fits");
        agents.push(Agent {
            name: "temporal",
            service: Box::new(service),
        });
    }
    let service = Propositional::new(model.clone()).expect("the model fits");
    agents.push(Agent {
        name: "propositional",
        service: Box::new(service),
    });
    let service = Compiled::new(model).expect("the model fits");
    agents.push(Agent {
        name: "compiled",
        service: Box::new(service),
    });
    for agent in &mut agents {
        agent.cycle(0);
    }
    agents
}

impl Agent {
    fn timeline(&self, name: &str) -> TimelineId {
        let timelines = &self.service.model().timelines;
        let found = timelines.iter().position(|at| at.name == name);
        found.unwrap_or_else(|| panic!("there is a timeline {name}"))
    }

    fn predicate(&self, name: &str) -> PredicateId {
        let predicates = &self.service.model().predicates;
        let found = predicates.iter().position(|at| at.name == name);
        found.unwrap_or_else(|| panic!("there is a predicate {name}"))
    }

    fn symbol(&self, name: &str) -> Value {
        let symbols = &self.service.model().symbols;
        let found = symbols.iter().position(|at| at == name);
        found.unwrap_or_else(|| panic!("there is a symbol {name}")) as Value
    }

    fn cycle(&mut self, tick: Ticks) {
        self.service.advance(tick);
        let outcome = self.service.solve(1, BUDGET);
        assert_eq!(outcome, Outcome::Decided, "{} at {tick}", self.name);
        self.service.forget(tick);
    }

    /// Cycles without anything that happens.
    fn idle(&mut self, ticks: std::ops::Range<Ticks>) {
        ticks.for_each(|tick| self.cycle(tick));
    }

    fn contract(&self, timeline: &str) -> Contract {
        let present = self.service.present(self.timeline(timeline));
        present.expect("it says something").contract
    }

    /// What a timeline says, and since when.
    fn says(&self, timeline: &str) -> (&str, Ticks) {
        let present = self.service.present(self.timeline(timeline));
        let present = present.expect("it says something");
        let said = &self.service.model().predicates[present.predicate];
        (&said.name, present.start)
    }

    fn goal(&mut self, timeline: &str, name: &str, inputs: &[Value]) -> Result<(), Refusal> {
        let (timeline, predicate) = (self.timeline(timeline), self.predicate(name));
        self.service.insert_goal(timeline, predicate, inputs)
    }

    /// A status, of which only the last output is given.
    fn status(&mut self, timeline: &str, status: &str) -> Result<(), Refusal> {
        let (contract, status) = (self.contract(timeline), self.symbol(status));
        self.service.bind(contract, &[Some(status)], true)
    }

    /// The tokens that ended with the last cycle, with what their last parameter says.
    fn ended(&self) -> Vec<String> {
        let model = self.service.model();
        let say = |ended: &Ended| {
            let said = &model.predicates[ended.predicate];
            let last = said.parameters.last().zip(ended.parameters.last());
            let value = match last {
                Some((parameter, Some(value))) => model.show(parameter.of, *value),
                Some((_, None)) => "?".to_owned(),
                None => String::new(),
            };
            format!("{}({value}) {}-{}", said.name, ended.start, ended.finish)
        };
        self.service.ended().iter().map(say).collect()
    }
}
