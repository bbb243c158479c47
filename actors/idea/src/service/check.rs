//! Whether what is posted to a planning technology can be, as far as the model alone says: the same
//! for every technology.

use farside_planning::Ticks;
use farside_planning::model::{Model, PredicateId, TimelineId, Value, Values};

use super::{Contract, Plan, Refusal, Stale};

/// Whether a predicate's inputs or outputs can have such values.
pub(super) fn values(
    model: &Model,
    predicate: PredicateId,
    what: &'static str,
    given: &[Option<Value>],
) -> Result<(), Refusal> {
    let said = &model.predicates[predicate];
    let places = match what {
        "inputs" => 0..said.inputs,
        _ => said.inputs..said.parameters.len(),
    };
    if given.len() != places.len() {
        return Err(Refusal::Count {
            predicate: said.name.clone(),
            what,
            expected: places.len(),
            actual: given.len(),
        });
    }
    for (place, value) in places.zip(given) {
        if let Some(value) = *value
            && !may_be(model, predicate, place, value)
        {
            let parameter = &said.parameters[place];
            return Err(Refusal::Domain {
                predicate: said.name.clone(),
                parameter: parameter.name.clone(),
                expected: model.types[parameter.of].name.clone(),
                value,
            });
        }
    }
    Ok(())
}

/// Whether a value is one of a parameter's type.
fn may_be(model: &Model, predicate: PredicateId, place: usize, value: Value) -> bool {
    match &model.types[model.predicates[predicate].parameters[place].of].values {
        Values::Truth => value == 0 || value == 1,
        Values::Numbers(span) => span.contains(value),
        Values::Symbols(all) => all.binary_search(&value).is_ok(),
    }
}

/// Whether a timeline says such things.
pub(super) fn predicate(
    model: &Model,
    timeline: TimelineId,
    predicate: PredicateId,
) -> Result<(), Refusal> {
    let at = model.timelines.get(timeline);
    if at.is_some_and(|at| at.predicates.contains(&predicate)) {
        return Ok(());
    }
    let said = model.predicates.get(predicate);
    Err(Refusal::Unknown {
        timeline: at.map_or_else(|| format!("timeline {timeline}"), |at| at.name.clone()),
        predicate: said.map_or_else(
            || format!("predicate {predicate}"),
            |said| said.name.clone(),
        ),
    })
}

/// That a contract is not active.
pub(super) fn dead(model: &Model, contract: Contract) -> Refusal {
    let timeline = usize::from(contract.timeline);
    let at = model.timelines.get(timeline);
    Refusal::Dead {
        timeline: at.map_or_else(|| format!("timeline {timeline}"), |at| at.name.clone()),
        number: contract.number,
    }
}

/// Whether a plan is one, of which nothing starts too soon.
pub(super) fn plan(model: &Model, plan: &Plan, now: Ticks) -> Result<(), Stale> {
    for (step, at) in plan.steps.iter().enumerate() {
        let malformed = |refusal| Stale::Malformed { step, refusal };
        predicate(model, plan.timeline, at.predicate).map_err(malformed)?;
        let inputs: Vec<Option<Value>> = at.inputs.iter().copied().map(Some).collect();
        values(model, at.predicate, "inputs", &inputs).map_err(malformed)?;
        for branch in &at.branches {
            let said = &model.predicates[at.predicate];
            let wrong = |reason: String| Stale::Malformed {
                step,
                refusal: Refusal::Rule {
                    what: said.name.clone(),
                    reason,
                },
            };
            if branch.next <= step || branch.next >= plan.steps.len() {
                return Err(wrong(format!("no step {} follows it", branch.next)));
            }
            let Some((place, value)) = branch.when else {
                continue;
            };
            if !(said.inputs..said.parameters.len()).contains(&place) {
                return Err(wrong(format!("it has no output in place {place}")));
            }
            if !may_be(model, at.predicate, place, value) {
                let parameter = &said.parameters[place];
                return Err(malformed(Refusal::Domain {
                    predicate: said.name.clone(),
                    parameter: parameter.name.clone(),
                    expected: model.types[parameter.of].name.clone(),
                    value,
                }));
            }
        }
        let latency = now.saturating_add(1);
        if at.not_before <= latency {
            return Err(Stale::TooSoon {
                step,
                at: at.not_before,
                now: latency,
            });
        }
    }
    Ok(())
}

/// That a token may not end yet.
pub(super) fn lasts(model: &Model, predicate: PredicateId, earliest: Ticks) -> Refusal {
    Refusal::Rule {
        what: model.predicates[predicate].name.clone(),
        reason: format!("it lasts until tick {earliest} at least"),
    }
}

/// That a timeline has a goal from this cycle already.
pub(super) fn two_goals(model: &Model, timeline: TimelineId, predicate: PredicateId) -> Refusal {
    Refusal::Rule {
        what: model.predicates[predicate].name.clone(),
        reason: format!(
            "{} has a goal from this cycle already",
            model.timelines[timeline].name
        ),
    }
}

/// How early a goal is put on its timeline: as search control says, or else after all that it names
/// and before all that it does not.
pub(super) fn goal_order(model: &Model, timeline: TimelineId, predicate: PredicateId) -> u32 {
    let subgoals = &model.control.subgoals;
    let named = subgoals.iter().position(|&at| at == (timeline, predicate));
    2 * named.unwrap_or(subgoals.len()) as u32 + 1
}
