//! The model and the problem of a project.

use super::{Activity, Project};
use crate::Ticks;
use crate::model::{
    Argument, Body, Bound, Distance, Effect, EffectKind, End, Goal, Model, Order, Parameter,
    Pattern, Position, Predicate, Problem, Resource, ResourceKind, Rule, Timeline, TimelineKind,
    Type, Values, Variable,
};
use crate::temporal::{FURTHEST, Span};

/// Types, after truth values, numbers and the project.
const ACTIVITY: usize = 3;
const DEMAND: usize = 4;

/// The model of projects with these resources.
pub(super) fn model(name: &str, project: &Project) -> Model {
    let ty = |name: &str, values| Type {
        name: name.to_owned(),
        values,
    };
    let last = project.activities.len() as i64 - 1;
    let demands = project
        .activities
        .iter()
        .flat_map(|activity| &activity.demands);
    let most = demands.copied().max().unwrap_or(0);
    let resources = project.capacities.iter().enumerate();
    let resources = resources.map(|(place, &capacity)| Resource {
        name: format!("project.resource_{}", place + 1),
        object: 0,
        kind: ResourceKind::Renewable,
        initial: capacity,
        limits: Span::new(0, capacity),
        changes: Vec::new(),
        position: at(project.capacities_line, place as u32 + 1),
    });
    let parameter = |name: String, of| Parameter { name, of };
    let of_demands =
        (1..=project.capacities.len()).map(|place| parameter(format!("demand_{place}"), DEMAND));
    let number = parameter("number".to_owned(), ACTIVITY);
    let parameters: Vec<Parameter> = [number].into_iter().chain(of_demands).collect();
    Model {
        files: vec![name.to_owned()],
        symbols: vec!["project".to_owned()],
        types: vec![
            ty("Truth", Values::Truth),
            ty("Number", Values::Numbers(Span::ALL)),
            ty("Project", Values::Symbols(vec![0])),
            ty("ActivityNumber", Values::Numbers(Span::new(1, last))),
            ty("Demand", Values::Numbers(Span::new(0, most))),
        ],
        rules: vec![rule(project, &parameters)],
        predicates: vec![Predicate {
            name: "Activity".to_owned(),
            inputs: parameters.len(),
            parameters,
            ..Predicate::default()
        }],
        timelines: vec![Timeline {
            name: "project.activities".to_owned(),
            object: 0,
            kind: TimelineKind::Free,
            predicates: vec![0],
            default: None,
            initial: None,
        }],
        resources: resources.collect(),
        rules_by_timeline: vec![vec![vec![0]]],
        ..Model::default()
    }
}

/// What activities do: each uses its demands.
fn rule(project: &Project, parameters: &[Parameter]) -> Rule {
    let variables = parameters.iter().map(|parameter| Variable {
        name: format!("?{}", parameter.name),
        of: parameter.of,
    });
    let effects = (0..project.capacities.len()).map(|resource| Effect {
        position: at(project.capacities_line, resource as u32 + 1),
        resources: vec![resource],
        kind: EffectKind::Uses,
        amount: Bound::Variable(resource + 1),
    });
    let position = at(project.capacities_line, 1);
    Rule {
        position,
        master: Pattern {
            position,
            timelines: vec![0],
            object: None,
            predicate: 0,
            arguments: (0..parameters.len()).map(Argument::Variable).collect(),
        },
        variables: variables.collect(),
        when: Vec::new(),
        duration: None,
        relationships: Vec::new(),
        effects: effects.collect(),
        body: Body::All(Vec::new()),
        labels: 1,
    }
}

/// The problem: all activities, in a horizon in which they have room if they have any.
pub(super) fn problem(name: &str, project: &Project) -> Problem {
    let activities = &project.activities;
    let last = activities.len() - 1;
    let has_end = end_is_a_goal(project);
    // If there is a schedule, there is one that is over after so long: at any time before, an
    // activity or a lag lasts.
    let spans = activities.iter().map(|activity| {
        let lags = activity.successors.iter().map(|&(_, lag)| lag);
        lags.chain([activity.duration]).max().unwrap_or(0).max(0)
    });
    let horizon = spans.sum::<Ticks>().min(FURTHEST);
    let mut starts = vec![Span::at_least(0); activities.len()];
    let mut orders = Vec::new();
    for (from, activity) in activities.iter().enumerate() {
        for (place, &(to, lag)) in activity.successors.iter().enumerate() {
            let position = at(activity.successors_line, place as u32 + 1);
            if from == 0 {
                starts[to] = starts[to].intersect(Span::at_least(lag));
            } else if to == 0 {
                starts[from] = starts[from].intersect(Span::at_most(-lag));
            } else if has_end || to != last {
                orders.push(order(position, from - 1, to - 1, lag));
            }
        }
    }
    let goals = activities.iter().zip(starts).enumerate();
    let goals = goals.filter(|(id, _)| *id != 0 && (has_end || *id != last));
    let goals = goals.map(|(id, (activity, start))| {
        let name = match id == last {
            true => "end".to_owned(),
            false => format!("activity_{id}"),
        };
        goal(name, id, activity, start)
    });
    Problem {
        name: name.to_owned(),
        files: vec![name.to_owned()],
        horizon,
        goals: goals.collect(),
        orders,
        ..Problem::default()
    }
}

/// Whether lags say more of the project's end than that activities are over by then.
fn end_is_a_goal(project: &Project) -> bool {
    let last = project.activities.len() - 1;
    let end = &project.activities[last];
    let mut others = project.activities[..last].iter();
    !end.successors.is_empty()
        || others.any(|activity| {
            let mut lags = activity.successors.iter();
            lags.any(|&(to, lag)| to == last && lag > activity.duration)
        })
}

fn goal(name: String, id: usize, activity: &Activity, start: Span) -> Goal {
    let position = at(activity.line, 1);
    let demands = activity.demands.iter().copied();
    let arguments = [id as i64].into_iter().chain(demands);
    Goal {
        name,
        position,
        pattern: Pattern {
            position,
            timelines: vec![0],
            object: None,
            predicate: 0,
            arguments: arguments.map(Argument::Value).collect(),
        },
        variables: Vec::new(),
        start,
        finish: Span::ALL,
        duration: Span::exactly(activity.duration),
        weight: None,
    }
}

/// That `to` starts at least `lag` after `from`, or, if that is negative, `from` at most so much
/// after `to`.
fn order(position: Position, from: usize, to: usize, lag: Ticks) -> Order {
    let (from, to, min, max) = match lag < 0 {
        false => (from, to, Bound::Value(lag), Bound::None),
        true => (to, from, Bound::None, Bound::Value(-lag)),
    };
    Order {
        position,
        from,
        to,
        distances: vec![Distance {
            from: End::Start,
            to: End::Start,
            min,
            max,
            backward: false,
        }],
    }
}

fn at(line: u32, column: u32) -> Position {
    Position {
        file: 0,
        line,
        column,
    }
}
