//! What a planner makes a plan with: tokens, effects and places by their names.

use super::{
    Origin, Plan, PlanEffect, PlanEffectKind, PlanEnd, PlanResource, PlanResourceKind,
    PlanTimeline, PlanTimelineKind, PlanToken, PlanValue, TokenId,
};
use crate::Ticks;
use crate::model::{
    Effect, EffectKind, End, Model, Position, PredicateId, Problem, ResourceId, ResourceKind,
    TimelineId, TimelineKind, Value, Values,
};

/// What a token does to resources: the effect of the model, the resource that was taken, how much.
pub type Effects<'a> = &'a [(&'a Effect, ResourceId, Value)];

impl Plan {
    /// A plan without tokens: names, horizon, timelines and resources of a problem.
    ///
    /// ```
    /// use farside_planning::model::{Model, Problem};
    /// use farside_planning::plan::Plan;
    /// let problem = Problem { name: "day 1".into(), horizon: 100, ..Problem::default() };
    /// let plan = Plan::new(&Model::default(), &problem);
    /// assert_eq!((plan.problem.as_str(), plan.horizon), ("day 1", 100));
    /// ```
    pub fn new(model: &Model, problem: &Problem) -> Plan {
        let timelines = model.timelines.iter().map(|timeline| PlanTimeline {
            name: timeline.name.clone(),
            kind: match timeline.kind {
                TimelineKind::State => PlanTimelineKind::State,
                TimelineKind::Unary => PlanTimelineKind::Unary,
                TimelineKind::Free => PlanTimelineKind::Free,
            },
        });
        let resources = (0..model.resources.len()).map(|id| PlanResource::of(model, problem, id));
        Plan {
            model: model
                .files
                .first()
                .map(|name| stem(name))
                .unwrap_or_default(),
            problem: problem.name.clone(),
            horizon: problem.horizon,
            timelines: timelines.collect(),
            resources: resources.collect(),
            ..Plan::default()
        }
    }
}

impl PlanResource {
    /// A resource as it is in a problem.
    pub fn of(model: &Model, problem: &Problem, id: ResourceId) -> PlanResource {
        let resource = &model.resources[id];
        let here = problem.initial.iter().rev().find(|(of, _)| *of == id);
        let here_changes = problem.changes.iter().filter(|(of, ..)| *of == id);
        let mut changes = resource.changes.clone();
        changes.extend(here_changes.map(|&(_, from, by)| (from, by)));
        changes.sort_by_key(|&(from, _)| from);
        let (min, max) = (resource.limits.min, resource.limits.max);
        PlanResource {
            name: resource.name.clone(),
            kind: match resource.kind {
                ResourceKind::Renewable => PlanResourceKind::Renewable,
                ResourceKind::Depletable => PlanResourceKind::Depletable,
                ResourceKind::RateLimited { window_ticks } => {
                    PlanResourceKind::RateLimited(window_ticks)
                }
            },
            initial: here.map_or(resource.initial, |&(_, level)| level),
            limits: [
                (min != Value::MIN).then_some(min),
                (max != Value::MAX).then_some(max),
            ],
            changes,
        }
    }
}

impl PlanToken {
    /// A token at fixed times, on which its windows are closed, that fills a timeline.
    ///
    /// `values` has one entry for each parameter of the predicate.
    pub fn new(
        model: &Model,
        id: TokenId,
        (timeline, predicate): (TimelineId, PredicateId),
        values: &[Option<Value>],
        [start, end]: [Ticks; 2],
    ) -> PlanToken {
        let parameters = &model.predicates[predicate].parameters;
        let arguments = parameters.iter().zip(values).enumerate();
        let arguments = arguments.map(|(place, (parameter, value))| {
            let value = match (*value, &model.types[parameter.of].values) {
                (None, _) => PlanValue::Unbound,
                (Some(value), Values::Truth) => PlanValue::Truth(value != 0),
                (Some(value), Values::Numbers(_)) => PlanValue::Number(value),
                (Some(value), Values::Symbols(_)) => {
                    PlanValue::Symbol(model.show(parameter.of, value))
                }
            };
            (argument_name(&parameter.name, place), value)
        });
        PlanToken {
            id,
            timeline: model.timelines[timeline].name.clone(),
            predicate: model.predicates[predicate].name.clone(),
            arguments: arguments.collect(),
            start,
            end,
            start_window: [start, start],
            end_window: [end, end],
            origin: Origin::Filler,
            effects: Vec::new(),
        }
    }

    /// The same token with what it does to resources.
    #[must_use]
    pub fn with_effects(mut self, model: &Model, effects: Effects<'_>) -> PlanToken {
        let effects = effects
            .iter()
            .map(|&(effect, resource, amount)| PlanEffect {
                place: place(model, effect.position),
                resource: model.resources[resource].name.clone(),
                does: effect.kind.into(),
                amount,
            });
        self.effects = effects.collect();
        self
    }
}

impl From<EffectKind> for PlanEffectKind {
    fn from(kind: EffectKind) -> PlanEffectKind {
        match kind {
            EffectKind::Uses => PlanEffectKind::Uses,
            EffectKind::Consumes(end) => PlanEffectKind::Consumes(end.into()),
            EffectKind::Produces(end) => PlanEffectKind::Produces(end.into()),
        }
    }
}

impl From<End> for PlanEnd {
    fn from(end: End) -> PlanEnd {
        match end {
            End::Start => PlanEnd::Start,
            End::Finish => PlanEnd::End,
        }
    }
}

/// How a plan writes where something stands: `file:line:column`, the file without its folders, so
/// that it is the same wherever the model is read from.
pub fn place(model: &Model, position: Position) -> String {
    let file = model.files.get(position.file as usize);
    format!(
        "{}:{position}",
        file.map(|name| stem(name)).unwrap_or_default()
    )
}

/// How a plan names a parameter, whose place is counted from 0.
pub(crate) fn argument_name(name: &str, place: usize) -> String {
    match name {
        "" => format!("#{}", place + 1),
        name => name.to_owned(),
    }
}

/// A file's name without its folders.
fn stem(path: &str) -> String {
    let name = path.rsplit(['/', '\\']).next();
    name.unwrap_or_default().to_owned()
}
