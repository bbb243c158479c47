//! Whether what an agent did is legal by its model.
//!
//! No technology is asked: what began and ended is written down as a plan, and the checker of plans
//! ([`farside_planning::checker`]), which shares no code with databases or searches, says what breaks
//! which rule. Tokens that last when the trace ends are there to be spoken of; what they ask for
//! themselves may still come.

use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::checker::{Kind, Violation, check};
use farside_planning::model::{Model, PredicateId, Problem, Value, Values};
use farside_planning::plan::{Origin, Plan, PlanToken, PlanValue};

use super::{Contract, PlanService};

/// What an agent said from its first cycle on.
///
/// ```
/// use std::sync::Arc;
/// use farside_idea::service::{PlanService, legal::Trace};
/// use farside_idea::service::temporal::{Temporal, TemporalOptions};
/// use farside_planning::language::{Options, read_model};
/// # let text = include_str!("../../../planning/models/polling.ddl");
/// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
/// let mut service = Temporal::new(Arc::new(model), TemporalOptions::default()).expect("it fits");
/// let mut trace = Trace::new(service.model().clone());
/// for tick in 0..20 {
///     service.advance(tick);
///     if tick > 0 {
///         let poll = service.present(0).expect("it polls").contract;
///         service.bind(poll, &[None, Some(295 + tick), Some(1)], true).expect("it can be");
///     }
///     service.solve(1, 10_000);
///     trace.note(&service);
/// }
/// assert_eq!(trace.violations(&service), []);
/// ```
#[derive(Clone, Debug)]
pub struct Trace {
    model: Arc<Model>,
    tokens: Vec<PlanToken>,
}

impl Trace {
    /// Of nothing yet.
    pub fn new(model: Arc<Model>) -> Self {
        Trace {
            model,
            tokens: Vec::new(),
        }
    }

    /// Notes what ended with a cycle that was decided.
    pub fn note(&mut self, service: &dyn PlanService) {
        for ended in service.ended() {
            let times = [ended.start, ended.finish];
            let said = (ended.predicate, &ended.parameters[..]);
            let token = self.token(ended.contract, said, times);
            self.tokens.push(token);
        }
    }

    fn token(
        &self,
        contract: Contract,
        (predicate, values): (PredicateId, &[Option<Value>]),
        [start, end]: [Ticks; 2],
    ) -> PlanToken {
        let said = &self.model.predicates[predicate];
        let name = |place: usize| match said.parameters[place].name.as_str() {
            "" => format!("#{}", place + 1),
            name => name.to_owned(),
        };
        let arguments = values.iter().enumerate().map(|(place, value)| {
            let value = self.value(said.parameters[place].of, *value);
            (name(place), value)
        });
        PlanToken {
            id: self.tokens.len() as u32,
            timeline: self.model.timelines[usize::from(contract.timeline)]
                .name
                .clone(),
            predicate: said.name.clone(),
            arguments: arguments.collect(),
            start,
            end,
            start_window: [start; 2],
            end_window: [end; 2],
            origin: Origin::Filler,
            effects: Vec::new(),
        }
    }

    fn value(&self, of: usize, value: Option<Value>) -> PlanValue {
        match (value, &self.model.types[of].values) {
            (None, _) => PlanValue::Unbound,
            (Some(value), Values::Truth) => PlanValue::Truth(value != 0),
            (Some(value), Values::Numbers(_)) => PlanValue::Number(value),
            (Some(value), Values::Symbols(_)) => PlanValue::Symbol(self.model.show(of, value)),
        }
    }

    /// What of the trace breaks a rule, with what a service says now.
    pub fn violations(&self, service: &dyn PlanService) -> Vec<Violation> {
        let horizon = service.now().saturating_add(1);
        let problem = Problem {
            horizon,
            ..Problem::default()
        };
        let mut whole = self.clone();
        let ended = whole.tokens.len() as u32;
        for timeline in 0..self.model.timelines.len() {
            if let Some(at) = service.present(timeline) {
                let said = (at.predicate, &at.parameters[..]);
                let token = whole.token(at.contract, said, [at.start, horizon]);
                whole.tokens.push(token);
            }
        }
        let plan = Plan {
            tokens: whole.tokens,
            ..Plan::new(&self.model, &problem)
        };
        let mut violations = check(&self.model, &problem, &plan);
        violations.retain(|at| {
            // Why tokens are there is not known, and those that last ask for more yet.
            let lasts = at.tokens.first().is_some_and(|&token| token >= ended);
            let of_rules = matches!(
                at.kind,
                Kind::Relation | Kind::Relationship | Kind::Duration | Kind::Undecided
            );
            at.kind != Kind::Origin && !(lasts && of_rules)
        });
        violations
    }
}
