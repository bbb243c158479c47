//! Whether a plan speaks of the model's things: names, parameters, values.

use std::collections::BTreeSet;

use super::{Kind, Report, Scene, Seen};
use crate::model::{Model, PredicateId, Problem, Value, Values};
use crate::nearest::did_you_mean;
use crate::plan::argument_name;
use crate::plan::{Plan, PlanResource, PlanToken, PlanValue};
use crate::temporal::FURTHEST;

/// Resolves all names. What has unknown ones is reported and left out.
pub(super) fn resolve<'a>(
    model: &'a Model,
    problem: &'a Problem,
    plan: &'a Plan,
    report: &mut Report,
) -> Scene<'a> {
    is_of_the_problem(model, problem, plan, report);
    let mut ids = BTreeSet::new();
    let mut tokens = Vec::with_capacity(plan.tokens.len());
    for token in &plan.tokens {
        if !ids.insert(token.id) {
            let message = format!("two tokens have the number {}", token.id);
            report.add(Kind::Name, message).tokens([token.id]);
            continue;
        }
        // No sum or difference of the times of others is beyond all numbers.
        if token.start < -FURTHEST || token.end > FURTHEST {
            let message = format!(
                "token {token} is not in the horizon, 0 to {}",
                problem.horizon
            );
            report.add(Kind::Horizon, message).tokens([token.id]);
            continue;
        }
        if token.end < token.start {
            let message = format!("token {token} ends before it starts");
            let added = report.add(Kind::Inverted, message).tokens([token.id]);
            added.times(token.start, token.end);
            continue;
        }
        match seen(model, token) {
            Ok(seen) => tokens.push(seen),
            Err((kind, problem)) => {
                let message = format!("token {token}: {problem}");
                report.add(kind, message).tokens([token.id]);
            }
        }
    }
    let mut by_start = vec![Vec::new(); model.timelines.len()];
    for (index, seen) in tokens.iter().enumerate() {
        by_start[seen.timeline].push(index);
    }
    let mut by_end = by_start.clone();
    let start_end = |&index: &usize| (tokens[index].token.start, tokens[index].token.end);
    let end_start = |&index: &usize| (tokens[index].token.end, tokens[index].token.start);
    by_start
        .iter_mut()
        .for_each(|list| list.sort_by_key(start_end));
    by_end
        .iter_mut()
        .for_each(|list| list.sort_by_key(end_start));
    let scene = Scene {
        model,
        problem,
        plan,
        tokens,
        by_start,
        by_end,
    };
    for seen in &scene.tokens {
        has_domains(&scene, seen, report);
    }
    scene
}

/// That the plan is one for this problem, with its timelines and resources as they are.
fn is_of_the_problem(model: &Model, problem: &Problem, plan: &Plan, report: &mut Report) {
    if plan.problem != problem.name {
        let (is, asked) = (&plan.problem, &problem.name);
        report.add(
            Kind::Name,
            format!("the plan is for the problem {is:?}, not {asked:?}"),
        );
    }
    if plan.horizon != problem.horizon {
        let (is, asked) = (plan.horizon, problem.horizon);
        report.add(
            Kind::Name,
            format!("the plan's horizon is {is}, the problem's {asked}"),
        );
    }
    let is = Plan::new(model, problem);
    if plan.timelines != is.timelines {
        let names = |plan: &Plan| plan.timelines.iter().map(|t| t.name.clone()).collect();
        let (here, there): (BTreeSet<String>, BTreeSet<String>) = (names(plan), names(&is));
        let differing: Vec<&String> = here.symmetric_difference(&there).take(5).collect();
        let message = match differing.is_empty() {
            true => "the plan's timelines are not the model's: their order or kinds differ".into(),
            false => format!("the plan's timelines are not the model's: {differing:?} differ"),
        };
        report.add(Kind::Name, message);
    }
    let differs = |(a, b): &(&PlanResource, &PlanResource)| a != b;
    let pairs = plan.resources.iter().zip(&is.resources);
    if plan.resources.len() != is.resources.len() {
        report.add(
            Kind::Name,
            "the plan's resources are not those of the model".into(),
        );
    } else if let Some((here, _)) = pairs.clone().find(differs) {
        let message = format!(
            "the plan says of the resource {:?} other than the model",
            here.name
        );
        report.add(Kind::Name, message);
    }
}

/// A token, or what is wrong with it.
fn seen<'a>(model: &Model, token: &'a PlanToken) -> Result<Seen<'a>, (Kind, String)> {
    let timelines = &model.timelines;
    let timeline = timelines.iter().position(|one| one.name == token.timeline);
    let timeline = timeline.ok_or_else(|| {
        let names = timelines.iter().map(|one| one.name.as_str());
        let near = did_you_mean(&token.timeline, names);
        (
            Kind::Name,
            format!("there is no timeline {:?}{near}", token.timeline),
        )
    })?;
    let named = |&&id: &&PredicateId| model.predicates[id].name == token.predicate;
    let predicate = timelines[timeline].predicates.iter().find(named);
    let predicate = *predicate.ok_or_else(|| {
        let predicates = timelines[timeline].predicates.iter();
        let near = did_you_mean(
            &token.predicate,
            predicates.map(|&id| model.predicates[id].name.as_str()),
        );
        let (says, on) = (&token.predicate, &token.timeline);
        (Kind::Name, format!("{on} never says {says:?}{near}"))
    })?;
    let parameters = &model.predicates[predicate].parameters;
    if token.arguments.len() != parameters.len() {
        let (is, asked) = (token.arguments.len(), parameters.len());
        let message = format!("it has {is} arguments, and its predicate {asked}");
        return Err((Kind::Name, message));
    }
    let mut values = Vec::with_capacity(parameters.len());
    for (place, parameter) in parameters.iter().enumerate() {
        let name = argument_name(&parameter.name, place);
        let argument = token.arguments.iter().find(|(of, _)| *of == name);
        let (_, value) = argument.ok_or_else(|| {
            let names = token.arguments.iter().map(|(of, _)| of.as_str());
            let near = did_you_mean(&name, names);
            (Kind::Name, format!("it has no argument {name:?}{near}"))
        })?;
        let of = &model.types[parameter.of];
        let value = value_of(model, &of.values, value).map_err(|problem| {
            (
                Kind::Domain,
                format!("its {name} is {value}, no {}{problem}", of.name),
            )
        })?;
        values.push(value);
    }
    let mut resources = Vec::with_capacity(token.effects.len());
    for effect in &token.effects {
        let resource = model
            .resources
            .iter()
            .position(|one| one.name == effect.resource);
        if resource.is_none() {
            let names = model.resources.iter().map(|one| one.name.as_str());
            let near = did_you_mean(&effect.resource, names);
            let message = format!("there is no resource {:?}{near}", effect.resource);
            return Err((Kind::Name, message));
        }
        resources.push(resource);
    }
    Ok(Seen {
        token,
        timeline,
        predicate,
        values,
        resources,
    })
}

/// A value as the model has it; what is wrong with it if it is of another kind than its type.
fn value_of(model: &Model, of: &Values, value: &PlanValue) -> Result<Option<Value>, String> {
    match (of, value) {
        (_, PlanValue::Unbound) => Ok(None),
        (Values::Truth, PlanValue::Truth(truth)) => Ok(Some(Value::from(*truth))),
        (Values::Numbers(_), PlanValue::Number(number)) => Ok(Some(*number)),
        (Values::Symbols(symbols), PlanValue::Symbol(name)) => {
            let named = |&symbol: &Value| {
                let symbol = usize::try_from(symbol).ok();
                symbol
                    .and_then(|symbol| model.symbols.get(symbol))
                    .map(String::as_str)
            };
            let symbol = symbols
                .iter()
                .find(|&symbol| named(symbol) == Some(name.as_str()));
            let found = symbol.copied().map(Some);
            found.ok_or_else(|| did_you_mean(name, symbols.iter().filter_map(named)))
        }
        _ => Err(String::new()),
    }
}

/// That numbers are within their types' spans. Symbols and truth values are, or would not have
/// been read.
fn has_domains(scene: &Scene<'_>, seen: &Seen<'_>, report: &mut Report) {
    let parameters = &scene.model.predicates[seen.predicate].parameters;
    for (place, (parameter, value)) in parameters.iter().zip(&seen.values).enumerate() {
        let Some(value) = *value else { continue };
        if !scene.is_of(parameter.of, value) {
            let name = argument_name(&parameter.name, place);
            let of = &scene.model.types[parameter.of].name;
            let message = format!("token {}: its {name} is {value}, no {of}", seen.token);
            report.add(Kind::Domain, message).tokens([seen.token.id]);
        }
    }
}
