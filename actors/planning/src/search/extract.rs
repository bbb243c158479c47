//! The plan that a database holds, as data: each token as early as it can be.

use super::schedule::Schedule;
use crate::database::{Cause, Database, InstanceId, Owner, Status, Time, TokenId};
use crate::model::{End, Problem, Value};
use crate::objective::Objective;
use crate::plan::{
    self, Achieved, LeftOut, Moment, Origin, Plan, PlanConstraint, PlanToken, place,
};

/// The plan of a schedule, with every active token at its earliest times, and with all constraints
/// that keep its flexible times together.
///
/// `reason` says why a goal is left out.
pub fn extract(
    schedule: &Schedule,
    reason: impl Fn(usize) -> String,
    (planner, seed, operations): (&str, u64, u64),
) -> Plan {
    let (database, problem) = (&schedule.database, &schedule.problem);
    let mut plan = Plan::new(database.model(), problem);
    planner.clone_into(&mut plan.planner);
    (plan.seed, plan.operations) = (seed, operations);
    let numbers = Numbers::of(database);
    for &(token, number) in &numbers.tokens {
        plan.tokens.push(as_data(schedule, &numbers, token, number));
    }
    let mut objective = Objective::new(problem);
    for (goal, &token) in schedule.goals.iter().enumerate() {
        let name = problem.goals[goal].name.clone();
        let by = match database.token(token).map(|at| at.status) {
            Some(Status::Active) => numbers.of_token(token),
            Some(Status::Merged(into)) => numbers.of_token(into),
            _ => None,
        };
        match by {
            Some(token) => {
                objective.set(goal, true);
                plan.achieved.push(Achieved { goal: name, token });
            }
            None => plan.left_out.push(LeftOut {
                goal: name,
                reason: reason(goal),
            }),
        }
    }
    plan.score = objective.score();
    plan.makespan = plan.latest_end();
    plan.constraints = constraints(database, problem, &numbers);
    plan
}

/// The numbers of tokens within a plan: in the order of their starts, then of their timelines.
struct Numbers {
    tokens: Vec<(TokenId, plan::TokenId)>,
    /// By the place of a token.
    by_place: Vec<Option<plan::TokenId>>,
}

impl Numbers {
    fn of(database: &Database) -> Self {
        let active = database.tokens().filter(|at| at.1.status == Status::Active);
        let mut tokens: Vec<TokenId> = active.map(|at| at.0).collect();
        tokens.sort_by_key(|&token| {
            let timeline = database.token(token).and_then(|at| at.timeline);
            (database.start(token).min, timeline, token)
        });
        let places = tokens.iter().map(|token| token.index() + 1).max();
        let mut by_place = vec![None; places.unwrap_or(0)];
        for (number, token) in (1..).zip(&tokens) {
            by_place[token.index()] = Some(number);
        }
        Numbers {
            tokens: tokens.into_iter().zip(1..).collect(),
            by_place,
        }
    }

    fn of_token(&self, token: TokenId) -> Option<plan::TokenId> {
        self.by_place.get(token.index()).copied().flatten()
    }
}

fn as_data(
    schedule: &Schedule,
    numbers: &Numbers,
    token: TokenId,
    number: plan::TokenId,
) -> PlanToken {
    let (database, problem) = (&schedule.database, &schedule.problem);
    let model = database.model();
    let at = database.token(token).expect("the token is there");
    let timeline = at.timeline.expect("an active token is on a timeline");
    let parameters = at.parameters.iter();
    let values: Vec<Option<Value>> = parameters.map(|&one| database.value(one)).collect();
    let (start, finish) = (database.start(token), database.finish(token));
    let mut one = PlanToken::new(
        model,
        number,
        (timeline, at.predicate),
        &values,
        [start.min, finish.min],
    );
    one.start_window = [start.min, start.max];
    one.end_window = [finish.min, finish.max];
    one.origin = match at.cause {
        Cause::Goal(goal) => Origin::Goal(problem.goals[goal].name.clone()),
        Cause::Fact(fact) => Origin::Fact(place(model, problem.facts[fact].position)),
        Cause::Rule { rule, master } => Origin::Rule {
            place: place(model, model.rules[rule].position),
            master: numbers.of_token(master).unwrap_or(number),
        },
        Cause::Filler | Cause::User => Origin::Filler,
    };
    let mut effects = Vec::new();
    for &instance in at.instances() {
        for (effect, resource) in database.assigned(instance) {
            let rule = database.instance(instance).map_or(0, |at| at.rule);
            let effect = &model.rules[rule].effects[effect as usize];
            let amount = database.amount(instance, effect.amount);
            effects.push((effect, resource, amount));
        }
    }
    one.with_effects(model, &effects)
}

/// All constraints of times between tokens of the plan, and of theirs to time 0.
fn constraints(database: &Database, problem: &Problem, numbers: &Numbers) -> Vec<PlanConstraint> {
    let network = database.network();
    let mut moments: Vec<Option<Moment>> = Vec::new();
    for (token, at) in database.tokens() {
        let by = match at.status {
            Status::Active => numbers.of_token(token),
            Status::Merged(into) => numbers.of_token(into),
            Status::Free | Status::Rejected => None,
        };
        let Some(token) = by else { continue };
        for (time, end) in [(at.start, End::Start), (at.finish, End::Finish)] {
            if let Time::Point(point) = time {
                let place = point.index();
                if moments.len() <= place {
                    moments.resize(place + 1, None);
                }
                let at = end.into();
                moments[place] = Some(Moment { token, at });
            }
        }
    }
    let moment = |place: usize| moments.get(place).copied().flatten();
    let origin = network.origin();
    let mut all = Vec::new();
    for (constraint, from, to, span) in network.all_constraints() {
        let (of, at) = (moment(from.index()), moment(to.index()));
        let known = (of.is_some() || from == origin) && (at.is_some() || to == origin);
        if !known || of == at {
            continue;
        }
        let owner = network.owner(constraint).copied();
        all.push(PlanConstraint {
            from: of,
            to: at,
            min: (span.min != i64::MIN).then_some(span.min),
            max: (span.max != i64::MAX).then_some(span.max),
            why: owner.map_or(String::new(), |owner| why(database, problem, owner)),
        });
    }
    all
}

/// Where the reason of a constraint stands.
fn why(database: &Database, problem: &Problem, owner: Owner) -> String {
    let model = database.model();
    match owner {
        Owner::Rule { rule, relation, .. } => {
            let position = match relation {
                Some(relation) => database.position_of(rule, relation),
                None => model.rules[rule].position,
            };
            place(model, position)
        }
        Owner::Token(token) => match database.token(token).map(|at| at.cause) {
            Some(Cause::Goal(goal)) => format!("goal {}", problem.goals[goal].name),
            Some(Cause::Fact(fact)) => place(model, problem.facts[fact].position),
            _ => "its own duration".to_owned(),
        },
        Owner::Order(order) => place(model, problem.orders[order].position),
        Owner::Sequence { .. } => "one after the other on a timeline".to_owned(),
        Owner::Merge(_) => "one token for both".to_owned(),
        Owner::Decision(_) => "a decision of the planner".to_owned(),
        Owner::Given | Owner::Past => String::new(),
    }
}

/// Who asks for what, by instance: kept here since only texts need it.
impl Database {
    /// How much an effect takes, if it is certain; else the least that it can.
    pub fn amount(&self, instance: InstanceId, amount: crate::model::Bound) -> Value {
        self.span(instance, amount, amount, false).min.max(0)
    }
}
